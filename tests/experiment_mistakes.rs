//! Every mistake in an experiment file is told once, at its place, with its mend, and together with all others.

use crate::experiment_files::{after_head, parse, told};
use vargeo::experiment::diagnostic::render;

#[test]
fn every_mistake_has_its_place_and_its_mend() {
    let cases: &[(&str, &str)] = &[
        (
            "tittle = \"x\"",
            "1:1 unknown key \"tittle\" in model \"ball\" |  | \"title\" stands at the top of the file, above its first [table]",
        ),
        (
            "[settings]\nlambdaa = 1",
            "2:1 unknown key \"lambdaa\" in settings |  | did you mean \"lambda\"?",
        ),
        (
            "[settings]\nrelaxation = true",
            "2:1 unknown key \"relaxation\" in settings |  | it belongs into the table \"newton\"",
        ),
        (
            "[settings]\nzzz = true",
            "2:1 unknown key \"zzz\" in settings |  | known: energy, order, lambda, untangle, solver, newton, barrier, patience, cache, label, schedule",
        ),
        (
            "[settings]\nnewton = { omgea = 1 }",
            "2:12 unknown key \"omgea\" in newton |  | did you mean \"omega\"?",
        ),
        (
            "[limits]\ntimes = \"1 s\"",
            "2:1 unknown key \"times\" in limits |  | did you mean \"time\"?",
        ),
        (
            "[[table]]\nname = \"a\"\ncolumns = [\"d_ma\"]\nrow = [\"model\"]",
            "4:1 unknown key \"row\" in [[table]] |  | did you mean \"rows\"?",
        ),
        (
            "[[table]]\ncolumns = [\"d_ma\"]",
            "1:1 \"name\" is missing in [[table]] |  | add name = ...: Name of the files: letters, digits, `-`, `_`, `.`.",
        ),
        (
            "[table]\nname = \"a\"",
            "1:2 \"table\" is a table |  | write [[table]] with two brackets: there may be several",
        ),
        (
            "[[vary]]\nenergy = [\"arap\"]",
            "1:1 \"vary\" is a list | expected a table | write one pair of brackets: there is only one",
        ),
        (
            "[settings]\nuntangle = 1",
            "2:12 \"untangle\" is a whole number | expected true or false | ",
        ),
        (
            "[settings]\norder = 1.5",
            "2:9 \"order\" is a number | expected a whole number from 1 to 16 | ",
        ),
        (
            "[settings]\norder = 17",
            "2:9 \"order\" is 17, out of range | expected a whole number from 1 to 16 | ",
        ),
        (
            "[settings]\nlambda = nan",
            "2:10 \"lambda\" is NaN, out of range | expected a number from 0 to 100 | ",
        ),
        (
            "[settings]\nlambda = -0.5",
            "2:10 \"lambda\" is -0.5, out of range | expected a number from 0 to 100 | ",
        ),
        (
            "[settings]\nnewton = { omega = 0 }",
            "2:20 \"newton.omega\" is 0, out of range | expected a positive number | ",
        ),
        (
            "[settings]\nnewton = 3",
            "2:10 \"newton\" is a whole number | expected a table | ",
        ),
        (
            "[settings]\nbarrier = 3",
            "2:11 \"barrier\" is a whole number | expected one of \"auto\", \"none\", or a table | ",
        ),
        (
            "[settings]\nbarrier = {}",
            "2:11 \"barrier.width\" is missing | expected width = a positive number | ",
        ),
        (
            "[settings]\nschedule = [1, \"2\"]",
            "2:16 \"schedule\" is text | expected a positive number | ",
        ),
        (
            "[settings]\nlabel = 1979-05-27",
            "2:9 \"label\" is a date | expected text in quotes | ",
        ),
        (
            "[settings]\norder = 99999999999999999999",
            "2:9 whole number 99999999999999999999 is too large | expected at most 9223372036854775807 in magnitude | ",
        ),
        (
            "[limits]\ntime = \"10 mins\"",
            "2:8 unknown unit \"mins\" |  | did you mean \"min\"?",
        ),
        (
            "[limits]\ntime = 10",
            "2:8 \"limits.time\" has no unit | expected a duration such as \"10 min\" | write \"10 s\" for instance",
        ),
        (
            "[limits]\ntime = \"soon\"",
            "2:8 duration \"soon\" does not begin with a number |  | write a number and a unit, such as \"10 min\"",
        ),
        (
            "[limits]\ntime = \"0 s\"",
            "2:8 duration \"0 s\" is not positive |  | write a positive number and a unit, such as \"10 min\"",
        ),
        (
            "[limits]\nmemory = \"8 GIB\"",
            "2:10 unknown unit \"GIB\" |  | did you mean \"GiB\"?",
        ),
        (
            "[limits]\nmemory = \"8\"",
            "2:10 size \"8\" has no unit |  | add one of B, kB, MB, GB, TB, KiB, MiB, GiB, TiB, such as \"8 GiB\"",
        ),
        (
            "[timing]\nrepeat = 0",
            "2:10 \"timing.repeat\" is 0, out of range | expected a whole number from 1 to 1000 | ",
        ),
        (
            "[settings]\nenergy = \"strech\"",
            "2:10 unknown energy \"strech\" |  | did you mean \"stretch\"?",
        ),
        (
            "[settings]\nsolver = \"newtons method\"",
            "2:10 unknown solver \"newtons method\" |  | did you mean \"newton\"?",
        ),
        (
            "[settings]\nbarrier = \"atuo\"",
            "2:11 unknown barrier \"atuo\" |  | did you mean \"auto\"?",
        ),
        (
            "[models.bar]\nmesh = { generate = \"barr\" }",
            "2:21 unknown generator \"barr\" |  | did you mean \"bar\"?",
        ),
        (
            "[models.bar]\nmesh = { generate = \"bar\" }",
            "2:8 \"models.bar.mesh.tetrahedra\" is missing | expected tetrahedra = a whole number from 1 to 1000000 | ",
        ),
        (
            "[models.bar]\nmesh = { generate = \"bar\", tetrahedra = 1, lenght = 1 }",
            "2:44 unknown key \"lenght\" in models.bar.mesh |  | did you mean \"length\"?",
        ),
        (
            "[models.bar]\nmesh = \"bar\"",
            "2:8 \"bar\" is read as a file, and is the name of a generator |  | write { generate = \"bar\" }, or \"./bar\" for a file",
        ),
        (
            "[models.bar]\nmesh = { genrate = \"bar\" }",
            "2:8 \"models.bar.mesh\" says neither generate nor file | expected \"FILE\" or { generate = \"ball\", ... } | did you mean \"generate\" instead of \"genrate\"?",
        ),
        (
            "[models.bar]\nmesh = { shape = \"bar\" }",
            "2:8 \"models.bar.mesh\" says neither generate nor file | expected \"FILE\" or { generate = \"ball\", ... } | did you mean \"generate\" instead of \"shape\"?",
        ),
        (
            "[models.bar]\nmesh = { generate = \"ball\", file = \"x\" }",
            "2:29 both \"generate\" and \"file\" are given |  | keep one of the two",
        ),
        (
            "[models.bar]\nmesh = \"bar.mesh\"\ntarget = \"cube\"",
            "3:10 \"models.bar.target\" is text | expected { shape = \"cube\", ... } | write { shape = \"cube\" }",
        ),
        (
            "[models.bar]\ntarget = { shape = \"cube\" }",
            "1:1 model \"bar\" has no mesh | expected mesh = \"FILE\" or { generate = \"ball\", ... } | ",
        ),
        (
            "[models.bar]\nmesh = \"\"",
            "2:8 an empty file name | expected the path of a file | ",
        ),
        (
            "[models.bar]\nmesh = \"bar.mesh\"\noptionl = true",
            "3:1 unknown key \"optionl\" in model \"bar\" |  | did you mean \"optional\"?",
        ),
        (
            "[vary]\nenrgy = [\"arap\"]",
            "2:1 axis \"enrgy\" names no setting of tiny |  | did you mean \"energy\"?",
        ),
        (
            "[vary]\nomega = [1]",
            "2:1 axis \"omega\" names no setting of tiny |  | did you mean \"newton.omega\"?",
        ),
        (
            "[vary]\nenergy = []",
            "2:10 axis \"energy\" has no values |  | give it at least one value, or leave it out",
        ),
        (
            "[vary]\nenergy = \"arap\"",
            "2:10 axis \"energy\" is text | expected a list of values | write [\"arap\"]; what does not vary belongs into [settings]",
        ),
        (
            "[vary]\nenergy = [\"arap\", \"strech\"]",
            "2:19 unknown energy \"strech\" |  | did you mean \"stretch\"?",
        ),
        (
            "[vary]\nlambda = [1, 1.0]",
            "2:14 1 stands twice in axis \"lambda\" |  | remove one of the two",
        ),
        (
            "[vary]\nmodel = [\"bal\"]",
            "2:10 unknown model \"bal\" |  | did you mean \"ball\"?",
        ),
        (
            "[vary]\nnewton = [{ omega = 1 }]\n\"newton.omega\" = [1]",
            "3:1 axis \"newton.omega\" sets a part of axis \"newton\" |  | let one axis hold all values",
        ),
        (
            "[vary]\n\"barrier.width\" = [1, 2]",
            "2:1 axis \"barrier.width\" needs \"barrier\" to be a table |  | write barrier = { ... } under [settings]",
        ),
        (
            "[vary]\norder = [1]\n[[zip]]\norder = [1]\nlambda = [1]",
            "4:1 axis \"order\" stands twice |  | let one axis hold all values",
        ),
        (
            "[settings]\norder = 1\n[vary]\norder = [1, 2]",
            "2:1 \"order\" is both held and varied |  | hold it here, or vary it as an axis, not both",
        ),
        (
            "[vary]\n\"model.length\" = [1, 2]",
            "2:1 axis \"model.length\" does not fit model \"ball\" | generator \"ball\" has no parameter \"length\" | known: tetrahedra",
        ),
        (
            "[vary]\n\"model.tetrahedra\" = [1, 0]",
            "2:26 \"model.tetrahedra\" is 0, out of range | expected a whole number from 1 to 1000000 | ",
        ),
        (
            "[models.duck]\nmesh = \"duck.mesh\"\n[vary]\n\"model.tetrahedra\" = [1, 2]",
            "4:1 axis \"model.tetrahedra\" does not fit model \"duck\" | its mesh is a file | list under `model` only those that are generated, or split the experiment",
        ),
        (
            "[[zip]]\norder = [1, 2]\nlambda = [1, 2, 3]",
            "3:10 \"lambda\" has 3 values, \"order\" has 2 | expected 2 values | the axes of a zip move together and need equally many values",
        ),
        (
            "[[zip]]\norder = [1, 1]\nlambda = [2, 2]",
            "2:13 order = 1, lambda = 2 stands twice in a zip |  | remove one of the two",
        ),
        (
            "[vary]\norder = [1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16]\nlambda = [1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16]\nnewton.omega = [1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16]\nschedule=[[1],[2],[3],[4],[5],[6],[7],[8],[9],[10],[11],[12],[13],[14],[15],[16],[17],[18],[19],[20],[21],[22],[23],[24],[25]]",
            "1:2 the grid has 102400 jobs |  | shorten an axis or split the experiment: at most 100000 jobs",
        ),
        (
            "[vary]\nenergy = [\"arap\", \"stretch\"]\n[[exclude]]\nenergy = \"hencky\"",
            "4:10 axis \"energy\" has no value \"hencky\" |  | known: arap, stretch",
        ),
        (
            "[vary]\nenergy = [\"arap\", \"stretch\"]\n[[exclude]]\nenrgy = \"arap\"",
            "4:1 unknown axis \"enrgy\" |  | did you mean \"energy\"?",
        ),
        (
            "[vary]\nenergy = [\"arap\"]\n[[exclude]]\nenergy = \"arap\"",
            "3:1 every job is excluded |  | leave at least one job",
        ),
        (
            "[[zip]]\norder = [1, 2]\nlambda = [1, 2]\n[[exclude]]\norder = 1\nlambda = 2",
            "4:1 \"exclude\" matches no job |  | its values occur, but not together; remove it",
        ),
        (
            "[[zip]]\norder = [1, 2]\nlambda = [1, 2]\n[[expect]]\nwhere = { order = 1, lambda = 2 }\ninverted = 0",
            "5:9 \"where\" matches no job |  | its values occur, but not together; see `vargeo plan`",
        ),
        (
            "[[expect]]\nwhere = {}\ninverted = 0",
            "2:9 \"where\" names no axis |  | write an axis and its values, such as model = \"ball\"",
        ),
        (
            "[[table]]\nname = \"a\"\ncolumns = [\"dma\"]",
            "3:12 unknown metric \"dma\" |  | did you mean \"d_ma\"?",
        ),
        (
            "[[table]]\nname = \"a\"\ncolumns = [\"model\"]",
            "3:12 \"model\" is an axis, not a metric |  | axes stand in \"rows\", \"series\" and \"where\"",
        ),
        (
            "[[table]]\nname = \"a\"\ncolumns = []",
            "3:11 \"columns\" is empty | expected at least one metric | ",
        ),
        (
            "[[table]]\nname = \"a\"\nrows = [\"energy\"]\ncolumns = [\"d_ma\"]",
            "3:9 unknown axis \"energy\" |  | \"energy\" is a setting that does not vary; give it values under [vary]",
        ),
        (
            "[[table]]\nname = \"a/b\"\ncolumns = [\"d_ma\"]",
            "2:8 \"a/b\" cannot name a file |  | use letters, digits, `-`, `_` and `.`, and do not begin with a dot",
        ),
        (
            "[[table]]\nname = \"jobs\"\ncolumns = [\"d_ma\"]",
            "2:8 \"jobs\" is the name of a file that every report has |  | choose another name",
        ),
        (
            "[vary]\norder = [1, 2]\n[[table]]\nname = \"a\"\nrows = \"model\"\ncolumns = [\"d_ma\"]",
            "5:8 2 jobs fall into 1 row |  | add order to the rows, or say which jobs with \"where\"",
        ),
        (
            "[[plot]]\nname = \"a\"\nx = \"h\"\ny = \"d_ma\"\n[[plot]]\nname = \"A\"\nx = \"h\"\ny = \"d_ma\"",
            "6:8 another plot has the name \"A\" |  | give this plot a name of its own: name = \"...\"",
        ),
        (
            "[[plot]]\nx = \"iteratoin\"\ny = \"energy\"",
            "2:5 unknown trace, metric or axis \"iteratoin\" |  | did you mean \"iteration\"?",
        ),
        (
            "[[plot]]\nx = \"iteration\"\ny = \"d_ma\"",
            "3:5 \"iteration\" is a trace, \"d_ma\" is one number of each job |  | known: iteration, energy",
        ),
        (
            "[[plot]]\nx = \"h\"\ny = \"energy\"",
            "3:5 \"energy\" is a trace, \"h\" is one value of each job |  | known: inverted, d_ma, l2_error, h, iterations, seconds, cpu_seconds, peak_memory, threads",
        ),
        (
            "[[plot]]\nx = \"h\"\ny = \"d_ma\"\nlog = \"z\"",
            "4:7 unknown log \"z\" |  | known: x, y, xy",
        ),
        (
            "[[plot]]\nx = \"h\"\ny = \"model\"",
            "3:5 axis \"model\" has values that are no numbers |  | known: inverted, d_ma, l2_error, h, iterations, seconds, cpu_seconds, peak_memory, threads",
        ),
        (
            "[[rate]]\nx = \"model\"\ny = \"d_ma\"",
            "2:5 axis \"model\" has values that are no numbers |  | use it in \"series\"",
        ),
        (
            "[[rate]]\nx = \"iteration\"\ny = \"d_ma\"",
            "2:5 unknown metric or axis \"iteration\" |  | did you mean \"iterations\"?",
        ),
        (
            "[[rate]]\nx = \"h\"\ny = \"d_ma\"\nwindow = [2, 1]",
            "4:10 \"window\" is no interval | expected [FIRST, LAST] with FIRST < LAST | ",
        ),
        (
            "[[rate]]\nx = \"h\"\ny = \"d_ma\"\nexpect = { min = 2, max = 1 }",
            "4:10 \"expect\" has \"min\" above \"max\" | expected { min = ..., max = ... } or { equals = ..., tolerance = ... } | ",
        ),
        (
            "[[expect]]\ninvertd = 0",
            "2:1 unknown metric \"invertd\" |  | did you mean \"inverted\"?",
        ),
        (
            "[[expect]]\ninverted = \"none\"",
            "2:12 \"inverted\" is text | expected a number, or a table such as { max = 20.0 } | ",
        ),
        (
            "[[expect]]\ninverted = {}",
            "2:12 \"inverted\" says nothing | expected { min = ..., max = ... } or { equals = ..., tolerance = ... } | ",
        ),
        (
            "[[expect]]\ninverted = { mx = 1 }",
            "2:14 unknown key \"mx\" in the bound of \"inverted\" |  | did you mean \"max\"?",
        ),
        (
            "[[expect]]\ninverted = { max = 1, tolerance = 1 }",
            "2:12 \"inverted\" has a tolerance and no \"equals\" | expected { min = ..., max = ... } or { equals = ..., tolerance = ... } | ",
        ),
        (
            "[[expect]]\nstop = \"convergd\"",
            "2:8 unknown stop \"convergd\" |  | did you mean \"converged\"?",
        ),
        (
            "[[expect]]\nwhere = { model = \"ball\" }",
            "1:1 an expectation that says nothing |  | add a metric with its bound, such as inverted = 0, or stop = \"converged\"",
        ),
        (
            "[vary]\nenergy = [\"arap\", \"stretch\"]\n[[expect]]\nwhere = { energy = \"arap\" }\nd_ma = { less_than = { energy = \"arap\" } }",
            "5:22 the job with model = ball, energy = arap has no other to be compared with | expected axis values that another job has, all else equal | narrow the expectation with \"where\"",
        ),
        (
            "[[expect]]\nd_ma = { factor = 2.0 }",
            "2:8 \"less_than\" is missing in the bound of \"d_ma\" |  | add less_than = ...: The other jobs: those with these axis values that agree in every other axis.",
        ),
        (
            "[[table]]\nname = \"a\"\ncolumns = [\"d_ma\"]\npublished = \"nowhere.toml\"",
            "4:13 cannot read experiments/nowhere.toml: No such file or directory (os error 2) |  | the path is relative to the experiment file",
        ),
        (
            "[[table]]\nname = \"a\"\ncolumns = [\"d_ma\"]\npublished = { source = \"x\", rows = [{ model = \"ball\", inverted = 1 }] }",
            "4:55 \"inverted\" is no column of this table |  | add it to \"columns\", or remove the figure",
        ),
        (
            "[[table]]\nname = \"a\"\ncolumns = [\"d_ma\"]\npublished = { source = \"x\", rows = [{ model = \"ball\" }] }",
            "4:37 a printed row with no figure | expected axis values and figures, such as { energy = \"stretch\", d_ma = 1.2 } | ",
        ),
        (
            "[[table]]\nname = \"a\"\ncolumns = [\"d_ma\"]\npublished = { source = \"x\", rows = [{ d_ma = 1 }] }",
            "4:37 a printed row with no axis value | expected axis values and figures, such as { energy = \"stretch\", d_ma = 1.2 } | ",
        ),
        (
            "[[table]]\nname = \"a\"\ncolumns = [\"d_ma\"]\npublished = { source = \"x\", rows = [{ modle = \"ball\", d_ma = 1 }] }",
            "4:39 unknown axis \"modle\" |  | did you mean \"model\"?",
        ),
        (
            "[[table]]\nname = \"a\"\ncolumns = [\"d_ma\"]\npublished = { source = \"x\", rows = [{ model = \"cow\", d_ma = 1 }] }",
            "4:37 no job belongs to the printed row model = cow |  | it is not shown",
        ),
        (
            "[[table]]\nname = \"a\"\ncolumns = [\"d_ma\"]\npublished = { rows = [] }",
            "4:13 \"source\" is missing in published |  | add source = ...: Where the figures were printed.\n4:22 \"rows\" is empty | expected at least one row | ",
        ),
    ];
    for (text, expected) in cases {
        assert_eq!(after_head(text), *expected, "{text}");
    }
}

#[test]
fn one_slip_is_told_once() {
    // What depends on a wrong axis is not wrong itself.
    let text = "[vary]\nenrgy = [\"arap\", \"stretch\"]\n[[exclude]]\nenergy = \"arap\"\n\
                [[table]]\nname = \"a\"\nrows = \"energy\"\ncolumns = [\"d_ma\"]\n";
    assert_eq!(
        after_head(text),
        "2:1 axis \"enrgy\" names no setting of tiny |  | did you mean \"energy\"?"
    );
    let text = "[vary]\nenergy = [\"strech\", \"arap\"]\n[[expect]]\nwhere = { energy = \"stretch\" }\ninverted = 0";
    assert_eq!(
        after_head(text),
        "2:11 unknown energy \"strech\" |  | did you mean \"stretch\"?"
    );
    let text = "[models.duck]\nmesh = 1\n[vary]\nmodel = [\"ball\", \"duck\"]\n[[expect]]\nwhere = { model = \"duck\" }\ninverted = 0";
    assert_eq!(
        after_head(text),
        "2:8 \"models.duck.mesh\" is a whole number | expected \"FILE\" or { generate = \"ball\", ... } | "
    );
}

#[test]
fn all_mistakes_are_told_at_once_and_underlined() {
    let text = "method = \"tiny\"\ntitel = \"x\"\n\n[models.\"b\u{e4}r\"]\nmesh = { generate = \"bar\", tetrahedra = 0, \
                \"l\u{e4}nge\" = 1 }\n\n[settings]\nenergy = \"strech\" # not a word\n\n[limits]\ntime = \"10 minutes\"\n";
    let diagnostics = parse(text).err().expect("mistakes");
    let shown = render(&diagnostics, false);
    assert_eq!(
        shown,
        r#"error: unknown key "titel"
 --> experiments/question.toml:2:1
  |
2 | titel = "x"
  | ^^^^^
  |
  = help: did you mean "title"?

error: "models.bär.mesh.tetrahedra" is 0, out of range
 --> experiments/question.toml:5:41
  |
5 | mesh = { generate = "bar", tetrahedra = 0, "länge" = 1 }
  |                                         ^ expected a whole number from 1 to 1000000

error: unknown key "länge" in models.bär.mesh
 --> experiments/question.toml:5:44
  |
5 | mesh = { generate = "bar", tetrahedra = 0, "länge" = 1 }
  |                                            ^^^^^^^
  |
  = help: known: tetrahedra, length

error: unknown energy "strech"
 --> experiments/question.toml:8:10
  |
8 | energy = "strech" # not a word
  |          ^^^^^^^^
  |
  = help: did you mean "stretch"?

error: unknown unit "minutes"
  --> experiments/question.toml:11:8
   |
11 | time = "10 minutes"
   |        ^^^^^^^^^^^^
   |
   = help: did you mean "min"?

"#
    );
    assert!(render(&diagnostics, true).contains("\u{1b}["));
    assert_eq!(
        diagnostics[0].to_string(),
        "experiments/question.toml:2:1: error: unknown key \"titel\" (did you mean \"title\"?)"
    );
}

#[test]
fn mistakes_of_toml_are_underlined_too() {
    let cases: &[(&str, &str)] = &[
        (
            "method = tiny\ntitle = \"x\n",
            "1:10 invalid boolean | expected `true` | text stands in quotes: \"...\"\n2:11 invalid basic string | expected `\"` | ",
        ),
        (
            "method = \"tiny\"\nmethod = \"tiny\"\n[vary]\n[vary]\n",
            "2:1 duplicate key |  | a key or table may stand only once; join the two or remove one\n4:2 duplicate key |  | a key or table may stand only once; join the two or remove one",
        ),
        (
            "method = \"tiny\"\n[vary\nenergy = [\"arap\"]\n",
            "2:6 unclosed table | expected `]` | ",
        ),
        (
            "method = \"tiny\"\n[vary]\nenergy = [\"arap\",\n[settings]\norder = 1\n",
            "3:10 a list that is never closed | opened here | close it, and see that commas part its entries",
        ),
        (
            "method = \"tiny\"\r\n[settings]\r\norder 1\r\n",
            "3:7 key with no value | expected `=` | ",
        ),
        (
            "",
            "1:1 \"method\" is missing |  | add method = ... at the top, one of \"tiny\"",
        ),
        (
            "method = \"tiney\"\nx = 1\n",
            "1:10 unknown method \"tiney\" |  | did you mean \"tiny\"?\n1:10 method \"tiny\" needs a model, and there is none |  | add a table [models.NAME]; `vargeo new` prints an example\n2:1 unknown key \"x\" |  | known: title, description, method, claims, models, settings, vary, zip, exclude, limits, timing, table, plot, rate, expect",
        ),
        (
            "method = \"tiny\"\n",
            "1:10 method \"tiny\" needs a model, and there is none |  | add a table [models.NAME]; `vargeo new` prints an example",
        ),
        (
            "method = \"tiny\"\n[[zip]\norder = [1]\n",
            "2:7 unclosed array table | expected `]` | ",
        ),
        (
            "method = \"tiny\"\n[vary]\nschedule = [\n  [1],\n  [2,\n  [3],\n]\n[settings]\norder = 1\n",
            "3:12 a list that is never closed | opened here | close it, and see that commas part its entries",
        ),
        (
            "method = 1\n",
            "1:10 \"method\" is a whole number | expected text in quotes | ",
        ),
    ];
    for (text, expected) in cases {
        assert_eq!(told(text).join("\n"), *expected, "{text}");
    }
}
