//! A chart as SVG: plotters' output made smaller, its colours turned into classes that follow light and dark.

use super::Chart;
use super::draw::{self, Role, SERIES};
use crate::report::ReportError;
use crate::report::page::html::escape;
use plotters::prelude::*;
use std::fmt::Write;

/// Rules for all plots, once a page. On dark paper the series' colours are lighter.
pub fn style() -> String {
    let dark = [
        "#4fa8e0", "#f08046", "#2fc79a", "#dd94bd", "#eceff2", "#f0b429", "#7cc8f2", "#d8c62a",
    ];
    let mut light_rules = String::new();
    let mut dark_rules = String::new();
    for (index, (red, green, blue)) in SERIES.into_iter().enumerate() {
        let _ = write!(light_rules, "--c{index}:#{red:02x}{green:02x}{blue:02x};");
        let _ = write!(dark_rules, "--c{index}:{};", dark[index]);
    }
    let mut text = format!(
        ".plot{{--pi:#1f2328;--pm:#575e66;--pg:#e1e4e8;{light_rules}font-family:system-ui,Roboto,Helvetica,Arial,sans-serif}}\
         @media(prefers-color-scheme:dark){{.plot{{--pi:#e6e9ec;--pm:#a3abb3;--pg:#32373d;{dark_rules}}}}}\
         @media print{{.plot{{--pi:#1f2328;--pm:#575e66;--pg:#e1e4e8;{light_rules}}}}}\
         .plot path,.plot polygon{{stroke-linejoin:round;stroke-linecap:butt}}"
    );
    for (class, variable) in [("i", "pi"), ("m", "pm"), ("g", "pg")] {
        let _ = write!(
            text,
            ".plot .s{class}{{stroke:var(--{variable});fill:none}}.plot .f{class}{{fill:var(--{variable})}}"
        );
    }
    for index in 0..SERIES.len() {
        let _ = write!(
            text,
            ".plot .s{index}{{stroke:var(--c{index});fill:none}}.plot .f{index}{{fill:var(--c{index})}}"
        );
    }
    text
}

/// An SVG file that stands alone, with its paper.
pub fn standalone(chart: &Chart) -> Result<String, ReportError> {
    let (width, height) = (draw::WIDTH, draw::height(chart));
    let style = style();
    let style = format!(
        "<style>{style}.paper{{fill:#fff}}@media(prefers-color-scheme:dark){{.paper{{fill:#16191d}}}}@media print{{.paper{{fill:#fff}}}}</style><rect class=\"paper\" width=\"{width}\" height=\"{height}\"/>"
    );
    // A quarter of the canvas is the natural size on a screen.
    let size = format!(" width=\"{}\" height=\"{}\"", width / 4, height / 4);
    compose(chart, &size, &style)
}

/// An SVG element for a page that has [`style`].
pub fn inline(chart: &Chart) -> Result<String, ReportError> {
    compose(chart, "", "")
}

fn compose(chart: &Chart, size: &str, head: &str) -> Result<String, ReportError> {
    let failed = |error: String| ReportError::Plot(chart.name.clone(), error);
    let (width, height) = (draw::WIDTH, draw::height(chart));
    let mut raw = String::new();
    {
        let area = SVGBackend::with_string(&mut raw, (width, height)).into_drawing_area();
        draw::draw(&area, chart).map_err(failed)?;
        area.present().map_err(|error| failed(error.to_string()))?;
    }
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"plot\" viewBox=\"0 0 {width} {height}\"{size} role=\"img\" aria-label=\"{}\">{head}",
        escape(&chart.alternative())
    );
    rewrite(&raw, &mut text).map_err(failed)?;
    text.push_str("</svg>\n");
    Ok(text)
}

/// Reads plotters' elements, one a line, and writes fewer and shorter ones: polylines of one style become one path.
fn rewrite(raw: &str, text: &mut String) -> Result<(), String> {
    let mut open_path: Option<(String, String)> = None;
    let close = |open_path: &mut Option<(String, String)>, text: &mut String| {
        if let Some((style, data)) = open_path.take() {
            let _ = write!(text, "<path {style} d=\"{data}\"/>");
        }
    };
    let mut lines = raw.lines();
    while let Some(line) = lines.next() {
        let get = |name: &str| attribute(line, name).ok_or_else(|| format!("an SVG element has no {name}: {line}"));
        let element = line.trim_start_matches('<').split([' ', '>']).next().unwrap_or("");
        match element {
            "svg" | "/svg" => {}
            "polyline" | "line" => {
                let style = format!(
                    "class=\"s{}\" stroke-width=\"{}\"",
                    class(get("stroke")?)?,
                    get("stroke-width")?
                );
                let data = if element == "line" {
                    format!("M{} {} {} {}", get("x1")?, get("y1")?, get("x2")?, get("y2")?)
                } else {
                    format!("M{}", get("points")?.trim_end().replace(',', " "))
                };
                match &mut open_path {
                    Some((open, all)) if *open == style => all.push_str(&data),
                    _ => {
                        close(&mut open_path, text);
                        open_path = Some((style, data));
                    }
                }
            }
            "polygon" => {
                close(&mut open_path, text);
                let _ = write!(
                    text,
                    "<polygon class=\"f{}\" points=\"{}\"/>",
                    class(get("fill")?)?,
                    get("points")?.trim_end()
                );
            }
            "circle" => {
                close(&mut open_path, text);
                let _ = write!(
                    text,
                    "<circle class=\"f{}\" cx=\"{}\" cy=\"{}\" r=\"{}\"/>",
                    class(get("fill")?)?,
                    get("cx")?,
                    get("cy")?,
                    get("r")?
                );
            }
            "text" => {
                close(&mut open_path, text);
                let transform =
                    attribute(line, "transform").map_or_else(String::new, |value| format!(" transform=\"{value}\""));
                let _ = write!(
                    text,
                    "<text class=\"f{}\" x=\"{}\" y=\"{}\" dy=\"{}\" text-anchor=\"{}\" font-size=\"{}\"{transform}>{}</text>",
                    class(get("fill")?)?,
                    get("x")?,
                    get("y")?,
                    get("dy")?,
                    get("text-anchor")?,
                    draw::TEXT,
                    lines.next().unwrap_or("")
                );
            }
            "/text" => {}
            other => return Err(format!("plotters wrote an unexpected element {other}")),
        }
    }
    close(&mut open_path, text);
    Ok(())
}

fn attribute<'a>(line: &'a str, name: &str) -> Option<&'a str> {
    let key = format!(" {name}=\"");
    let start = line.find(&key)? + key.len();
    let length = line[start..].find('"')?;
    Some(&line[start..start + length])
}

/// The class of a colour: each role has its own.
fn class(colour: &str) -> Result<String, String> {
    let roles = [(Role::Ink, "i"), (Role::Muted, "m"), (Role::Grid, "g")];
    let hex = |role: Role| {
        let (red, green, blue) = role.light();
        format!("#{red:02X}{green:02X}{blue:02X}")
    };
    if let Some((_, class)) = roles.iter().find(|(role, _)| hex(*role) == colour) {
        return Ok(class.to_string());
    }
    (0..SERIES.len())
        .find(|index| hex(Role::Series(*index)) == colour)
        .map(|index| index.to_string())
        .ok_or_else(|| format!("the colour {colour} has no role"))
}
