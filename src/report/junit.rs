//! JUnit XML for CI: a test suite of the jobs and one of the expectations.

use super::gate::{Outcome, Verdict};
use super::row::Row;
use super::table::word;
use crate::experiment::record::Status;
use quick_junit::{NonSuccessKind, Report, TestCase, TestCaseStatus, TestSuite};
use std::time::Duration;

/// A document of all experiments of a command.
pub struct Document(Report);

impl Document {
    pub fn new(name: &str) -> Self {
        Self(Report::new(name))
    }

    /// Adds an experiment. Failed jobs are errors, failed expectations failures; missing optional models are skipped.
    pub fn add(&mut self, name: &str, rows: &[Row], verdicts: &[Verdict]) {
        self.0.add_test_suites(suites(name, rows, verdicts));
    }

    /// The whole document.
    ///
    /// # Errors
    /// Text that XML cannot hold.
    pub fn write(&self) -> Result<String, quick_junit::SerializeError> {
        self.0.to_string()
    }
}

fn suites(name: &str, rows: &[Row], verdicts: &[Verdict]) -> [TestSuite; 2] {
    let mut jobs = TestSuite::new(format!("{name}: jobs"));
    for row in rows {
        let result = &row.record.result;
        let mut status = match result.status {
            Status::Done | Status::Refused => TestCaseStatus::success(),
            Status::Failed => TestCaseStatus::non_success(NonSuccessKind::Error),
            Status::Skipped => TestCaseStatus::skipped(),
        };
        if result.status != Status::Done {
            status.set_message(format!("{}: {}", word(row), result.reason));
        }
        let mut case = TestCase::new(row.name.as_str(), status);
        case.set_classname(name);
        if let Some(seconds) = row.figure("seconds").filter(|seconds| (0.0..1e9).contains(seconds)) {
            case.set_time(Duration::from_secs_f64(seconds));
        }
        jobs.add_test_case(case);
    }
    let mut expectations = TestSuite::new(format!("{name}: expectations"));
    for verdict in verdicts {
        let mut status = match verdict.outcome {
            Outcome::Met => TestCaseStatus::success(),
            Outcome::Failed => TestCaseStatus::non_success(NonSuccessKind::Failure),
            Outcome::Skipped => TestCaseStatus::skipped(),
        };
        if verdict.outcome != Outcome::Met {
            status.set_message(format!("expected {}, found {}", verdict.expected, verdict.found));
        }
        let subject = if verdict.subject.is_empty() {
            "no job"
        } else {
            &verdict.subject
        };
        let mut case = TestCase::new(format!("{subject}: {}", verdict.expected), status);
        case.set_classname(format!("{name} {}", verdict.place));
        expectations.add_test_case(case);
    }
    [jobs, expectations]
}
