//! Entities, nodes and elements of version 4.1.

use super::super::binary::Scalar;
use super::super::{CellKind, Content, Fault};
use super::{Reading, code, shape};
use crate::mesh::bounding_box;
use std::collections::BTreeSet;
use std::io::Write as _;

/// Reads `$Entities` for the physical group of each.
pub(super) fn read_entities(reading: &mut Reading<'_>) -> Result<(), Fault> {
    let size = reading.size;
    let numbers = &mut reading.numbers;
    numbers.start_block();
    let mut counts = [0; 4];
    for (dimension, count) in counts.iter_mut().enumerate() {
        *count = numbers.count(size, format_args!("the number of entities of dimension {dimension}"))?;
    }
    let mut several = 0;
    for (dimension, count) in counts.into_iter().enumerate() {
        numbers.can_follow(count, 5, 4, format_args!("entities of dimension {dimension}"))?;
        for _ in 0..count {
            let tag = numbers.integer(Scalar::Int32, format_args!("the tag of an entity"))?;
            for _ in 0..if dimension == 0 { 3 } else { 6 } {
                numbers.real(Scalar::Float64, format_args!("the bounds of entity {tag}"))?;
            }
            let groups = numbers.count(size, format_args!("the number of groups of entity {tag}"))?;
            numbers.can_follow(groups, 1, 4, format_args!("groups of entity {tag}"))?;
            for index in 0..groups {
                let group = numbers.integer(Scalar::Int32, format_args!("a group of entity {tag}"))?;
                if index == 0 {
                    reading.groups.insert((dimension as i64, tag), group);
                }
            }
            several += usize::from(groups > 1);
            if dimension > 0 {
                let bounding = numbers.count(size, format_args!("the number of entities that bound entity {tag}"))?;
                numbers.can_follow(bounding, 1, 4, format_args!("entities that bound entity {tag}"))?;
                for _ in 0..bounding {
                    numbers.integer(Scalar::Int32, format_args!("an entity that bounds entity {tag}"))?;
                }
            }
        }
    }
    if several > 0 {
        reading.notices.push(format!(
            "{several} entities belong to several physical groups; the first is kept as their reference"
        ));
    }
    Ok(())
}

/// Reads `$Nodes`: blocks of tags followed by as many coordinates.
pub(super) fn read_nodes(reading: &mut Reading<'_>) -> Result<(), Fault> {
    let size = reading.size;
    reading.numbers.start_block();
    let (blocks, count) = section_header(reading, "nodes")?;
    reading.numbers.can_follow(count, 4, 7, format_args!("nodes"))?;
    reading.points.reserve(count);
    reading.node_tags.reserve(count);
    for _ in 0..blocks {
        let dimension = reading
            .numbers
            .count(Scalar::Int32, format_args!("the dimension of a block of nodes"))?;
        reading
            .numbers
            .integer(Scalar::Int32, format_args!("the entity of a block of nodes"))?;
        let parametric = reading
            .numbers
            .integer(Scalar::Int32, format_args!("whether nodes have parameters (0 or 1)"))?;
        if dimension > 3 || !(0..=1).contains(&parametric) {
            return Err(reading.numbers.fault(format!(
                "a block of nodes of dimension {dimension} with parametric flag {parametric}; 0 to 3 and 0 or 1 are expected"
            )));
        }
        let parameters = if parametric == 1 { dimension } else { 0 };
        let block = block_size(reading, count - reading.points.len(), "nodes")?;
        for _ in 0..block {
            let tag = reading.numbers.integer(size, format_args!("the tag of a node"))?;
            reading.node_tags.push(tag);
        }
        for _ in 0..block {
            let tag = reading.node_tags[reading.points.len()];
            reading.point(tag)?;
            for _ in 0..parameters {
                reading
                    .numbers
                    .real(Scalar::Float64, format_args!("a parameter of node {tag}"))?;
            }
        }
    }
    complete(reading, reading.points.len(), count, "nodes")
}

/// Reads `$Elements`: blocks of one type and entity.
pub(super) fn read_elements(reading: &mut Reading<'_>) -> Result<(), Fault> {
    let size = reading.size;
    reading.numbers.start_block();
    let (blocks, count) = section_header(reading, "elements")?;
    reading.numbers.can_follow(count, 2, 4, format_args!("elements"))?;
    for _ in 0..blocks {
        let dimension = reading
            .numbers
            .integer(Scalar::Int32, format_args!("the dimension of a block of elements"))?;
        let entity = reading
            .numbers
            .integer(Scalar::Int32, format_args!("the entity of a block of elements"))?;
        let code = reading
            .numbers
            .integer(Scalar::Int32, format_args!("the type of a block of elements"))?;
        let (nodes, kind) = shape(code).map_err(|message| reading.numbers.fault(message))?;
        let label = reading.groups.get(&(dimension, entity)).copied().unwrap_or(0);
        let block = block_size(reading, count - reading.element_tags.len(), "elements")?;
        for _ in 0..block {
            let tag = reading.numbers.integer(size, format_args!("the tag of an element"))?;
            reading.element(tag, label, nodes, kind, size)?;
        }
    }
    complete(reading, reading.element_tags.len(), count, "elements")
}

/// The numbers of blocks and of all things in them.
fn section_header(reading: &mut Reading<'_>, what: &str) -> Result<(usize, usize), Fault> {
    let size = reading.size;
    let blocks = reading
        .numbers
        .count(size, format_args!("the number of blocks of {what}"))?;
    let count = reading.numbers.count(size, format_args!("the number of {what}"))?;
    for end in ["smallest", "largest"] {
        reading.numbers.integer(size, format_args!("the {end} tag of {what}"))?;
    }
    reading
        .numbers
        .can_follow(blocks, 4, 4, format_args!("blocks of {what}"))?;
    Ok((blocks, count))
}

fn block_size(reading: &mut Reading<'_>, left: usize, what: &str) -> Result<usize, Fault> {
    let size = reading.size;
    let block = reading
        .numbers
        .count(size, format_args!("the size of a block of {what}"))?;
    if block > left {
        return Err(reading.numbers.fault(format!(
            "a block of {block} {what} does not fit: {left} are left; correct the counts"
        )));
    }
    Ok(block)
}

fn complete(reading: &Reading<'_>, seen: usize, count: usize, what: &str) -> Result<(), Fault> {
    if seen < count {
        return Err(reading.numbers.fault(format!(
            "the blocks hold {seen} {what}, {count} are announced; correct the counts"
        )));
    }
    Ok(())
}

/// Writes one entity for every dimension and label, and blocks of cells that follow one another with one label.
pub(super) fn write(content: &Content, labels: &[i64], out: &mut Vec<u8>) {
    let cells = content.cells();
    let dimension = |kind: CellKind| if CellKind::SURFACE.contains(&kind) { 2 } else { 3 };
    let entities: BTreeSet<(usize, i64)> = cells
        .iter()
        .zip(labels)
        .map(|((kind, _), &label)| (dimension(kind), label))
        .collect();
    let mut entities: Vec<(usize, i64)> = entities.into_iter().collect();
    if entities.is_empty() {
        entities.push((3, 0));
    }
    let count_of = |dimension: usize| entities.iter().filter(|entity| entity.0 == dimension).count();
    // Tags count from 1 within a dimension.
    let surfaces = count_of(2);
    let tag = |place: usize, dimension: usize| {
        if dimension == 2 {
            place + 1
        } else {
            place + 1 - surfaces
        }
    };

    // Writing to memory cannot fail.
    let _ = writeln!(out, "$Entities\n0 0 {surfaces} {}", count_of(3));
    let [low, high] = bounding_box(&content.points).unwrap_or_default();
    for (place, &(dimension, label)) in entities.iter().enumerate() {
        let _ = write!(out, "{}", tag(place, dimension));
        for value in low.iter().chain(&high) {
            let _ = write!(out, " {value:?}");
        }
        match label {
            0 => out.extend_from_slice(b" 0 0\n"),
            _ => {
                let _ = writeln!(out, " 1 {label} 0");
            }
        }
    }
    let points = content.points.len();
    let (last, &(top, _)) = (entities.len() - 1, &entities[entities.len() - 1]);
    let _ = writeln!(
        out,
        "$EndEntities\n$Nodes\n{} {points} {} {points}",
        usize::from(points > 0),
        usize::from(points > 0)
    );
    if points > 0 {
        let _ = writeln!(out, "{top} {} 0 {points}", tag(last, top));
    }
    for row in 1..=points {
        let _ = writeln!(out, "{row}");
    }
    for [x, y, z] in &content.points {
        let _ = writeln!(out, "{x:?} {y:?} {z:?}");
    }
    out.extend_from_slice(b"$EndNodes\n$Elements\n");

    let all: Vec<(CellKind, &[u32])> = cells.iter().collect();
    let mut starts: Vec<usize> = (0..all.len())
        .filter(|&row| row == 0 || all[row].0 != all[row - 1].0 || labels[row] != labels[row - 1])
        .collect();
    let _ = writeln!(
        out,
        "{} {} {} {}",
        starts.len(),
        all.len(),
        usize::from(!all.is_empty()),
        all.len()
    );
    starts.push(all.len());
    for range in starts.windows(2) {
        let (kind, label) = (all[range[0]].0, labels[range[0]]);
        let place = entities.binary_search(&(dimension(kind), label)).unwrap_or(0);
        let _ = writeln!(
            out,
            "{} {} {} {}",
            dimension(kind),
            tag(place, dimension(kind)),
            code(kind),
            range[1] - range[0]
        );
        for (row, (_, corners)) in all.iter().enumerate().take(range[1]).skip(range[0]) {
            let _ = write!(out, "{}", row + 1);
            for corner in *corners {
                let _ = write!(out, " {}", u64::from(*corner) + 1);
            }
            out.push(b'\n');
        }
    }
    out.extend_from_slice(b"$EndElements\n");
}
