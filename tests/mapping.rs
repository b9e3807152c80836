//! The energy of a map over a mesh: derivatives, affine maps, determinism, the largest valid step, bad input.

use crate::energies::Random;
use crate::sample::with_threads;
use nalgebra::{Matrix3, SMatrix, SymmetricEigen, Vector3};
use vargeo::energy::lim_barrier::LimBarrier;
use vargeo::energy::mapping::{BLOCK_NUMBERS, BLOCK_PAIRS, Density, InvalidRest, MappingEnergy};
use vargeo::energy::target_weighted::TargetWeighted;
use vargeo::energy::untangling::Untangling;
use vargeo::energy::{energies, find};
use vargeo::linalg::processor::Processor;
use vargeo::mesh::TetrahedralMesh;
use vargeo::mesh::generate::lattice::kuhn;

/// A cube of n^3 cells, six tetrahedra each, with its inner vertices moved a little.
fn grid(n: usize) -> TetrahedralMesh {
    let mut random = Random(20);
    let mut mesh = kuhn(n);
    for point in &mut mesh.points {
        let inner = point.iter().all(|&c| c > 0.0 && c < 1.0);
        let shift = if inner { 0.1 / n as f64 } else { 0.0 };
        *point = point.map(|c| c + shift * random.number());
    }
    mesh
}

fn determinant(mesh: &TetrahedralMesh, cell: usize, positions: &[f64]) -> f64 {
    let at = |a: usize| Vector3::from_column_slice(&positions[3 * mesh.cells[cell][a] as usize..][..3]);
    Matrix3::from_columns(&[at(1) - at(0), at(2) - at(0), at(3) - at(0)]).determinant()
}

fn volume_weights(mesh: &TetrahedralMesh) -> Vec<f64> {
    let positions = mesh.points.concat();
    let volumes: Vec<f64> = (0..mesh.cells.len())
        .map(|cell| determinant(mesh, cell, &positions))
        .collect();
    let total: f64 = volumes.iter().sum();
    volumes.iter().map(|volume| volume / total).collect()
}

/// Positions near the rest shape under an affine map, all tetrahedra positive.
fn bent(mesh: &TetrahedralMesh, amount: f64) -> Vec<f64> {
    let mut random = Random(21);
    let affine = Matrix3::new(1.2, 0.3, 0.0, -0.1, 0.8, 0.2, 0.1, 0.0, 1.1);
    mesh.points
        .iter()
        .flat_map(|&point| {
            let noise = Vector3::from_fn(|_, _| amount * random.number());
            let moved: [f64; 3] = (affine * Vector3::from(point) + noise).into();
            moved
        })
        .collect()
}

fn direction(length: usize) -> Vec<f64> {
    let mut random = Random(22);
    (0..length).map(|_| random.number()).collect()
}

fn moved(positions: &[f64], t: f64, direction: &[f64]) -> Vec<f64> {
    positions.iter().zip(direction).map(|(x, d)| x + t * d).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The product of the matrix of blocks with a vector.
fn multiply(mesh: &TetrahedralMesh, blocks: &[f64], x: &[f64]) -> Vec<f64> {
    let mut y = vec![0.0; x.len()];
    for (cell, blocks) in mesh.cells.iter().zip(blocks.chunks_exact(BLOCK_NUMBERS)) {
        for (&(a, b), block) in BLOCK_PAIRS.iter().zip(blocks.chunks_exact(9)) {
            let (p, q) = (3 * cell[a] as usize, 3 * cell[b] as usize);
            for i in 0..3 {
                for j in 0..3 {
                    y[p + i] += block[3 * i + j] * x[q + j];
                    if a != b {
                        y[q + j] += block[3 * i + j] * x[p + i];
                    }
                }
            }
        }
    }
    y
}

/// Every energy alone and with a barrier, and the untangling density.
fn densities() -> Vec<Density> {
    let barrier = LimBarrier::new(1.3);
    let mut all: Vec<Density> = energies().iter().map(|&energy| Density::new(energy)).collect();
    all.extend(
        energies()
            .iter()
            .map(|&energy| Density::new(energy).with_barrier(0.05, barrier)),
    );
    all.push(Density::of(Untangling {
        epsilon: 0.2,
        lambda: 1.0,
    }));
    all.extend(energies().iter().map(|&energy| Density::of(TargetWeighted(energy))));
    all
}

fn evaluate(energy: &MappingEnergy, positions: &[f64]) -> (f64, Vec<f64>, Vec<f64>) {
    let mut gradient = vec![0.0; positions.len()];
    let mut blocks = vec![0.0; BLOCK_NUMBERS * energy.cells()];
    let value = energy.hessian(positions, &mut gradient, &mut blocks);
    (value, gradient, blocks)
}

#[test]
fn derivatives_have_their_orders() {
    let mesh = grid(3);
    let positions = bent(&mesh, 0.02);
    let along = direction(positions.len());
    for density in densities() {
        let name = format!("{density:?}");
        let mut energy = MappingEnergy::new(&mesh, &volume_weights(&mesh), density, None).expect("a valid mesh");
        energy.set_negative_part(1.0);
        let (value, gradient, blocks) = evaluate(&energy, &positions);
        let mut other = vec![0.0; positions.len()];
        assert_eq!(
            energy.gradient(&positions, &mut other).to_bits(),
            value.to_bits(),
            "{name}"
        );
        assert_eq!(energy.value(&positions).to_bits(), value.to_bits(), "{name}");
        assert_eq!(gradient, other, "{name}");
        let product = multiply(&mesh, &blocks, &along);
        let slope = dot(&gradient, &along);
        let mut remainders = [[0.0; 2]; 2];
        for (n, h) in [2e-4, 1e-4].into_iter().enumerate() {
            let step = moved(&positions, h, &along);
            let ahead = energy.gradient(&step, &mut other);
            remainders[0][n] = (ahead - value - h * slope - 0.5 * h * h * dot(&product, &along)).abs();
            let rest: Vec<f64> = (0..other.len())
                .map(|i| other[i] - gradient[i] - h * product[i])
                .collect();
            remainders[1][n] = dot(&rest, &rest).sqrt();
        }
        let order = |pair: [f64; 2]| {
            if pair[0] < 1e-12 {
                f64::INFINITY
            } else {
                (pair[0] / pair[1]).log2()
            }
        };
        let (third, second) = (order(remainders[0]), order(remainders[1]));
        assert!(third > 2.7, "{name}: value remainder {:?}", remainders[0]);
        assert!(second > 1.8, "{name}: gradient remainder {:?}", remainders[1]);
    }
}

/// The 12x12 matrix of a tetrahedron is the projection of its exact one: pulled back from a projected 9x9.
#[test]
fn projected_blocks_are_positive_and_agree_with_the_density() {
    let mesh = grid(2);
    let weights = volume_weights(&mesh);
    let positions = bent(&mesh, 0.08);
    for &density in energies() {
        let energy = MappingEnergy::new(&mesh, &weights, Density::new(density), None).expect("a valid mesh");
        let (_, _, blocks) = evaluate(&energy, &positions);
        for (cell, blocks) in blocks.chunks_exact(BLOCK_NUMBERS).enumerate() {
            let mut full = SMatrix::<f64, 12, 12>::zeros();
            for (&(a, b), block) in BLOCK_PAIRS.iter().zip(blocks.chunks_exact(9)) {
                for i in 0..3 {
                    for j in 0..3 {
                        full[(3 * a + i, 3 * b + j)] = block[3 * i + j];
                        full[(3 * b + j, 3 * a + i)] = block[3 * i + j];
                        if a == b {
                            assert_eq!(block[3 * i + j].to_bits(), block[3 * j + i].to_bits());
                        }
                    }
                }
            }
            let corner =
                |a: usize, points: &[f64]| Vector3::from_column_slice(&points[3 * mesh.cells[cell][a] as usize..][..3]);
            let edges =
                |points: &[f64]| Matrix3::from_columns(&[1, 2, 3].map(|a| corner(a, points) - corner(0, points)));
            let inverse = edges(&mesh.points.concat())
                .try_inverse()
                .expect("a positive tetrahedron");
            let jacobian = edges(&positions) * inverse;
            let mut pull = SMatrix::<f64, 9, 12>::zeros();
            for a in 0..4 {
                for column in 0..3 {
                    let g = if a == 0 {
                        -inverse.column(column).sum()
                    } else {
                        inverse[(a - 1, column)]
                    };
                    for i in 0..3 {
                        pull[(3 * column + i, 3 * a + i)] = g;
                    }
                }
            }
            let expected = pull.transpose() * density.projected(&jacobian).hessian * pull * weights[cell];
            let scale = expected.norm();
            let error = (full - expected).norm();
            assert!(error <= 1e-12 * scale, "{}: {error} of {scale}", density.name());
            let least = SymmetricEigen::new(full).eigenvalues.min();
            assert!(
                least >= -1e-13 * scale,
                "{}: least eigenvalue {least} of {scale}",
                density.name()
            );
        }
    }
}

/// Terms are summed before they are projected: less is cut off than from each alone.
#[test]
fn barrier_and_energy_are_projected_together() {
    let mesh = grid(2);
    let positions = bent(&mesh, 0.08);
    let weights = volume_weights(&mesh);
    let trace = |density: Density, negative: f64| {
        let mut energy = MappingEnergy::new(&mesh, &weights, density, None).expect("a valid mesh");
        energy.set_negative_part(negative);
        let (_, _, blocks) = evaluate(&energy, &positions);
        let diagonal = |block: &[f64]| block[0] + block[4] + block[8];
        blocks
            .chunks_exact(BLOCK_NUMBERS)
            .map(|b| [0, 36, 63, 81].iter().map(|&at| diagonal(&b[at..])).sum::<f64>())
            .sum::<f64>()
    };
    let barrier = LimBarrier::new(3.0);
    let lpm = find("lpm").expect("in the list");
    let together = trace(Density::new(lpm).with_barrier(0.5, barrier), 0.0);
    let exact = trace(Density::new(lpm).with_barrier(0.5, barrier), 1.0);
    let mut alone =
        MappingEnergy::new(&mesh, &vec![0.0; weights.len()], Density::new(lpm), None).expect("a valid mesh");
    alone.set_density(Density::new(lpm).with_barrier(0.5, barrier));
    let (_, _, blocks) = evaluate(&alone, &positions);
    let diagonal = |block: &[f64]| block[0] + block[4] + block[8];
    let barrier_alone: f64 = blocks
        .chunks_exact(BLOCK_NUMBERS)
        .map(|b| [0, 36, 63, 81].iter().map(|&at| diagonal(&b[at..])).sum::<f64>())
        .sum();
    let apart = trace(Density::new(lpm), 0.0) + barrier_alone;
    assert!(
        exact < together && together < 0.999 * apart,
        "{exact} < {together} < {apart}"
    );
}

/// With affine data on the boundary and volume weights an affine map is critical.
#[test]
fn patch_test() {
    let n = 3;
    let mesh = grid(n);
    let inner = |point: &[f64; 3]| point.iter().all(|&x| x > 1e-9 && x < 1.0 - 1e-9);
    let positions = bent(&mesh, 0.0);
    let most = |energy: &MappingEnergy| {
        let mut gradient = vec![0.0; positions.len()];
        energy.gradient(&positions, &mut gradient);
        let vertices = mesh
            .points
            .iter()
            .zip(gradient.chunks_exact(3))
            .filter(|(point, _)| inner(point));
        vertices
            .flat_map(|(_, g)| g.to_vec())
            .fold(0.0_f64, |most, g| most.max(g.abs()))
    };
    for &density in energies() {
        let mut energy =
            MappingEnergy::new(&mesh, &volume_weights(&mesh), Density::new(density), None).expect("a valid mesh");
        let weighted = most(&energy);
        assert!(
            weighted < 2e-15 * (1.0 + energy.value(&positions)),
            "{}: {weighted:e}",
            density.name()
        );
        energy
            .set_weights(&vec![1.0 / mesh.cells.len() as f64; mesh.cells.len()])
            .expect("as many as cells");
        assert!(
            most(&energy) > 1e-3,
            "{}: uniform weights should fail the patch test",
            density.name()
        );
    }
}

#[test]
fn same_bits_with_any_number_of_threads_and_in_every_instruction_set() {
    let mesh = grid(8);
    let weights = volume_weights(&mesh);
    let positions = bent(&mesh, 0.01);
    let along = direction(positions.len());
    for density in [
        Density::new(find("symmetric-dirichlet").expect("in the list")),
        Density::new(find("amips").expect("in the list")),
        Density::new(find("arap").expect("in the list")).with_barrier(0.01, LimBarrier::new(1.5)),
        Density::of(Untangling {
            epsilon: 0.1,
            lambda: 1.0,
        }),
    ] {
        let mut energy = MappingEnergy::new(&mesh, &weights, density, None).expect("a valid mesh");
        let mut bits: Option<Vec<u64>> = None;
        for processor in Processor::available() {
            energy.set_processor(processor);
            for threads in [1, 2, 4] {
                let numbers = with_threads(threads, || {
                    let (value, mut gradient, mut blocks) = evaluate(&energy, &positions);
                    assert!(value.is_finite());
                    gradient.append(&mut blocks);
                    gradient.extend([value, energy.value(&positions), energy.max_step(&positions, &along)]);
                    gradient
                });
                let now = numbers.iter().map(|number| number.to_bits()).collect();
                let first = bits.get_or_insert_with(|| Vec::clone(&now));
                assert!(
                    *first == now,
                    "{:?} with {threads} threads on {processor:?}",
                    energy.density()
                );
            }
        }
    }
}

/// Against the smallest root found by stepping finely and bisecting.
#[test]
fn max_step_is_the_first_flat_tetrahedron() {
    let mesh = grid(2);
    let positions = bent(&mesh, 0.02);
    let energy = MappingEnergy::new(
        &mesh,
        &volume_weights(&mesh),
        Density::new(find("stretch").expect("in the list")),
        None,
    )
    .expect("a valid mesh");
    let mut random = Random(23);
    for _ in 0..20 {
        let along: Vec<f64> = (0..positions.len()).map(|_| random.number()).collect();
        let least = |t: f64| {
            let now = moved(&positions, t, &along);
            (0..mesh.cells.len())
                .map(|cell| determinant(&mesh, cell, &now))
                .fold(f64::INFINITY, f64::min)
        };
        let step = 1e-4;
        let last = (1..)
            .map(|n| n as f64 * step)
            .find(|&t| least(t) <= 0.0)
            .expect("random motion flips something");
        let (mut low, mut high) = (last - step, last);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if least(middle) > 0.0 {
                low = middle
            } else {
                high = middle
            }
        }
        let ours = energy.max_step(&positions, &along);
        assert!((ours - low).abs() < 1e-12 * low.max(1e-3), "{ours} for {low}");
        assert!(energy.value(&moved(&positions, 0.999 * ours, &along)).is_finite());
        assert_eq!(energy.value(&moved(&positions, 1.001 * ours, &along)), f64::INFINITY);
    }
    let outward = positions.clone();
    assert_eq!(
        energy.max_step(&positions, &outward),
        f64::INFINITY,
        "growing flips nothing"
    );
    let inward: Vec<f64> = positions.iter().map(|x| -x).collect();
    assert!(
        (energy.max_step(&positions, &inward) - 1.0).abs() < 1e-5,
        "shrinking is a triple root at 1"
    );
    assert_eq!(energy.max_step(&positions, &vec![0.0; positions.len()]), f64::INFINITY);
    assert_eq!(energy.max_step(&positions, &vec![f64::NAN; positions.len()]), 0.0);
}

#[test]
fn infinite_outside_the_domain() {
    let mesh = grid(2);
    let mut positions = bent(&mesh, 0.0);
    let middle = mesh
        .points
        .iter()
        .position(|p| p.iter().all(|&x| x > 0.2 && x < 0.8))
        .expect("an inner vertex");
    positions[3 * middle] += 2.0;
    for density in densities() {
        let barrier = density.is_barrier();
        let name = format!("{density:?}");
        let energy = MappingEnergy::new(&mesh, &volume_weights(&mesh), density, None).expect("a valid mesh");
        let mut gradient = vec![0.0; positions.len()];
        let values = [
            energy.value(&positions),
            energy.gradient(&positions, &mut gradient),
            evaluate(&energy, &positions).0,
        ];
        for value in values {
            assert_eq!(value == f64::INFINITY, barrier, "{name}: {value}");
            assert!(!value.is_nan());
        }
    }
}

#[test]
fn determinants_singular_values_and_rest_scale() {
    let mesh = grid(2);
    let positions = bent(&mesh, 0.05);
    let weights = volume_weights(&mesh);
    let density = || Density::new(find("symmetric-dirichlet").expect("in the list"));
    let energy = MappingEnergy::new(&mesh, &weights, density(), None).expect("a valid mesh");
    let cells = mesh.cells.len();
    let (mut d, mut s) = (vec![0.0; cells], vec![0.0; 3 * cells]);
    energy.determinants(&positions, &mut d);
    energy.singular_values(&positions, &mut s);
    let rest = mesh.points.concat();
    for cell in 0..cells {
        let ratio = determinant(&mesh, cell, &positions) / determinant(&mesh, cell, &rest);
        assert!((d[cell] - ratio).abs() < 1e-13 && (s[3 * cell..][..3].iter().product::<f64>() - ratio).abs() < 1e-13);
    }
    let mean: f64 = d.iter().zip(&weights).map(|(d, w)| d * w).sum();
    let doubled = MappingEnergy::new(&mesh, &weights, density(), Some(&vec![2.0; cells])).expect("a valid mesh");
    let mut smaller = vec![0.0; cells];
    doubled.determinants(&positions, &mut smaller);
    let other: f64 = smaller.iter().zip(&weights).map(|(d, w)| d * w).sum();
    assert!((other - mean / 8.0).abs() < 1e-14);
}

#[test]
fn bad_input_is_named() {
    let good = grid(1);
    let weights = volume_weights(&good);
    let density = || Density::new(find("dirichlet").expect("in the list"));
    let error = |mesh: &TetrahedralMesh, weights: &[f64], scale: Option<&[f64]>| {
        MappingEnergy::new(mesh, weights, density(), scale)
            .err()
            .expect("an error")
    };
    assert_eq!(error(&TetrahedralMesh::default(), &[], None), InvalidRest::Empty);
    let mut reversed = good.clone();
    reversed.cells[3].swap(0, 1);
    assert!(matches!(error(&reversed, &weights, None), InvalidRest::Volume { cell: 3, volume } if volume < 0.0));
    let mut outside = good.clone();
    outside.cells[2][1] = 99;
    assert_eq!(
        error(&outside, &weights, None).to_string(),
        "tetrahedron 2 names vertex 99, but the mesh has 8 vertices"
    );
    let mut lost = good.clone();
    lost.points[0][0] = f64::NAN;
    assert!(matches!(error(&lost, &weights, None), InvalidRest::Volume { .. }));
    assert!(matches!(
        error(&good, &weights[1..], None),
        InvalidRest::Count {
            given: 5,
            needed: 6,
            ..
        }
    ));
    assert!(matches!(
        error(&good, &[-1.0; 6], None),
        InvalidRest::Number { cell: 0, .. }
    ));
    assert!(matches!(
        error(&good, &weights, Some(&[0.0; 6])),
        InvalidRest::Number { cell: 0, .. }
    ));
}
