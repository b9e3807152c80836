//! What a run leaves for its reader: tables, rates, plots, pictures, verdicts and one self-contained page.
//!
//! The report is made from the experiment and its records alone. The same records give the same bytes: no clock is
//! read, and the only times are recorded ones. Every file is published whole or not at all.

pub mod compare;
pub mod gate;
pub mod jobs;
pub mod junit;
pub mod macros;
pub mod number;
pub mod overview;
pub mod page;
pub mod picture;
pub mod plot;
pub mod publish;
pub mod rate;
pub mod row;
pub mod table;

pub use row::Row;

use crate::experiment::file::Experiment;
use std::path::{Path, PathBuf};

/// Why a report could not be made.
#[derive(Debug)]
pub enum ReportError {
    /// A folder or file could not be written.
    Write(PathBuf, std::io::Error),
    /// A file of a stored result could not be read.
    Read(PathBuf, std::io::Error),
    /// A CSV file could not be composed.
    Csv(String, String),
    /// A plot could not be drawn.
    Plot(String, String),
    /// A picture could not be compressed.
    Picture(String, String),
}

impl std::fmt::Display for ReportError {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            ReportError::Write(path, error) => write!(formatter, "cannot write {}: {error}", path.display()),
            ReportError::Read(path, error) => write!(formatter, "cannot read {}: {error}", path.display()),
            ReportError::Csv(name, error) => write!(formatter, "cannot compose {name}: {error}"),
            ReportError::Plot(name, error) => write!(formatter, "cannot draw the plot {name}: {error}"),
            ReportError::Picture(name, error) => write!(formatter, "cannot draw the result of {name}: {error}"),
        }
    }
}

impl std::error::Error for ReportError {}

/// What was written.
#[derive(Debug)]
pub struct Written {
    pub page: PathBuf,
    /// All files, the page last.
    pub files: Vec<PathBuf>,
    pub verdicts: Vec<gate::Verdict>,
}

/// Writes everything into `folder`, which is made where it is missing. `planned` is the number of jobs of the
/// experiment, of which `rows` are those with a record.
pub fn write(experiment: &Experiment, rows: &[Row], planned: usize, folder: &Path) -> Result<Written, ReportError> {
    std::fs::create_dir_all(folder).map_err(|error| ReportError::Write(folder.into(), error))?;
    let mut files = Vec::new();
    let mut publish = |name: &str, bytes: &[u8]| -> Result<(), ReportError> {
        files.push(publish::publish(folder, name, bytes)?);
        Ok(())
    };
    publish("jobs.csv", &jobs::write(experiment, rows)?)?;
    for table in &experiment.tables {
        let grid = table::build(experiment, table, rows);
        publish(&format!("{}.md", table.name), table::markdown::write(&grid).as_bytes())?;
        let csv = table::csv::write(&grid).map_err(|error| ReportError::Csv(table.name.clone(), error.to_string()))?;
        publish(&format!("{}.csv", table.name), &csv)?;
        publish(&format!("{}.tex", table.name), table::latex::write(&grid).as_bytes())?;
    }
    let fits = rate::fits(experiment, rows);
    publish("macros.tex", macros::write(experiment, rows, &fits).as_bytes())?;
    for row in rows {
        let mesh = row.mesh.iter().map(|path| ("vtu", path));
        for (ending, path) in mesh.chain(row.files.iter().map(|(name, path)| (name.as_str(), path))) {
            let bytes = std::fs::read(path).map_err(|error| ReportError::Read(path.clone(), error))?;
            publish(&format!("{}.{ending}", row.name), &bytes)?;
        }
    }
    let verdicts = gate::judge(experiment, rows, &fits);
    let mut drawings = Vec::new();
    for plot in &experiment.plots {
        let chart = plot::chart(experiment, plot, rows);
        publish(&format!("{}.svg", plot.name), plot::svg::standalone(&chart)?.as_bytes())?;
        publish(&format!("{}.png", plot.name), &plot::bitmap::write(&chart)?)?;
        drawings.push(chart);
    }
    let page = page::write(experiment, rows, planned, &fits, &verdicts, &drawings)?;
    publish("index.html", page.as_bytes())?;
    Ok(Written {
        page: folder.join("index.html"),
        files,
        verdicts,
    })
}

/// The tables and rates of the experiment for the terminal, after a run.
pub fn terminal(experiment: &Experiment, rows: &[Row], width: Option<u16>) -> String {
    let mut text = String::new();
    for table in &experiment.tables {
        text.push_str(&table::terminal::write(&table::build(experiment, table, rows), width));
        text.push('\n');
    }
    for fit in rate::fits(experiment, rows) {
        text.push_str(&table::terminal::plain(&fit.sentence()));
        text.push('\n');
    }
    text
}
