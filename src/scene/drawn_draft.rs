//! Drafts that are pictures, a pixel for each end and pick: the weave that each colour stands for, or the ends that are up.

use std::path::Path;

use glam::Vec3;

use super::palette::Pixels;
use crate::pattern::draft::{Draft, DraftError};

/// What the colours of a picture stand for.
pub(crate) enum Legend {
    /// Weaves, each counted from the picture's lower left corner, so that they run through.
    Weaves(Vec<(Vec3, Draft)>),
    /// The warp on top where a pixel is of this colour, and not of that which differs most from it.
    Up(Vec3),
}

impl Legend {
    /// Whether a weave can be part of a figure.
    ///
    /// # Errors
    /// It is of several layers, twines or has a pile.
    pub(crate) fn suits(name: &str, weave: &Draft) -> Result<(), DraftError> {
        let what = if weave.pile().is_some() {
            "has a pile"
        } else if weave.twines() {
            "twines its warps"
        } else if weave.layers() > 1 {
            "is of several layers"
        } else {
            return Ok(());
        };
        let problem = format!("`{name}` {what}, which a weave of a figure cannot");
        Err(DraftError { problem, hint: "weaves of one layer, as plain, twill 3/1, satin 8, sateen 8".to_owned() })
    }

    /// The draft of a picture.
    ///
    /// # Errors
    /// The picture cannot be read; it has too many pixels. In words, with its path, and a hint.
    pub(crate) fn draft(&self, path: &Path) -> Result<Draft, (String, Option<String>)> {
        let pixels = match self {
            Self::Weaves(weaves) => {
                let colors: Vec<Vec3> = weaves.iter().map(|(color, _)| *color).collect();
                Pixels::read(path, &colors)
            }
            Self::Up(color) => Pixels::read_one(path, *color),
        };
        let pixels = pixels.map_err(|problem| (problem, None))?;
        let rows = |weft: usize| -> Vec<bool> {
            let over = |(warp, number): (usize, &usize)| match self {
                Self::Weaves(weaves) => weaves[*number].1.warp_over(weft, warp),
                Self::Up(_) => *number == 1,
            };
            pixels.row(weft).iter().enumerate().map(over).collect()
        };
        let rows: Vec<Vec<bool>> = (0..pixels.height).map(rows).collect();
        let wrong = |error: DraftError| (format!("{}: {}", path.display(), error.problem), Some(error.hint));
        Draft::of_crossings(&rows).map_err(wrong)
    }
}

#[cfg(test)]
mod tests {
    use super::{super::palette::color, *};
    use crate::testing::write_png;

    /// A picture of rows of signs, the top one first, not quite in the colours of its palette.
    fn picture(rows: &[&str]) -> (tempfile::TempDir, std::path::PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("draft.png");
        let pixel = |c: char| if c == '#' { [180, 30, 36] } else { [250, 252, 249] };
        let bytes: Vec<u8> = rows.iter().flat_map(|row| row.chars().flat_map(pixel)).collect();
        write_png(&path, rows[0].len(), png::ColorType::Rgb, &bytes);
        (folder, path)
    }

    #[test]
    fn each_colour_is_a_weave_that_runs_through() {
        let (_folder, path) = picture(&["..........", "..####....", "..####....", "..####....", "....####.."]);
        let [satin, plain] = ["satin 5", "plain"].map(|name| Draft::named(name).unwrap());
        let legend = Legend::Weaves(vec![
            (color("#ffffff").unwrap(), plain.clone()),
            (color("#b02020").unwrap(), satin.clone()),
        ]);
        let draft = legend.draft(&path).unwrap();
        assert_eq!((draft.warps(), draft.wefts()), (10, 5));
        for (weft, warp) in (0..5).flat_map(|i| (0..10).map(move |j| (i, j))) {
            let figure = if weft == 0 { (4..8).contains(&warp) } else { weft < 4 && (2..6).contains(&warp) };
            let weave = if figure { &satin } else { &plain };
            assert_eq!(draft.warp_over(weft, warp), weave.warp_over(weft, warp), "{weft} {warp}");
        }
    }

    #[test]
    fn a_lift_plan_has_the_warp_up_where_it_is_drawn() {
        let rows = ["#..#", "##..", ".##.", "..##"];
        let (_folder, path) = picture(&rows);
        let draft = Legend::Up(color("#c00000").unwrap()).draft(&path).unwrap();
        assert_eq!(draft, Draft::matrix(&rows).unwrap());
        let draft = Legend::Up(color("#ffffff").unwrap()).draft(&path).unwrap();
        assert!(draft.warp_over(0, 0) && !draft.warp_over(0, 3));
    }

    #[test]
    fn layers_piles_and_twined_warps_are_no_figures() {
        for name in ["double cloth", "leno", "terry", "velvet", "corduroy"] {
            assert!(Legend::suits(name, &Draft::named(name).unwrap()).is_err(), "{name}");
        }
        assert!(Legend::suits("satin 8", &Draft::named("satin 8").unwrap()).is_ok());
    }
}
