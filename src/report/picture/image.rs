//! Small pictures: averaging down, and PNG files with a palette.

use std::collections::BTreeMap;

/// Averages squares of `by` pixels of red, green, blue and returns red, green, blue, opacity.
pub fn shrink(pixels: &[u8], width: usize, height: usize, by: usize) -> Vec<u8> {
    let clear: Vec<u8> = pixels
        .chunks_exact(3)
        .flat_map(|pixel| [pixel[0], pixel[1], pixel[2], 255])
        .collect();
    shrink_clear(&clear, width, height, by)
}

/// Averages squares of `by` pixels of red, green, blue, opacity, each colour weighted by its opacity.
pub fn shrink_clear(pixels: &[u8], width: usize, height: usize, by: usize) -> Vec<u8> {
    let (columns, rows) = (width / by, height / by);
    let mut small = Vec::with_capacity(4 * columns * rows);
    for row in 0..rows {
        for column in 0..columns {
            let mut sum = [0u32; 3];
            let mut opacity = 0u32;
            for inner in 0..by * by {
                let index = 4 * ((row * by + inner / by) * width + column * by + inner % by);
                let weight = u32::from(pixels[index + 3]);
                opacity += weight;
                for (part, value) in sum.iter_mut().zip(&pixels[index..index + 3]) {
                    *part += weight * u32::from(*value);
                }
            }
            if opacity == 0 {
                small.extend([0, 0, 0, 0]);
            } else {
                small.extend(sum.map(|part| ((part + opacity / 2) / opacity) as u8));
                small.push((opacity / (by * by) as u32) as u8);
            }
        }
    }
    small
}

/// A PNG with at most so many colours (up to 256), chosen by halving the box of colours with most to gain.
pub fn palette_png(pixels: &[u8], width: usize, height: usize, most: usize) -> Result<Vec<u8>, String> {
    // Colours to five bits, opacity to two: finer steps do not show and cost bytes.
    let coarse = |pixel: &[u8]| -> [u8; 4] {
        let opacity = (u16::from(pixel[3]) + 42) / 85 * 85;
        if opacity == 0 {
            return [0, 0, 0, 0];
        }
        let part = |value: u8| ((u16::from(value) + 2) / 4 * 4).min(255) as u8;
        [part(pixel[0]), part(pixel[1]), part(pixel[2]), opacity as u8]
    };
    let mut counts: BTreeMap<[u8; 4], u32> = BTreeMap::new();
    for pixel in pixels.chunks_exact(4) {
        *counts.entry(coarse(pixel)).or_default() += 1;
    }
    let palette = choose(
        counts.iter().map(|(colour, count)| (*colour, *count)).collect(),
        most.min(256),
    );
    let mut nearest: BTreeMap<[u8; 4], u8> = BTreeMap::new();
    for colour in counts.keys() {
        let distance = |entry: &[u8; 4]| -> i32 {
            colour
                .iter()
                .zip(entry)
                .map(|(left, right)| (i32::from(*left) - i32::from(*right)).pow(2))
                .sum()
        };
        let index = (0..palette.len())
            .min_by_key(|&index| distance(&palette[index]))
            .unwrap_or(0);
        nearest.insert(*colour, index as u8);
    }
    let indices: Vec<u8> = pixels.chunks_exact(4).map(|pixel| nearest[&coarse(pixel)]).collect();

    let bits: usize = if palette.len() <= 16 { 4 } else { 8 };
    let packed: Vec<u8> = if bits == 8 {
        indices
    } else {
        indices
            .chunks(width)
            .flat_map(|row| {
                row.chunks(2)
                    .map(|pair| pair[0] << 4 | pair.get(1).copied().unwrap_or(0))
            })
            .collect()
    };
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width as u32, height as u32);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(if bits == 8 {
        png::BitDepth::Eight
    } else {
        png::BitDepth::Four
    });
    encoder.set_palette(
        palette
            .iter()
            .flat_map(|colour| [colour[0], colour[1], colour[2]])
            .collect::<Vec<u8>>(),
    );
    if palette.iter().any(|colour| colour[3] < 255) {
        encoder.set_trns(palette.iter().map(|colour| colour[3]).collect::<Vec<u8>>());
    }
    encoder.set_compression(png::Compression::High);
    encoder.set_filter(png::Filter::NoFilter);
    let mut writer = encoder.write_header().map_err(|error| error.to_string())?;
    writer.write_image_data(&packed).map_err(|error| error.to_string())?;
    writer.finish().map_err(|error| error.to_string())?;
    Ok(bytes)
}

/// Median cut: the box with the largest spread times count is halved at the median of its longest side.
fn choose(colours: Vec<([u8; 4], u32)>, most: usize) -> Vec<[u8; 4]> {
    type Box = Vec<([u8; 4], u32)>;
    let longest = |colours: &Box| -> (usize, u32) {
        (0..4)
            .map(|part| {
                let low = colours.iter().map(|colour| colour.0[part]).min().unwrap_or(0);
                let high = colours.iter().map(|colour| colour.0[part]).max().unwrap_or(0);
                (part, u32::from(high - low))
            })
            .max_by_key(|(part, spread)| (*spread, 3 - part))
            .unwrap_or((0, 0))
    };
    let weight = |colours: &Box| -> u64 {
        let count: u64 = colours.iter().map(|colour| u64::from(colour.1)).sum();
        // The square root keeps rare colours, such as a few inverted cells, from being averaged away.
        u64::from(longest(colours).1).pow(2) * (1.0 + (count as f64).sqrt()) as u64
    };
    let mut boxes: Vec<Box> = vec![colours];
    while boxes.len() < most {
        let Some(index) = (0..boxes.len())
            .filter(|&index| boxes[index].len() > 1)
            .max_by_key(|&index| (weight(&boxes[index]), usize::MAX - index))
        else {
            break;
        };
        let mut split = std::mem::take(&mut boxes[index]);
        let (part, _) = longest(&split);
        split.sort_by_key(|colour| (colour.0[part], colour.0));
        let total: u64 = split.iter().map(|colour| u64::from(colour.1)).sum();
        let mut sum = 0;
        let middle = split.iter().position(|colour| {
            sum += u64::from(colour.1);
            2 * sum >= total
        });
        let middle = (middle.unwrap_or(0) + 1).clamp(1, split.len() - 1);
        let rest = split.split_off(middle);
        boxes[index] = split;
        boxes.push(rest);
    }
    boxes
        .iter()
        .map(|colours| {
            let total: u64 = colours.iter().map(|colour| u64::from(colour.1)).sum();
            [0, 1, 2, 3].map(|part| {
                let sum: u64 = colours
                    .iter()
                    .map(|colour| u64::from(colour.0[part]) * u64::from(colour.1))
                    .sum();
                ((sum + total / 2) / total.max(1)) as u8
            })
        })
        .collect()
}
