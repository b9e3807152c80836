//! Durations such as `"10 min"` and sizes such as `"8 GiB"`.

use super::nearest::nearest;

/// Units of time with their seconds.
pub const DURATIONS: &[(&str, f64)] = &[("ms", 1e-3), ("s", 1.0), ("min", 60.0), ("h", 3600.0), ("d", 86400.0)];

/// Units of size with their bytes: powers of 1000, and of 1024 with an `i`.
pub const SIZES: &[(&str, f64)] = &[
    ("B", 1.0),
    ("kB", 1e3),
    ("MB", 1e6),
    ("GB", 1e9),
    ("TB", 1e12),
    ("KiB", 1024.0),
    ("MiB", 1048576.0),
    ("GiB", 1073741824.0),
    ("TiB", 1099511627776.0),
];

/// Why a text is no quantity: what is wrong, and the mend.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Misfit {
    pub message: String,
    pub help: String,
}

/// Seconds of a duration.
pub fn duration(text: &str) -> Result<f64, Misfit> {
    quantity(text, DURATIONS, "duration", "10 min")
}

/// Bytes of a size, rounded to a whole number.
pub fn size(text: &str) -> Result<u64, Misfit> {
    let bytes = quantity(text, SIZES, "size", "8 GiB")?.round();
    if (1.0..=9e15).contains(&bytes) {
        Ok(bytes as u64)
    } else {
        Err(Misfit {
            message: format!("size \"{text}\" is out of range"),
            help: "expected at least 1 B and at most 8000 TiB".to_owned(),
        })
    }
}

fn quantity(text: &str, units: &[(&str, f64)], what: &str, example: &str) -> Result<f64, Misfit> {
    let names = || units.iter().map(|(name, _)| *name).collect::<Vec<_>>();
    let trimmed = text.trim();
    let split = trimmed
        .find(|character: char| !(character.is_ascii_digit() || "._+-".contains(character)))
        .unwrap_or(trimmed.len());
    let (digits, unit) = (trimmed[..split].replace('_', ""), trimmed[split..].trim_start());
    let number: f64 = digits.parse().map_err(|_| Misfit {
        message: format!("{what} \"{text}\" does not begin with a number"),
        help: format!("write a number and a unit, such as \"{example}\""),
    })?;
    if unit.is_empty() {
        return Err(Misfit {
            message: format!("{what} \"{text}\" has no unit"),
            help: format!("add one of {}, such as \"{example}\"", names().join(", ")),
        });
    }
    let Some((_, factor)) = units.iter().find(|(name, _)| *name == unit) else {
        return Err(Misfit {
            message: format!("unknown unit \"{unit}\""),
            help: match nearest(unit, names()) {
                Some(name) => format!("did you mean \"{name}\"?"),
                None => format!("expected one of {}", names().join(", ")),
            },
        });
    };
    let value = number * factor;
    if value > 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err(Misfit {
            message: format!("{what} \"{text}\" is not positive"),
            help: format!("write a positive number and a unit, such as \"{example}\""),
        })
    }
}
