//! Models: what an experiment file may say of one, and what a method receives once its files are read.

use super::setting::{Default, Field, Kind};
use crate::mesh::generate::Parameter;

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
#[derive(Debug, Clone, std::default::Default, PartialEq)]
pub struct LoadedModel {
    pub parts: std::collections::BTreeMap<String, Part>,
}

/// A list that lives as long as the program, for declarations derived from the lists of generators and shapes.
pub fn keep<T>(list: Vec<T>) -> &'static [T] {
    Box::leak(list.into_boxed_slice())
}

/// A generator's parameters as fields.
pub fn fields(parameters: &'static [Parameter]) -> &'static [Field] {
    let field = |parameter: &'static Parameter| Field {
        name: parameter.name,
        kind: if parameter.whole {
            Kind::Integer {
                min: parameter.min as i64,
                max: parameter.max as i64,
            }
        } else {
            Kind::Number {
                min: parameter.min,
                max: parameter.max,
            }
        },
        default: if parameter.whole {
            Default::Integer(parameter.default as i64)
        } else {
            Default::Number(parameter.default)
        },
        doc: parameter.doc,
    };
    keep(parameters.iter().map(field).collect())
}
