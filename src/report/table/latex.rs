//! A table for LaTeX with the rules of `booktabs`; notes and legend below it.

use super::{Cell, Column, Content, Grid, Judgement};
use crate::report::number;
use std::fmt::Write;

/// A `tabular` without float, to be placed by the document; needs `\usepackage{booktabs}`.
pub fn write(grid: &Grid) -> String {
    let mut text = String::from("% Needs \\usepackage{booktabs}.\n\\begin{tabular}{@{}");
    for head in &grid.head {
        text.push(if head.kind == Column::Axis { 'l' } else { 'r' });
    }
    text.push_str("@{}}\n\\toprule\n");
    let heads: Vec<String> = grid
        .head
        .iter()
        .map(|head| {
            let unit = if head.unit.is_empty() {
                String::new()
            } else {
                format!(" [{}]", escape(&head.unit))
            };
            format!("{}{unit}", escape(&head.text))
        })
        .collect();
    let _ = writeln!(text, "{} \\\\\n\\midrule", heads.join(" & "));
    for line in &grid.body {
        let cells: Vec<String> = line.iter().map(cell).collect();
        let _ = writeln!(text, "{} \\\\", cells.join(" & "));
    }
    text.push_str("\\bottomrule\n\\end{tabular}\n");
    text.push_str("\n\\par\\smallskip{\\footnotesize\n");
    for (index, note) in grid.notes.iter().enumerate() {
        let _ = writeln!(text, "$^{{{}}}$ {}\\\\", index + 1, escape(note));
    }
    let _ = writeln!(text, "{}\\par}}", escape(&grid.legend.join(" ")));
    text
}

fn cell(cell: &Cell) -> String {
    let mut text = match &cell.content {
        Content::Text(text) => escape(text),
        Content::Figure { value, digits, spread } => {
            let mut text = number::round(*value, *digits).latex();
            if let Some((deviation, count)) = spread {
                let _ = write!(text, " $\\pm$ {} ({count})", number::round(*deviation, 2).latex());
            }
            text
        }
        Content::Absent(word) => format!("\\emph{{{}}}", escape(word)),
        Content::Difference { text, judgement } => {
            let text = escape(text);
            match judgement {
                Judgement::Ratio => text,
                _ => format!("{text} {}", judgement.word()),
            }
        }
        Content::Empty => String::new(),
    };
    if cell.best {
        // \boldmath makes the digits of mathematics bold as well.
        text = format!("{{\\boldmath\\bfseries {text}}}");
    }
    if let Some(mark) = cell.mark {
        let _ = write!(text, "$^{{{mark}}}$");
    }
    text
}

/// Text with LaTeX's special characters made plain.
pub fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => {
                escaped.push('\\');
                escaped.push(character);
            }
            '\\' => escaped.push_str("\\textbackslash{}"),
            '~' => escaped.push_str("\\textasciitilde{}"),
            '^' => escaped.push_str("\\textasciicircum{}"),
            '<' => escaped.push_str("$<$"),
            '>' => escaped.push_str("$>$"),
            '\u{b1}' => escaped.push_str("$\\pm$"),
            '\u{d7}' => escaped.push_str("$\\times$"),
            '\u{2212}' => escaped.push_str("$-$"),
            '\n' | '\r' => escaped.push(' '),
            _ => escaped.push(character),
        }
    }
    escaped
}
