//! The files of a fit for other programs: Lagrange cells for VTK and Gmsh, and the coefficients to the last bit.

use super::fit::Fit;
use crate::fem::coefficient_file;
use crate::fem::lagrange::{Lagrange, lagrange};
use crate::mesh::format::{gmsh, vtu};
use crate::method::Failure;
use std::collections::BTreeMap;

/// The files that can be written, for the setting.
pub static FILES: &[(&str, &str)] = &[
    (
        "lagrange",
        "`curved.vtu`: VTK's Lagrange cells of the elements' own order, with the fields of the picture",
    ),
    (
        "gmsh",
        "`curved.msh`: Gmsh's complete elements of the elements' own order; not written where one needs more than 9",
    ),
    (
        "coefficients",
        "`coefficients`: basis, orders and coefficients to the last bit; a template for further jobs",
    ),
];

/// Most nodes for which all files are written unasked.
const MOST_NODES: usize = 300_000;

impl Fit<'_> {
    /// The files wanted of a map given in the units of the target, with fields of a number a cell.
    pub(super) fn files(
        &mut self,
        x: &[f64],
        fields: &[(&str, Vec<f64>)],
    ) -> Result<BTreeMap<String, Vec<u8>>, Failure> {
        let mut wanted: Vec<&str> = match &self.settings.files {
            Some(names) => names.iter().map(String::as_str).collect(),
            None => FILES.iter().map(|file| file.0).collect(),
        };
        if self.settings.files.is_none() && self.space.nodes > MOST_NODES {
            wanted.retain(|name| *name == "coefficients");
            self.notices.push(format!(
                "more than {MOST_NODES} nodes: of the files only the coefficients are written; ask for others by `files`"
            ));
        }
        let mut files = BTreeMap::new();
        for name in wanted {
            match name {
                "lagrange" => {
                    let form = self.form(x, vtu::curved::HIGHEST_ORDER, "curved.vtu")?;
                    let views: Vec<(&str, usize, &[f64])> = fields
                        .iter()
                        .map(|(name, values)| (*name, 1, values.as_slice()))
                        .collect();
                    files.insert("curved.vtu".to_string(), vtu::curved::write_curved(&form.mesh, &views));
                }
                "gmsh" => {
                    let form = self.form(x, gmsh::curved::HIGHEST_ORDER, "curved.msh")?;
                    // Cut orders may turn valid elements inside out.
                    if form.cut > 0 {
                        continue;
                    }
                    let bytes = gmsh::curved::write_curved(&form.mesh).map_err(Failure::invalid)?;
                    files.insert("curved.msh".to_string(), bytes);
                }
                _ => {
                    let bytes = coefficient_file::write(&self.volume, &self.space, x);
                    files.insert(coefficient_file::EXTENSION.to_string(), bytes);
                }
            }
        }
        Ok(files)
    }

    fn form(&mut self, x: &[f64], highest: usize, file: &str) -> Result<Lagrange, Failure> {
        let form = lagrange(&self.volume, &self.space, &self.references, x, highest).map_err(Failure::invalid)?;
        if form.cut > 0 && file == "curved.msh" {
            self.notices.push(format!(
                "{file} is not written: {} elements need orders above the format's {highest}; the coefficient file is exact",
                form.cut
            ));
        } else if form.approximated > 0 {
            self.notices.push(format!(
                "{file}: {} elements are interpolated, since their functions are no polynomials{}: what is said of validity \
                 holds for the coefficient file, which is exact",
                form.approximated,
                if form.cut > 0 { ", some with too few points" } else { "" }
            ));
        }
        Ok(form)
    }
}
