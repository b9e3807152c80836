//! Models: what an experiment file may say of one, and what a method receives once its files are read.

use super::setting::Field;
use crate::mesh::{TetrahedralMesh, TriangleMesh};

/// A generator of meshes or targets: a name, its parameters, its meaning.
#[derive(Debug)]
pub struct Generator {
    pub name: &'static str,
    pub parameters: &'static [Field],
    pub doc: &'static str,
}

/// One named part of a model, such as `mesh` or `target`.
#[derive(Debug)]
pub struct Role {
    pub name: &'static str,
    pub required: bool,
    /// A path may be given: `mesh = "duck.mesh"`, or `{ file = "duck.txt", ...parameters }`.
    pub file: bool,
    /// Parameters that go with a file, such as `scale`.
    pub file_parameters: &'static [Field],
    /// The key that names a generator in a table: `{ generate = "ball", tetrahedra = 12_600 }`, `{ shape = "cube" }`.
    pub generator_key: &'static str,
    pub generators: &'static [Generator],
    pub doc: &'static str,
}

/// What `[models.NAME]` may hold for a method.
#[derive(Debug)]
pub struct ModelKind {
    pub roles: &'static [Role],
}

/// A role's content after its file was read or with its generator still to run.
#[derive(Debug, Clone, PartialEq)]
pub enum Part {
    /// A generator's name and its validated parameters, defaults filled.
    Generated {
        generator: String,
        parameters: serde_json::Value,
    },
    /// A file's bytes with the name to use in messages and its extension-derived or sniffed format.
    File {
        name: String,
        bytes: Vec<u8>,
        parameters: serde_json::Value,
    },
}

/// The parts of a model by role name.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LoadedModel {
    pub parts: std::collections::BTreeMap<String, Part>,
}

/// A surface or a volume, as read from a file of either kind.
#[derive(Debug, Clone, PartialEq)]
pub enum AnyMesh {
    Triangles(TriangleMesh),
    Tetrahedra(TetrahedralMesh),
}
