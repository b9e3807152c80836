//! A factorized system, one-field or mixed, that turns conditions into solutions.

use super::factorization::{Accuracy, Factorization, singular};
use super::mixed_system::{self, Numbering};
use super::one_field::{self, OneField};
use super::scheme::Discretization;
use super::settings::Solver;
use super::signed_system::SignedSystem;
use crate::method::Failure;
use crate::optimize::Observer;

/// A larger backward error is taken as a breakdown of a factorization.
const BROKEN: f64 = 1e-9;

/// A system ready for right-hand sides.
pub struct System {
    form: Form,
    factorization: Factorization,
    pub factorizations: u64,
    /// Factorizations that broke down, by name, with the vertex where one is known.
    pub broken: Vec<String>,
    /// The factorization that answers a breakdown.
    next: Option<Solver>,
}

enum Form {
    OneField,
    Mixed(Numbering),
}

/// The field `u` at every vertex, and how good the solution of the system is.
pub struct Solution {
    pub values: Vec<f64>,
    pub accuracy: Accuracy,
}

impl System {
    /// Assembles and factorizes.
    ///
    /// # Errors
    /// When the matrix is singular, or memory runs out.
    pub fn new(
        discretization: &Discretization<'_>,
        one_field: bool,
        solver: Solver,
        observer: &mut dyn Observer,
    ) -> Result<Self, Failure> {
        if one_field {
            let system = OneField::new(discretization, observer);
            let free: Vec<u32> = (0..discretization.unknown[0].len() as u32)
                .filter(|&vertex| discretization.unknown[0][vertex as usize])
                .collect();
            observer.phase("factorize");
            return Ok(Self {
                form: Form::OneField,
                factorization: Factorization::cholesky(system, &free)?,
                factorizations: 1,
                broken: Vec::new(),
                next: None,
            });
        }
        let mut broken = Vec::new();
        if matches!(solver, Solver::Auto | Solver::Ldlt) {
            observer.phase("order");
            let (system, numbering) = SignedSystem::new(discretization);
            observer.phase("factorize");
            let place = match Factorization::ldlt(system) {
                Ok(factorization) => {
                    return Ok(Self {
                        form: Form::Mixed(numbering),
                        factorization,
                        factorizations: 1,
                        broken,
                        next: (solver == Solver::Auto).then_some(Solver::Lblt),
                    });
                }
                Err(place) => place,
            };
            let vertex = numbering.vertex(place);
            if solver == Solver::Ldlt {
                return Err(singular(format!(
                    "a pivot at vertex {vertex} (counted from 0) has not the sign that it should have; use solver = \
                     \"lblt\" or \"auto\""
                )));
            }
            broken.push(format!("ldlt at vertex {vertex} (counted from 0)"));
        }
        let pivoted = if solver == Solver::Auto { Solver::Lblt } else { solver };
        let (form, factorization) = pivoting(discretization, pivoted, observer)?;
        Ok(Self {
            form,
            factorization,
            factorizations: 1 + broken.len() as u64,
            broken,
            next: (solver == Solver::Auto).then_some(Solver::Lu),
        })
    }

    /// Solves for the right-hand side of a discretization with the same unknowns.
    ///
    /// # Errors
    /// When the system turns out to be singular in floating-point arithmetic.
    pub fn solve(
        &mut self,
        discretization: &Discretization<'_>,
        observer: &mut dyn Observer,
    ) -> Result<Solution, Failure> {
        observer.phase("solve");
        let mut x = self.right_side(discretization);
        let mut accuracy = self.factorization.solve(&mut x, discretization.components)?;
        while let Some(next) = self.next.take_if(|_| !(accuracy.backward < BROKEN)) {
            self.broken.push(self.solver().to_string());
            (self.form, self.factorization) = pivoting(discretization, next, observer)?;
            self.factorizations += 1;
            self.next = (next == Solver::Lblt).then_some(Solver::Lu);
            observer.phase("solve");
            x = self.right_side(discretization);
            accuracy = self.factorization.solve(&mut x, discretization.components)?;
        }
        if !(accuracy.backward < BROKEN) {
            return Err(broken(accuracy.backward));
        }
        let values = match &self.form {
            Form::OneField => one_field::field(discretization, &x),
            Form::Mixed(numbering) => numbering.field(discretization, &x, 0),
        };
        Ok(Solution { values, accuracy })
    }

    fn right_side(&self, discretization: &Discretization<'_>) -> Vec<f64> {
        match &self.form {
            Form::OneField => one_field::right_side(discretization),
            Form::Mixed(numbering) => mixed_system::right_side(discretization, numbering),
        }
    }

    /// `cholesky`, `ldlt`, `lblt` or `lu`.
    pub fn solver(&self) -> &'static str {
        self.factorization.name()
    }

    pub fn unknowns(&self) -> usize {
        match &self.form {
            Form::OneField => self.factorization.dimension(),
            Form::Mixed(numbering) => numbering.unknown_count(),
        }
    }

    pub fn matrix_entries(&self) -> usize {
        self.factorization.matrix_entries()
    }

    /// `None` where the factorization does not tell.
    pub fn factor_entries(&self) -> Option<usize> {
        self.factorization.factor_entries()
    }
}

/// Assembles the mixed system and factorizes it with pivoting, by `lu` if the solver is that, else by `lblt`.
fn pivoting(
    discretization: &Discretization<'_>,
    solver: Solver,
    observer: &mut dyn Observer,
) -> Result<(Form, Factorization), Failure> {
    observer.phase("order");
    let numbering = Numbering::new(discretization);
    observer.phase("assemble");
    let matrix = mixed_system::matrix(discretization, &numbering);
    let factorization = if solver == Solver::Lu {
        observer.phase("factorize");
        Factorization::lu(matrix)?
    } else {
        observer.phase("analyse");
        Factorization::lblt(matrix, || observer.phase("factorize"))?
    };
    Ok((Form::Mixed(numbering), factorization))
}

fn broken(residual: f64) -> Failure {
    Failure {
        kind: "singular".to_string(),
        reason: format!(
            "the system is singular or nearly so: its solution leaves the backward error {residual:.1e}; with \
             condition = \"curve\" use curve = \"stabilised\", and look for very thin triangles"
        ),
    }
}

/// The nullity of the mixed matrix, for up to 600 unknowns.
pub fn mixed_nullity(discretization: &Discretization<'_>) -> Option<usize> {
    let numbering = Numbering::new(discretization);
    // The singular values of a large matrix take too long.
    (numbering.count <= 600)
        .then(|| mixed_system::matrix(discretization, &numbering).nullity())
        .flatten()
}
