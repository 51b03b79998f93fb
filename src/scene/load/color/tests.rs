use super::{
    variation::{SHADES, shine},
    *,
};
use crate::{
    input::diagnostic::{SourceId, Sources},
    scene::{
        motif::{Cells, Motif},
        palette::hex,
    },
    testing::write_png,
};

fn span() -> Span {
    let id: SourceId = Sources::new().add_file("s.toml", "");
    Span::whole(id)
}

fn motif(cells: Cells, signs: [&str; 2], stretched: bool) -> NamedMotif {
    let motif = Motif { cells, signs: signs.map(str::to_owned).to_vec(), stretched, offset: [0; 2], again: [true; 2] };
    NamedMotif { motif, names: vec![String::new(); 2], place: None, span: span() }
}

/// The cells of a map as they are seen, the top row first.
fn drawn(map: &CellMap, width: usize, height: usize) -> Vec<String> {
    let sign = |x: usize, y: usize| ['.', '#'][map.at(x as f32 + 0.5, y as f32 + 0.5)];
    (0..height).rev().map(|y| (0..width).map(|x| sign(x, y)).collect()).collect()
}

const LETTER: [&str; 5] = ["####", "#...", "###.", "#...", "#..."];

#[test]
fn a_motif_stands_upright_and_repeats() {
    let rows = LETTER.map(str::to_owned).to_vec();
    let mut letter = motif(Cells::Signs(rows), [".", "#"], false);
    let map = letter.motif.cells([8.0, 5.0], &[0, 1], 0).unwrap();
    assert_eq!(drawn(&map, 4, 5), LETTER);
    assert_eq!(drawn(&map, 8, 1), ["#...#..."]);
    letter.motif.offset = [1, 0];
    let map = letter.motif.cells([8.0, 5.0], &[0, 1], 0).unwrap();
    assert_eq!(drawn(&map, 4, 1), [".#.."]);
    // The same in millimetres, of stitches of 4 x 3.
    letter.place = Some([4.5, -0.5]);
    let map = letter.placed([8.0, 5.0], Some([4.0, 3.0]), &[0, 1], 0).unwrap();
    assert_eq!(drawn(&map, 4, 1), [".#.."]);
    assert!(letter.placed([8.0, 5.0], None, &[0, 1], 0).is_err_and(|problem| problem.contains("`offset`")));
}

#[test]
fn a_motif_tells_where_it_breaks_in_rounds() {
    let rows = LETTER.map(str::to_owned).to_vec();
    let mut letter = motif(Cells::Signs(rows), [".", "#"], false);
    let breaks = |letter: &NamedMotif, widths: &[u32]| {
        letter.motif.cells([48.0, 8.0], &[0, 1], 0).unwrap().breaks_in_rounds(widths)
    };
    assert_eq!(breaks(&letter, &[48; 8]), None);
    let told = breaks(&letter, &[48, 46]).expect("it breaks");
    assert!(told.contains("4 stitches wide") && told.contains("round 2 of 46") && told.contains("44 or 48"), "{told}");
    assert!(breaks(&letter, &[3]).expect("it is wider").ends_with("; 4 would hold it"));
    // A round of one yarn does not show it, and what does not begin anew has no seam.
    assert_eq!(breaks(&letter, &[48, 48, 48, 48, 46]), None);
    letter.motif.again = [false, true];
    assert_eq!(breaks(&letter, &[46; 8]), None);
}

#[test]
fn an_image_stands_upright_and_is_averaged_where_it_is_finer_than_the_stitches() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("letter.png");
    let (w, h) = (4u32, 5u32);
    let mut bytes = Vec::new();
    for y in 0..3 * h {
        for x in 0..3 * w {
            let red = LETTER[(y / 3) as usize].as_bytes()[(x / 3) as usize] == b'#';
            // A stray pixel in the middle of each cell must not matter.
            let red = red != (x % 3 == 1 && y % 3 == 1);
            bytes.extend(if red { [190, 30, 30] } else { [250, 250, 240] });
        }
    }
    write_png(&path, 3 * w as usize, png::ColorType::Rgb, &bytes);
    let stretched = motif(Cells::Picture(path.clone()), ["#ffffff", "#c02020"], true);
    let map = stretched.motif.cells([4.0, 5.0], &[0, 1], 0).unwrap();
    assert_eq!(drawn(&map, 4, 5), LETTER);
    let pixels = motif(Cells::Picture(path), ["#ffffff", "#c02020"], false);
    let map = pixels.motif.cells([4.0, 5.0], &[0, 1], 0).unwrap();
    assert_eq!(drawn(&map, 12, 15)[0], "#.##.##.##.#".replace('.', "#"));
    assert_eq!(drawn(&map, 12, 15)[1], "#.##.##.##.#");
    let absent = motif(Cells::Picture(folder.path().join("no.png")), ["#ffffff", "#000000"], true);
    assert!(absent.motif.cells([4.0, 5.0], &[0, 1], 0).is_err());
}

#[test]
fn colours_are_read_as_they_are_written() {
    assert_eq!(hex("#ff0080"), Some([1.0, 0.0, 128.0 / 255.0]));
    assert!(["ff0080", "#ff008", "#ff00zz", "#ffé08"].into_iter().all(|t| hex(t).is_none()));
}

#[test]
fn shades_have_the_spread_that_is_asked_for() {
    let variation = Variation { seed: 1, radius: 0.0, phase: 0.0, color: 0.1, tension: 0.0 };
    let all: Vec<f64> = (0..SHADES).map(|s| f64::from(shine(variation, s))).collect();
    let mean = all.iter().sum::<f64>() / all.len() as f64;
    let deviation = (all.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / all.len() as f64).sqrt();
    assert!((mean - 1.0).abs() < 1e-3 && (deviation - 0.1).abs() < 2e-3, "{mean} {deviation}");
}
