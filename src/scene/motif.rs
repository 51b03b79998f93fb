//! A motif: rows of signs, or a picture, whose cells name yarns. Scenes and the command line have one.

use std::path::{Path, PathBuf};

use glam::Vec3;

use super::palette::{self, hex};
use crate::pattern::period::counts_that_hold;

/// Whether a picture is drawn once over the whole fabric, not a pixel for each stitch, by its name.
pub(crate) const FITS: [(&str, bool); 2] = [("stitch", false), ("fabric", true)];

/// Whether a motif begins anew across and up, by its name.
pub(crate) const REPEATS: [(&str, [bool; 2]); 4] =
    [("both", [true; 2]), ("across", [true, false]), ("up", [false, true]), ("none", [false; 2])];

/// Cells, each of which names a yarn.
#[derive(Clone, Debug)]
pub(crate) struct Motif {
    pub(crate) cells: Cells,
    /// The sign or the colour (`#rrggbb`) of each yarn.
    pub(crate) signs: Vec<String>,
    /// As [`FITS`] has it; of a picture.
    pub(crate) stretched: bool,
    /// How many stitches and rows its lower left corner is from the fabric's.
    pub(crate) offset: [i64; 2],
    /// As [`REPEATS`] has it.
    pub(crate) again: [bool; 2],
}

#[derive(Clone, Debug)]
pub(crate) enum Cells {
    /// Rows of signs, the top one first.
    Signs(Vec<String>),
    Picture(PathBuf),
}

/// What is wrong with what stands for a yarn, in a picture or in rows of signs.
pub(crate) fn wrong_sign(sign: &str, in_picture: bool) -> Option<String> {
    if in_picture {
        hex(sign).is_none().then(|| format!("`{sign}` is no colour"))
    } else {
        (sign.chars().count() != 1).then(|| format!("`{sign}` is not one sign"))
    }
}

/// What is wrong with a row of signs: it has `width` of them, and each stands for a yarn.
pub(crate) enum WrongRow {
    Width(String),
    Sign(String),
}

/// Looks at a row of signs of a motif that is so many wide.
pub(crate) fn wrong_row<'a>(row: &str, width: usize, signs: impl Iterator<Item = &'a str> + Clone) -> Option<WrongRow> {
    if row.chars().count() != width || width == 0 {
        return Some(WrongRow::Width(format!("every row of a motif has {width} signs, like the first")));
    }
    let unknown = row.chars().find(|c| !signs.clone().any(|s| s.chars().eq([*c])))?;
    Some(WrongRow::Sign(format!("`{unknown}` stands for no yarn")))
}

/// Which of a list of yarns each cell of a grid is.
pub(crate) struct CellMap {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Rows from the bottom.
    pub(crate) cells: Vec<usize>,
    pub(crate) offset: [i64; 2],
    /// Whether it begins anew across and up, and what is where it does not.
    pub(crate) again: [bool; 2],
    pub(crate) ground: usize,
}

impl CellMap {
    pub(crate) fn at(&self, x: f32, y: f32) -> usize {
        let place = |v: f32, offset: i64| (v.floor() as i64).saturating_sub(offset);
        let (x, y) = (place(x, self.offset[0]), place(y, self.offset[1]));
        let (w, h) = (self.width as i64, self.height as i64);
        let outside = |v: i64, n: i64, again: bool| !again && !(0..n).contains(&v);
        if outside(x, w, self.again[0]) || outside(y, h, self.again[1]) {
            return self.ground;
        }
        self.cells[(y.rem_euclid(h) * w + x.rem_euclid(w)) as usize]
    }

    /// What to tell where rounds of so many stitches do not hold it a whole number of times, in the first row of two yarns.
    pub(crate) fn breaks_in_rounds(&self, widths: &[u32]) -> Option<String> {
        let wide = self.width as u32;
        let breaks = |(row, count): (usize, &u32)| {
            let at = |column: u32| self.at(column as f32 + 0.5, row as f32 + 0.5);
            self.again[0] && count % wide != 0 && (1..wide).any(|column| at(column) != at(0))
        };
        let (row, count) = widths.iter().enumerate().find(|of| breaks(*of))?;
        let (round, fits) = (row + 1, counts_that_hold(wide, *count));
        Some(format!(
            "the motif is {wide} stitches wide and breaks where round {round} of {count} begins; {fits} would hold it"
        ))
    }

    /// The yarn of each stitch of rows of so many.
    fn of_stitches(&self, widths: &[u32]) -> Vec<Vec<usize>> {
        let of = |(row, width): (usize, &u32)| {
            (0..*width).map(|column| self.at(column as f32 + 0.5, row as f32 + 0.5)).collect()
        };
        widths.iter().enumerate().map(of).collect()
    }

    /// The colour of each stitch of rows of so many, from 0, and the yarn that each colour is: the yarn of most stitches first.
    pub(crate) fn colors(&self, widths: &[u32]) -> (Vec<Vec<u16>>, Vec<usize>) {
        let yarns = self.of_stitches(widths);
        let mut counts: Vec<(usize, usize)> = Vec::new();
        for &yarn in yarns.iter().flatten() {
            match counts.iter_mut().find(|c| c.1 == yarn) {
                Some(count) => count.0 += 1,
                None => counts.push((1, yarn)),
            }
        }
        counts.sort_by_key(|&(count, yarn)| (std::cmp::Reverse(count), yarn));
        let order: Vec<usize> = counts.into_iter().map(|c| c.1).collect();
        let color = |yarn: &usize| order.iter().position(|y| y == yarn).unwrap_or(0) as u16;
        (yarns.iter().map(|row| row.iter().map(color).collect()).collect(), order)
    }
}

impl Motif {
    /// Its cells over a fabric of so many stitches and rows, each the yarn of its sign; `ground` where it does not begin anew.
    ///
    /// # Errors
    /// A picture that cannot be read.
    pub(crate) fn cells(&self, extent: [f32; 2], yarns: &[usize], ground: usize) -> Result<CellMap, String> {
        match &self.cells {
            Cells::Signs(rows) => {
                let width = rows[0].chars().count();
                let yarn = |c: char| {
                    let place = self.signs.iter().position(|sign| sign.chars().eq([c]));
                    place.map_or(yarns[0], |p| yarns[p])
                };
                let cells = rows.iter().rev().flat_map(|row| row.chars().map(yarn)).collect();
                Ok(CellMap { width, height: rows.len(), cells, offset: self.offset, again: self.again, ground })
            }
            Cells::Picture(path) => self.picture(path, extent, yarns, ground),
        }
    }

    /// A cell for each pixel, or for each stitch the mean of the pixels over it; the yarn of the nearest colour.
    fn picture(&self, path: &Path, extent: [f32; 2], yarns: &[usize], ground: usize) -> Result<CellMap, String> {
        let (w, pixels) = palette::on_paper(path)?;
        let h = pixels.len() / w;
        let (width, height) = if self.stretched {
            (extent[0].ceil().max(1.0) as usize, extent[1].ceil().max(1.0) as usize)
        } else {
            (w, h)
        };
        let colors: Vec<Vec3> = self.signs.iter().map(|sign| palette::color(sign).unwrap_or_default()).collect();
        let mut cells = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                let span = |i: usize, n: usize, of: usize| {
                    let start = i * of / n;
                    start..((i + 1) * of / n).clamp(start + 1, of)
                };
                // Rows of the picture run from the top.
                let (columns, rows) = (span(x, width, w), span(height - 1 - y, height, h));
                let mut sum = [0f32; 3];
                for i in rows.clone().flat_map(|row| columns.clone().map(move |column| row * w + column)) {
                    sum = [0, 1, 2].map(|k| sum[k] + pixels[i][k]);
                }
                let mean = palette::seen(sum.map(|s| s / (rows.len() * columns.len()) as f32));
                cells.push(yarns[palette::nearest(mean, &colors)]);
            }
        }
        Ok(CellMap { width, height, cells, offset: self.offset, again: self.again, ground })
    }
}
