//! Running: jobs as processes side by side, their limits, and the store that keeps what they find.
//!
//! [`run_plan`] looks every job up in the [`store::Store`], starts a process for each that is missing, and returns a
//! record for every job of the plan: a crash, a limit or a missing model is a record with a reason and never stops the
//! others. [`job::serve`] is the other side: the process that computes one job and publishes it. The two talk in lines of
//! JSON, [`protocol`]. Whoever wants to show what happens implements [`event::Listener`].
//!
//! Does not guarantee: that a job without a time limit ever ends.

pub mod event;
pub mod execute;
pub mod interrupt;
pub mod job;
pub mod pool;
pub mod protocol;
pub mod provenance;
pub mod store;

mod child;

pub use pool::{Finished, Options, Program, Run, run_plan};
