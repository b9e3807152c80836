//! A table in Markdown.

use super::{Cell, Column, Content, Grid};
use crate::report::number;
use std::fmt::Write;

/// The table with its title, notes and legend.
pub fn write(grid: &Grid) -> String {
    let mut text = format!("### {}\n\n|", escape(&grid.title));
    for head in &grid.head {
        let unit = if head.unit.is_empty() {
            String::new()
        } else {
            format!(" [{}]", head.unit)
        };
        let _ = write!(text, " {}{} |", escape(&head.text), escape(&unit));
    }
    text.push_str("\n|");
    for head in &grid.head {
        text.push_str(if head.kind == Column::Axis {
            " :--- |"
        } else {
            " ---: |"
        });
    }
    text.push('\n');
    for line in &grid.body {
        text.push('|');
        for cell in line {
            let _ = write!(text, " {} |", self::cell(cell));
        }
        text.push('\n');
    }
    for (index, note) in grid.notes.iter().enumerate() {
        let _ = write!(text, "\n[{}] {}  ", index + 1, escape(note));
    }
    if !grid.notes.is_empty() {
        text.push('\n');
    }
    let _ = write!(text, "\n{}\n", escape(&grid.legend.join(" ")));
    text
}

fn cell(cell: &Cell) -> String {
    let mut text = match &cell.content {
        Content::Text(text) => escape(text),
        Content::Figure { value, digits, spread } => {
            let mut text = number::round(*value, *digits).plain();
            if let Some((deviation, count)) = spread {
                let _ = write!(text, " \u{b1} {} ({count})", number::round(*deviation, 2).plain());
            }
            text
        }
        Content::Absent(word) => escape(word),
        Content::Difference { text, judgement } => format!("{text} {}", judgement.word()).trim().to_string(),
        Content::Empty => String::new(),
    };
    if cell.best {
        text = format!("**{text}**");
    }
    if let Some(mark) = cell.mark {
        let _ = write!(text, " [{mark}]");
    }
    text
}

/// Text that Markdown would take for markup, made plain; line ends become blanks.
pub fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '|' | '*' | '`' | '<' | '>' | '\\' => {
                escaped.push('\\');
                escaped.push(character);
            }
            '\n' | '\r' => escaped.push(' '),
            _ => escaped.push(character),
        }
    }
    escaped
}
