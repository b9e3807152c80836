//! `vargeo compare`: two result sets side by side.

use super::Exit;
use crate::report::compare::{Sheet, compare, describe};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Compares the figures of two result folders of one experiment, job by job.
///
/// Ends with 1 when a result differs or only one folder has a job; times and memory are shown and never count.
#[derive(clap::Args)]
pub struct Arguments {
    /// A folder such as results/quickstart, or its jobs.csv.
    left: PathBuf,
    /// Another one.
    right: PathBuf,
    /// Relative difference up to which two numbers count as equal.
    #[arg(long, value_name = "NUMBER", default_value_t = 0.0, value_parser = tolerance)]
    tolerance: f64,
    /// Compare this column only, without its unit; may be given several times.
    #[arg(long = "column", value_name = "NAME")]
    columns: Vec<String>,
}

fn tolerance(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value >= 0.0 && value.is_finite() => Ok(value),
        _ => Err("a number from 0 on is expected, such as 1e-9".to_string()),
    }
}

/// Reads both and prints what differs.
pub fn execute(arguments: Arguments) -> Exit {
    let sheets = read(&arguments.left).and_then(|left| Ok((left, read(&arguments.right)?)));
    let (left, right) = match sheets {
        Ok(sheets) => sheets,
        Err(error) => {
            tell!("error: {error}");
            return Exit::FileWrong;
        }
    };
    for column in &arguments.columns {
        let has = |sheet: &Sheet| {
            let bare = |name: &String| name.split(" [").next() == Some(column);
            sheet.head.iter().any(bare)
        };
        if !has(&left) || !has(&right) {
            tell!("error: no column \"{column}\" in both; the first line of jobs.csv names them");
            return Exit::FileWrong;
        }
    }
    let comparison = compare(&left, &right, arguments.tolerance, &arguments.columns);
    let name = |path: &Path| path.display().to_string();
    // A reader who has gone away is no error.
    let _ =
        std::io::stdout().write_all(describe(&comparison, &name(&arguments.left), &name(&arguments.right)).as_bytes());
    if comparison.same() {
        Exit::Well
    } else {
        Exit::ExpectationFailed
    }
}

fn read(path: &Path) -> Result<Sheet, String> {
    let file = if path.is_dir() {
        path.join("jobs.csv")
    } else {
        path.to_path_buf()
    };
    let bytes = std::fs::read(&file).map_err(|error| {
        format!(
            "cannot read {}: {error}\nhelp: name a folder that `vargeo run` wrote, such as results/quickstart",
            file.display()
        )
    })?;
    Sheet::read(&bytes).map_err(|error| format!("{}: {error}", file.display()))
}
