//! Validation and repair of meshes before use.
