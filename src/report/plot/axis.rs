//! Axes: their range, ticks and labels.

use crate::report::number::{round, superscript};

/// How values become positions.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Kind {
    Linear,
    Logarithmic,
    /// Named values at positions 0, 1, ...
    Category(Vec<String>),
}

/// One axis.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Name and unit.
    pub label: String,
    pub kind: Kind,
    /// Values at both ends.
    pub low: f64,
    pub high: f64,
    pub ticks: Vec<Tick>,
}

/// A mark on an axis; without a label it is a short one.
#[derive(Clone, Debug, PartialEq)]
pub struct Tick {
    pub value: f64,
    pub label: Option<String>,
}

impl Axis {
    /// An axis that shows all these values with some room, or with none at its low end when `flush`.
    pub fn new(label: String, kind: Kind, values: impl Iterator<Item = f64>, flush: bool) -> Axis {
        let (mut low, mut high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        });
        if low > high {
            (low, high) = if kind == Kind::Logarithmic {
                (1.0, 10.0)
            } else {
                (0.0, 1.0)
            };
        }
        match &kind {
            Kind::Category(names) => {
                let ticks = names.iter().enumerate();
                Axis {
                    label,
                    low: -0.5,
                    high: names.len() as f64 - 0.5,
                    ticks: ticks.map(|(index, name)| tick(index as f64, name.clone())).collect(),
                    kind,
                }
            }
            Kind::Linear => {
                if low == high {
                    let room = if low == 0.0 { 1.0 } else { 0.1 * low.abs() };
                    (low, high) = (low - room, high + room);
                } else {
                    // A range that nearly reaches zero shows zero.
                    if low > 0.0 && low < 0.3 * high && !flush {
                        low = 0.0;
                    }
                    let room = 0.04 * (high - low);
                    high += room;
                    if !flush && low != 0.0 {
                        low -= room;
                    }
                }
                Axis {
                    label,
                    kind,
                    low,
                    high,
                    ticks: linear_ticks(low, high),
                }
            }
            Kind::Logarithmic => {
                let room = if low == high {
                    2f64.ln()
                } else {
                    0.05 * (high / low).ln()
                };
                low = (low.ln() - if flush { 0.0 } else { room }).exp();
                high = (high.ln() + room).exp();
                Axis {
                    label,
                    kind,
                    low,
                    high,
                    ticks: logarithmic_ticks(low, high),
                }
            }
        }
    }

    /// Position of a value between 0 and 1.
    pub fn position(&self, value: f64) -> f64 {
        match self.kind {
            Kind::Logarithmic => (value / self.low).ln() / (self.high / self.low).ln(),
            _ => (value - self.low) / (self.high - self.low),
        }
    }
}

fn tick(value: f64, label: String) -> Tick {
    Tick {
        value,
        label: Some(label),
    }
}

/// About six ticks at multiples of 1, 2 or 5 times a power of ten.
fn linear_ticks(low: f64, high: f64) -> Vec<Tick> {
    let raw = (high - low) / 6.0;
    let power = 10f64.powi(raw.log10().floor() as i32);
    let step = [1.0, 2.0, 5.0, 10.0]
        .map(|factor| factor * power)
        .into_iter()
        .find(|step| *step >= raw)
        .unwrap_or(raw);
    let largest = low.abs().max(high.abs());
    let decimals = (-step.log10().floor()).max(0.0) as usize;
    let first = (low / step - 1e-9).ceil() as i64;
    let last = (high / step + 1e-9).floor() as i64;
    (first..=last.min(first + 50))
        .map(|index| {
            let value = index as f64 * step;
            let label = if largest >= 1e6 || decimals > 5 {
                round(value, 4).unicode()
            } else {
                format!("{value:.decimals$}").replace('-', "\u{2212}")
            };
            tick(value, label)
        })
        .collect()
}

/// A labelled tick at each decade, or each few of many decades, short ones at 2 to 9 times; where the range has no two
/// decades, labels at 1, 2 and 5 times; where it has none of these either, ticks as on a linear axis.
fn logarithmic_ticks(low: f64, high: f64) -> Vec<Tick> {
    let (first, last) = (low.log10().floor() as i32, high.log10().ceil() as i32);
    let inside = |value: f64| value >= low * (1.0 - 1e-12) && value <= high * (1.0 + 1e-12);
    let power = |exponent: i32| 10f64.powi(exponent);
    let decades: Vec<i32> = (first..=last).filter(|&exponent| inside(power(exponent))).collect();
    if decades.len() >= 2 {
        let plain = decades.iter().all(|exponent| (-2..=3).contains(exponent));
        let every = decades.len().div_ceil(8) as i32;
        let mut ticks = Vec::new();
        for exponent in first..=last {
            let value = power(exponent);
            if inside(value) {
                let label = (exponent.rem_euclid(every) == 0).then(|| {
                    if plain {
                        round(value, 1).plain()
                    } else {
                        format!("10{}", superscript(exponent))
                    }
                });
                ticks.push(Tick { value, label });
            }
            if every == 1 && decades.len() <= 6 {
                ticks.extend(
                    (2..10)
                        .map(|factor| f64::from(factor) * value)
                        .filter(|value| inside(*value))
                        .map(|value| Tick { value, label: None }),
                );
            }
        }
        return ticks;
    }
    let mut ticks = Vec::new();
    for exponent in first..=last {
        for factor in 1..10 {
            let value = f64::from(factor) * power(exponent);
            if inside(value) {
                let label = matches!(factor, 1 | 2 | 5).then(|| round(value, 1).unicode());
                ticks.push(Tick { value, label });
            }
        }
    }
    if ticks.iter().filter(|tick| tick.label.is_some()).count() >= 2 {
        return ticks;
    }
    linear_ticks(low, high)
        .into_iter()
        .filter(|tick| tick.value > 0.0)
        .collect()
}
