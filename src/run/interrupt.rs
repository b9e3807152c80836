//! A wish to stop, as Ctrl-C, SIGTERM and a closed terminal express it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Set once and seen by everyone who holds a copy.
#[derive(Clone, Debug, Default)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Asks everyone to stop.
    pub fn set(&self) {
        self.0.store(true, Ordering::SeqCst);
    }

    /// Whether somebody has asked.
    pub fn is_set(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }

    /// Lets SIGINT, SIGTERM and SIGHUP set this, and calls `then`, with the number of the signal since the start, from a
    /// thread of its own. Once a process.
    ///
    /// A signal that the process was started to ignore, as `nohup` does with SIGHUP, stays ignored.
    pub fn listen(&self, mut then: impl FnMut(u32) + Send + 'static) {
        let ignored = ignored_signals();
        let interrupt = self.clone();
        let mut count = 0;
        let _ = ctrlc::set_handler(move || {
            interrupt.set();
            count += 1;
            then(count);
        });
        for signal in [SIGHUP, SIGINT] {
            if ignored & (1 << (signal - 1)) != 0 {
                ignore(signal);
            }
        }
    }
}

const SIGHUP: i32 = 1;
const SIGINT: i32 = 2;

/// Bit `n - 1` is set when signal `n` is ignored.
fn ignored_signals() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok())
        .unwrap_or(0)
}

fn ignore(signal: i32) {
    unsafe extern "C" {
        #[link_name = "signal"]
        fn posix_signal(number: i32, handler: usize) -> usize;
    }
    /// `SIG_IGN` on every system that vargeo runs on.
    const IGNORE: usize = 1;
    // SAFETY: POSIX's `signal` with SIG_IGN touches no memory of ours and runs none of our code.
    unsafe {
        posix_signal(signal, IGNORE);
    }
}
