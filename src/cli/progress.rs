//! How a run is shown: bars on a terminal, a line an event elsewhere, warnings only with `--quiet`.

use crate::experiment::record::{Record, Status};
use crate::run::event::{Event, Listener, Progress};
use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use std::collections::BTreeMap;
use std::io::IsTerminal;
use std::time::Duration;

/// The display that suits the command line and the terminal. All of it goes to standard error.
pub fn display(quiet: bool) -> Box<dyn Listener> {
    if quiet {
        Box::new(Quiet)
    } else if std::io::stderr().is_terminal() && std::env::var_os("TERM").is_none_or(|term| term != "dumb") {
        Box::new(Bars::default())
    } else {
        Box::new(Lines::default())
    }
}

/// How a record ended, in a few words.
fn ending(record: &Record, cached: bool) -> String {
    let mut text = record.result.stop.clone();
    if record.result.status != Status::Done && !record.result.reason.is_empty() {
        text += &format!(": {}", record.result.reason);
    }
    if cached {
        text += " (stored)";
    } else if let (Status::Done | Status::Refused, Some(seconds)) =
        (record.result.status, median(&record.measurement.wall_seconds))
    {
        text += &format!(" in {}", duration(seconds));
    }
    text
}

fn median(values: &[f64]) -> Option<f64> {
    let mut values = values.to_vec();
    values.sort_by(f64::total_cmp);
    values.get(values.len().checked_sub(1)? / 2).copied()
}

/// Seconds with three digits.
fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 1.0 => format!("{:.0} ms", 1e3 * s),
        s if s < 10.0 => format!("{s:.2} s"),
        s if s < 600.0 => format!("{s:.1} s"),
        s => format!("{:.0} min", s / 60.0),
    }
}

fn standing(progress: &Progress) -> String {
    let number = |value: Option<f64>| value.map_or("not finite".into(), |value| format!("{value:.6e}"));
    format!(
        "iteration {}, energy {}, gradient {}",
        progress.iteration,
        number(progress.energy),
        progress
            .gradient_norm
            .map_or("not finite".into(), |value| format!("{value:.1e}"))
    )
}

/// What is said when a run is stopped.
fn stopping(running: usize) -> String {
    format!("stopping {running} running jobs; finished ones are kept")
}

struct Quiet;

impl Listener for Quiet {
    fn event(&mut self, event: &Event<'_>) {
        match event {
            Event::Warning { text } => tell!("warning: {text}"),
            Event::Finished { name, record, .. }
                if matches!(record.result.status, Status::Failed | Status::Refused) =>
            {
                tell!("error: {name}: {}: {}", record.result.stop, record.result.reason);
            }
            _ => {}
        }
    }
}

/// A line an event, for logs: nothing for iterates, since they are many.
#[derive(Default)]
struct Lines {
    done: usize,
    jobs: usize,
}

impl Listener for Lines {
    fn event(&mut self, event: &Event<'_>) {
        match event {
            Event::Planned { jobs, .. } => self.jobs = *jobs,
            Event::Started { name, .. } => tell!("{name}: started"),
            Event::Waiting { name, reason, .. } => tell!("{name}: waiting, {reason}"),
            Event::Repetition { name, repetition, .. } if *repetition > 0 => {
                tell!("{name}: repetition {}", repetition + 1);
            }
            Event::Phase { name, phase, .. } => tell!("{name}: {phase}"),
            Event::Repetition { .. } | Event::Iterate { .. } => {}
            Event::Finished {
                name, record, cached, ..
            } => {
                self.done += 1;
                // What was stored beforehand is counted, not listed.
                if !cached || record.result.status != Status::Done {
                    tell!("[{}/{}] {name}: {}", self.done, self.jobs, ending(record, *cached));
                }
            }
            Event::Warning { text } => tell!("warning: {text}"),
            Event::Interrupted { running } => tell!("{}", stopping(*running)),
        }
    }
}

/// A bar for the whole run, and under it a line for each running job.
#[derive(Default)]
struct Bars {
    all: MultiProgress,
    overall: Option<ProgressBar>,
    jobs: BTreeMap<usize, Line>,
}

struct Line {
    bar: ProgressBar,
    phase: String,
}

impl Bars {
    fn line(&mut self, index: usize, change: impl FnOnce(&mut Line)) {
        if let Some(line) = self.jobs.get_mut(&index) {
            change(line);
        }
    }

    fn say(&self, text: &str) {
        let _ = self.all.println(text);
    }
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}

impl Listener for Bars {
    fn event(&mut self, event: &Event<'_>) {
        match *event {
            Event::Planned { jobs, missing, .. } if missing > 0 => {
                let bar = self.all.add(ProgressBar::new(jobs as u64));
                bar.set_style(style("{elapsed:>4} [{bar:32}] {pos}/{len} jobs {msg}"));
                bar.enable_steady_tick(Duration::from_millis(250));
                self.overall = Some(bar);
            }
            Event::Planned { .. } => {}
            Event::Started { index, name } => {
                // Started anew after another process was found to compute it.
                if let Some(line) = self.jobs.remove(&index) {
                    self.all.remove(&line.bar);
                }
                let bar = self.all.add(ProgressBar::new_spinner());
                bar.set_style(style("{elapsed:>4} {spinner} {prefix}  {wide_msg}"));
                bar.set_prefix(name.to_string());
                bar.enable_steady_tick(Duration::from_millis(250));
                self.jobs.insert(
                    index,
                    Line {
                        bar,
                        phase: String::new(),
                    },
                );
            }
            Event::Waiting { index, reason, .. } => {
                self.line(index, |line| line.bar.set_message(format!("waiting, {reason}")));
            }
            Event::Repetition { index, repetition, .. } => self.line(index, |line| {
                line.bar.reset_elapsed();
                if repetition > 0 {
                    line.bar.set_message(format!("repetition {}", repetition + 1));
                }
            }),
            Event::Phase { index, phase, .. } => self.line(index, |line| {
                line.phase = phase.into();
                line.bar.set_message(line.phase.clone());
            }),
            Event::Iterate {
                index, ref progress, ..
            } => self.line(index, |line| {
                line.bar.set_message(format!("{}: {}", line.phase, standing(progress)));
            }),
            Event::Finished {
                index,
                name,
                record,
                cached,
            } => {
                if let Some(line) = self.jobs.remove(&index) {
                    line.bar.finish_and_clear();
                    self.all.remove(&line.bar);
                }
                if let Some(overall) = &self.overall {
                    overall.inc(1);
                    if !cached || record.result.status != Status::Done {
                        self.say(&format!("{name}: {}", ending(record, cached)));
                    }
                    if overall.length() == Some(overall.position()) {
                        overall.finish_and_clear();
                    }
                }
            }
            Event::Warning { text } => self.say(&format!("warning: {text}")),
            Event::Interrupted { running } => self.say(&stopping(running)),
        }
    }
}

impl Drop for Bars {
    fn drop(&mut self) {
        let _ = self.all.clear();
    }
}
