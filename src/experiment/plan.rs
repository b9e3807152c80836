//! The plan: every job of an experiment with its key, checked before anything runs.
//!
//! Guarantees that each job's settings are complete and pass the method's own check, that required files exist, and that
//! job names are unique. Does not read what the files say.

use super::check::{defaults, fields_of};
use super::diagnostic::Diagnostic;
use super::file::{Experiment, Model, PartSpecification};
use super::grid::{self, Point, show};
use super::job::{Job, JobPart, Key, sha256};
use super::read::axes::parameter;
use super::record::RECORD_SCHEMA;
use crate::mesh::format::Format;
use crate::method::setting::Field;
use serde_json::{Map, Value};
use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// One job of the plan.
#[derive(Clone, Debug)]
pub struct PlannedJob {
    /// Unique within the plan and fit for a file name: `ball-stretch`.
    pub name: String,
    /// The values of all axes in the order of the file, `model` included even when there is only one.
    pub axes: Vec<(String, Value)>,
    /// Absent when an optional model's file is missing.
    pub resolved: Option<(Key, Job)>,
    /// Where the input files of the job are, by role.
    pub inputs: BTreeMap<String, PathBuf>,
    /// Why `resolved` is absent.
    pub missing: Option<String>,
}

/// All jobs of an experiment.
pub struct Plan {
    pub experiment: Experiment,
    pub jobs: Vec<PlannedJob>,
    /// Skipped optional models and the like, told before anything runs.
    pub notices: Vec<String>,
}

/// Where model files are looked for: beside the experiment file first, then in these folders.
#[derive(Clone, Debug, Default)]
pub struct Lookup {
    pub folders: Vec<PathBuf>,
}

impl Lookup {
    /// The first place where the file is, or all places where it is not.
    pub fn find(&self, beside: &Path, path: &str) -> Result<PathBuf, Vec<PathBuf>> {
        let mut places = vec![beside.join(path)];
        if Path::new(path).is_relative() {
            places.extend(self.folders.iter().map(|folder| folder.join(path)));
        }
        match places.iter().find(|place| place.exists()) {
            Some(place) => Ok(place.clone()),
            None => Err(places),
        }
    }
}

/// A model with its files found and hashed.
struct Resolved {
    parts: BTreeMap<String, JobPart>,
    inputs: BTreeMap<String, PathBuf>,
}

impl Plan {
    /// Unfolds an experiment into its jobs; every error of every job in one go.
    pub fn new(experiment: Experiment, lookup: &Lookup) -> Result<Plan, Vec<Diagnostic>> {
        let mut diagnostics = Vec::new();
        let mut notices = Vec::new();
        let mut points = grid::points(&experiment.axes, &experiment.zips);
        points.retain(|point| !experiment.excludes.iter().any(|exclude| grid::matches(exclude, point)));
        let names = names(&points, &experiment.name);

        let mut files = BTreeMap::new();
        let used: BTreeSet<&str> = points.iter().filter_map(|point| model_of(point)).collect();
        let mut models = BTreeMap::new();
        for model in experiment
            .models
            .iter()
            .filter(|model| used.contains(model.name.as_str()))
        {
            match resolve_model(&experiment, model, lookup, &mut files, &mut diagnostics) {
                Some(Err(missing)) => {
                    notices.push(missing.clone());
                    models.insert(model.name.as_str(), Err(missing));
                }
                Some(Ok(resolved)) => {
                    models.insert(model.name.as_str(), Ok(resolved));
                }
                None => {}
            }
        }

        let mut jobs = Vec::new();
        let mut complaints: BTreeMap<(String, String), Vec<usize>> = BTreeMap::new();
        for (index, point) in points.into_iter().enumerate() {
            let settings = Value::Object(job_settings(&experiment, &point));
            for complaint in experiment.method.check(&settings) {
                complaints.entry(complaint).or_default().push(index);
            }
            let model = model_of(&point).and_then(|name| models.get(name));
            let missing = model.and_then(|model| model.as_ref().err()).cloned();
            let (parts, inputs) = match model {
                Some(Ok(resolved)) => (job_parts(&experiment, resolved, &point), resolved.inputs.clone()),
                _ => Default::default(),
            };
            let resolved = missing.is_none().then(|| {
                let job = Job {
                    record_schema: RECORD_SCHEMA,
                    method: experiment.method.name().to_owned(),
                    method_version: experiment.method.version(),
                    model: parts,
                    settings: experiment.method.canonical(settings),
                };
                (Key::of(&job), job)
            });
            jobs.push(PlannedJob {
                name: names[index].clone(),
                axes: point,
                resolved,
                inputs,
                missing,
            });
        }
        for ((path, message), indices) in complaints {
            diagnostics.push(complaint(&experiment, &path, message, &indices, &jobs));
        }
        if !diagnostics.is_empty() {
            diagnostics.sort_by_key(|diagnostic| diagnostic.place.as_ref().map_or(0, |place| place.span.start));
            return Err(diagnostics);
        }
        notices.extend(identical(&jobs));
        Ok(Plan {
            experiment,
            jobs,
            notices,
        })
    }
}

fn model_of(point: &[(String, Value)]) -> Option<&str> {
    point
        .iter()
        .find(|(axis, _)| axis == "model")
        .and_then(|(_, value)| value.as_str())
}

/// The settings held for every job with those of this job's axes.
fn job_settings(experiment: &Experiment, point: &Point) -> Map<String, Value> {
    let mut settings = experiment.settings.as_object().cloned().unwrap_or_default();
    for (axis, value) in point {
        if axis != "model" && parameter(experiment.method, axis).is_none() {
            set(&mut settings, experiment.method.settings(), axis, value);
        }
    }
    settings
}

/// Sets a value at a dotted path; a table that is absent on the way is filled with its defaults.
fn set(table: &mut Map<String, Value>, fields: &'static [Field], path: &str, value: &Value) {
    match path.split_once('.') {
        None => {
            table.insert(path.to_owned(), value.clone());
        }
        Some((first, rest)) => {
            let inner = fields
                .iter()
                .find(|field| field.name == first)
                .and_then(|field| fields_of(&field.kind));
            let inner = inner.unwrap_or_default();
            let entry = table.entry(first).or_insert_with(|| Value::Object(defaults(inner)));
            if let Value::Object(entry) = entry {
                set(entry, inner, rest, value);
            }
        }
    }
}

/// The parts of a model with the generator parameters of this job's axes.
fn job_parts(experiment: &Experiment, resolved: &Resolved, point: &Point) -> BTreeMap<String, JobPart> {
    let mut parts = resolved.parts.clone();
    for (axis, value) in point {
        if let Some((role, name)) = parameter(experiment.method, axis)
            && let Some(JobPart::Generated {
                parameters: Value::Object(parameters),
                ..
            }) = parts.get_mut(role)
        {
            parameters.insert(name.to_owned(), value.clone());
        }
    }
    parts
}

/// Finds and hashes a model's files. `Err` when an optional model lacks one, none when there was an error.
fn resolve_model(
    experiment: &Experiment,
    model: &Model,
    lookup: &Lookup,
    identified: &mut BTreeMap<PathBuf, (String, String)>,
    diagnostics: &mut Vec<Diagnostic>,
) -> Option<Result<Resolved, String>> {
    let mut resolved = Resolved {
        parts: BTreeMap::new(),
        inputs: BTreeMap::new(),
    };
    let mut missing = Vec::new();
    let before = diagnostics.len();
    for (role, part) in &model.parts {
        let (path, parameters) = match part {
            PartSpecification::Generated { generator, parameters } => {
                let part = JobPart::Generated {
                    generator: generator.clone(),
                    parameters: parameters.clone(),
                };
                resolved.parts.insert(role.clone(), part);
                continue;
            }
            PartSpecification::File { path, parameters } => (path, parameters),
        };
        let span = place(experiment, &format!("models.{}.{role}", model.name));
        let found = match lookup.find(&experiment.origin.folder, path) {
            Ok(found) => found,
            Err(_) if model.optional => {
                missing.push(path.clone());
                continue;
            }
            Err(places) => {
                let places: Vec<String> = places.iter().map(|place| place.display().to_string()).collect();
                let error = Diagnostic::error(format!(
                    "model \"{}\" needs the file {path}, which is not found",
                    model.name
                ))
                .at(&experiment.origin.source, span)
                .label(format!("looked for {}", places.join(", ")))
                .help("mend the path, name its folder with --models, or write optional = true to skip the model");
                diagnostics.push(error);
                continue;
            }
        };
        let (sha256, format) = match identified.get(&found) {
            Some(known) => known.clone(),
            None => match identify(&found) {
                Ok(identity) => {
                    identified.insert(found.clone(), identity.clone());
                    identity
                }
                Err(error) => {
                    let message = format!("cannot read {}: {error}", found.display());
                    diagnostics.push(Diagnostic::error(message).at(&experiment.origin.source, span));
                    continue;
                }
            },
        };
        let part = JobPart::File {
            sha256,
            format,
            parameters: parameters.clone(),
        };
        resolved.parts.insert(role.clone(), part);
        resolved.inputs.insert(role.clone(), found);
    }
    if diagnostics.len() > before {
        None
    } else if missing.is_empty() {
        Some(Ok(resolved))
    } else {
        let many = if missing.len() > 1 { "are" } else { "is" };
        let names = missing.join(" and ");
        Some(Err(format!(
            "optional model \"{}\" is skipped: {names} {many} not found",
            model.name
        )))
    }
}

/// SHA-256 and format of a file. A format that the content shows does not depend on the file's name.
fn identify(path: &Path) -> io::Result<(String, String)> {
    let bytes = std::fs::read(path)?;
    let format = match Format::of_content(&bytes) {
        Some(format) => format.entry().name.to_owned(),
        None => path
            .extension()
            .map_or_else(String::new, |extension| extension.to_string_lossy().to_lowercase()),
    };
    Ok((sha256(&bytes), format))
}

/// Where an entry stands, or the nearest table around it.
fn place(experiment: &Experiment, path: &str) -> Range<usize> {
    let places = &experiment.origin.places;
    let mut path = path;
    loop {
        if let Some(span) = places.get(path) {
            return span.clone();
        }
        match path.rsplit_once('.') {
            Some((outer, _)) => path = outer,
            None => break,
        }
    }
    places.get("method").cloned().unwrap_or(0..0)
}

/// What the method says of a setting, underlined at the axis that varies it or where it is held.
fn complaint(
    experiment: &Experiment,
    path: &str,
    message: String,
    indices: &[usize],
    jobs: &[PlannedJob],
) -> Diagnostic {
    let varying =
        |name: &str| name == path || path.starts_with(&format!("{name}.")) || name.starts_with(&format!("{path}."));
    let axis = indices.first().and_then(|&index| {
        jobs[index]
            .axes
            .iter()
            .find(|(name, _)| name != "model" && varying(name))
    });
    let span = match axis {
        Some((name, _)) => place(experiment, &format!("vary.{name}")),
        None => place(experiment, &format!("settings.{path}")),
    };
    let label = match indices {
        [first, rest @ ..] if indices.len() < jobs.len() => match rest.len() {
            0 => format!("in job {}", jobs[*first].name),
            more => format!("in job {} and {more} more", jobs[*first].name),
        },
        _ => String::new(),
    };
    Diagnostic::error(message)
        .at(&experiment.origin.source, span)
        .label(label)
}

/// Notices of jobs that are the same computation.
fn identical(jobs: &[PlannedJob]) -> Vec<String> {
    let mut by_key: BTreeMap<&Key, Vec<&str>> = BTreeMap::new();
    for job in jobs {
        if let Some((key, _)) = &job.resolved {
            by_key.entry(key).or_default().push(&job.name);
        }
    }
    let mut notices: Vec<String> = by_key
        .into_values()
        .filter(|names| names.len() > 1)
        .map(|names| format!("jobs {} are the same computation, which runs once", names.join(", ")))
        .collect();
    notices.sort();
    notices
}

/// A name for each job from the axes that vary, fit for a file and unique even where letter case is not told apart.
fn names(points: &[Point], experiment: &str) -> Vec<String> {
    let axes = points.first().map_or(0, Vec::len);
    let varies: Vec<bool> = (0..axes)
        .map(|axis| points.iter().any(|point| point[axis].1 != points[0][axis].1))
        .collect();
    let any = varies.contains(&true);
    let mut taken = BTreeSet::new();
    points
        .iter()
        .map(|point| {
            let words: Vec<String> = point
                .iter()
                .zip(&varies)
                .filter(|(_, varies)| **varies || !any)
                .map(|((axis, value), _)| word(axis, value))
                .collect();
            let mut name = words.join("-");
            name.truncate(120);
            if name.is_empty() {
                name = slug(experiment);
            }
            let mut unique = name.clone();
            let mut count = 1;
            while !taken.insert(unique.to_lowercase()) {
                count += 1;
                unique = format!("{name}-{count}");
            }
            unique
        })
        .collect()
}

/// `stretch` for text, `omega-100` for a number: a number alone says nothing.
fn word(axis: &str, value: &Value) -> String {
    let last = axis.rsplit('.').next().unwrap_or(axis);
    match value {
        Value::String(text) => slug(text),
        Value::Number(_) | Value::Bool(_) => format!("{}-{}", slug(last), show(value)),
        other => slug(&format!("{last}-{other}")),
    }
}

/// Letters, digits, `.`, `_` and `-` only; never empty.
fn slug(text: &str) -> String {
    let mut slug = String::new();
    for character in text.chars() {
        if character.is_ascii_alphanumeric() || character == '_' || character == '.' {
            slug.push(character);
        } else if !slug.ends_with('-') && !slug.is_empty() {
            slug.push('-');
        }
    }
    let slug = slug.trim_matches(['-', '.']);
    if slug.is_empty() {
        "x".to_owned()
    } else {
        slug.to_owned()
    }
}
