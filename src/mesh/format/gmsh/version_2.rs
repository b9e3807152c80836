//! Nodes and elements of version 2.2.

use super::super::Content;
use super::super::Fault;
use super::super::binary::Scalar;
use super::{Reading, code, shape, write_row};
use std::io::Write as _;

/// Reads `$Nodes`: a count, then a number and three coordinates each.
pub(super) fn read_nodes(reading: &mut Reading<'_>) -> Result<(), Fault> {
    let count = reading.numbers.text.count(format_args!("the number of nodes"), 0)?;
    reading.numbers.start_block();
    reading.numbers.can_follow(count, 4, 7, format_args!("nodes"))?;
    reading.points.reserve(count);
    reading.node_tags.reserve(count);
    for index in 1..=count {
        let tag = reading
            .numbers
            .integer(Scalar::Int32, format_args!("the number of node {index}"))?;
        reading.node_tags.push(tag);
        reading.point(tag)?;
    }
    Ok(())
}

/// Reads `$Elements`: one by one in text, in blocks of one type in binary.
pub(super) fn read_elements(reading: &mut Reading<'_>) -> Result<(), Fault> {
    let count = reading.numbers.text.count(format_args!("the number of elements"), 0)?;
    reading.numbers.start_block();
    reading.numbers.can_follow(count, 2, 4, format_args!("elements"))?;
    let mut seen = 0;
    while seen < count {
        if !reading.numbers.is_binary() {
            let tag = reading
                .numbers
                .integer(Scalar::Int32, format_args!("the number of element {}", seen + 1))?;
            let code = reading
                .numbers
                .integer(Scalar::Int32, format_args!("the type of element {tag}"))?;
            let (nodes, kind) =
                shape(code).map_err(|message| reading.numbers.fault(format!("element {tag}: {message}")))?;
            let tags = reading
                .numbers
                .count(Scalar::Int32, format_args!("the number of tags of element {tag}"))?;
            let label = read_tags(reading, tags, tag)?;
            reading.element(tag, label, nodes, kind, Scalar::Int32)?;
            seen += 1;
            continue;
        }
        let code = reading
            .numbers
            .integer(Scalar::Int32, format_args!("the type of a block of elements"))?;
        let (nodes, kind) = shape(code).map_err(|message| reading.numbers.fault(message))?;
        let block = reading
            .numbers
            .count(Scalar::Int32, format_args!("the size of a block of elements"))?;
        let tags = reading
            .numbers
            .count(Scalar::Int32, format_args!("the number of tags"))?;
        if block == 0 || block > count - seen {
            return Err(reading.numbers.fault(format!(
                "a block of {block} elements does not fit: {} of {count} are left",
                count - seen
            )));
        }
        for _ in 0..block {
            let tag = reading
                .numbers
                .integer(Scalar::Int32, format_args!("the number of an element"))?;
            let label = read_tags(reading, tags, tag)?;
            reading.element(tag, label, nodes, kind, Scalar::Int32)?;
        }
        seen += block;
    }
    Ok(())
}

/// The first of an element's tags, its physical group.
fn read_tags(reading: &mut Reading<'_>, count: usize, element: i64) -> Result<i64, Fault> {
    reading
        .numbers
        .can_follow(count, 1, 4, format_args!("tags of element {element}"))?;
    let mut label = 0;
    for index in 0..count {
        let tag = reading
            .numbers
            .integer(Scalar::Int32, format_args!("a tag of element {element}"))?;
        if index == 0 {
            label = tag;
        }
    }
    Ok(label)
}

/// Writes nodes and elements; each element has its physical group and an elementary entity of the same number.
pub(super) fn write(content: &Content, labels: &[i64], out: &mut Vec<u8>) {
    // Writing to memory cannot fail.
    let _ = write!(out, "$Nodes\n{}\n", content.points.len());
    for (row, point) in content.points.iter().enumerate() {
        write_row(out, format_args!("{}", row + 1), point);
    }
    let cells = content.cells();
    let _ = write!(out, "$EndNodes\n$Elements\n{}\n", cells.count());
    for (row, ((kind, corners), label)) in cells.iter().zip(labels).enumerate() {
        let _ = write!(out, "{} {} 2 {label} {}", row + 1, code(kind), (*label).max(1));
        for corner in corners {
            let _ = write!(out, " {}", u64::from(*corner) + 1);
        }
        out.push(b'\n');
    }
    out.extend_from_slice(b"$EndElements\n");
}
