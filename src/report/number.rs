//! Rounded numbers for people: significant digits, powers of ten, times and sizes.
//!
//! Tables, plots and the page round; `jobs.csv` never does.

/// A value rounded to significant digits, still to be typeset.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rounded {
    /// Digits with an ASCII minus sign and a decimal point, or a word.
    pub mantissa: String,
    /// A power of ten where plain digits would be long.
    pub exponent: Option<i32>,
}

/// Rounds to so many significant digits. Whole numbers below ten million keep all their digits; numbers from 0.001 to a
/// million are written plainly, others with a power of ten. Not-a-number becomes the word `undefined`.
pub fn round(value: f64, digits: usize) -> Rounded {
    let plain = |mantissa: String| Rounded {
        mantissa,
        exponent: None,
    };
    if value.is_nan() {
        return plain("undefined".into());
    }
    if value.is_infinite() {
        return plain(if value > 0.0 { "infinite" } else { "-infinite" }.into());
    }
    if value == 0.0 {
        return plain("0".into());
    }
    if value.fract() == 0.0 && value.abs() < 1e7 {
        return plain(format!("{value:.0}"));
    }
    let digits = digits.max(1);
    let scientific = format!("{:.*e}", digits - 1, value);
    let (mantissa, exponent) = scientific.split_once('e').expect("{:e} writes an exponent");
    let exponent: i32 = exponent.parse().expect("{:e} writes a whole exponent");
    if (-3..6).contains(&exponent) {
        let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
        plain(format!("{value:.decimals$}"))
    } else {
        Rounded {
            mantissa: mantissa.to_string(),
            exponent: Some(exponent),
        }
    }
}

impl Rounded {
    /// `1.23e-5`, for Markdown, CSV and terminals.
    pub fn plain(&self) -> String {
        match self.exponent {
            Some(exponent) => format!("{}e{exponent}", self.mantissa),
            None => self.mantissa.clone(),
        }
    }

    /// `1.23×10⁻⁵` with a true minus sign, for pages and plots.
    pub fn unicode(&self) -> String {
        let mantissa = self.mantissa.replace('-', "\u{2212}");
        match self.exponent {
            Some(exponent) => format!("{mantissa}\u{d7}10{}", superscript(exponent)),
            None => mantissa,
        }
    }

    /// Mathematics for LaTeX.
    pub fn latex(&self) -> String {
        match (self.exponent, self.mantissa.as_str()) {
            (_, "undefined") => "undefined".into(),
            (_, "infinite") => "$\\infty$".into(),
            (_, "-infinite") => "$-\\infty$".into(),
            (Some(exponent), mantissa) => format!("${mantissa}\\cdot 10^{{{exponent}}}$"),
            (None, mantissa) => format!("${mantissa}$"),
        }
    }
}

/// All digits of a number that a person wrote, as short as they can be: `0.05`, `1e8`.
pub fn written(value: f64) -> String {
    if value != 0.0 && !(1e-4..1e6).contains(&value.abs()) {
        format!("{value:e}")
    } else {
        format!("{value}")
    }
}

/// An exponent in raised digits.
pub fn superscript(exponent: i32) -> String {
    exponent
        .to_string()
        .chars()
        .map(|digit| match digit {
            '-' => '\u{207b}',
            '1' => '\u{b9}',
            '2' => '\u{b2}',
            '3' => '\u{b3}',
            other => char::from_u32(0x2070 + other as u32 - '0' as u32).unwrap_or(other),
        })
        .collect()
}

/// Bytes in binary units: `812 MiB`.
pub fn bytes(count: u64) -> String {
    let mut value = count as f64;
    let mut unit = "B";
    for next in ["KiB", "MiB", "GiB", "TiB"] {
        if value < 1024.0 {
            break;
        }
        value /= 1024.0;
        unit = next;
    }
    format!("{} {unit}", round(value, 3).unicode())
}

/// A moment as `2026-11-22 03:05 UTC`; empty when it was not recorded.
pub fn moment(seconds: i64) -> String {
    match jiff::Timestamp::from_second(seconds) {
        Ok(stamp) if seconds != 0 => stamp.strftime("%Y-%m-%d %H:%M UTC").to_string(),
        _ => String::new(),
    }
}

/// A moment as ISO 8601; empty when it was not recorded.
pub fn iso_moment(seconds: i64) -> String {
    match jiff::Timestamp::from_second(seconds) {
        Ok(stamp) if seconds != 0 => stamp.strftime("%Y-%m-%dT%H:%M:%SZ").to_string(),
        _ => String::new(),
    }
}
