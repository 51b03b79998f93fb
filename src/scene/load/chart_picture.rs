//! `chart = { image, stitches }`: a chart as knitters draw it, a pixel for each stitch, its steps by a palette.

use std::path::Path;

use glam::Vec3;

use super::{Context, Reader};
use crate::{
    pattern::chart::Chart,
    scene::palette::{self, Pixels},
};

/// A colour of the palette and what it stands for.
struct Symbol {
    /// As pixels are compared with it.
    color: Vec3,
    /// Empty where there is no stitch.
    steps: String,
    /// Stitches that it makes, and so its pixels in a row; 0 where there is no stitch.
    width: usize,
}

/// The rows of the chart, from the cast-on edge; `None` where a mistake is told.
pub(super) fn rows(table: Reader<'_>, context: &Context<'_>) -> Option<Vec<String>> {
    let span = table.span("image").unwrap_or(table.header());
    let path = table.required_string("image").map(|p| context.resolve(p, span));
    let mut symbols: Option<Vec<Symbol>> = Some(Vec::new());
    if let Some(stitches) = table.required_table("stitches") {
        for sign in stitches.keys().collect::<Vec<_>>() {
            let symbol = symbol(&stitches, sign, context);
            symbols = symbols.zip(symbol).map(|(mut all, own)| {
                all.push(own);
                all
            });
        }
        if symbols.as_ref().is_some_and(Vec::is_empty) {
            stitches
                .error("`stitches` names no colour", Some("stitches = { \"#ffffff\" = \"k\", \"#000000\" = \"p\" }"));
            symbols = None;
        }
        stitches.finish();
    } else {
        symbols = None;
    }
    table.finish();
    let path = path?;
    read(&path, &symbols?).map_err(|problem| context.wrong_file(&path, span, problem)).ok()
}

fn symbol(stitches: &Reader<'_>, sign: &str, context: &Context<'_>) -> Option<Symbol> {
    let span = stitches.span(sign).unwrap_or(stitches.header());
    let steps = stitches.string(sign)?.trim().to_owned();
    let Some(color) = palette::color(sign) else {
        context.error(span, format!("`{sign}` is no colour"), Some("as in \"#c02a1f\" = \"k2tog\"".to_owned()));
        return None;
    };
    if steps.is_empty() {
        return Some(Symbol { color, steps, width: 0 });
    }
    match Chart::stitches_of(&steps) {
        Ok(0) => {
            let problem = format!("`{steps}` makes no stitch, which a pixel could stand for");
            context.error(span, problem, Some("add what stands beside it".to_owned()));
            None
        }
        Ok(width) => Some(Symbol { color, steps, width: width as usize }),
        Err(error) => {
            context.error(span, error.problem, Some(error.hint));
            None
        }
    }
}

fn read(path: &Path, symbols: &[Symbol]) -> Result<Vec<String>, String> {
    let colors: Vec<Vec3> = symbols.iter().map(|s| s.color).collect();
    let pixels = Pixels::read(path, &colors)?;
    let width = pixels.width;
    (0..pixels.height)
        .map(|y| {
            let row = pixels.row(y);
            let mut steps: Vec<&str> = Vec::new();
            let mut x = 0;
            while x < width {
                let own = &symbols[row[x]];
                if own.width == 0 {
                    x += 1;
                    continue;
                }
                let run = row[x..].iter().take_while(|s| **s == row[x]).count();
                if run < own.width {
                    return Err(format!(
                        "{}: row {} from the bottom, pixel {} from the left: `{}` makes {} stitches, but there {} of it",
                        path.display(),
                        y + 1,
                        x + 1,
                        own.steps,
                        own.width,
                        if run == 1 { "is 1 pixel".to_owned() } else { format!("are {run} pixels") },
                    ));
                }
                steps.push(&own.steps);
                x += own.width;
            }
            if steps.is_empty() {
                return Err(format!("{}: row {} from the bottom has no stitch", path.display(), y + 1));
            }
            Ok(steps.join(" "))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn symbols() -> Vec<Symbol> {
        let of = |color: [f32; 3], steps: &str| {
            let width = if steps.is_empty() { 0 } else { Chart::stitches_of(steps).unwrap() as usize };
            Symbol { color: palette::seen(color), steps: steps.to_owned(), width }
        };
        vec![
            of([1.0, 1.0, 1.0], "k"),
            of([0.0, 0.0, 0.0], "p"),
            of([1.0, 0.0, 0.0], "c4f"),
            of([0.0, 0.0, 1.0], "k2tog"),
            of([0.0, 1.0, 0.0], ""),
        ]
    }

    fn drawn(rows: &[&str]) -> Result<Vec<String>, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("chart.png");
        // Not quite the colours of the palette.
        let color = |c: char| match c {
            'w' => [250, 252, 249],
            'b' => [9, 4, 0],
            'r' => [240, 10, 12],
            'd' => [5, 8, 250],
            _ => [3, 250, 9],
        };
        let bytes: Vec<u8> = rows.iter().flat_map(|row| row.chars().flat_map(color)).collect();
        crate::testing::write_png(&path, rows[0].len(), png::ColorType::Rgb, &bytes);
        read(&path, &symbols())
    }

    #[test]
    fn pixels_are_stitches_from_the_bottom_row_up() {
        let rows = drawn(&["gwwdwg", "brrrrb", "bwwwwb"]).unwrap();
        assert_eq!(rows, ["p k k k k p", "p c4f p", "k k k2tog k"]);
        assert!(Chart::parse(&rows).is_ok());
    }

    #[test]
    fn what_is_cut_off_is_told() {
        let error = drawn(&["wwwwww", "brrrwb"]).unwrap_err();
        assert!(
            error.ends_with(
                "row 1 from the bottom, pixel 2 from the left: `c4f` makes 4 stitches, but there are 3 pixels of it"
            ),
            "{error}"
        );
        assert!(drawn(&["ww", "gg"]).unwrap_err().ends_with("row 1 from the bottom has no stitch"));
    }
}
