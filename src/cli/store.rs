//! `vargeo store`: verify it, count it, tidy it.

use super::Exit;
use super::input::Input;
use crate::experiment::job::Key;
use crate::run::store::{Garbage, GarbageKind, Store};
use indicatif::HumanBytes;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::time::Duration;

/// Verifies, counts and tidies the store of results.
#[derive(clap::Args)]
pub struct Arguments {
    #[command(subcommand)]
    action: Action,
}

#[derive(clap::Subcommand)]
enum Action {
    /// Reads every byte of every result; damaged ones are moved to the store's quarantine.
    Verify(Place),
    /// Says what is there.
    Stat(Place),
    /// Lists what nobody needs, and removes it with --delete.
    Gc(Tidy),
}

#[derive(clap::Args)]
struct Place {
    /// Folder of results; the store is in its folder `store`.
    #[arg(long, value_name = "DIR", default_value = "results")]
    results: PathBuf,
}

#[derive(clap::Args)]
struct Tidy {
    #[command(flatten)]
    place: Place,
    /// Remove, rather than only list.
    #[arg(long)]
    delete: bool,
    /// Hours for which unfinished writes are left alone, since another process may be at work on them.
    #[arg(long, value_name = "HOURS", default_value_t = 24)]
    older: u64,
    /// Remove the results of all experiments but these as well; may be given several times.
    #[arg(long, value_name = "FILE")]
    keep: Vec<PathBuf>,
    /// A folder where their model files are looked for too.
    #[arg(long, value_name = "DIR", requires = "keep")]
    models: Vec<PathBuf>,
}

/// Does what is asked.
pub fn execute(arguments: Arguments) -> Exit {
    let done = match arguments.action {
        Action::Verify(place) => verify(&place),
        Action::Stat(place) => statistics(&place),
        Action::Gc(tidy) => collect(&tidy),
    };
    done.unwrap_or_else(|error| {
        tell!("error: {error}");
        Exit::FileWrong
    })
}

type Done = Result<Exit, Box<dyn std::error::Error>>;

/// The store of a results folder, which must be there.
fn open(place: &Place) -> Result<Store, String> {
    let root = place.results.join("store");
    if !root.is_dir() {
        return Err(format!(
            "there is no store at {}; --results names the folder of results",
            root.display()
        ));
    }
    Ok(Store::new(root))
}

fn verify(place: &Place) -> Done {
    let (sound, damaged) = open(place)?.verify()?;
    answer!("{sound} results are sound, {} are damaged", damaged.len());
    for damage in &damaged {
        answer!("{}: {}", damage.key.0, damage.reason);
        match &damage.quarantine {
            Ok(path) => answer!("  moved to {}; the next run computes it again", path.display()),
            Err(error) => answer!("  {error}"),
        }
    }
    Ok(if damaged.is_empty() {
        Exit::Well
    } else {
        Exit::ExpectationFailed
    })
}

fn statistics(place: &Place) -> Done {
    let statistics = open(place)?.statistics()?;
    answer!("{} results, {}", statistics.entries, HumanBytes(statistics.bytes));
    for (kind, count) in &statistics.kinds {
        answer!("  {count} {kind}");
    }
    answer!("{} failures, tried again by the next run", statistics.failures);
    answer!(
        "{} in quarantine, {}",
        statistics.quarantined,
        HumanBytes(statistics.quarantined_bytes)
    );
    answer!(
        "{} unfinished, {}",
        statistics.leftovers,
        HumanBytes(statistics.leftover_bytes)
    );
    Ok(Exit::Well)
}

fn collect(tidy: &Tidy) -> Done {
    let store = open(&tidy.place)?;
    let keep = match tidy.keep.is_empty() {
        true => None,
        false => match keys(tidy) {
            Ok(keys) => Some(keys),
            Err(exit) => return Ok(exit),
        },
    };
    let age = Duration::from_secs(tidy.older.saturating_mul(3600));
    let garbage = store.garbage(age, keep.as_ref())?;
    let mut sums: BTreeMap<GarbageKind, (usize, u64)> = BTreeMap::new();
    for Garbage { kind, path, bytes } in &garbage {
        answer!("{}", path.display());
        let sum = sums.entry(*kind).or_default();
        *sum = (sum.0 + 1, sum.1 + bytes);
    }
    for (kind, (count, bytes)) in sums {
        let word = match kind {
            GarbageKind::Leftover => "unfinished writes",
            GarbageKind::Quarantined => "in quarantine",
            GarbageKind::Unreferenced => "results of no given experiment",
            GarbageKind::Failure => "failures of no given experiment",
            GarbageKind::Lock => "idle locks",
        };
        answer!("{count} {word}, {}", HumanBytes(bytes));
    }
    match (garbage.is_empty(), tidy.delete) {
        (true, _) => answer!("nothing to remove"),
        (false, true) => {
            store.remove(&garbage)?;
            answer!("removed");
        }
        (false, false) => answer!("nothing was removed; --delete does it"),
    }
    Ok(Exit::Well)
}

/// The keys of every job of the experiments to keep. All their models must be there, for a job without them has no key.
fn keys(tidy: &Tidy) -> Result<BTreeSet<Key>, Exit> {
    let mut keys = BTreeSet::new();
    for file in &tidy.keep {
        let input = Input {
            files: vec![file.clone()],
            models: tidy.models.clone(),
        };
        for job in input.plans()?.into_iter().flat_map(|plan| plan.jobs) {
            match (job.resolved, job.missing) {
                (Some((key, _)), _) => keys.extend([key]),
                (None, missing) => {
                    let reason = missing.unwrap_or_default();
                    tell!(
                        "error: {}: which results to keep is not known ({reason})",
                        file.display()
                    );
                    tell!("help: name the folder of its models with --models");
                    return Err(Exit::FileWrong);
                }
            }
        }
    }
    Ok(keys)
}
