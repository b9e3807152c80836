//! A table for the terminal.

use super::{Cell, Column, Content, Grid};
use crate::report::number;
use comfy_table::{CellAlignment, ContentArrangement, Table, presets};
use std::fmt::Write;

/// The table with its notes; best figures carry a star.
pub fn write(grid: &Grid, width: Option<u16>) -> String {
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    if let Some(width) = width {
        table.set_content_arrangement(ContentArrangement::Dynamic);
        table.set_width(width);
    }
    table.set_header(grid.head.iter().map(|head| {
        if head.unit.is_empty() {
            plain(&head.text)
        } else {
            format!("{} [{}]", plain(&head.text), head.unit)
        }
    }));
    for line in &grid.body {
        table.add_row(line.iter().map(cell));
    }
    for (column, head) in table.column_iter_mut().zip(&grid.head) {
        if head.kind != Column::Axis {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    let mut text = format!("{}\n", plain(&grid.title));
    for line in table.to_string().lines() {
        let _ = writeln!(text, "{}", line.trim_end());
    }
    for (index, note) in grid.notes.iter().enumerate() {
        let _ = writeln!(text, "  [{}] {}", index + 1, plain(note));
    }
    if grid.body.iter().flatten().any(|cell| cell.best) {
        text.push_str("  * best of those that differ in the last axis only\n");
    }
    text
}

fn cell(cell: &Cell) -> String {
    let mut text = match &cell.content {
        Content::Text(text) => plain(text),
        Content::Figure { value, digits, spread } => {
            let mut text = number::round(*value, *digits).plain();
            if let Some((deviation, count)) = spread {
                let _ = write!(text, " \u{b1} {} ({count})", number::round(*deviation, 2).plain());
            }
            text
        }
        Content::Absent(word) => plain(word),
        Content::Difference { text, judgement } => format!("{text} {}", judgement.word()).trim().to_string(),
        Content::Empty => String::new(),
    };
    if cell.best {
        text.push('*');
    }
    if let Some(mark) = cell.mark {
        let _ = write!(text, " [{mark}]");
    }
    text
}

/// Text without control characters, so that no name can steer the terminal.
pub fn plain(text: &str) -> String {
    text.chars()
        .map(|character| if character.is_control() { ' ' } else { character })
        .collect()
}
