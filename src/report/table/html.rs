//! A table for the page.

use super::{Cell, Column, Content, Grid, Judgement};
use crate::report::number;
use crate::report::page::html::escape;
use std::fmt::Write;

/// A `figure` with a `table`, its notes and its legend.
pub fn write(grid: &Grid) -> String {
    let mut text = String::new();
    let _ = write!(
        text,
        "<figure class=\"table\" id=\"table-{0}\"><div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"{1}\">\
         <table><caption>{1}</caption><thead><tr>",
        escape(&grid.name),
        escape(&grid.title)
    );
    for head in &grid.head {
        let class = match head.kind {
            Column::Axis => "axis",
            Column::Figure => "",
            Column::Printed | Column::Difference => "beside",
        };
        let title = if head.definition.is_empty() {
            String::new()
        } else {
            format!(" title=\"{}\"", escape(&head.definition))
        };
        let unit = if head.unit.is_empty() {
            String::new()
        } else {
            format!(" <span class=\"unit\">[{}]</span>", escape(&head.unit))
        };
        let _ = write!(
            text,
            "<th scope=\"col\" class=\"{class}\"{title}>{}{unit}</th>",
            escape(&head.text)
        );
    }
    text.push_str("</tr></thead><tbody>");
    let mut previous: Option<&Vec<Cell>> = None;
    for line in &grid.body {
        text.push_str(if new_group(grid, previous, line) {
            "<tr class=\"group\">"
        } else {
            "<tr>"
        });
        for (head, cell) in grid.head.iter().zip(line) {
            text.push_str(&self::cell(grid, head.kind, cell));
        }
        text.push_str("</tr>");
        previous = Some(line);
    }
    text.push_str("</tbody></table></div><figcaption>");
    if !grid.notes.is_empty() {
        text.push_str("<ol class=\"notes\">");
        for (index, note) in grid.notes.iter().enumerate() {
            let _ = write!(
                text,
                "<li id=\"note-{}-{}\">{}</li>",
                escape(&grid.name),
                index + 1,
                escape(note)
            );
        }
        text.push_str("</ol>");
    }
    let _ = write!(text, "<p>{}</p>", escape(&grid.legend.join(" ")));
    let _ = write!(
        text,
        "<p>As <a href=\"{0}.csv\">CSV</a>, <a href=\"{0}.md\">Markdown</a>, <a href=\"{0}.tex\">LaTeX</a>.</p></figcaption></figure>",
        escape(&grid.name)
    );
    text
}

/// Whether the first of several row axes changes here, which a rule shows.
fn new_group(grid: &Grid, previous: Option<&Vec<Cell>>, line: &[Cell]) -> bool {
    let axes = grid.head.iter().filter(|head| head.kind == Column::Axis).count();
    let (Some(previous), true) = (previous, axes > 1) else {
        return false;
    };
    match (&previous[0].content, &line[0].content) {
        (Content::Text(left), Content::Text(right)) => left != right,
        _ => false,
    }
}

fn cell(grid: &Grid, column: Column, cell: &Cell) -> String {
    let mark = cell.mark.map_or_else(String::new, |mark| {
        format!(
            "<sup><a href=\"#note-{}-{mark}\" aria-label=\"note {mark}\">{mark}</a></sup>",
            escape(&grid.name)
        )
    });
    match &cell.content {
        Content::Text(text) if column == Column::Axis => format!("<th scope=\"row\">{}</th>", escape(text)),
        Content::Text(text) => format!("<td class=\"beside\">{}</td>", escape(text)),
        Content::Figure { value, digits, spread } => {
            let mut text = number::round(*value, *digits).unicode();
            if let Some((deviation, count)) = spread {
                let _ = write!(
                    text,
                    " <span class=\"unit\">\u{b1} {} ({count})</span>",
                    number::round(*deviation, 2).unicode()
                );
            }
            if cell.best {
                format!("<td><strong>{text}</strong>{mark}</td>")
            } else {
                format!("<td>{text}{mark}</td>")
            }
        }
        Content::Absent(word) => format!("<td class=\"absent\">{}{mark}</td>", escape(word)),
        Content::Difference { text, judgement } => {
            let class = match judgement {
                Judgement::Within | Judgement::Better => "well",
                Judgement::Worse => "ill",
                Judgement::Differs | Judgement::Ratio => "beside",
            };
            let word = judgement.word();
            let gap = if word.is_empty() { "" } else { " " };
            format!(
                "<td class=\"difference {class}\">{}{gap}<span>{word}</span></td>",
                escape(text)
            )
        }
        Content::Empty => "<td></td>".into(),
    }
}
