//! Colours of values: a map from dark blue to yellow that keeps its order in grey and for every kind of colour vision.

/// Samples of the map at equal steps, red green blue (viridis, a work in the public domain).
pub const MAP: [[u8; 3]; 9] = [
    [68, 1, 84],
    [71, 45, 123],
    [59, 82, 139],
    [44, 114, 142],
    [33, 145, 140],
    [40, 174, 128],
    [94, 201, 98],
    [173, 220, 48],
    [253, 231, 37],
];

/// Inverted cells.
pub const INVERTED: [u8; 3] = [214, 20, 40];

/// Cells whose value is undefined.
pub const UNDEFINED: [u8; 3] = [150, 150, 150];

/// Values at both ends of the map. Those beyond take the colours of the ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    pub low: f64,
    pub high: f64,
    /// The extremes of all values.
    pub least: f64,
    pub most: f64,
    pub logarithmic: bool,
}

impl Scale {
    /// A scale from the 1st to the 99th percentile; logarithmic where all values are positive and these span a factor
    /// of 3.
    pub fn of(values: impl Iterator<Item = f64>) -> Scale {
        let mut sorted: Vec<f64> = values.filter(|value| value.is_finite()).collect();
        sorted.sort_by(f64::total_cmp);
        let (Some(first), Some(last)) = (sorted.first(), sorted.last()) else {
            return Scale {
                low: 0.0,
                high: 1.0,
                least: 0.0,
                most: 1.0,
                logarithmic: false,
            };
        };
        let at = |share: f64| sorted[((sorted.len() - 1) as f64 * share).round() as usize];
        let (mut low, mut high) = (at(0.01), at(0.99));
        if low == high {
            (low, high) = (*first, *last);
        }
        if low == high {
            high = low + if low == 0.0 { 1.0 } else { 0.1 * low.abs() };
        }
        Scale {
            low,
            high,
            least: *first,
            most: *last,
            logarithmic: *first > 0.0 && high > 3.0 * low,
        }
    }

    /// Place on the map between 0 and 1; not-a-number for undefined values.
    pub fn position(&self, value: f64) -> f64 {
        let position = if self.logarithmic {
            (value / self.low).ln() / (self.high / self.low).ln()
        } else {
            (value - self.low) / (self.high - self.low)
        };
        position.clamp(0.0, 1.0)
    }

    /// The colour of a value.
    pub fn colour(&self, value: f64) -> [u8; 3] {
        let position = self.position(value);
        if position.is_nan() {
            return UNDEFINED;
        }
        let along = position * (MAP.len() - 1) as f64;
        let index = (along as usize).min(MAP.len() - 2);
        let share = along - index as f64;
        let mix = |from: u8, to: u8| (f64::from(from) + share * (f64::from(to) - f64::from(from))).round() as u8;
        let (from, to) = (MAP[index], MAP[index + 1]);
        [mix(from[0], to[0]), mix(from[1], to[1]), mix(from[2], to[2])]
    }
}
