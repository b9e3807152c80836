//! The coefficient file: a map as its coefficients, which read back to the same bits.
//!
//! A header of text lines, `vargeo-coefficients 1`, then `basis NAME`, `vertices N`, `hexahedra N`, `prisms N`,
//! `tetrahedra N`, `nodes N`, `checksum HEX`, `data`, each ended by a line feed; then binary data, little-endian: the
//! corners of all cells as `u32` (eight, six or four a cell, as in VTK, in the order of the header), the order of
//! every cell as `u8`, and three `f64` a node, nodes numbered as in [`Space`]. The checksum is 64-bit FNV-1a over the
//! data.
//!
//! Guaranteed: sizes are compared with the bytes that are there before memory is taken; what reads is a conforming mesh
//! with orders in range and finite coefficients. Not guaranteed: that its cells are valid.

use super::basis::{self, Basis};
use super::space::{HIGHEST_ORDER, Space};
use crate::mesh::mixed::{MixedMesh, Shape};

/// What the file starts with.
const FIRST: &str = "vargeo-coefficients 1\n";

/// The usual end of a file's name.
pub const EXTENSION: &str = "coefficients";

/// A mesh with a map over it.
#[derive(Clone)]
pub struct Volume {
    /// Its points are the images of the vertices.
    pub mesh: MixedMesh,
    pub basis: &'static dyn Basis,
    /// Order of every cell.
    pub orders: Vec<usize>,
    /// Three numbers a node of the space over the mesh.
    pub x: Vec<f64>,
}

impl std::fmt::Debug for Volume {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter
            .debug_struct("Volume")
            .field("basis", &self.basis.name())
            .field("cells", &self.mesh.cells())
            .field("nodes", &(self.x.len() / 3))
            .finish()
    }
}

/// Whether the bytes start as a coefficient file does.
pub fn sniff(bytes: &[u8]) -> bool {
    bytes.starts_with(FIRST.trim_end().as_bytes())
}

/// 64-bit FNV-1a.
fn checksum(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// The file of a map.
pub fn write(mesh: &MixedMesh, space: &Space, x: &[f64]) -> Vec<u8> {
    assert_eq!(x.len(), 3 * space.nodes, "three numbers a node");
    let mut data = Vec::with_capacity(8 * x.len() + 40 * mesh.cells());
    for (_, corners) in mesh.iter() {
        data.extend(corners.iter().flat_map(|corner| corner.to_le_bytes()));
    }
    data.extend(space.orders.iter().map(|&order| order as u8));
    data.extend(x.iter().flat_map(|value| value.to_le_bytes()));
    let mut out = format!(
        "{FIRST}basis {}\nvertices {}\nhexahedra {}\nprisms {}\ntetrahedra {}\nnodes {}\nchecksum {:016x}\ndata\n",
        space.basis.name(),
        mesh.points.len(),
        mesh.hexahedra.len(),
        mesh.prisms.len(),
        mesh.tetrahedra.len(),
        space.nodes,
        checksum(&data)
    )
    .into_bytes();
    out.extend(data);
    out
}

/// Reads a file.
///
/// # Errors
/// What is wrong, and in which line of the header or at which cell or node.
pub fn read(bytes: &[u8]) -> Result<Volume, String> {
    let mut rest = bytes;
    let mut number = 0;
    let mut line = |wanted: &str| -> Result<&str, String> {
        number += 1;
        let end = rest.iter().take(200).position(|&byte| byte == b'\n');
        let end = end.ok_or_else(|| format!("line {number}: `{wanted}` is missing; the file is cut off"))?;
        let text = std::str::from_utf8(&rest[..end]).map_err(|_| format!("line {number} is no text"))?;
        rest = &rest[end + 1..];
        text.strip_prefix(wanted)
            .map(str::trim)
            .ok_or_else(|| format!("line {number}: `{wanted}` is expected, here is {text:?}"))
    };
    line(FIRST.trim_end())?;
    let name = line("basis ")?;
    let basis = basis::find(name).ok_or_else(|| {
        let known: Vec<&str> = basis::bases().iter().map(|basis| basis.name()).collect();
        format!("line 2: the basis {name:?} is unknown; known are {}", known.join(", "))
    })?;
    let mut count = |wanted: &str| -> Result<usize, String> {
        let text = line(wanted)?;
        let value: Result<u32, _> = text.parse();
        value
            .map(|value| value as usize)
            .map_err(|_| format!("`{wanted}` needs a whole number below 2^32, not {text:?}"))
    };
    let vertices = count("vertices ")?;
    let cells = [count("hexahedra ")?, count("prisms ")?, count("tetrahedra ")?];
    let nodes = count("nodes ")?;
    let text = line("checksum ")?;
    let stated =
        u64::from_str_radix(text, 16).map_err(|_| format!("the checksum {text:?} is no hexadecimal number"))?;
    line("data")?;
    let all: usize = cells.iter().sum();
    let corners: usize = cells
        .iter()
        .zip(Shape::ALL)
        .map(|(count, shape)| count * shape.corners())
        .sum();
    let expected = 4 * corners + all + 24 * nodes;
    if rest.len() != expected {
        return Err(format!(
            "the header announces {expected} bytes of data, there are {}",
            rest.len()
        ));
    }
    if checksum(rest) != stated {
        return Err("the data do not agree with the checksum; the file is damaged, write it again".to_string());
    }
    let (indices, rest) = rest.split_at(4 * corners);
    let (orders, values) = rest.split_at(all);
    let mut indices = indices
        .chunks_exact(4)
        .map(|bytes| u32::from_le_bytes(bytes.try_into().unwrap_or_default()));
    let orders: Vec<usize> = orders.iter().map(|&order| usize::from(order)).collect();
    let x: Vec<f64> = values
        .chunks_exact(8)
        .map(|bytes| f64::from_le_bytes(bytes.try_into().unwrap_or_default()))
        .collect();
    if let Some(place) = x.iter().position(|value| !value.is_finite()) {
        return Err(format!("node {} has the coefficient {}", place / 3, x[place]));
    }
    if vertices > nodes {
        return Err(format!("{vertices} vertices cannot be among {nodes} nodes"));
    }
    let mut mesh = MixedMesh {
        points: x[..3 * vertices]
            .chunks_exact(3)
            .map(|row| [row[0], row[1], row[2]])
            .collect(),
        ..MixedMesh::default()
    };
    let mut cell = 0;
    for (shape, count) in Shape::ALL.into_iter().zip(cells) {
        for _ in 0..count {
            let corners: Vec<u32> = indices.by_ref().take(shape.corners()).collect();
            let beyond = corners.iter().find(|&&corner| corner as usize >= vertices);
            if let Some(corner) = beyond {
                return Err(format!(
                    "cell {cell} has the corner {corner}, there are {vertices} vertices"
                ));
            }
            mesh.push(shape, &corners);
            if !(1..=HIGHEST_ORDER).contains(&orders[cell]) {
                return Err(format!(
                    "cell {cell} has order {}; orders are from 1 to {HIGHEST_ORDER}",
                    orders[cell]
                ));
            }
            cell += 1;
        }
    }
    let topology = mesh.topology()?;
    let counted = Space::count(&mesh, &topology, basis, &orders)?;
    if counted != nodes {
        return Err(format!(
            "cells of these orders have {counted} nodes, the header says {nodes}"
        ));
    }
    Ok(Volume { mesh, basis, orders, x })
}
