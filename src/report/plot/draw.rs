//! Drawing of a chart on any backend of plotters.
//!
//! Coordinates are whole numbers on a canvas 3200 wide: an SVG scales them through its viewBox, a bitmap is averaged
//! down.

use super::axis::Kind;
use super::{Chart, Look, Point};
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::sync::OnceLock;

/// Width of the canvas.
pub const WIDTH: u32 = 3200;
/// Size of a text's em.
pub const TEXT: u32 = 70;
/// The name under which the embedded typeface is registered.
pub const FONT: &str = "sans-serif";

const TYPEFACE: &[u8] = include_bytes!("../font/Roboto-Regular.ttf");

/// A colour by its role; the SVG names the role, and the reader's light or dark setting decides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    Ink,
    Muted,
    Grid,
    Series(usize),
}

/// Colours told apart by people with any kind of colour vision (Okabe and Ito 2008), with yellow darkened for white
/// paper.
pub const SERIES: [(u8, u8, u8); 8] = [
    (0, 114, 178),
    (213, 94, 0),
    (0, 158, 115),
    (204, 121, 167),
    (26, 26, 26),
    (230, 159, 0),
    (86, 180, 233),
    (166, 148, 0),
];

/// Lengths of dash and gap in turn; empty for a solid line.
const DASHES: [&[f64]; 8] = [
    &[],
    &[56.0, 26.0],
    &[12.0, 22.0],
    &[70.0, 22.0, 12.0, 22.0],
    &[110.0, 34.0],
    &[28.0, 20.0],
    &[70.0, 20.0, 12.0, 20.0, 12.0, 20.0],
    &[110.0, 22.0, 28.0, 22.0],
];

impl Role {
    /// The colour on white paper. No two roles share one.
    pub fn light(self) -> (u8, u8, u8) {
        match self {
            Role::Ink => (31, 35, 40),
            Role::Muted => (87, 94, 102),
            Role::Grid => (225, 228, 232),
            Role::Series(index) => SERIES[index % SERIES.len()],
        }
    }

    fn rgb(self) -> RGBColor {
        let (red, green, blue) = self.light();
        RGBColor(red, green, blue)
    }

    fn stroke(self, width: u32) -> ShapeStyle {
        ShapeStyle {
            color: self.rgb().to_rgba(),
            filled: false,
            stroke_width: width,
        }
    }

    fn fill(self) -> ShapeStyle {
        ShapeStyle {
            color: self.rgb().to_rgba(),
            filled: true,
            stroke_width: 0,
        }
    }
}

/// Registers the embedded typeface under every family that plotters may ask for.
pub fn register_font() -> Result<(), String> {
    static RESULT: OnceLock<Result<(), String>> = OnceLock::new();
    RESULT
        .get_or_init(|| {
            plotters::style::register_font(FONT, FontStyle::Normal, TYPEFACE)
                .map_err(|_| "the embedded typeface cannot be read".to_string())
        })
        .clone()
}

fn font(size: u32) -> FontDesc<'static> {
    // The SVG backend divides sizes by 1.24.
    (FONT, f64::from(size) * 1.24).into_font()
}

fn text_style(role: Role, size: u32, horizontal: HPos, vertical: VPos) -> TextStyle<'static> {
    style_of(font(size), role, horizontal, vertical)
}

/// Text that reads upwards.
fn upright_style(role: Role, size: u32, horizontal: HPos, vertical: VPos) -> TextStyle<'static> {
    style_of(
        font(size).transform(FontTransform::Rotate270),
        role,
        horizontal,
        vertical,
    )
}

fn style_of(font: FontDesc<'static>, role: Role, horizontal: HPos, vertical: VPos) -> TextStyle<'static> {
    let mut style = TextStyle::from(font);
    style.color = role.rgb().to_backend_color();
    style.pos = Pos::new(horizontal, vertical);
    style
}

/// Width of a text in canvas units.
pub fn text_width(text: &str, size: u32) -> i32 {
    match font(size).box_size(text) {
        Ok((width, _)) => width as i32,
        Err(_) => (text.chars().count() as u32 * size * 6 / 10) as i32,
    }
}

/// Where everything goes.
struct Layout {
    left: i32,
    right: i32,
    top: i32,
    bottom: i32,
    upright_names: bool,
    named: bool,
}

/// Series names longer than this are cut, with an ellipsis in each of their longest parts.
const LONGEST_NAME: usize = 42;

fn short(name: &str) -> String {
    let parts: Vec<&str> = name.split(", ").collect();
    let length = |part: &str| part.chars().count();
    let whole = |most: usize| -> usize {
        parts.iter().map(|part| length(part).min(most)).sum::<usize>() + 2 * (parts.len() - 1)
    };
    // The longest parts give way first, so that the others still tell the series apart.
    let most = (3..=length(name))
        .rev()
        .find(|&most| whole(most) <= LONGEST_NAME)
        .unwrap_or(3);
    let cut = |part: &&str| {
        if length(part) <= most {
            return part.to_string();
        }
        let kept: String = part.chars().take(most - 1).collect();
        kept + "\u{2026}"
    };
    parts.iter().map(cut).collect::<Vec<_>>().join(", ")
}

/// Height of the canvas: enough for the names of all series one below the other.
pub fn height(chart: &Chart) -> u32 {
    let names = chart.series.len() as u32 * (TEXT + 16) + 360;
    let upright = if upright_names(chart) { 420 } else { 0 };
    names.max(1800 + upright).min(12_000)
}

fn upright_names(chart: &Chart) -> bool {
    let Kind::Category(names) = &chart.x.kind else {
        return false;
    };
    let widest = names
        .iter()
        .map(|name| text_width(&short(name), TEXT))
        .max()
        .unwrap_or(0);
    widest + 30 > 2200 / names.len().max(1) as i32
}

fn layout(chart: &Chart) -> Layout {
    let label = |tick: &super::axis::Tick| tick.label.as_ref().map_or(0, |text| text_width(text, TEXT));
    let y_labels = chart.y.ticks.iter().map(label).max().unwrap_or(0);
    let named = chart.series.len() > 1 || chart.series.first().is_some_and(|one| !one.name.is_empty());
    let names = chart
        .series
        .iter()
        .map(|one| text_width(&short(&one.name), TEXT))
        .max()
        .unwrap_or(0);
    let upright_names = upright_names(chart);
    let x_labels = if upright_names {
        chart.x.ticks.iter().map(label).max().unwrap_or(0).min(900)
    } else {
        TEXT as i32
    };
    Layout {
        left: 130 + y_labels + 40,
        // A reader's typeface may be wider than the embedded one.
        right: WIDTH as i32 - if named { names * 6 / 5 + 230 } else { 60 },
        top: 50,
        bottom: height(chart) as i32 - x_labels - 190,
        upright_names,
        named,
    }
}

/// Draws the whole chart.
pub fn draw<B: DrawingBackend>(area: &DrawingArea<B, Shift>, chart: &Chart) -> Result<(), String> {
    register_font()?;
    Pen { area }.chart(chart).map_err(|error| error.to_string())
}

struct Pen<'a, B: DrawingBackend> {
    area: &'a DrawingArea<B, Shift>,
}

type Drawn<B> = Result<(), DrawingAreaErrorKind<<B as DrawingBackend>::ErrorType>>;

impl<B: DrawingBackend> Pen<'_, B> {
    fn line(&self, points: Vec<(i32, i32)>, style: ShapeStyle) -> Drawn<B> {
        self.area.draw(&PathElement::new(points, style))
    }

    fn text(&self, text: &str, at: (i32, i32), style: TextStyle<'static>) -> Drawn<B> {
        // The SVG is read line by line.
        let text: String = text
            .chars()
            .map(|character| if character.is_control() { ' ' } else { character })
            .collect();
        self.area.draw(&Text::new(text, at, style))
    }

    fn chart(&self, chart: &Chart) -> Drawn<B> {
        let layout = layout(chart);
        self.frame(chart, &layout)?;
        let x =
            |value: f64| layout.left + (chart.x.position(value) * f64::from(layout.right - layout.left)).round() as i32;
        let y = |value: f64| {
            layout.bottom - (chart.y.position(value) * f64::from(layout.bottom - layout.top)).round() as i32
        };
        let mut ends = Vec::new();
        for (index, one) in chart.series.iter().enumerate() {
            // Dots of several series over one named value stand side by side.
            let offset = match chart.x.kind {
                Kind::Category(ref names) => {
                    let room = f64::from(layout.right - layout.left) / names.len() as f64;
                    let step = (0.7 * room / chart.series.len() as f64).min(70.0);
                    ((index as f64 - 0.5 * (chart.series.len() as f64 - 1.0)) * step) as i32
                }
                _ => 0,
            };
            let at = |point: &Point| (x(point.x) + offset, y(point.y));
            let (role, shape) = (Role::Series(one.look.colour), one.look.shape);
            let places: Vec<(i32, i32)> = one.points.iter().map(at).collect();
            for point in one.points.iter().filter(|point| point.high > point.low) {
                let across = x(point.x) + offset;
                self.line(vec![(across, y(point.low)), (across, y(point.high))], role.stroke(5))?;
            }
            if one.joined {
                self.dashed(&places, dashes(shape), role.stroke(9))?;
            } else if chart.series.len() == 1 && chart.y.kind == Kind::Linear && chart.y.low <= 0.0 {
                for place in &places {
                    self.line(vec![(place.0, y(0.0)), *place], role.stroke(9))?;
                }
            }
            for phase in one
                .phases
                .iter()
                .filter(|phase| (chart.x.low..=chart.x.high).contains(phase))
            {
                if let Some(point) = one
                    .points
                    .iter()
                    .min_by(|a, b| (a.x - phase).abs().total_cmp(&(b.x - phase).abs()))
                {
                    let (across, along) = at(point);
                    self.line(vec![(across, along - 46), (across, along + 46)], role.stroke(7))?;
                }
            }
            for place in marked(&places, index) {
                self.marker(shape, place, role)?;
            }
            if let Some(&end) = places.last() {
                ends.push((index, end));
            }
        }
        if layout.named {
            self.names(chart, &layout, ends)?;
        }
        Ok(())
    }

    fn frame(&self, chart: &Chart, layout: &Layout) -> Drawn<B> {
        let grid = Role::Grid.stroke(4);
        let mark = Role::Muted.stroke(5);
        for tick in &chart.y.ticks {
            let position = chart.y.position(tick.value);
            if !(-1e-6..=1.000001).contains(&position) {
                continue;
            }
            let y = layout.bottom - (position * f64::from(layout.bottom - layout.top)).round() as i32;
            match &tick.label {
                Some(label) => {
                    self.line(vec![(layout.left, y), (layout.right, y)], grid)?;
                    self.line(vec![(layout.left - 22, y), (layout.left, y)], mark)?;
                    self.text(
                        label,
                        (layout.left - 36, y),
                        text_style(Role::Muted, TEXT, HPos::Right, VPos::Center),
                    )?;
                }
                None => self.line(vec![(layout.left - 12, y), (layout.left, y)], mark)?,
            }
        }
        for tick in &chart.x.ticks {
            let position = chart.x.position(tick.value);
            if !(-1e-6..=1.000001).contains(&position) {
                continue;
            }
            let x = layout.left + (position * f64::from(layout.right - layout.left)).round() as i32;
            match &tick.label {
                Some(label) => {
                    let category = matches!(chart.x.kind, Kind::Category(_));
                    if !category {
                        self.line(vec![(x, layout.top), (x, layout.bottom)], grid)?;
                    }
                    self.line(vec![(x, layout.bottom), (x, layout.bottom + 22)], mark)?;
                    if layout.upright_names {
                        let at = (x, layout.bottom + 36);
                        self.text(
                            &short(label),
                            at,
                            upright_style(Role::Muted, TEXT, HPos::Right, VPos::Center),
                        )?;
                    } else {
                        let at = (x, layout.bottom + 34);
                        self.text(
                            &short(label),
                            at,
                            text_style(Role::Muted, TEXT, HPos::Center, VPos::Top),
                        )?;
                    }
                }
                None => self.line(vec![(x, layout.bottom), (x, layout.bottom + 12)], mark)?,
            }
        }
        self.line(
            vec![
                (layout.left, layout.top),
                (layout.left, layout.bottom),
                (layout.right, layout.bottom),
            ],
            mark,
        )?;
        let middle = (layout.left + layout.right) / 2;
        let foot = height(chart) as i32 - 24;
        self.text(
            &chart.x.label,
            (middle, foot),
            text_style(Role::Ink, TEXT, HPos::Center, VPos::Bottom),
        )?;
        let at = (28, (layout.top + layout.bottom) / 2);
        self.text(
            &chart.y.label,
            at,
            upright_style(Role::Ink, TEXT, HPos::Center, VPos::Top),
        )
    }

    /// Names beside the ends of their lines, moved apart where they would overlap, each with its dashes and marker.
    fn names(&self, chart: &Chart, layout: &Layout, mut ends: Vec<(usize, (i32, i32))>) -> Drawn<B> {
        ends.sort_by_key(|(index, end)| (end.1, *index));
        let step = TEXT as i32 + 16;
        let mut places: Vec<i32> = ends.iter().map(|(_, end)| end.1).collect();
        for index in 1..places.len() {
            places[index] = places[index].max(places[index - 1] + step);
        }
        // What was pushed below the axis moves up again.
        let mut limit = layout.bottom;
        for place in places.iter_mut().rev() {
            *place = (*place).min(limit);
            limit = *place - step;
        }
        let left = layout.right + 30;
        for ((index, end), place) in ends.into_iter().zip(places) {
            let Look { colour, shape } = chart.series[index].look;
            let role = Role::Series(colour);
            if chart.series[index].joined && end.0 >= layout.right - 400 {
                self.line(vec![(end.0 + 40, end.1), (left - 10, place)], Role::Grid.stroke(4))?;
            }
            if chart.series[index].joined {
                self.dashed(&[(left, place), (left + 150, place)], dashes(shape), role.stroke(9))?;
            }
            self.marker(shape, (left + 75, place), role)?;
            self.text(
                &short(&chart.series[index].name),
                (left + 178, place),
                text_style(Role::Ink, TEXT, HPos::Left, VPos::Center),
            )?;
        }
        Ok(())
    }

    /// A polyline in dashes; plotters' own would write an element for each dash.
    fn dashed(&self, points: &[(i32, i32)], pattern: &[f64], style: ShapeStyle) -> Drawn<B> {
        if points.len() < 2 {
            return Ok(());
        }
        if pattern.is_empty() {
            return self.line(points.to_vec(), style);
        }
        let mut phase = 0;
        let mut left = pattern[0];
        let mut dash: Vec<(i32, i32)> = vec![points[0]];
        for pair in points.windows(2) {
            let (from, to) = (pair[0], pair[1]);
            let (across, along) = (f64::from(to.0 - from.0), f64::from(to.1 - from.1));
            let length = across.hypot(along);
            let mut done = 0.0;
            while length - done > left {
                done += left;
                let at = (
                    from.0 + (across * done / length).round() as i32,
                    from.1 + (along * done / length).round() as i32,
                );
                if phase % 2 == 0 {
                    dash.push(at);
                    self.line(std::mem::take(&mut dash), style)?;
                }
                dash = vec![at];
                phase = (phase + 1) % pattern.len();
                left = pattern[phase];
            }
            left -= length - done;
            if phase % 2 == 0 {
                dash.push(to);
            }
        }
        if phase % 2 == 0 && dash.len() > 1 {
            self.line(dash, style)?;
        }
        Ok(())
    }

    fn marker(&self, index: usize, (x, y): (i32, i32), role: Role) -> Drawn<B> {
        let polygon = |corners: &[(i32, i32)]| {
            Polygon::new(
                corners.iter().map(|(dx, dy)| (x + dx, y + dy)).collect::<Vec<_>>(),
                role.fill(),
            )
        };
        match index % 8 {
            0 => self.area.draw(&Circle::new((x, y), 24, role.fill())),
            1 => self.area.draw(&polygon(&[(-21, -21), (21, -21), (21, 21), (-21, 21)])),
            2 => self.area.draw(&polygon(&[(0, -30), (27, 20), (-27, 20)])),
            3 => self.area.draw(&polygon(&[(0, -31), (31, 0), (0, 31), (-31, 0)])),
            4 => self.area.draw(&polygon(&[(0, 30), (27, -20), (-27, -20)])),
            5 => {
                self.line(vec![(x - 26, y), (x + 26, y)], role.stroke(11))?;
                self.line(vec![(x, y - 26), (x, y + 26)], role.stroke(11))
            }
            6 => {
                self.line(vec![(x - 22, y - 22), (x + 22, y + 22)], role.stroke(11))?;
                self.line(vec![(x - 22, y + 22), (x + 22, y - 22)], role.stroke(11))
            }
            _ => {
                let ring: Vec<(i32, i32)> = (0..=16)
                    .map(|step| {
                        let angle = std::f64::consts::TAU * f64::from(step) / 16.0;
                        (
                            x + (23.0 * angle.cos()).round() as i32,
                            y + (23.0 * angle.sin()).round() as i32,
                        )
                    })
                    .collect();
                self.line(ring, role.stroke(9))
            }
        }
    }
}

/// The dashes of a shape; past eight shapes the markers come again with other dashes.
fn dashes(index: usize) -> &'static [f64] {
    DASHES[(index + index / DASHES.len() * 3) % DASHES.len()]
}

/// Places for markers: all of a few points, some of many, at different ones for each series.
fn marked(places: &[(i32, i32)], index: usize) -> Vec<(i32, i32)> {
    const MOST: usize = 12;
    if places.len() <= 2 * MOST {
        return places.to_vec();
    }
    let step = places.len() / MOST;
    places
        .iter()
        .copied()
        .skip((index * step / 3) % step)
        .step_by(step)
        .collect()
}
