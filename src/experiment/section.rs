//! The sections of an experiment file and their keys, declared as data.
//!
//! The reader finds unknown and missing keys by these lists, `vargeo schema` derives the JSON Schema from them, and
//! `vargeo new` its comments. What a method declares (models, settings, columns) is joined in by the method's name.

use super::claims::CLAIMS;
use crate::method::setting::{Default, Field, Kind};

/// A key of a section.
#[derive(Debug)]
pub struct Key {
    pub name: &'static str,
    pub holds: Holds,
    pub required: bool,
    pub doc: &'static str,
}

/// What a key holds, where this depends on the method or on other sections.
#[derive(Debug)]
pub enum Holds {
    /// A value that needs nothing else to be checked.
    Plain(Kind),
    /// The name of a method.
    Method,
    /// Tables of models by name.
    Models,
    /// The method's settings.
    Settings,
    /// Axes with their values.
    Axes,
    /// A list of tables with these keys: `[[table]]`.
    Sections(&'static [Key]),
    /// A list of tables of axes that move together: `[[zip]]`.
    Zips,
    /// A list of conditions: `[[exclude]]`.
    Conditions,
    /// A list of expectations: these keys, and columns with their bounds.
    Expectations(&'static [Key]),
    /// A value or a list of values by axis name.
    Condition,
    /// Axis names: one, or a list.
    AxisNames,
    /// A list of metrics, counters and measurements.
    Columns,
    /// A trace, a column or an axis.
    Coordinate,
    /// Printed figures in place, or the path of their file.
    Published,
    /// A list of rows: values by axis name, figures by column name.
    PublishedRows,
}

const fn key(name: &'static str, holds: Holds, required: bool, doc: &'static str) -> Key {
    Key {
        name,
        holds,
        required,
        doc,
    }
}

fn claims() -> Vec<(&'static str, String)> {
    CLAIMS.iter().map(|claim| (claim.id, claim.text.to_owned())).collect()
}

/// The file.
pub static EXPERIMENT: &[Key] = &[
    key(
        "title",
        Holds::Plain(Kind::Text),
        false,
        "The question in one line; the file's name when absent.",
    ),
    key(
        "description",
        Holds::Plain(Kind::Text),
        false,
        "What is compared and why, for the top of the page.",
    ),
    key("method", Holds::Method, true, "The method that all jobs run."),
    key(
        "claims",
        Holds::Plain(Kind::List(&Kind::Named(claims))),
        false,
        "Claims of the papers that the file reproduces.",
    ),
    key(
        "models",
        Holds::Models,
        false,
        "Models by name: files or generators for each role of the method.",
    ),
    key(
        "settings",
        Holds::Settings,
        false,
        "Settings of the method that are held for every job.",
    ),
    key(
        "vary",
        Holds::Axes,
        false,
        "The grid: every combination of the values of these axes, the last varying fastest. An axis is `model`, a setting by its dotted path, or `model.PARAMETER` of the mesh's generator.",
    ),
    key(
        "zip",
        Holds::Zips,
        false,
        "Axes that move together; each group counts as one axis after those of `vary`.",
    ),
    key(
        "exclude",
        Holds::Conditions,
        false,
        "Jobs to leave out. One that matches nothing is an error.",
    ),
    key(
        "limits",
        Holds::Plain(Kind::Table(LIMITS)),
        false,
        "Limits of each job; one that is exceeded is a record with its reason.",
    ),
    key(
        "timing",
        Holds::Plain(Kind::Table(TIMING)),
        false,
        "How times are taken.",
    ),
    key("table", Holds::Sections(TABLE), false, "Tables of the report."),
    key("plot", Holds::Sections(PLOT), false, "Plots of the report."),
    key("rate", Holds::Sections(RATE), false, "Slopes of log y against log x."),
    key(
        "expect",
        Holds::Expectations(EXPECT),
        false,
        "What `vargeo check` gates: bounds by column name.",
    ),
];

/// `[limits]`
pub static LIMITS: &[Field] = &[
    Field {
        name: "time",
        kind: Kind::Duration,
        default: Default::Absent,
        doc: "Wall-clock time of one job.",
    },
    Field {
        name: "memory",
        kind: Kind::Size,
        default: Default::Absent,
        doc: "Resident memory of one job.",
    },
];

/// `[timing]`
pub static TIMING: &[Field] = &[
    Field {
        name: "exclusive",
        kind: Kind::Boolean,
        default: Default::Boolean(false),
        doc: "One job at a time, so that its times can be reported.",
    },
    Field {
        name: "repeat",
        kind: Kind::Integer { min: 1, max: 1000 },
        default: Default::Integer(1),
        doc: "How often each job is timed; the median is reported.",
    },
    Field {
        name: "threads",
        kind: Kind::Integer { min: 1, max: 4096 },
        default: Default::Absent,
        doc: "Threads of each job. When absent: all cores if exclusive, one otherwise.",
    },
];

/// `[[table]]`
pub static TABLE: &[Key] = &[
    key(
        "name",
        Holds::Plain(Kind::Text),
        true,
        "Name of the files: letters, digits, `-`, `_`, `.`.",
    ),
    key(
        "title",
        Holds::Plain(Kind::Text),
        false,
        "Heading; the name when absent.",
    ),
    key(
        "rows",
        Holds::AxisNames,
        false,
        "Axes whose values head each row, the first changing most slowly; those that vary when absent. Bold marks the best value \
         of the last one, all else equal.",
    ),
    key("columns", Holds::Columns, true, "Metrics, counters and measurements."),
    key(
        "across",
        Holds::AxisNames,
        false,
        "Axes for each of whose values every column stands once, side by side; they are no rows.",
    ),
    key(
        "where",
        Holds::Condition,
        false,
        "Only the jobs with these axis values.",
    ),
    key(
        "published",
        Holds::Published,
        false,
        "Printed figures to stand beside ours.",
    ),
];

/// `published`, in place or in a file under the table's name.
pub static PUBLISHED: &[Key] = &[
    key(
        "source",
        Holds::Plain(Kind::Text),
        true,
        "Where the figures were printed.",
    ),
    key(
        "machine",
        Holds::Plain(Kind::Text),
        false,
        "The machine that printed times were taken on.",
    ),
    key(
        "rows",
        Holds::PublishedRows,
        true,
        "Axis values that tell the jobs, their figures by column name, and `tolerance`, relative, where the usual one does not fit.",
    ),
];

/// `[[plot]]`
pub static PLOT: &[Key] = &[
    key(
        "name",
        Holds::Plain(Kind::Text),
        false,
        "Name of the files; `Y-X` when absent.",
    ),
    key(
        "title",
        Holds::Plain(Kind::Text),
        false,
        "Heading; the name when absent.",
    ),
    key(
        "x",
        Holds::Coordinate,
        true,
        "A trace such as `iteration`, a column, or an axis.",
    ),
    key(
        "y",
        Holds::Coordinate,
        true,
        "A trace if x is one, else a column or an axis of numbers.",
    ),
    key(
        "series",
        Holds::AxisNames,
        false,
        "Axes whose values tell the series apart. When absent all that vary, save x and its zip; and where x is measured, such \
         as an edge length, save the models' numbers, which refine.",
    ),
    key(
        "log",
        Holds::Plain(Kind::Choice(LOG)),
        false,
        "Which axes are logarithmic.",
    ),
    key(
        "where",
        Holds::Condition,
        false,
        "Only the jobs with these axis values.",
    ),
];

/// Values of a plot's `log`.
pub static LOG: &[(&str, &str)] = &[
    ("x", "the horizontal axis"),
    ("y", "the vertical axis"),
    ("xy", "both axes"),
];

/// `[[rate]]`
pub static RATE: &[Key] = &[
    key(
        "name",
        Holds::Plain(Kind::Text),
        false,
        "Name of the rate; `Y-X-rate` when absent.",
    ),
    key("x", Holds::Coordinate, true, "A column or an axis of numbers."),
    key("y", Holds::Coordinate, true, "A column or an axis of numbers."),
    key(
        "series",
        Holds::AxisNames,
        false,
        "Axes with a slope for each of their values. When absent all that vary, save x and its zip; and where x is measured, \
         such as an edge length, save the models' numbers, which refine.",
    ),
    key(
        "where",
        Holds::Condition,
        false,
        "Only the jobs with these axis values.",
    ),
    key(
        "window",
        Holds::Plain(Kind::List(&Kind::Number {
            min: f64::MIN,
            max: f64::MAX,
        })),
        false,
        "Only x from the first to the second of these numbers counts.",
    ),
    key(
        "expect",
        Holds::Plain(Kind::Table(BOUND)),
        false,
        "What the slope must satisfy.",
    ),
];

/// `[[expect]]`, beside columns with their bounds.
pub static EXPECT: &[Key] = &[
    key(
        "where",
        Holds::Condition,
        false,
        "Only the jobs with these axis values.",
    ),
    key(
        "stop",
        Holds::Plain(Kind::Named(stops)),
        false,
        "Why each job must have ended.",
    ),
];

fn stops() -> Vec<(&'static str, String)> {
    super::record::STOPS
        .iter()
        .map(|(word, meaning)| (*word, (*meaning).to_owned()))
        .collect()
}

const ANY: Kind = Kind::Number {
    min: f64::MIN,
    max: f64::MAX,
};

/// What a number must satisfy.
pub static BOUND: &[Field] = &[
    Field {
        name: "min",
        kind: ANY,
        default: Default::Absent,
        doc: "The least value.",
    },
    Field {
        name: "max",
        kind: ANY,
        default: Default::Absent,
        doc: "The greatest value.",
    },
    Field {
        name: "equals",
        kind: ANY,
        default: Default::Absent,
        doc: "The value, up to `tolerance`.",
    },
    Field {
        name: "tolerance",
        kind: Kind::Number {
            min: 0.0,
            max: f64::MAX,
        },
        default: Default::Absent,
        doc: "Relative tolerance of `equals`; exact when absent.",
    },
];

/// What a column must satisfy beside a bound: to be less than in another job.
pub static COMPARISON: &[Key] = &[
    key(
        "less_than",
        Holds::Condition,
        true,
        "The other jobs: those with these axis values that agree in every other axis.",
    ),
    key(
        "factor",
        Holds::Plain(Kind::Number {
            min: f64::MIN_POSITIVE,
            max: f64::MAX,
        }),
        false,
        "The value must be less than this many times the others'; 1 when absent.",
    ),
];
