//! Colour work of `yarnray make knit`: a motif and how it is knitted.

use std::path::PathBuf;

use clap::Args;

use crate::{
    cli::{Failure, named, two},
    math::srgb::srgb_to_linear,
    pattern::knit::{CARRY_ROWS, CATCH_FLOATS, Colors, Knit, Work},
    scene::{
        motif::{Cells, FITS, Motif, REPEATS, WrongRow, wrong_row, wrong_sign},
        palette::hex,
    },
};

#[derive(Args, Debug)]
pub(super) struct ColorArgs {
    /// Colour work: a row of signs, the top one first, as in '.#.' (repeatable), or a picture, `@FILE`, of which a pixel is a stitch.
    #[arg(long, value_name = "ROW", requires = "color", conflicts_with = "tile", allow_hyphen_values = true)]
    motif: Vec<String>,
    /// The colour of a yarn and the sign it stands for, as in '#=#c02a1f', or the colour of a picture, as in '#c02a1f' or
    /// '#ff0000=#c02a1f' (repeatable).
    #[arg(long, value_name = "SIGN=COLOR", requires = "motif")]
    color: Vec<String>,
    /// Whether the motif begins anew across and up.
    #[arg(long, default_value = "both", value_parser = named(&REPEATS), requires = "motif")]
    motif_repeat: [bool; 2],
    /// Stitches and rows from the lower left corner to that of the motif.
    #[arg(long, value_name = "X,Y", value_parser = offset, requires = "motif", allow_hyphen_values = true)]
    motif_offset: Option<[i64; 2]>,
    /// A pixel of the picture for each stitch, or all of it over the whole piece.
    #[arg(long, default_value = "stitch", action = clap::ArgAction::Set, value_parser = named(&FITS), requires = "motif")]
    motif_fit: bool,
    /// How colours are knitted.
    #[arg(long, default_value = "stranded", value_parser = named(&Work::NAMES), requires = "motif")]
    color_work: Work,
    /// Stitches over which a yarn floats before it is caught; 0 for never.
    #[arg(long, default_value_t = CATCH_FLOATS, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=1_000_000), requires = "motif")]
    catch_floats: u32,
    /// Rows without a colour over which its yarn is carried.
    #[arg(long, default_value_t = CARRY_ROWS, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=1_000_000), requires = "motif")]
    carry_rows: u32,
}

/// Colours of a piece, linear: those of its yarns.
pub(super) struct Palette(Vec<[f32; 3]>);

impl Palette {
    /// The colour of a yarn, by its number.
    pub(super) fn of(&self, yarn: u16) -> Option<[f32; 3]> {
        self.0.get(usize::from(yarn)).copied()
    }
}

fn offset(text: &str) -> Result<[i64; 2], String> {
    let near = |v: f64| v.fract() == 0.0 && v.abs() <= 1e6;
    let whole = two(text).filter(|place| place.iter().all(|v| near(*v)));
    whole.map(|place| place.map(|v| v as i64)).ok_or_else(|| "expected stitches and rows, as in 4,-2".to_owned())
}

/// What stands for a yarn, and its colour as sRGB.
fn sign_and_color(text: &str, in_picture: bool) -> Result<(String, [f32; 3]), Failure> {
    let example = if in_picture { "#c02a1f or #ff0000=#c02a1f" } else { "#=#c02a1f" };
    let wrong =
        |problem: String| Failure::hinted(format!("--color {text}: {problem}"), format!("as in --color '{example}'"));
    // A sign may be `=` itself.
    let split = text.char_indices().skip(1).find(|(_, c)| *c == '=');
    let (sign, color) = match split {
        Some((at, _)) => (&text[..at], &text[at + 1..]),
        None if in_picture => (text, text),
        None => return Err(wrong("expected a sign and a colour".to_owned())),
    };
    if let Some(problem) = wrong_sign(sign, in_picture) {
        return Err(wrong(problem));
    }
    let color = hex(color).ok_or_else(|| wrong(format!("`{color}` is no colour")))?;
    Ok((sign.to_owned(), color))
}

impl ColorArgs {
    /// The piece in the colours that are asked for, if any are, and what they look like; what is worth telling goes to `tell`.
    pub(super) fn dyed(&self, piece: Knit, tell: impl Fn(&str)) -> Result<(Knit, Palette), Failure> {
        if self.motif.is_empty() {
            return Ok((piece, Palette(Vec::new())));
        }
        let (motif, colors) = self.motif()?;
        if let Err([problem, _]) = self.color_work.suits(&piece.form) {
            return Err(Failure::hinted(problem, "--color-work stranded"));
        }
        let wrong = |problem: &str| Failure::Input(format!("error: --motif: {problem}"));
        let widths = piece.widths().map_err(|e| wrong(&e.to_string()))?;
        let widest = widths.iter().copied().max().unwrap_or(1);
        let yarns: Vec<usize> = (0..colors.len()).collect();
        // Where the motif is not, the yarn of its first sign is.
        let cells = motif.cells([widest as f32, widths.len() as f32], &yarns, 0).map_err(|problem| wrong(&problem))?;
        if piece.form.is_round() {
            cells.breaks_in_rounds(&widths).iter().for_each(|told| tell(told));
        }
        let (rows, order) = cells.colors(&widths);
        self.color_work.takes(order.len()).map_err(|problem| {
            Failure::hinted(problem, "a --motif of two colours; more of them are knitted with --color-work stranded")
        })?;
        let catch = (self.catch_floats > 0).then_some(self.catch_floats);
        let worked = Colors { rows, work: self.color_work, catch, carry: self.carry_rows };
        worked.too_many("--color-work intarsia").iter().for_each(|told| tell(told));
        let palette = order.iter().map(|yarn| colors[*yarn].map(srgb_to_linear)).collect();
        Ok((Knit { colors: Some(worked), ..piece }, Palette(palette)))
    }

    /// The motif, and the colour of each of its signs.
    fn motif(&self) -> Result<(Motif, Vec<[f32; 3]>), Failure> {
        let picture = match self.motif.as_slice() {
            [one] => one.strip_prefix('@').map(PathBuf::from),
            _ => None,
        };
        let keys: Result<Vec<_>, Failure> =
            self.color.iter().map(|text| sign_and_color(text, picture.is_some())).collect();
        let (signs, colors): (Vec<String>, Vec<[f32; 3]>) = keys?.into_iter().unzip();
        if let Some(twice) = (1..signs.len()).find(|&k| signs[..k].contains(&signs[k])) {
            return Err(Failure::Input(format!("error: --color: `{}` stands for two colours", signs[twice])));
        }
        let cells = match picture {
            Some(path) => Cells::Picture(path),
            None => {
                let width = self.motif[0].chars().count();
                for row in &self.motif {
                    let hint = match wrong_row(row, width, signs.iter().map(String::as_str)) {
                        None => continue,
                        Some(WrongRow::Width(problem)) => {
                            (problem, "--motif '.#.' --motif '###', or a picture: --motif @heart.png")
                        }
                        Some(WrongRow::Sign(problem)) => (problem, "--color '.=#f0e8d8' --color '#=#c02a1f'"),
                    };
                    return Err(Failure::hinted(format!("--motif {row}: {}", hint.0), hint.1));
                }
                if self.motif_fit {
                    return Err(Failure::hinted(
                        "--motif-fit fabric is for a picture",
                        "--motif @FILE, or leave it out",
                    ));
                }
                Cells::Signs(self.motif.clone())
            }
        };
        let offset = self.motif_offset.unwrap_or_default();
        Ok((Motif { cells, signs, stretched: self.motif_fit, offset, again: self.motif_repeat }, colors))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_and_colours_are_read() {
        let read = |text: &str, in_picture| sign_and_color(text, in_picture).map(|(sign, _)| sign).map_err(|_| ());
        assert_eq!(read("#=#c02a1f", false), Ok("#".to_owned()));
        assert_eq!(read("==#c02a1f", false), Ok("=".to_owned()));
        assert_eq!(read("#c02a1f", true), Ok("#c02a1f".to_owned()));
        assert_eq!(read("#ff0000=#c02a1f", true), Ok("#ff0000".to_owned()));
        for (text, in_picture) in
            [("#c02a1f", false), ("ab=#c02a1f", false), (".=red", false), ("red", true), ("", true)]
        {
            assert_eq!(read(text, in_picture), Err(()), "{text}");
        }
    }
}
