//! A table as comma-separated values: the same rounded figures as in print, best and notes in columns of their own.

use super::{Column, Content, Grid};
use crate::report::number;

/// One line a row. Units stand in the header; cells without figures are empty and `notes` holds their reasons. A column
/// that sums up several jobs is followed by their standard deviation and count.
pub fn write(grid: &Grid) -> Result<Vec<u8>, csv::Error> {
    let spread: Vec<bool> = (0..grid.head.len())
        .map(|column| {
            grid.body
                .iter()
                .any(|line| matches!(line[column].content, Content::Figure { spread: Some(_), .. }))
        })
        .collect();
    let mut writer = csv::Writer::from_writer(Vec::new());
    let mut head: Vec<String> = Vec::new();
    let mut figure = String::new();
    for (column, spread) in grid.head.iter().zip(&spread) {
        let unit = if column.unit.is_empty() {
            String::new()
        } else {
            format!(" [{}]", column.unit)
        };
        match column.kind {
            Column::Axis => head.push(column.text.clone()),
            Column::Figure => {
                figure.clone_from(&column.text);
                head.push(format!("{figure}{unit}"));
            }
            Column::Printed | Column::Difference => head.push(format!("{figure} {}{unit}", column.text)),
        }
        if *spread {
            head.push(format!("{figure} deviation{unit}"));
            head.push(format!("{figure} jobs"));
        }
    }
    head.extend(["best".into(), "notes".into()]);
    writer.write_record(&head)?;
    for line in &grid.body {
        let mut best: Vec<&str> = Vec::new();
        let mut notes: Vec<&str> = Vec::new();
        let mut fields: Vec<String> = Vec::new();
        for ((column, cell), spread) in grid.head.iter().zip(line).zip(&spread) {
            fields.push(match &cell.content {
                Content::Text(text) => text.clone(),
                Content::Figure { value, digits, .. } => number::round(*value, *digits).plain(),
                Content::Absent(_) | Content::Empty => String::new(),
                Content::Difference { text, judgement } => {
                    format!("{text} {}", judgement.word()).trim().replace('\u{2212}', "-")
                }
            });
            if *spread {
                match cell.content {
                    Content::Figure {
                        spread: Some((deviation, count)),
                        ..
                    } => fields.extend([number::round(deviation, 2).plain(), count.to_string()]),
                    _ => fields.extend([String::new(), String::new()]),
                }
            }
            if cell.best {
                best.push(&column.text);
            }
            if let Some(note) = cell.mark.and_then(|mark| grid.notes.get(mark - 1))
                && !notes.contains(&note.as_str())
            {
                notes.push(note);
            }
        }
        fields.push(best.join(" "));
        fields.push(notes.join("; "));
        writer.write_record(&fields)?;
    }
    writer
        .into_inner()
        .map_err(|error| csv::Error::from(error.into_error()))
}
