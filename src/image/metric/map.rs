//! Pictures of errors: values in a perceptual colour map (magma), with the scale below.

use std::path::Path;

use super::{Pair, relative_square};
use crate::image::{ImageError, png, png::srgb_to_linear};

/// Height of the strip with the scale, in pixels.
const STRIP: usize = 26;
/// Edge of a dot of a figure, in pixels.
const DOT: usize = 2;

/// |test - reference| / sqrt(reference^2 + [`EPSILON`](super::EPSILON)) at every pixel, the root of the mean over channels of
/// its square: the root of a pixel's relMSE. 0 where a pixel does not count.
pub fn relative_error(pair: &Pair) -> Vec<f32> {
    let mut out = vec![0.0; pair.counted.len()];
    for (i, test, reference) in pair.pixels() {
        let square = |k: usize| relative_square(test[k], reference[k]);
        out[i] = ((0..3).map(square).sum::<f64>() / 3.0).sqrt() as f32;
    }
    out
}

/// The colour of a value from 0 to 1 in the map magma, which looks even and grows in brightness: sRGB in eight bits.
pub fn magma(value: f32) -> [u8; 3] {
    // NaN becomes 0 in the cast of the look-up's index as everywhere else.
    let value = if value.is_nan() { 0.0 } else { value.clamp(0.0, 1.0) };
    colorous::MAGMA.eval_continuous(f64::from(value)).into_array()
}

/// Writes a PNG of values from 0 to `most`, which gets the brightest colour as does all beyond. Below stands the scale with
/// 0, half of it and `most`.
///
/// # Errors
/// [`ImageError::Write`]; then nothing has been left behind.
pub fn write(path: &Path, values: &[f32], width: usize, most: f32) -> Result<(), ImageError> {
    let height = values.len() / width.max(1);
    let strip = strip(width, most);
    let linear = |byte: u8| srgb_to_linear(f32::from(byte) / 255.0);
    png::write(path, width, height + STRIP, &png::Display::default(), |y, row| {
        for (x, out) in row.iter_mut().enumerate() {
            let [r, g, b] = match y.checked_sub(height) {
                None => magma(values[y * width + x] / most),
                Some(y) => strip[y * width + x],
            };
            *out = [linear(r), linear(g), linear(b), 1.0];
        }
    })
}

/// The strip below the picture: all colours, and the figures of three of them.
fn strip(width: usize, most: f32) -> Vec<[u8; 3]> {
    let mut pixels = vec![[0; 3]; width * STRIP];
    let bar = STRIP - 5 * DOT - 6;
    for y in 2..bar {
        for x in 0..width {
            pixels[y * width + x] = magma(x as f32 / (width.max(2) - 1) as f32);
        }
    }
    for (share, align) in [(0.0, 0.0), (0.5, 0.5), (1.0, 1.0)] {
        let text = figure(share * most);
        let length = text.len() * 4 * DOT - DOT;
        // Narrow pictures have room for the last figure only.
        if (length * 3 + 8 * DOT > width && align < 1.0) || length > width {
            continue;
        }
        let left = ((width - length) as f32 * align) as usize;
        for (i, letter) in text.bytes().enumerate() {
            for (row, bits) in glyph(letter).into_iter().enumerate() {
                for column in (0..3).filter(|c| bits >> (2 - c) & 1 == 1) {
                    for (dy, dx) in (0..DOT).flat_map(|dy| (0..DOT).map(move |dx| (dy, dx))) {
                        let x = left + (4 * i + column) * DOT + dx;
                        pixels[(bar + 3 + row * DOT + dy) * width + x] = [255; 3];
                    }
                }
            }
        }
    }
    pixels
}

/// A number with three digits that mean something, without those that do not.
fn figure(value: f32) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if !(1e-3..1e4).contains(&value) {
        return format!("{value:.1e}");
    }
    let decimals = (2 - value.log10().floor() as i32).clamp(0, 6) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// Five rows of three dots.
fn glyph(letter: u8) -> [u8; 5] {
    match letter {
        b'0' => [7, 5, 5, 5, 7],
        b'1' => [2, 6, 2, 2, 7],
        b'2' => [7, 1, 7, 4, 7],
        b'3' => [7, 1, 3, 1, 7],
        b'4' => [5, 5, 7, 1, 1],
        b'5' => [7, 4, 7, 1, 7],
        b'6' => [7, 4, 7, 5, 7],
        b'7' => [7, 1, 1, 2, 2],
        b'8' => [7, 5, 7, 5, 7],
        b'9' => [7, 5, 7, 1, 7],
        b'.' => [0, 0, 0, 0, 2],
        b'-' => [0, 0, 7, 0, 0],
        b'e' => [0, 7, 7, 4, 7],
        _ => [0; 5],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_short_and_true() {
        let cases = [(0.0, "0"), (0.5, "0.5"), (1.0, "1"), (0.125, "0.125"), (12.5, "12.5"), (1234.0, "1234")];
        for (value, text) in cases {
            assert_eq!(figure(value), text);
        }
        assert_eq!(figure(0.0333), "0.0333");
        assert_eq!(figure(2e-5), "2.0e-5");
    }

    #[test]
    fn the_map_grows_in_brightness() {
        let light = |v: f32| magma(v).iter().map(|c| f64::from(*c)).sum::<f64>();
        assert!((0..100).all(|i| light(i as f32 / 100.0) < light((i + 1) as f32 / 100.0) + 3.0));
        assert_eq!(magma(f32::NAN), magma(0.0));
        assert_eq!(magma(7.0), magma(1.0));
    }

    #[test]
    fn a_map_has_its_picture_and_its_scale() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("map.png");
        let values: Vec<f32> = (0..100 * 10).map(|i| (i % 100) as f32 / 99.0).collect();
        write(&path, &values, 100, 0.5).unwrap();
        let image = crate::image::read(&path).unwrap();
        assert_eq!((image.width, image.height), (100, 10 + STRIP));
        let at = |x: usize, y: usize| {
            let byte = |v: f32| (png::linear_to_srgb(v) * 255.0).round() as u8;
            image.rgb().unwrap().map(|plane| byte(plane[y * 100 + x]))
        };
        assert_eq!([at(0, 5), at(25, 5), at(99, 5)], [magma(0.0), magma(2.0 * 25.0 / 99.0), magma(1.0)]);
        // White figures on black below the bar.
        assert!((0..100).any(|x| at(x, 10 + STRIP - 5) == [255; 3]));
    }
}
