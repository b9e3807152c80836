//! Functions of the plane whose derivatives of every order are known: solutions that a study compares with.
//!
//! A function is a sum of products `X(x) Y(y)`; `Laplacian^k (X Y) = sum_j binomial(k, j) X^(2j) Y^(2k-2j)`.

/// A function of one variable.
#[derive(Clone, Copy, Debug)]
enum Factor {
    /// `sin(frequency t + phase)`.
    Sine { frequency: f64, phase: f64 },
    /// `exp(rate t)`.
    Exponential { rate: f64 },
    /// `t^power`.
    Power(u32),
}

impl Factor {
    /// The derivative of the given order at `t`.
    fn derivative(self, order: u32, t: f64) -> f64 {
        match self {
            Self::Sine { frequency, phase } => {
                let quarter_turns = f64::from(order) * std::f64::consts::FRAC_PI_2;
                let angle = frequency * t + phase;
                // Shifted by whole quarters without rounding.
                let value = match order % 4 {
                    0 => angle.sin(),
                    1 => angle.cos(),
                    2 => -angle.sin(),
                    _ => -angle.cos(),
                };
                debug_assert!((value - (angle + quarter_turns).sin()).abs() < 1e-9);
                frequency.powi(order as i32) * value
            }
            Self::Exponential { rate } => rate.powi(order as i32) * (rate * t).exp(),
            Self::Power(power) if order > power => 0.0,
            Self::Power(power) => {
                let falling: f64 = (power - order + 1..=power).map(f64::from).product();
                falling * t.powi((power - order) as i32)
            }
        }
    }
}

/// A term `coefficient X(x) Y(y)`.
type Term = (f64, Factor, Factor);

/// A function to choose by name.
#[derive(Debug)]
pub struct Function {
    pub name: &'static str,
    pub formula: &'static str,
    terms: &'static [Term],
}

/// `cos(1.5 y - 0.2)` is a sine a quarter turn further.
const QUARTER: f64 = std::f64::consts::FRAC_PI_2;

/// Every function, in the order of the documentation.
pub static FUNCTIONS: &[Function] = &[
    Function {
        name: "waves-and-exponential",
        formula: "sin(2x + 0.3) cos(1.5y - 0.2) + exp(0.7x - 0.4y)",
        terms: &[
            (
                1.0,
                Factor::Sine {
                    frequency: 2.0,
                    phase: 0.3,
                },
                Factor::Sine {
                    frequency: 1.5,
                    phase: QUARTER - 0.2,
                },
            ),
            (
                1.0,
                Factor::Exponential { rate: 0.7 },
                Factor::Exponential { rate: -0.4 },
            ),
        ],
    },
    Function {
        name: "waves",
        formula: "sin(3x) sin(2y + 0.5)",
        terms: &[(
            1.0,
            Factor::Sine {
                frequency: 3.0,
                phase: 0.0,
            },
            Factor::Sine {
                frequency: 2.0,
                phase: 0.5,
            },
        )],
    },
    Function {
        name: "polynomial",
        formula: "x^4 y^3 + x^3 - 2x y^2 + x^6/10",
        terms: &[
            (1.0, Factor::Power(4), Factor::Power(3)),
            (1.0, Factor::Power(3), Factor::Power(0)),
            (-2.0, Factor::Power(1), Factor::Power(2)),
            (0.1, Factor::Power(6), Factor::Power(0)),
        ],
    },
    Function {
        name: "biharmonic-polynomial",
        formula: "x^3 + x^2 y - 3x y^2 + y^2",
        terms: &[
            (1.0, Factor::Power(3), Factor::Power(0)),
            (1.0, Factor::Power(2), Factor::Power(1)),
            (-3.0, Factor::Power(1), Factor::Power(2)),
            (1.0, Factor::Power(0), Factor::Power(2)),
        ],
    },
    Function {
        name: "linear",
        formula: "1 + 2x - 3y",
        terms: &[
            (1.0, Factor::Power(0), Factor::Power(0)),
            (2.0, Factor::Power(1), Factor::Power(0)),
            (-3.0, Factor::Power(0), Factor::Power(1)),
        ],
    },
];

/// The function of this name.
pub fn find(name: &str) -> Option<&'static Function> {
    FUNCTIONS.iter().find(|function| function.name == name)
}

impl Function {
    /// The partial derivative of orders `[along x, along y]`.
    pub fn derivative(&self, [x, y]: [f64; 2], orders: [u32; 2]) -> f64 {
        self.terms
            .iter()
            .map(|(coefficient, first, second)| {
                coefficient * first.derivative(orders[0], x) * second.derivative(orders[1], y)
            })
            .sum()
    }

    pub fn value(&self, point: [f64; 2]) -> f64 {
        self.derivative(point, [0, 0])
    }

    pub fn gradient(&self, point: [f64; 2]) -> [f64; 2] {
        [self.derivative(point, [1, 0]), self.derivative(point, [0, 1])]
    }

    /// Second derivatives `[xx, xy, yy]`.
    pub fn hessian(&self, point: [f64; 2]) -> [f64; 3] {
        [
            self.derivative(point, [2, 0]),
            self.derivative(point, [1, 1]),
            self.derivative(point, [0, 2]),
        ]
    }

    /// The Laplacian applied `times` times.
    pub fn laplacian(&self, point: [f64; 2], times: u32) -> f64 {
        let mut binomial = 1.0;
        let mut sum = 0.0;
        for j in 0..=times {
            sum += binomial * self.derivative(point, [2 * j, 2 * (times - j)]);
            binomial *= f64::from(times - j) / f64::from(j + 1);
        }
        sum
    }
}
