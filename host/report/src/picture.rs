//! Pictures as PNG with a palette.

use std::collections::BTreeMap;

use echoloop_sim::picture::Picture;

/// Greatest number of colours of a palette.
const MAX_COLOURS: usize = 256;

/// Bits of each channel that count while a palette is chosen.
const BITS: u32 = 6;

/// A picture as PNG of 256 colours chosen for it, a third of the bytes of all colours. `texts` are
/// keywords of PNG (`Title`, `Software`) with their text.
///
/// # Errors
///
/// A text about the size or the keyword at fault.
pub fn picture_png(picture: &Picture, texts: &[(&str, &str)]) -> Result<Vec<u8>, String> {
    let palette = palette(picture);
    let side = |side: usize| u32::try_from(side).map_err(|_| format!("{side} pixels"));
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, side(picture.width)?, side(picture.height)?);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_palette(palette.colours.concat());
    encoder.set_compression(png::Compression::High);
    // Filters compare neighbouring indices, and those say nothing about colours.
    encoder.set_filter(png::Filter::NoFilter);
    for (keyword, text) in texts {
        encoder
            .add_itxt_chunk((*keyword).to_owned(), (*text).to_owned())
            .map_err(|error| error.to_string())?;
    }
    let mut writer = encoder.write_header().map_err(|error| error.to_string())?;
    let indices: Vec<u8> =
        picture.pixels.iter().map(|pixel| palette.index[&coarse(pixel)]).collect();
    writer.write_image_data(&indices).map_err(|error| error.to_string())?;
    writer.finish().map_err(|error| error.to_string())?;
    Ok(bytes)
}

/// Colours, and the index of the one for each coarse colour.
struct Palette {
    colours: Vec<[u8; 3]>,
    index: BTreeMap<[u8; 3], u8>,
}

/// A coarse colour and the pixels that have it.
#[derive(Clone, Copy)]
struct Shade {
    coarse: [u8; 3],
    /// Sum of each channel over its pixels.
    sum: [u64; 3],
    pixels: u64,
}

fn coarse(pixel: &[u8; 3]) -> [u8; 3] {
    pixel.map(|channel| channel >> (8 - BITS))
}

/// Median cut (Heckbert 1982): halves the box of colours with the greatest [`spread`] until there
/// are enough boxes.
fn palette(picture: &Picture) -> Palette {
    let mut boxes = vec![shades(picture)];
    while boxes.len() < MAX_COLOURS {
        let worst = (0..boxes.len()).max_by_key(|&at| (spread(&boxes[at]).0, usize::MAX - at));
        let Some(at) = worst.filter(|&at| spread(&boxes[at]).0 > 0) else { break };
        let (first, second) = halves(std::mem::take(&mut boxes[at]));
        boxes[at] = first;
        boxes.push(second);
    }
    let index = boxes
        .iter()
        .enumerate()
        .flat_map(|(index, shades)| shades.iter().map(move |shade| (shade.coarse, index as u8)));
    Palette { index: index.collect(), colours: boxes.iter().map(|shades| mean(shades)).collect() }
}

fn shades(picture: &Picture) -> Vec<Shade> {
    let mut found = BTreeMap::new();
    for pixel in &picture.pixels {
        let coarse = coarse(pixel);
        let shade = found.entry(coarse).or_insert(Shade { coarse, sum: [0; 3], pixels: 0 });
        (0..3).for_each(|k| shade.sum[k] += u64::from(pixel[k]));
        shade.pixels += 1;
    }
    found.into_values().collect()
}

/// Spread of a box: its widest side, squared, times the root of its number of pixels. With that
/// side's channel.
fn spread(shades: &[Shade]) -> (u64, usize) {
    let pixels: u64 = shades.iter().map(|shade| shade.pixels).sum();
    let side = |k: usize| {
        let channel = || shades.iter().map(|shade| shade.coarse[k]);
        u64::from(channel().max().unwrap_or(0) - channel().min().unwrap_or(0))
    };
    let widest = (0..3).max_by_key(|&k| side(k)).unwrap_or(0);
    (side(widest).pow(2) * pixels.isqrt(), widest)
}

/// Splits a box across its widest side, half of the pixels on either part.
fn halves(mut shades: Vec<Shade>) -> (Vec<Shade>, Vec<Shade>) {
    let channel = spread(&shades).1;
    shades.sort_by_key(|shade| (shade.coarse[channel], shade.coarse));
    let half = shades.iter().map(|shade| shade.pixels).sum::<u64>() / 2;
    let mut below = 0;
    let middle = shades.iter().position(|shade| {
        below += shade.pixels;
        below > half
    });
    let second = shades.split_off(middle.unwrap_or(0).clamp(1, shades.len() - 1));
    (shades, second)
}

fn mean(shades: &[Shade]) -> [u8; 3] {
    let pixels = shades.iter().map(|shade| shade.pixels).sum::<u64>().max(1);
    [0, 1, 2].map(|k| (shades.iter().map(|shade| shade.sum[k]).sum::<u64>() / pixels) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoded(bytes: &[u8]) -> (Vec<[u8; 3]>, Vec<String>) {
        let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes));
        decoder.set_transformations(png::Transformations::EXPAND);
        let mut reader = decoder.read_info().expect("a PNG");
        let mut pixels = vec![0; reader.output_buffer_size().expect("a size")];
        reader.next_frame(&mut pixels).expect("pixels");
        let said = reader
            .info()
            .utf8_text
            .iter()
            .map(|text| format!("{}: {}", text.keyword, text.get_text().expect("a text")));
        (pixels.as_chunks::<3>().0.to_vec(), said.collect())
    }

    #[test]
    fn a_picture_of_few_colours_keeps_them_all_and_its_texts() {
        let colours = [[255, 0, 0], [0, 255, 0], [10, 20, 30], [200, 200, 210]];
        let pixels: Vec<[u8; 3]> = (0..60).map(|k| colours[k * k % 4]).collect();
        let picture = Picture { width: 10, height: 6, pixels: pixels.clone() };
        let bytes = picture_png(&picture, &[("Title", "a yard, 10 m")]).expect("a PNG");
        assert_eq!(decoded(&bytes), (pixels, vec!["Title: a yard, 10 m".to_owned()]));
    }

    #[test]
    fn each_pixel_of_many_colours_keeps_a_near_one() {
        let pixels: Vec<[u8; 3]> = (0..128 * 128_u32)
            .map(|k| [(k % 128 * 2) as u8, (k / 128 * 2) as u8, (k % 97) as u8])
            .collect();
        let picture = Picture { width: 128, height: 128, pixels: pixels.clone() };
        let bytes = picture_png(&picture, &[]).expect("a PNG");
        let (back, _) = decoded(&bytes);
        let off = |k: usize| (0..3).map(|c| pixels[k][c].abs_diff(back[k][c])).max().unwrap_or(0);
        let mean = (0..pixels.len()).map(|k| f64::from(off(k))).sum::<f64>() / pixels.len() as f64;
        assert!(mean < 16.0, "{mean} codes off");
        assert_eq!(bytes, picture_png(&picture, &[]).expect("a PNG"), "the same bytes");
    }

    #[test]
    fn a_picture_without_pixels_is_refused_in_words() {
        let picture = Picture { width: 0, height: 0, pixels: Vec::new() };
        assert!(!picture_png(&picture, &[]).expect_err("no size").is_empty());
    }
}
