//! The process of one job: takes a request, computes, publishes, and says what happens.
//!
//! Guarantees. It ends when its parent ends, however that ends. It stops within a second of SIGTERM or Ctrl-C. What it
//! publishes is whole. It prints nothing but messages.

use super::execute::{Bounds, Computed, Ending, catch_panics_quietly, execute, failure, load, unmeasured};
use super::interrupt::Interrupt;
use super::protocol::{Message, Request};
use super::provenance;
use super::store::{Lock, Lookup, Publication, Sharing, Store};
use crate::experiment::record::{JobResult, Record, Status};
use crate::method::Method;
use std::io::{Read, Write};
use std::time::Duration;

/// How often a waiting process looks again.
const LOOK: Duration = Duration::from_millis(50);

/// Answers the request on standard input with the methods that `find` knows. The return value is false when there is no
/// proper request.
pub fn serve(find: &dyn Fn(&str) -> Option<&'static dyn Method>) -> bool {
    let mut text = String::new();
    let read = std::io::stdin().read_to_string(&mut text);
    let Ok(request) = read
        .map_err(drop)
        .and_then(|_| serde_json::from_str::<Request>(&text).map_err(drop))
    else {
        return false;
    };
    let interrupt = Interrupt::default();
    confine(&request, &interrupt);
    let mut tell = messenger(interrupt.clone());
    let last = answer(&request, find(&request.job.method), &interrupt, &mut tell);
    tell(last);
    true
}

/// Ties the process to its parent, bounds its memory, and listens to signals.
fn confine(request: &Request, interrupt: &Interrupt) {
    let _ = rustix::thread::set_name(c"vargeo-job");
    #[cfg(target_os = "linux")]
    {
        let _ = rustix::process::set_parent_process_death_signal(Some(rustix::process::Signal::KILL));
        let parent = rustix::process::getppid().map(|parent| parent.as_raw_nonzero().get());
        if parent != i32::try_from(request.parent).ok() {
            // The parent ended before the line above took effect.
            std::process::exit(1);
        }
    }
    if let Some(memory) = request.memory {
        // The parent watches resident memory; this only stops what outruns it. Address space is always larger than
        // resident memory, by stacks and by what allocators reserve.
        let most = memory.saturating_mul(2).saturating_add(2 << 30);
        let limit = rustix::process::Rlimit {
            current: Some(most),
            maximum: Some(most),
        };
        let _ = rustix::process::setrlimit(rustix::process::Resource::As, limit);
    }
    interrupt.listen(|_| {
        // A method that does not look at its observer is not waited for: nothing unfinished is ever visible.
        std::thread::sleep(Duration::from_millis(900));
        std::process::exit(130);
    });
    catch_panics_quietly();
}

/// Writes messages to standard output. A reader that has gone away is a wish to stop.
fn messenger(interrupt: Interrupt) -> impl FnMut(Message) + Send {
    move |message| {
        let line = serde_json::to_string(&message).map(|line| line + "\n");
        let written = line.map_err(std::io::Error::from).and_then(|line| {
            let mut output = std::io::stdout().lock();
            output.write_all(line.as_bytes())?;
            output.flush()
        });
        if written.is_err() {
            interrupt.set();
        }
    }
}

/// Computes what is asked for, unless it is there, and returns the last message.
fn answer(
    request: &Request,
    method: Option<&dyn Method>,
    interrupt: &Interrupt,
    tell: &mut (dyn FnMut(Message) + Send),
) -> Message {
    let store = Store::new(&request.store);
    let mut taken = store.try_lock(&request.key);
    if taken.is_none() {
        if !request.wait {
            return Message::Busy;
        }
        tell(Message::Waiting("another process computes it".into()));
        taken = wait_for(interrupt, || store.try_lock(&request.key));
    }
    let Some(_lock) = taken else {
        return Message::Cancelled;
    };
    if !request.force {
        match store.lookup(&request.key) {
            Lookup::Hit(record) if request.effort.is_met_by(&record) => {
                return Message::Finished { record, cached: true };
            }
            Lookup::Hit(_) | Lookup::Miss => {}
            Lookup::Damaged { reason, quarantine } => {
                tell(Message::Warning(damage(&request.key.0, &reason, &quarantine)))
            }
        }
    }
    let sharing = if request.effort.exclusive {
        Sharing::Alone
    } else {
        Sharing::Shared
    };
    let mut machine = store.try_lock_machine(sharing);
    if machine.is_none() {
        tell(Message::Waiting("a timed job needs the machine to itself".into()));
        machine = wait_for(interrupt, || store.try_lock_machine(sharing));
    }
    let Some(_machine) = machine else {
        return Message::Cancelled;
    };
    compute(request, method, &store, interrupt, tell)
}

fn wait_for(interrupt: &Interrupt, mut take: impl FnMut() -> Option<Lock>) -> Option<Lock> {
    while !interrupt.is_set() {
        if let Some(lock) = take() {
            return Some(lock);
        }
        std::thread::sleep(LOOK);
    }
    None
}

fn compute(
    request: &Request,
    method: Option<&dyn Method>,
    store: &Store,
    interrupt: &Interrupt,
    tell: &mut (dyn FnMut(Message) + Send),
) -> Message {
    let finished = |record: Record| Message::Finished {
        record: Box::new(record),
        cached: false,
    };
    let record = |result: JobResult, measurement| Record {
        key: request.key.clone(),
        job: request.job.clone(),
        result,
        measurement,
    };
    let without = |result| finished(record(result, unmeasured(request.effort, &request.inputs)));
    let Some(method) = method else {
        let reason = format!("this vargeo has no method {}", request.job.method);
        return without(failure("not-started", reason));
    };
    let model = match load(&request.job, &request.inputs) {
        Ok(model) => model,
        Err(error) => return without(failure(&error.kind, error.reason)),
    };
    let bounds = Bounds {
        effort: request.effort,
        seconds: request.seconds,
        interrupt,
        tell,
    };
    let computed = match execute(method, &request.job, model, &request.inputs, bounds) {
        Ending::Computed(computed) => *computed,
        Ending::Cancelled => return Message::Cancelled,
    };
    let Computed {
        mut result,
        files,
        measurement,
        differing,
    } = computed;
    if let Some((first, later)) = differing {
        tell(Message::Warning(format!(
            "{} is not deterministic: repetitions in one process have the fingerprints {first} and {later}",
            request.key.0
        )));
    }
    if request.memory.is_some_and(|limit| measurement.peak_memory > limit) {
        let limit = request.memory.unwrap_or_default();
        let reason = memory_reason(measurement.peak_memory, limit);
        return finished(record(failure("memory-limit", reason), measurement));
    }
    if result.status == Status::Failed {
        return finished(record(result, measurement));
    }
    let made = record(result.clone(), measurement.clone());
    // A better measurement takes the stored one's place; a worse one is not kept.
    let replace = request.force || request.effort.exclusive || request.effort.repeat > 1;
    match store.publish(&made, &files, replace) {
        Ok(Publication::New | Publication::Remeasured) => finished(made),
        Ok(Publication::AlreadyThere(stored)) => Message::Finished {
            record: stored,
            cached: true,
        },
        Ok(Publication::Differs {
            stored,
            computed,
            kept,
            set_aside,
        }) => {
            let (made, now) = (&kept.measurement.commit, provenance::commit());
            let cause = if made == now {
                "is not deterministic".to_string()
            } else {
                format!("differs from that of another build, commit {made} against {now}, or is not deterministic")
            };
            tell(Message::Warning(format!(
                "{} {cause}: the stored result has the fingerprint {stored}, this computation {computed} on {}; the one \
                 not kept is in {}",
                request.key.0,
                provenance::target(),
                set_aside.display()
            )));
            Message::Finished {
                record: kept,
                cached: false,
            }
        }
        Err(error) => {
            result.status = Status::Failed;
            result.stop = "not-stored".into();
            result.reason = format!("computed, but {error}");
            result.artifacts.clear();
            finished(record(result, measurement))
        }
    }
}

/// A sentence on a damaged entry.
pub(super) fn damage(key: &str, reason: &str, quarantine: &Result<std::path::PathBuf, String>) -> String {
    match quarantine {
        Ok(path) => format!("stored result {key} is damaged ({reason}); moved to {}", path.display()),
        Err(error) => format!("stored result {key} cannot be used ({reason}); {error}"),
    }
}

/// A sentence on a memory limit.
pub(super) fn memory_reason(used: u64, limit: u64) -> String {
    let mebibytes = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    format!(
        "used {:.0} MiB of resident memory where limits.memory allows {:.0} MiB",
        mebibytes(used),
        mebibytes(limit)
    )
}
