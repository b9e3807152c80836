//! A wish to stop, as Ctrl-C and SIGTERM express it.

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
}
