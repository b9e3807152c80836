//! Every energy of the list: reference values, derivative orders, invariances, projections, domains.

use nalgebra::{Matrix3, Rotation3, SMatrix, SymmetricEigen, Vector3};
use serde_json::Value;
use vargeo::energy::hencky::Hencky;
use vargeo::energy::lim_barrier::LimBarrier;
use vargeo::energy::separable::BySingularValues;
use vargeo::energy::stretch::Stretch;
use vargeo::energy::target_weighted::TargetWeighted;
use vargeo::energy::untangling::Untangling;
use vargeo::energy::{Energy, Matrix9, Variables, energies, find};

static WIDE: Untangling = Untangling {
    epsilon: 1.0,
    lambda: 1.0,
};
static NARROW: Untangling = Untangling {
    epsilon: 0.05,
    lambda: 0.3,
};

/// The list, the untangling density with two sets of parameters, and two energies weighted by the image's volume.
fn all() -> Vec<&'static dyn Energy> {
    static STRETCH: TargetWeighted = TargetWeighted(&Stretch);
    static HENCKY: TargetWeighted = TargetWeighted(&BySingularValues(Hencky));
    let mut all = energies().to_vec();
    all.extend([&WIDE as &dyn Energy, &NARROW, &STRETCH, &HENCKY]);
    all
}

/// Numbers that look random (Steele et al. 2014, splitmix), uniform in [-1, 1].
pub(crate) struct Random(pub u64);

impl Random {
    pub(crate) fn number(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    pub(crate) fn matrix(&mut self) -> Matrix3<f64> {
        Matrix3::from_fn(|_, _| self.number())
    }

    pub(crate) fn rotation(&mut self) -> Matrix3<f64> {
        let axis = Vector3::from_fn(|_, _| self.number());
        Rotation3::new(axis.normalize() * 3.0 * self.number()).into_inner()
    }

    /// `U diag(s) V^T` with random rotations.
    fn with_singular_values(&mut self, s: [f64; 3]) -> Matrix3<f64> {
        self.rotation() * Matrix3::from_diagonal(&Vector3::from(s)) * self.rotation().transpose()
    }

    /// Singular values in [0.5, 2], so every energy is of moderate size.
    fn moderate(&mut self) -> Matrix3<f64> {
        let s = [(); 3].map(|()| 2.0_f64.powf(self.number()));
        self.with_singular_values(s)
    }
}

fn vector(matrix: &Matrix3<f64>) -> SMatrix<f64, 9, 1> {
    SMatrix::from_column_slice(matrix.as_slice())
}

fn matrix(rows: &Value) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| rows[i][j].as_f64().expect("a number"))
}

#[test]
fn reference_values() {
    let golden: Value = serde_json::from_str(include_str!("golden/energies.json")).expect("valid JSON");
    let mut compared = 0;
    for case in golden["cases"].as_array().expect("cases") {
        let jacobian = matrix(&case["jacobian"]);
        for (name, expected) in case["energies"].as_object().expect("energies") {
            let energy = find(name).unwrap_or_else(|| panic!("{name} is not in the list"));
            let close = |what: &str, ours: f64, theirs: f64, scale: f64| {
                assert!(
                    (ours - theirs).abs() <= 1e-9 * scale,
                    "{name} {what} at {jacobian}: {ours} for {theirs}"
                );
            };
            let value = expected["value"].as_f64().expect("a number");
            close("value", energy.value(&jacobian), value, 1.0 + value.abs());
            let (exact, projected) = (energy.derivatives(&jacobian), energy.projected(&jacobian));
            let stress = matrix(&expected["stress"]);
            for (ours, theirs) in exact.stress.iter().zip(&stress) {
                close("stress", *ours, *theirs, 1.0 + stress.norm());
            }
            if let Some(eigenvalues) = expected["eigenvalues"].as_array() {
                let mut ours = SymmetricEigen::new(exact.hessian).eigenvalues.as_slice().to_vec();
                ours.sort_by(f64::total_cmp);
                let scale = 1.0 + exact.hessian.norm();
                for (ours, theirs) in ours.iter().zip(eigenvalues) {
                    close("eigenvalue", *ours, theirs.as_f64().expect("a number"), scale);
                }
                let mut upper = expected["projected"].as_array().expect("a triangle").iter();
                for i in 0..9 {
                    for j in i..9 {
                        let theirs = upper.next().and_then(Value::as_f64).expect("45 numbers");
                        close("projected Hessian", projected.hessian[(i, j)], theirs, scale);
                        close("projected Hessian", projected.hessian[(j, i)], theirs, scale);
                    }
                }
            }
            compared += 1;
        }
    }
    assert_eq!(compared, 4 * 12 + 4);
}

/// The remainder of the Taylor polynomial of degree 2 is of order 3, and that of the stress's of degree 1 is of order 2.
#[test]
fn derivatives_have_their_orders() {
    let mut random = Random(1);
    for energy in all() {
        // Sums over Jacobians, because at a single one the leading term may happen to be small.
        let (mut value_errors, mut stress_errors, mut scale) = ([0.0; 2], [0.0; 2], 0.0);
        for _ in 0..40 {
            let (jacobian, direction) = (random.moderate(), random.matrix());
            let at = energy.derivatives(&jacobian);
            let (slope, second) = (at.stress.dot(&direction), at.hessian * vector(&direction));
            let curvature = vector(&direction).dot(&second);
            scale += 1.0 + at.value.abs() + at.stress.norm();
            for (n, h) in [4e-3, 2e-3].into_iter().enumerate() {
                let moved = energy.derivatives(&(jacobian + h * direction));
                value_errors[n] += (moved.value - at.value - h * slope - 0.5 * h * h * curvature).abs();
                stress_errors[n] += (vector(&(moved.stress - at.stress)) - h * second).norm();
            }
        }
        for (what, errors, expected) in [("value", value_errors, 3.0), ("stress", stress_errors, 2.0)] {
            let order = (errors[0] / errors[1]).log2();
            let exact = errors[0] < 1e-13 * scale;
            let name = energy.name();
            assert!(
                exact || (order - expected).abs() < 0.2,
                "{name}: {what} remainder of order {order}"
            );
            assert_eq!(
                exact,
                name == "dirichlet",
                "{name}: only a quadratic energy has no remainder"
            );
        }
    }
}

#[test]
fn isotropic() {
    let mut random = Random(2);
    for energy in all() {
        for _ in 0..50 {
            let jacobian = random.moderate();
            let turned = random.rotation() * jacobian * random.rotation();
            let (value, other) = (energy.value(&jacobian), energy.value(&turned));
            assert!(
                (value - other).abs() <= 1e-13 * (1.0 + value),
                "{}: {value} and {other}",
                energy.name()
            );
        }
    }
}

#[test]
fn identity_values_and_scale_exponents() {
    let e2 = 2.0_f64.exp();
    let expected = [
        ("dirichlet", 3.0, Some(2.0)),
        ("arap", 0.0, None),
        ("stretch", 3.0, Some(-2.0)),
        ("lscm", 0.0, Some(4.0)),
        ("lpm", 0.0, None),
        ("hencky", 0.0, None),
        ("symmetric-dirichlet", 6.0, None),
        ("condition-number", 1.0, Some(0.0)),
        ("condition-number-squared", 9.0, Some(0.0)),
        ("mips", 1.0, Some(0.0)),
        ("amips", e2, None),
        ("mean-ratio", 1.0, Some(0.0)),
    ];
    let names: Vec<&str> = energies().iter().map(|energy| energy.name()).collect();
    assert_eq!(names, expected.map(|(name, _, _)| name));
    let jacobian = Random(3).moderate();
    for (energy, (name, identity, exponent)) in energies().iter().zip(expected) {
        let value = energy.value(&Matrix3::identity());
        assert!(
            (value - identity).abs() < 1e-14 * (1.0 + identity),
            "{name} is {value} at the identity"
        );
        let stress = energy.derivatives(&Matrix3::identity()).stress.norm();
        let rests = energy.needs_rest_scale() || exponent == Some(0.0) || name == "lscm";
        assert_eq!(stress < 1e-13, rests, "{name} has stress {stress} at the identity");
        if let Some(exponent) = exponent {
            let measured = (energy.value(&(2.0 * jacobian)) / energy.value(&jacobian)).log2();
            assert!(
                (measured - exponent).abs() < 1e-12,
                "{name} scales with exponent {measured}"
            );
        }
    }
}

/// The analytic projection is the one by a numerical eigendecomposition of the 9x9 matrix.
#[test]
fn projection_filters_the_spectrum() {
    let mut random = Random(4);
    for energy in all() {
        for round in 0..30 {
            let mut jacobian = random.moderate();
            if !energy.is_barrier() && round % 2 == 1 {
                jacobian.column_mut(0).neg_mut();
            }
            let exact = energy.derivatives(&jacobian);
            let asymmetry = (exact.hessian - exact.hessian.transpose()).norm();
            let scale = exact.hessian.norm();
            assert!(asymmetry <= 1e-13 * scale, "{}: asymmetry {asymmetry}", energy.name());
            let eigen = SymmetricEigen::new(exact.hessian);
            for negative in [0.0, -1.0, 0.25] {
                let filtered = energy.filtered(&jacobian, negative);
                assert_eq!((filtered.value, filtered.stress), (exact.value, exact.stress));
                let expected =
                    Matrix9::from_diagonal(&eigen.eigenvalues.map(|l| if l < 0.0 { negative * l } else { l }));
                let expected = eigen.eigenvectors * expected * eigen.eigenvectors.transpose();
                let error = (filtered.hessian - expected).norm();
                assert!(
                    error <= 1e-11 * scale,
                    "{}: projection error {error} of {scale}",
                    energy.name()
                );
            }
        }
    }
}

#[test]
fn repeated_singular_values() {
    let mut random = Random(5);
    let cases = [
        [1.0, 1.0, 1.0],
        [2.0, 2.0, 2.0],
        [1.3, 1.3, 0.7],
        [1.5, 1.5 + 1e-9, 0.4],
        [1.2, 0.6, 0.6 + 1e-12],
        [1.2, 0.6 + 1e-7, 0.6],
    ];
    for energy in all() {
        for s in cases {
            let jacobian = random.with_singular_values(s);
            let at = energy.derivatives(&jacobian);
            for n in 0..9 {
                let mut unit = SMatrix::<f64, 9, 1>::zeros();
                unit[n] = 1.0;
                let step = Matrix3::from_column_slice(unit.as_slice());
                let stress = |h: f64| vector(&energy.derivatives(&(jacobian + h * step)).stress);
                let h = 1e-3;
                // Central differences of order 4.
                let difference = (8.0 * (stress(h) - stress(-h)) - (stress(2.0 * h) - stress(-2.0 * h))) / (12.0 * h);
                let error = (difference - at.hessian * unit).norm();
                let scale = at.hessian.norm().max(1.0);
                assert!(error <= 2e-7 * scale, "{} at {s:?}: {error} of {scale}", energy.name());
            }
        }
    }
}

/// Opposite singular values give ARAP a twist of eigenvalue minus infinity: kept finite, and gone after projection.
#[test]
fn arap_between_reflections() {
    let energy = find("arap").expect("in the list");
    for s in [[1.0, 0.5, -0.5], [0.3, 0.3, -0.3], [0.0, 0.0, 0.0]] {
        let projected = energy.projected(&Random(6).with_singular_values(s));
        let least = SymmetricEigen::new(projected.hessian).eigenvalues.min();
        assert!(
            projected.value.is_finite() && least >= -1e-13,
            "at {s:?}: least eigenvalue {least}"
        );
    }
}

#[test]
fn barriers_are_infinite_unless_the_determinant_is_positive() {
    let flat = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 0.0));
    let reflected = Matrix3::from_diagonal(&Vector3::new(1.0, 0.8, -0.3));
    for energy in all() {
        for jacobian in [flat, reflected] {
            let derivatives = energy.derivatives(&jacobian);
            assert_eq!(derivatives.value, energy.value(&jacobian));
            if energy.is_barrier() {
                assert_eq!(derivatives.value, f64::INFINITY, "{}", energy.name());
                assert!(derivatives.stress.iter().all(|entry| entry.is_nan()));
            } else {
                assert!(derivatives.value.is_finite() && derivatives.hessian.iter().all(|entry| entry.is_finite()));
            }
        }
    }
    for energy in energies() {
        if energy.is_barrier() {
            let thin = |s: f64| energy.value(&Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, s)));
            assert!(
                thin(0.02) > thin(0.1) && thin(0.1) > thin(0.5),
                "{} does not rise",
                energy.name()
            );
        }
    }
}

#[test]
fn untangling_tends_to_its_limits() {
    let mut random = Random(7);
    for _ in 0..20 {
        let jacobian = random.moderate();
        let (a, d) = (jacobian.norm_squared(), jacobian.determinant());
        let limit = a / d.powf(2.0 / 3.0) + (d * d + 1.0) / d;
        let value = Untangling {
            epsilon: 1e-7,
            lambda: 1.0,
        }
        .value(&jacobian);
        assert!(
            (value - limit).abs() < 1e-12 * limit,
            "{value} does not tend to {limit}"
        );
        let chi = |d: f64, epsilon: f64| Untangling { epsilon, lambda: 1.0 }.chi(d);
        assert!((chi(-d, 0.1) * chi(d, 0.1) - 0.0025).abs() < 1e-16, "chi cancels");
        // Far on the wrong side chi is epsilon^2 / (4 |D|), which the textbook form rounds to 0.
        let far = chi(-1.0, 1e-9);
        assert!((far - 2.5e-19).abs() < 1e-33, "{far}");
    }
    let reflected = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, -1.0));
    let price = |epsilon: f64| Untangling { epsilon, lambda: 1.0 }.value(&reflected);
    assert!(price(0.01) > 10.0 * price(0.1) && price(0.1) > 10.0 * price(1.0));
}

#[test]
fn lim_barrier_is_smooth_up_to_its_width() {
    let barrier = LimBarrier {
        gamma: 0.7,
        epsilon: 0.1,
    };
    let (end, width) = (0.1, 0.63);
    assert_eq!(barrier.evaluate(end)[0], f64::INFINITY);
    assert_eq!(barrier.evaluate(-3.0)[0], f64::INFINITY);
    assert_eq!(barrier.evaluate(end + width + 1e-12), [0.0; 3]);
    let [value, slope, curvature] = barrier.evaluate(end + width * (1.0 - 1e-5));
    assert!(value < 1e-14 && slope.abs() < 1e-8 && curvature > 0.0 && curvature < 2e-4);
    // phi = 1 / g - 1 by the paper's polynomial.
    for t in [0.05, 0.3, 0.5, 0.9] {
        let x = end + width * t;
        let [value, slope, curvature] = barrier.evaluate(x);
        let expected = 1.0 / (t * t * t - 3.0 * t * t + 3.0 * t) - 1.0;
        assert!((value - expected).abs() < 1e-13 * (1.0 + expected));
        let h = 1e-4 * t;
        let (after, before) = (barrier.evaluate(x + h), barrier.evaluate(x - h));
        assert!(((after[0] - before[0]) / (2.0 * h) - slope).abs() < 1e-6 * slope.abs());
        assert!(((after[1] - before[1]) / (2.0 * h) - curvature).abs() < 1e-6 * curvature.abs());
    }
}

#[test]
fn descriptions_are_complete() {
    for energy in all() {
        let description = energy.description();
        assert!(!description.formula.is_empty() && !description.source.is_empty());
        let kebab = |c: char| c.is_ascii_lowercase() || c == '-';
        assert!(description.name.chars().all(kebab), "{}", description.name);
    }
    assert!(find("Dirichlet").is_none());
    assert_eq!(
        find("arap").map(|energy| energy.variables()),
        Some(Variables::SingularValues)
    );
}
