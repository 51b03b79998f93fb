//! Pictures that are read by a palette: each pixel stands for what the nearest colour does.

use std::path::Path;

use glam::Vec3;

use crate::{image, math::srgb::srgb_to_linear};

/// `#rrggbb`, as sRGB.
pub(crate) fn hex(text: &str) -> Option<[f32; 3]> {
    let digits = text.strip_prefix('#').filter(|d| d.len() == 6 && d.is_ascii())?;
    let channel = |i: usize| u8::from_str_radix(&digits[2 * i..2 * i + 2], 16).ok().map(|v| f32::from(v) / 255.0);
    Some([channel(0)?, channel(1)?, channel(2)?])
}

/// `#rrggbb` as colours are compared: in the square root of light, as eyes nearly see it.
pub(crate) fn color(sign: &str) -> Option<Vec3> {
    hex(sign).map(|color| seen(color.map(srgb_to_linear)))
}

pub(crate) fn seen(color: [f32; 3]) -> Vec3 {
    Vec3::from(color.map(|v| v.max(0.0).sqrt()))
}

/// Which colour of a palette each pixel has, the lowest row first.
#[derive(Clone, Debug)]
pub(crate) struct Pixels {
    pub(crate) width: usize,
    pub(crate) height: usize,
    numbers: Vec<usize>,
}

impl Pixels {
    /// By the nearest colour.
    ///
    /// # Errors
    /// The picture cannot be read or has no colours.
    pub(crate) fn read(path: &Path, palette: &[Vec3]) -> Result<Self, String> {
        let (width, colors) = colors(path)?;
        Ok(Self::nearest(width, &colors, palette))
    }

    /// By two colours: this one is number 1, and what differs most from it in the picture number 0.
    ///
    /// # Errors
    /// The picture cannot be read or has no colours.
    pub(crate) fn read_one(path: &Path, one: Vec3) -> Result<Self, String> {
        let (width, colors) = colors(path)?;
        let apart = |c: &&Vec3| c.distance_squared(one);
        let other = colors.iter().max_by(|a, b| apart(a).total_cmp(&apart(b))).copied().unwrap_or(one);
        // One that is as near to both is that colour itself.
        let mut pixels = Self::nearest(width, &colors, &[one, other]);
        pixels.numbers.iter_mut().for_each(|number| *number = 1 - *number);
        Ok(pixels)
    }

    fn nearest(width: usize, colors: &[Vec3], palette: &[Vec3]) -> Self {
        let rows = colors.chunks_exact(width).rev();
        let numbers: Vec<usize> = rows.flatten().map(|&color| nearest(color, palette)).collect();
        Self { width, height: numbers.len() / width, numbers }
    }

    /// A row from the bottom, from the left.
    pub(crate) fn row(&self, row: usize) -> &[usize] {
        &self.numbers[row * self.width..(row + 1) * self.width]
    }
}

/// How wide a picture is, and the colours of its pixels, the top row first.
fn colors(path: &Path) -> Result<(usize, Vec<Vec3>), String> {
    let (width, colors) = on_paper(path)?;
    Ok((width, colors.into_iter().map(seen).collect()))
}

/// How wide a picture is, and its pixels as they look on white paper, linear, the top row first: what is transparent is
/// drawn by nobody.
pub(crate) fn on_paper(path: &Path) -> Result<(usize, Vec<[f32; 3]>), String> {
    let picture = image::read(path).map_err(|e| e.to_string())?;
    let [r, g, b] = picture.rgb().ok_or_else(|| format!("{}: no colour channels", path.display()))?;
    let alpha = picture.channel("A");
    let paper = |i: usize| alpha.map_or(0.0, |a| (1.0 - a[i]).max(0.0));
    let colors: Vec<[f32; 3]> =
        (0..picture.width * picture.height).map(|i| [r[i], g[i], b[i]].map(|c| c + paper(i))).collect();
    if colors.is_empty() {
        return Err(format!("{}: no pixels", path.display()));
    }
    Ok((picture.width, colors))
}

/// Which of a palette is nearest to a colour.
pub(crate) fn nearest(color: Vec3, palette: &[Vec3]) -> usize {
    let distance = |i: usize| color.distance_squared(palette[i]);
    (0..palette.len()).min_by(|&i, &j| distance(i).total_cmp(&distance(j))).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::write_png;

    #[test]
    fn what_is_transparent_is_white_paper() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("p.png");
        write_png(&path, 3, png::ColorType::Rgba, &[200, 30, 30, 255, 0, 0, 0, 0, 200, 30, 30, 0]);
        let palette = ["#000000", "#c81e1e", "#ffffff"].map(|sign| color(sign).unwrap());
        assert_eq!(Pixels::read(&path, &palette).unwrap().row(0), [1, 2, 2]);
    }
}
