//! Elementary functions and small decompositions: accuracy, extreme input, the same bits in every instruction set.

use crate::energies::Random;
use nalgebra::{Matrix3, SymmetricEigen, Vector3};
use vargeo::energy::spectrum::{Slopes, Spectrum};
use vargeo::energy::{energies, from_columns, invariants, to_columns};
use vargeo::linalg::eigen3::symmetric_eigen;
use vargeo::linalg::elementary::{exp, ln, ln_divided_difference, powf};
use vargeo::linalg::jet::SYMMETRIC;
use vargeo::linalg::lanes::{Lanes, Vector, WIDTH, load, store};
use vargeo::linalg::processor::{Kernel, Processor};
use vargeo::linalg::svd3::signed_svd;

fn relative(ours: f64, theirs: f64) -> f64 {
    if ours == theirs {
        0.0
    } else {
        ((ours - theirs) / theirs).abs()
    }
}

#[test]
fn elementary_functions_are_accurate() {
    let mut random = Random(10);
    for _ in 0..100_000 {
        let x = 740.0 * random.number();
        if x.abs() < 708.0 {
            assert!(relative(exp(x), x.exp()) < 5e-16, "exp {x}: {} for {}", exp(x), x.exp());
        }
        let y = (700.0 * random.number()).exp();
        assert!(relative(ln(y), y.ln()) < 5e-16, "ln {y}: {} for {}", ln(y), y.ln());
        let near = 1.0 + 0.3 * random.number();
        assert!(
            relative(ln(near), near.ln()) < 5e-16,
            "ln {near}: {} for {}",
            ln(near),
            near.ln()
        );
        let z = (20.0 * random.number()).exp();
        assert!(relative(powf(z, -2.0 / 3.0), z.powf(-2.0 / 3.0)) < 5e-15);
        let other = z * (1.0 + 1e-3 * random.number());
        let exact = ((z - other) / other).ln_1p() / (z - other);
        assert!(relative(ln_divided_difference(z, other), exact) < 1e-11);
    }
    let largest = exp(-745.0);
    assert!(largest > 0.0 && largest < 1e-322);
    assert_eq!(
        [exp(0.0), exp(710.0), exp(-746.0), exp(f64::INFINITY)],
        [1.0, f64::INFINITY, 0.0, f64::INFINITY]
    );
    assert_eq!(
        [ln(1.0), ln(0.0), ln(f64::INFINITY)],
        [0.0, f64::NEG_INFINITY, f64::INFINITY]
    );
    assert!(relative(ln(1e-310), 1e-310_f64.ln()) < 1e-15);
    assert!(ln(-1.0).is_nan() && ln(f64::NAN).is_nan() && exp(f64::NAN).is_nan());
    assert_eq!(ln_divided_difference(2.0, 2.0), 0.5);
}

/// Matrices of every kind: random, graded, nearly and exactly singular, huge and tiny.
fn matrices() -> Vec<Matrix3<f64>> {
    let mut random = Random(11);
    let mut matrices = Vec::new();
    for _ in 0..200 {
        matrices.push(random.matrix());
        let s = [1.0, random.number().powi(9), random.number().powi(25)];
        matrices.push(random.rotation() * Matrix3::from_diagonal(&Vector3::from(s)) * random.rotation());
        let (a, b) = (random.matrix(), random.matrix());
        matrices.push(a.column(0) * b.column(0).transpose());
        matrices.push(a.column(0) * b.column(0).transpose() + a.column(1) * b.column(1).transpose());
        matrices.push(random.rotation() * 3.0);
    }
    let base = random.matrix();
    matrices.extend([
        Matrix3::zeros(),
        Matrix3::identity(),
        -Matrix3::identity(),
        Matrix3::from_diagonal(&Vector3::new(0.0, -2.0, 0.0)),
        base * 1e150,
        base * 1e-150,
    ]);
    matrices
}

#[test]
fn signed_singular_values() {
    for matrix in matrices() {
        let svd = signed_svd(&to_columns(&matrix));
        let (u, v, s) = (from_columns(&svd.u), from_columns(&svd.v), Vector3::from(svd.s));
        for rotation in [u, v] {
            assert!(
                (rotation.transpose() * rotation - Matrix3::identity()).norm() < 4e-15,
                "{matrix}{rotation}"
            );
            assert!(rotation.determinant() > 0.99);
        }
        let error = (u * Matrix3::from_diagonal(&s) * v.transpose() - matrix).norm();
        assert!(error <= 4e-15 * s[0], "{matrix}: error {error}");
        assert!(s[0] >= s[1] && s[1] >= s[2].abs(), "{s}");
        let determinant = matrix.determinant();
        if determinant.abs() > 1e-12 * s[0].powi(3) && determinant.is_finite() {
            assert_eq!(s[2] > 0.0, determinant > 0.0, "{matrix}");
        }
    }
    // The smallest of widely different singular values, where those of J^T J would be lost.
    let mut random = Random(12);
    for _ in 0..50 {
        let columns = random.rotation() * Matrix3::from_diagonal(&Vector3::new(1.0, 1e-6, 1e-13));
        let s = signed_svd(&to_columns(&columns)).s;
        assert!(relative(s[1], 1e-6) < 1e-14 && relative(s[2], 1e-13) < 1e-14, "{s:?}");
    }
}

#[test]
fn symmetric_eigenvalues() {
    for matrix in matrices() {
        let symmetric = matrix + matrix.transpose();
        let eigen = symmetric_eigen(&SYMMETRIC.map(|(i, j)| symmetric[(i, j)]));
        let vectors = from_columns(&eigen.vectors);
        assert!((vectors.transpose() * vectors - Matrix3::identity()).norm() < 4e-15);
        let rebuilt = vectors * Matrix3::from_diagonal(&Vector3::from(eigen.values)) * vectors.transpose();
        let scale = symmetric.amax();
        assert!((rebuilt - symmetric).amax() <= 4e-15 * scale, "{symmetric}");
        if (1e-100..1e100).contains(&scale) {
            let mut ours = eigen.values;
            let mut theirs = SymmetricEigen::new(symmetric).eigenvalues.as_slice().to_vec();
            ours.sort_by(f64::total_cmp);
            theirs.sort_by(f64::total_cmp);
            assert!(
                ours.iter().zip(&theirs).all(|(a, b)| (a - b).abs() <= 1e-14 * scale),
                "{symmetric}"
            );
        }
    }
}

/// All numbers of a decomposition, in lanes.
struct Decompose<'a> {
    matrix: [[Lanes; 3]; 3],
    out: &'a mut [[Lanes; 3]; 8],
}

impl Kernel for Decompose<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let matrix = [
            load::<V, 3>(&self.matrix[0]),
            load(&self.matrix[1]),
            load(&self.matrix[2]),
        ];
        let svd = signed_svd(&matrix);
        let [s, u, v] = [[svd.s; 3], svd.u, svd.v];
        let a = matrix;
        let eigen = symmetric_eigen(&[a[0][0], a[0][1], a[0][2], a[1][1], a[1][2], a[2][2]]);
        let all = [s[0], u[0], u[1], u[2], v[0], v[1], v[2], eigen.values];
        for (values, out) in all.into_iter().zip(self.out) {
            store(values, out);
        }
    }
}

fn same(a: f64, b: f64) -> bool {
    a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan())
}

/// Side by side or alone, in every instruction set: the same bits.
#[test]
fn lanes_agree_with_numbers() {
    let matrices = matrices();
    for processor in Processor::available() {
        for group in matrices.chunks_exact(WIDTH) {
            let mut packed = [[Lanes::ZERO; 3]; 3];
            for (lane, matrix) in group.iter().enumerate() {
                for (column, entries) in to_columns(matrix).iter().enumerate() {
                    for row in 0..3 {
                        packed[column][row].0[lane] = entries[row];
                    }
                }
            }
            let mut out = [[Lanes::ZERO; 3]; 8];
            processor.run(Decompose {
                matrix: packed,
                out: &mut out,
            });
            for (lane, matrix) in group.iter().enumerate() {
                let a = to_columns(matrix);
                let svd = signed_svd(&a);
                let eigen = symmetric_eigen(&[a[0][0], a[0][1], a[0][2], a[1][1], a[1][2], a[2][2]]);
                let expected = [
                    svd.s,
                    svd.u[0],
                    svd.u[1],
                    svd.u[2],
                    svd.v[0],
                    svd.v[1],
                    svd.v[2],
                    eigen.values,
                ];
                for (ours, lanes) in expected.iter().flatten().zip(out.iter().flatten()) {
                    assert!(
                        same(*ours, lanes.0[lane]),
                        "{processor:?}, {matrix}: {ours:e} alone, {:e}",
                        lanes.0[lane]
                    );
                }
            }
        }
    }
}

#[test]
fn energies_in_lanes_agree_with_numbers() {
    let mut random = Random(13);
    for processor in Processor::available() {
        for energy in energies() {
            let (mut s, mut i) = ([Lanes::ZERO; 3], [Lanes::ZERO; 3]);
            for lane in 0..WIDTH {
                let a = 3.0 * 2.0_f64.powf(random.number());
                let b = a * (0.6 + 0.4 * random.number());
                let c = b * (0.6 + 0.4 * random.number());
                let at = invariants(&[[a, 0.0, 0.0], [0.0, b, 0.0], [0.0, 0.0, c]]);
                for n in 0..3 {
                    s[n].0[lane] = [a, b, c][n];
                    i[n].0[lane] = at[n];
                }
            }
            let zero = Lanes::ZERO;
            let variables = match energy.variables() {
                vargeo::energy::Variables::Invariants => i,
                vargeo::energy::Variables::SingularValues => s,
            };
            let mut values = [zero];
            let mut slopes = [Slopes {
                value: zero,
                partials: [zero; 3],
            }];
            let mut spectra = [Spectrum {
                value: zero,
                partials: [zero; 3],
                scaling: [zero; 6],
                flip: [zero; 3],
                twist: [zero; 3],
            }];
            energy.values_in_lanes(processor, &[variables], &mut values);
            energy.slopes_in_lanes(processor, &[variables], &mut slopes);
            energy.spectra_in_lanes(processor, &[s], &[i], &mut spectra);
            for lane in 0..WIDTH {
                let one = energy.slopes(variables.map(|v| v.0[lane]));
                let all = energy.spectrum(s.map(|v| v.0[lane]), i.map(|v| v.0[lane]));
                let name = energy.name();
                let check = |what: &str, ours: f64, theirs: f64| {
                    assert!(
                        same(ours, theirs),
                        "{name}, {processor:?}, {what}: {ours:e} alone, {theirs:e}"
                    );
                };
                check("value", one.value, values[0].0[lane]);
                check("value", one.value, slopes[0].value.0[lane]);
                check("value", one.value, spectra[0].value.0[lane]);
                check("value", all.value, spectra[0].value.0[lane]);
                for n in 0..3 {
                    check("slope", one.partials[n], slopes[0].partials[n].0[lane]);
                    check("slope", all.partials[n], spectra[0].partials[n].0[lane]);
                    check("flip", all.flip[n], spectra[0].flip[n].0[lane]);
                    check("twist", all.twist[n], spectra[0].twist[n].0[lane]);
                }
                for n in 0..6 {
                    check("scaling", all.scaling[n], spectra[0].scaling[n].0[lane]);
                }
            }
        }
    }
}
