//! Double knitting: what is drawn through what in both layers, and in which layer each colour is.

use super::{
    super::piece::follow::threaded,
    topology::{Stitches, stitches_of},
    *,
};
use crate::pattern::rods::passing::passed;

/// A diamond, and rows that change layers as a whole.
const PICTURE: [&str; 9] = [
    "aaaaaaaaaaaa",
    "aaaaaaaaaaaa",
    "aaaaabbaaaaa",
    "aaaabaabaaaa",
    "aababbabbaaa",
    "aaaabaabaaaa",
    "bbbbbbbbbbbb",
    "abababababab",
    "aaaaaaaaaaaa",
];

fn double(rows: &[&str], form: Form) -> Knit {
    let knit = in_colors(rows, form);
    let colors = knit.colors.map(|c| Colors { work: Work::DoubleKnit, ..c });
    Knit { colors, ..knit }
}

/// The stitches of the front and of the back layer, with the last row's chain in both.
fn layers(piece: &Knit, made: &Knitted) -> [Stitches; 2] {
    let colors = piece.colors.as_ref().unwrap();
    let mut layers = [Stitches::new(), Stitches::new()];
    for (yarn, color) in made.colors.iter().enumerate() {
        for ((r, i), points) in stitches_of(piece, made, yarn, true) {
            let edge = r < 0 || r == piece.rows as i32;
            for (side, layer) in layers.iter_mut().enumerate() {
                if r < 0 {
                    // Half of it is of the front layer, half of the back one.
                    let half = points.len() / 2;
                    let own = if side == 0 { &points[..half] } else { &points[half..] };
                    layer.insert((r, i), own.to_vec());
                } else if edge || (colors.of(r, i as u32) == *color) == (side == 0) {
                    layer.insert((r, i), points.clone());
                }
            }
        }
    }
    layers
}

/// How a stitch passes the loop below: on the way to its head, and on the way from there.
fn passes(ring: &Stitches, (r, k): (i32, i32), of: &[Stitches; 2], layer: usize) -> [i32; 2] {
    let below = &ring[&(r - 1, k)];
    let end = if r > 0 { ring[&(r - 1, k + 1)][0] } else { below[below.len() - 1] };
    let ring = [&below[..], &[end]].concat();
    let own = of[layer][&(r, k)].as_slice();
    // The yarn of this stitch has its neighbours where they are nearest.
    let beside = |k: i32, at: DVec3| {
        let ends = |s: &Stitches| s[&(r, k)].iter().map(|p| p.distance(at)).fold(f64::MAX, f64::min);
        if ends(&of[0]) < ends(&of[1]) { of[0][&(r, k)].as_slice() } else { of[1][&(r, k)].as_slice() }
    };
    let (before, after) = (beside(k - 1, own[0]), beside(k + 1, own[own.len() - 1]));
    let half = own.len() / 2;
    // Heads of what binds off lie about each other's feet: there the way begins at the foot before.
    let (begin, end) = match of[0].contains_key(&(r + 1, k)) {
        true => (before.len() / 2, after.len() / 2),
        false => (0, after.len() - 1),
    };
    let to = [&before[begin..], &own[..=half]].concat();
    let from = [&own[half..], &after[..=end]].concat();
    [threaded(&ring, &to), threaded(&ring, &from)]
}

#[test]
fn each_layer_is_plain_knit_with_its_right_side_outside() {
    for form in [Form::Flat, Form::Tube] {
        let piece = double(&PICTURE, form.clone());
        let mut made = None;
        assert_eq!(passed(|| made = piece.knitted(1.0).ok()), 0, "{form:?}");
        let made = made.unwrap();
        assert_eq!(made.colors, [0, 1], "{form:?}");
        let layers = layers(&piece, &made);
        let mut wrong = Vec::new();
        for (r, k) in (0..piece.rows as i32).flat_map(|r| (2..10).map(move |k| (r, k))) {
            for (side, sign) in [(0, 1), (1, -1)] {
                let own = passes(&layers[side], (r, k), &layers, side);
                let other = passes(&layers[1 - side], (r, k), &layers, side);
                if own != [sign, -sign] || other != [0, 0] {
                    wrong.push((side, r, k, own, other));
                }
            }
        }
        assert!(wrong.is_empty(), "{form:?}: {wrong:?}");
    }
}

#[test]
fn both_layers_are_bound_off_together() {
    let piece = double(&PICTURE, Form::Flat);
    let layers = layers(&piece, &piece.knitted(1.0).unwrap());
    let last = piece.rows as i32;
    for k in 2..10 {
        let through = [0, 1].map(|side| passes(&layers[side], (last, k), &layers, side));
        assert_eq!(through, [[1, -1], [1, -1]], "stitch {k}");
    }
}

#[test]
fn the_picture_is_on_the_front_and_exchanged_on_the_back() {
    let piece = double(&PICTURE, Form::Flat);
    let made = piece.knitted(1.0).unwrap();
    let colors = piece.colors.as_ref().unwrap();
    for (yarn, color) in made.colors.iter().enumerate() {
        for ((r, k), points) in stitches_of(&piece, &made, yarn, true) {
            if !(0..piece.rows as i32).contains(&r) || !(1..11).contains(&k) {
                continue;
            }
            // The legs, which are seen.
            let n = points.len();
            let z = (points[n / 4].z + points[3 * n / 4].z) / 2.0;
            assert_eq!(z > 0.0, colors.of(r, k as u32) == *color, "{color} in row {r}, stitch {k}: {z}");
            assert!(z.abs() > 0.8, "{color} in row {r}, stitch {k}: {z}");
        }
    }
}

#[test]
fn yarns_go_around_each_other_at_the_sides() {
    for picture in [["aaaaaaaa"; 6], ["abababab", "babababa", "aabbaaba", "bbaabbaa", "baaabbbb", "bbbbaaaa"]] {
        let piece = double(&picture, Form::Flat);
        let mut made = None;
        assert_eq!(passed(|| made = piece.knitted(1.0).ok()), 0);
        let made = made.unwrap();
        // From the head of the last stitch of a row to that of the first one of the next row.
        let turn = |yarn: usize, r: i32| {
            let k = if r % 2 == 0 { 7 } else { 0 };
            let strand = &made.strands[yarn];
            let at = |r: i32| {
                let own = |c: &[f32; 2]| (c[0].floor() as i32, c[1].floor() as i32) == (k, r) && c[1].fract() > 0.9;
                strand.coordinates.iter().position(own).unwrap()
            };
            strand.curve.points[at(r)..=at(r + 1)].to_vec()
        };
        // Heads of the last row are bound off.
        for r in 0..4 {
            let (a, b) = (turn(0, r), turn(1, r));
            let edge = if r % 2 == 0 { 7 } else { 0 };
            let colors = piece.colors.as_ref().unwrap();
            if colors.of(r, edge) == colors.of(r + 1, edge) {
                assert_eq!(threaded(&a, &b).abs(), 1, "{picture:?} after row {r}");
            } else {
                // They change layers, one to the front and one to the back.
                let from_to = |turn: &[DVec3]| [turn[0].z > 0.0, turn[turn.len() - 1].z > 0.0];
                let (a, b) = (from_to(&a), from_to(&b));
                assert!(a[0] != a[1] && b[0] != b[1] && a[0] != b[0], "{picture:?} after row {r}: {a:?} {b:?}");
            }
        }
    }
}

#[test]
fn it_is_twice_as_thick_as_plain_knit_and_keeps_its_yarns_apart() {
    let thickness = |made: &Knitted| {
        // Away from what ends.
        let inner = |c: &[f32; 2]| (3.0..9.0).contains(&c[0]) && (2.0..7.0).contains(&c[1]);
        let places = || made.strands.iter().flat_map(|s| s.curve.points.iter().zip(&s.coordinates));
        let z = || places().filter(|(_, c)| inner(c)).map(|(p, _)| p.z);
        z().fold(f64::MIN, f64::max) - z().fold(f64::MAX, f64::min) + 1.0
    };
    let live = |knit: Knit| Knit { edges: Edges::Live, ..knit };
    let one = thickness(&live(knit("stockinette", 12, 9)).knitted(1.0).unwrap());
    let solid = thickness(&live(double(&["aaaaaaaaaaaa"; 9], Form::Flat)).knitted(1.0).unwrap());
    eprintln!("thickness {one:.2}, {solid:.2}");
    assert!((solid / one - 2.0).abs() < 0.1, "{one} {solid}");
    for form in [Form::Flat, Form::Tube] {
        let twice = PICTURE.map(|row| row.repeat(2));
        let found =
            measured(&double(&twice.each_ref().map(String::as_str), form.clone()).knitted(1.0).unwrap().strands);
        eprintln!("{form:?}: {found:?}");
        assert!(found.share <= 0.031, "{form:?}: {found:?}");
    }
}

#[test]
fn what_cannot_be_double_knitted_is_refused() {
    let piece = double(&PICTURE, Form::Flat);
    let told = |knit: Knit| knit.knitted(1.0).unwrap_err().problem;
    assert!(told(double(&["abc"], Form::Flat)).contains("two colours"));
    assert!(told(Knit { chart: Chart::named("seed").unwrap(), ..piece.clone() }).contains("stockinette"));
    assert!(told(Knit { edges: Edges::Tile, ..piece.clone() }).contains("tile"));
    let profile = vec![DVec2::new(20.0, 0.0), DVec2::new(20.0, 30.0)];
    assert!(told(Knit { form: Form::Revolution(profile), ..piece }).contains("layers"));
}
