//! Short rows: which charts a yarn can go through, what is drawn through what where it turns, and the form of the cloth.

use std::{
    collections::BTreeMap,
    f64::consts::{PI, TAU},
};

use super::{
    super::{
        loops::{Border, Loops, Visit},
        piece::follow::threaded,
    },
    topology::{linked, yarn_of_stitches},
    *,
};
use crate::pattern::{chart::Act, rods::passing::passed};

/// Longer on the right, by as much for each stitch.
const WEDGE: [&str; 12] = ["k", "k", "k", "-4 k12", "-4 k12", "-8 k8", "-8 k8", "-12 k4", "-12 k4", "k", "k", "k"];
/// Longer in the middle.
const DART: [&str; 14] =
    ["k", "k", "k13 -3", "-3 k10 -3", "-3 k8 -5", "-5 k6 -5", "-5 k4 -7", "k9 -7", "k", "k", "k", "k", "k", "k"];

/// Four times as many rows on the right, bound off right above the last of them.
const BAND: [&str; 5] = ["k", "2: -1 k15", "2: -6 k10", "2: -11 k5", "k"];

fn shaped(rows: &[&str]) -> Knit {
    let chart = Chart::parse(rows).unwrap();
    Knit { rows: chart.rows(), chart, ..knit("stockinette", 16, 1) }
}

/// The wedge with wraps, which lie where they are, and with wraps that are picked up: on needles that go to the right too.
const WRAPPED: [&str; 8] = ["k", "k", "-4 sl k11", "-4 slwyif k11", "-8 sl k7", "-8 slwyif k7", "k", "k"];
const PICKED_UP: [&str; 10] =
    ["k", "k", "-3 sl k12", "-3 ds k9 sl -2", "-6 sl k6 ds -2", "-6 ds k3 sl -5", "k10 ds -5", "k", "k", "k"];

/// Points in a frame that stands on the feet of a loop: across, up and out.
fn upright(ring: &[DVec3], points: &[DVec3]) -> Vec<DVec3> {
    let (first, last, head) = (ring[0], ring[ring.len() - 1], ring[ring.len() / 2]);
    let up = (head - 0.5 * (first + last)).normalize();
    let across = (last - first).reject_from_normalized(up).normalize();
    let out = across.cross(up);
    points.iter().map(|p| DVec3::new(p.dot(across), p.dot(up), p.dot(out))).collect()
}

/// Loops that are not drawn through what they should be; of those with others beside them.
pub(super) fn undrawn(piece: &Knit) -> Vec<(i32, i32)> {
    let rows = piece.worked().unwrap();
    let mirrored = super::super::short_rows::from_right(&rows, true);
    let rims = piece.rims;
    let border = Border { round: None, stacked: false, turns: false, finished: true, rims, mirrored, slants: false };
    let backwards = piece.ways(&rows, mirrored)[0].rows.iter().any(|s| s.row == rows.len() as i32 && s.backwards);
    let loops = Loops::bound_off(&rows, piece.stitches as usize, border, backwards, None);
    let mut place = BTreeMap::new();
    for course in &loops.courses {
        for (column, visit) in &course.visits {
            if let Visit::Loop(i) = visit {
                place.insert(*i, (course.row, *column as i32));
            }
        }
    }
    let stitches = yarn_of_stitches(piece, false);
    let get = |(r, k): (i32, i32)| stitches.get(&(r, k)).map(Vec::as_slice);
    let is_drawn = |parent: (i32, i32), (r, k): (i32, i32), sign: i32, is_laid: bool| {
        let [before, own, after] = [k - 1, k, k + 1].map(|k| get((r, k)));
        let (Some(before), Some(own), Some(after), Some(ring)) = (before, own, after, get(parent)) else { return true };
        let end = get((parent.0, parent.1 + 1)).map_or(&ring[..0], |next| &next[..1]);
        let half = own.len() / 2;
        let to = [&before[before.len() / 2..], &own[..=half]].concat();
        let from = [&own[half..], &after[..=after.len() / 2]].concat();
        let ring = [ring, end].concat();
        // What is laid over the needle is open at its foot.
        let passes = |way: &[DVec3]| {
            if is_laid { linked(&upright(&ring, &ring), &upright(&ring, way)) } else { threaded(&ring, way) }
        };
        let found = [passes(&to), passes(&from)];
        if found != [sign, -sign] {
            eprintln!("{:?} of {:?}: {found:?}", (r, k), parent);
        }
        found == [sign, -sign]
    };
    let wrong = |(p, c): &(u32, u32)| {
        let (parent, child) = (&loops.loops[*p as usize], &loops.loops[*c as usize]);
        let sign = child.sign as i32 * if parent.twist == 0.0 { 1 } else { -1 };
        child.row < loops.rows && !is_drawn(place[p], place[c], sign, parent.sign == 0.0 && parent.row >= 0)
    };
    loops.links().iter().filter(|link| wrong(link)).map(|(_, c)| place[c]).collect()
}

#[test]
fn a_yarn_turns_and_all_of_it_is_drawn_through() {
    let charts =
        [("wedge", &WEDGE[..]), ("dart", &DART), ("band", &BAND), ("wrapped", &WRAPPED), ("picked up", &PICKED_UP)];
    for (name, rows) in charts {
        let piece = shaped(rows);
        let mut made = Vec::new();
        let passes = passed(|| made = piece.strands(1.0).unwrap());
        let found = measured(&made);
        eprintln!("{name}: {found:?}");
        assert_eq!((made.len(), passes), (1, 0), "{name}");
        assert_eq!(undrawn(&piece), [], "{name}");
        assert!(found.share <= 0.02, "{name}: {found:?}");
    }
}

/// How often a yarn goes around another, as both are seen from the front.
fn turns_around(way: &[DVec3], leg: &[DVec3]) -> f64 {
    let middle = leg.iter().sum::<DVec3>() / leg.len() as f64;
    let angle = |p: &DVec3| (p.z - middle.z).atan2(p.x - middle.x);
    let by = |w: &[DVec3]| (angle(&w[1]) - angle(&w[0]) + PI).rem_euclid(TAU) - PI;
    way.windows(2).map(by).sum::<f64>() / TAU
}

#[test]
fn a_wrap_lies_around_its_stitch() {
    let piece = shaped(&WRAPPED);
    let stitches = yarn_of_stitches(&piece, true);
    // Behind the stitch on the way there, in front of it on the way back, and around both of its legs.
    for (row, column) in [(2, 4), (4, 8)] {
        let [there, back] = [row, row + 1].map(|r| &stitches[&(r, column)]);
        let own = &stitches[&(row - 1, column)];
        let legs: Vec<DVec3> = own.iter().filter(|p| (p.y - there[there.len() / 2].y).abs() < 1.5).copied().collect();
        let [there_z, back_z, own_z] =
            [&there[..], &back[..], &legs[..]].map(|p| p.iter().map(|p| p.z).sum::<f64>() / p.len() as f64);
        let mut way = there.clone();
        way.reverse();
        way.extend(back);
        let around = turns_around(&way, &legs);
        eprintln!("{there_z:.2} {own_z:.2} {back_z:.2} {around:.2}");
        assert!(there_z < own_z && own_z < back_z && around.abs() > 0.4, "{there_z} {own_z} {back_z} {around}");
    }
}

/// Points of a row, by their columns.
fn row_of(piece: &Knit, row: i32) -> Vec<(f32, DVec3)> {
    let strands = piece.strands(1.0).unwrap();
    let points = strands[0].curve.points.iter().zip(&strands[0].coordinates);
    points.filter(|(_, c)| c[1].floor() as i32 == row).map(|(p, c)| (c[0], *p)).collect()
}

#[test]
fn a_wedge_bends_cloth_in_its_plane_and_a_dart_makes_it_bulge() {
    let direction = |row: &[(f32, DVec3)]| {
        let mean = |from: f32, to: f32| {
            let own: Vec<DVec3> = row.iter().filter(|(c, _)| (from..to).contains(c)).map(|(_, p)| *p).collect();
            own.iter().sum::<DVec3>() / own.len() as f64
        };
        let d = mean(11.0, 14.0) - mean(2.0, 5.0);
        d.y.atan2(d.x).to_degrees()
    };
    let wedge = shaped(&WEDGE);
    let turned = direction(&row_of(&wedge, 11)) - direction(&row_of(&wedge, 0));
    let depth = |piece: &Knit| {
        let strands = piece.strands(1.0).unwrap();
        let z = strands[0].curve.points.iter().map(|p| p.z);
        z.clone().fold(f64::MIN, f64::max) - z.fold(f64::MAX, f64::min)
    };
    let dart = shaped(&DART);
    let (flat, bent, bulged) = (depth(&knit("stockinette", 16, 12)), depth(&wedge), depth(&dart));
    eprintln!("turned by {turned:.1} degrees, {flat:.1} {bent:.1} {bulged:.1} deep");
    // Six rows over 16 stitches: 6 x 2.9 of 16 x 4.15.
    assert!((8.0..20.0).contains(&turned), "{turned}");
    assert!(bent < flat + 2.0 && bulged > flat + 3.0, "{flat} {bent} {bulged}");
}

#[test]
fn rows_that_no_yarn_can_go_through_are_told() {
    let problem = |rows: &[&str], form: Form| {
        let error = Knit { form, ..shaped(rows) }.strands(1.0).unwrap_err();
        (error.line, error.problem)
    };
    for (rows, line, expected) in [
        (&["k", "k6 -4 k6", "k"][..], 1, "row 2 leaves stitches unworked between others"),
        (&["k", "-16", "k"], 1, "row 2 works no stitch"),
        (&["k", "k12 -4", "k"], 2, "row 3 begins beside 0 unworked stitches, but row 2 turned beside 4"),
        (&["k", "-4 k12", "k", "k"], 2, "row 3 begins beside 0 unworked stitches, but row 2 turned beside 4"),
        (&["k", "-4 k12", "-6 k10", "k"], 2, "row 3 begins beside 6 unworked stitches, but row 2 turned beside 4"),
        (&["-2 k12 -2", "k"], 0, "row 1 begins beside 2 unworked stitches, but its yarn hangs at the edge"),
        (&["k", "-4 k12"], 1, "row 2, the last one, turns beside 4 stitches that are to be bound off"),
        (&["k", "-4 k8"], 1, "row 2 is written for 12 stitches, but finds 16"),
        (&["k", "-4 k12", "-4 k12", "k14 k2tog"], 3, "row 4 makes 15 stitches of 16, beside short rows"),
    ] {
        assert_eq!(problem(rows, Form::Flat), (Some(line), expected.to_owned()), "{rows:?}");
    }
    let tube = problem(&["k", "-4 k12", "-4 k12"], Form::Tube);
    assert_eq!(tube, (Some(1), "row 2 leaves stitches unworked in the round".to_owned()));
    let tile = Knit { edges: Edges::Tile, ..shaped(&WEDGE) }.strands(1.0).unwrap_err();
    assert!(tile.problem.contains("short rows"), "{tile}");
}

#[test]
fn short_rows_of_either_side_begin_where_the_yarn_is() {
    // Even rows go to the right unless short rows say otherwise.
    let begins = |rows: &[&str]| super::super::short_rows::from_right(&shaped(rows).worked().unwrap(), true);
    assert!(!begins(&["k12 -4", "k12 -4", "k"]) && begins(&["-4 k12", "-4 k12", "k"]));
    let doubles = |rows: &[&str]| -> Vec<(usize, usize)> {
        let rows = shaped(rows).worked().unwrap();
        let of = |(r, row): (usize, &Vec<Stitch>)| {
            let own = row.iter().enumerate().filter(|(_, s)| s.act == Act::Double);
            own.map(|(k, _)| (r, k)).collect::<Vec<_>>()
        };
        rows.iter().enumerate().flat_map(of).collect()
    };
    assert_eq!(doubles(&["k12 -4", "k12 -4", "k"]), [(1, 11)]);
    assert_eq!(doubles(&["k", "-4 k12", "-4 ds k11", "k"]), [(2, 4)]);
    // A slipped stitch is left as it is.
    assert_eq!(doubles(&["k", "-4 k12", "-4 sl k11", "k"]), []);
}
