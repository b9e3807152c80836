//! A chart as PNG on white paper: drawn at full size, averaged down by two.

use super::{Chart, draw};
use crate::report::ReportError;
use crate::report::picture::image;
use plotters::prelude::*;

/// Bytes of a PNG file 1600 wide.
pub fn write(chart: &Chart) -> Result<Vec<u8>, ReportError> {
    let failed = |error: String| ReportError::Plot(chart.name.clone(), error);
    let (width, height) = (draw::WIDTH, draw::height(chart) / 2 * 2);
    let mut pixels = vec![255u8; width as usize * height as usize * 3];
    {
        let area = BitMapBackend::with_buffer(&mut pixels, (width, height)).into_drawing_area();
        draw::draw(&area, chart).map_err(failed)?;
        area.present().map_err(|error| failed(error.to_string()))?;
    }
    let halved = image::shrink(&pixels, width as usize, height as usize, 2);
    image::palette_png(&halved, width as usize / 2, height as usize / 2, 128).map_err(failed)
}
