use glam::DVec2;

use super::super::{tests::overlap_of, *};
use crate::pattern::draft::Draft;

/// A square piece of cloth with a pile of yarn of radius 1, cut all around.
fn cloth(name: &str) -> (Weave, Vec<PatternStrand>) {
    let draft = Draft::named(name).unwrap();
    let yarns = 24;
    let wefts = if draft.cut_wefts() { 2 * yarns } else { yarns };
    let weave = Weave { warps: Extent::Yarns(yarns), wefts: Extent::Yarns(wefts), ..Weave::of(draft, 1.0) };
    let strands = weave.strands().unwrap();
    (weave, strands)
}

/// Share of the plane well inside of a cloth that is hidden from above by what stands higher than `height`.
fn cover(weave: &Weave, strands: &[PatternStrand], height: f64) -> f64 {
    const ACROSS: usize = 200;
    const BORDER: f64 = 8.0;
    let corner = DVec2::from_array(weave.relax().unwrap().measures().size) * 0.5 - BORDER;
    let cell = corner * 2.0 / ACROSS as f64;
    let mut hidden = vec![false; ACROSS * ACROSS];
    for strand in strands {
        let radii = strand.curve.radii.as_ref().unwrap();
        let pieces = strand
            .curve
            .points
            .windows(2)
            .zip(radii)
            .flat_map(|(pair, radius)| (0..8).map(move |k| (pair[0].lerp(pair[1], f64::from(k) / 8.0), *radius)));
        for (at, radius) in pieces.filter(|(at, _)| at.z > height) {
            let range = |axis: usize| {
                let middle = at.truncate()[axis] + corner[axis];
                let [low, high] = [middle - radius, middle + radius].map(|x| (x / cell[axis]).max(0.0) as usize);
                low.min(ACROSS)..high.min(ACROSS)
            };
            for (x, y) in range(1).flat_map(|y| range(0).map(move |x| (x, y))) {
                let centre = DVec2::new(x as f64 + 0.5, y as f64 + 0.5) * cell - corner;
                hidden[y * ACROSS + x] |= centre.distance(at.truncate()) < radius;
            }
        }
    }
    hidden.iter().filter(|hidden| **hidden).count() as f64 / hidden.len() as f64
}

/// Measured: 0.83 of the ground, 0.006 of the length.
#[test]
fn loops_hide_most_of_the_ground_and_lie_beside_each_other() {
    let (weave, strands) = cloth("terry");
    let (hidden, found) = (cover(&weave, &strands, 3.0), overlap_of(&strands));
    eprintln!("{hidden:.3} hidden, {found:?}");
    assert!(hidden > 0.78, "{hidden}");
    assert!(found.share < 0.02, "{found:?}");
}

/// Loops are not sausages: nowhere much thicker than the yarn, and many times as high as thick.
#[test]
fn loops_open_a_little() {
    let (weave, strands) = cloth("terry");
    let standing = |s: &PatternStrand| s.curve.points.iter().any(|p| p.z > 0.7 * weave.pile_height);
    let mut thickest: f64 = 0.0;
    for strand in strands.iter().filter(|s| standing(s)) {
        let free = strand.curve.points.iter().zip(strand.curve.radii.as_ref().unwrap()).filter(|(p, _)| p.z > 4.0);
        for (at, radius) in free {
            assert!((0.85..1.5).contains(radius), "{radius} at {at}");
            thickest = thickest.max(*radius);
        }
    }
    assert!(thickest > 1.2, "{thickest}");
}

/// Strands have places of their own from the ground to their tips. Measured: 0.08 and 0.02 of the length.
#[test]
fn strands_of_tufts_keep_apart() {
    for (name, most) in [("velvet", 0.1), ("corduroy", 0.04)] {
        let (_, strands) = cloth(name);
        let found = overlap_of(&strands);
        eprintln!("{name}: {found:?}");
        assert!(found.share < most, "{name}: {found:?}");
    }
}

/// A velvet is cut even; a corduroy is a vault over each wale.
#[test]
fn tips_are_cut_to_one_face() {
    for (name, least) in [("velvet", 0.95), ("corduroy", 0.4)] {
        let (weave, strands) = cloth(name);
        let tips: Vec<f64> = strands
            .iter()
            .filter(|s| s.share < 1.0)
            .flat_map(|s| [s.curve.points[0].z, s.curve.points[s.curve.points.len() - 1].z])
            .filter(|z| *z > 0.25 * weave.pile_height)
            .collect();
        let (low, high) = tips.iter().fold((f64::MAX, 0.0f64), |(low, high), &z| (low.min(z), high.max(z)));
        assert!(low > least * high && low < (least + 0.2).min(1.0) * high, "{name}: {low} to {high}");
    }
}

/// What is close together at the ground is so at the tips: no strand crosses another of its leg.
#[test]
fn places_go_to_strands_in_their_order() {
    let (_, strands) = cloth("velvet");
    let tuft: Vec<&PatternStrand> = strands.iter().filter(|s| s.share < 1.0).take(37).collect();
    assert!(tuft.iter().all(|s| s.index == tuft[0].index && (s.share - 1.0 / 37.0).abs() < 1e-9));
    let ends = |s: &PatternStrand| {
        // Side by side where the leg leaves the ground.
        let foot = s.curve.points.iter().position(|p| p.z < 1.8).unwrap();
        (s.curve.points[foot].truncate(), s.curve.points[0].truncate())
    };
    let ends: Vec<_> = tuft.iter().map(|s| ends(s)).collect();
    let pairs = (0..37).flat_map(|i| (0..i).map(move |j| (i, j)));
    let turned = pairs.filter(|&(i, j)| (ends[i].0 - ends[j].0).dot(ends[i].1 - ends[j].1) < -0.05).count();
    assert!(turned < 20, "{turned} of 666 pairs");
}
