//! Packings, and what is measured of them against other packings.

use glam::DMat2;

use super::{lines::Lines, measure::squeezed, *};
use crate::geometry::{density::KnownPacking, fiber::yielding::Ellipse, gaps::PlyGaps, ply::PlyShape};

/// Sections of other packings than are measured.
pub(super) fn other_sections(count: u32, density: f64, stretch: f64) -> Vec<Vec<DVec2>> {
    let share = (density / f64::from(count)).sqrt();
    let radius = share / (1.0 - share);
    let packings = (500..620).map(|seed| hard_discs(count, radius, Twist::NONE, &mut Stream::new(seed)));
    match Ellipse::of(DMat2::from_diagonal(DVec2::new(stretch, 1.0))) {
        None => packings.collect(),
        Some(ellipse) => {
            packings.flat_map(|discs| squeezed(&discs, share, &Slopes::NONE, &ellipse).collect::<Vec<_>>()).collect()
        }
    }
}

/// A ply whose fibres are packed as measured, and lines through it.
pub(super) fn measured_ply(count: u32, density: f64, stretch: f64, known: KnownPacking) -> (Lines, PlyShape) {
    let share = (density / f64::from(count)).sqrt();
    let radius = share / (1.0 - share);
    let lines = Lines { radius, stretch, slopes: Slopes::NONE };
    let mut ply = lines.ply(count);
    ply.pack(&measured(count, radius, Twist::NONE, stretch, known));
    (lines, ply)
}

#[test]
fn discs_do_not_overlap_and_fill_the_core_evenly() {
    for (count, density) in [(2u32, 0.3f64), (33, 0.25), (70, 0.5), (150, 0.7), (1000, 0.6)] {
        let fiber = (density / f64::from(count)).sqrt();
        let radius = fiber / (1.0 - fiber);
        let (mut inner, mut total) = (0.0, 0.0);
        for seed in 0..(3000 / count).clamp(3, 40) {
            let discs = hard_discs(count, radius, Twist::NONE, &mut Stream::new(seed));
            assert_eq!(discs.len(), count as usize);
            for (i, a) in discs.iter().enumerate() {
                assert!(a.length() <= 1.0 + 1e-12);
                for b in &discs[..i] {
                    let gap = a.distance(*b) / (2.0 * radius);
                    assert!(gap > 0.999_99, "{count} discs at {density}: {gap}");
                }
            }
            inner += discs.iter().filter(|d| d.length_squared() < 0.5).count() as f64;
            total += f64::from(count);
        }
        // Half of the core's area holds about half of the centres; discs line up at the wall when dense.
        let share = inner / total;
        assert!(count < 10 || (0.44..0.56).contains(&share), "{count} discs at {density}: {share}");
    }
}

#[test]
fn too_many_discs_overlap_and_do_not_hang() {
    for (count, radius) in [(50, 0.5), (3, 10.0), (0, 0.1), (1, 2.0), (400, 1e-9)] {
        let discs = hard_discs(count, radius, Twist::NONE, &mut Stream::new(7));
        assert_eq!(discs.len(), count as usize);
        assert!(discs.iter().all(|d| d.is_finite() && d.length() <= 1.0 + 1e-12));
    }
}

#[test]
fn crowding_is_that_of_many_packings_and_falls_with_the_discs() {
    let of = |count: u32, density: f64| {
        let fiber = (density / f64::from(count)).sqrt();
        (count, fiber / (1.0 - fiber))
    };
    for (count, radius) in [of(33, 0.25), of(70, 0.5)] {
        let many: Vec<f64> = (1000..1060)
            .flat_map(|seed| hard_discs(count, radius, Twist::NONE, &mut Stream::new(seed)))
            .map(|at| at.length_squared())
            .collect();
        let want = 2.0 * many.iter().sum::<f64>() / many.len() as f64 - 1.0;
        let got = measured(count, radius, Twist::NONE, 1.0, KnownPacking::default()).crowding;
        assert!((got - want).abs() < 0.03, "{count}: {got}, not {want}");
    }
    let (few, radius) = of(100, 0.5);
    let (many, smaller) = of(10_000, 0.5);
    let crowding = |count, radius| measured(count, radius, Twist::NONE, 1.0, KnownPacking::default()).crowding;
    assert!(crowding(many, smaller).abs() < 0.5 * crowding(few, radius).abs() + 0.01);
    assert_eq!(crowding(0, 0.1), 0.0);
    assert!(crowding(1, 1.0).is_finite() && crowding(u32::MAX, 1e-9).is_finite());
}

#[test]
fn lines_pass_loose_packings_more_regularly_than_dense_ones_that_are_pushed_apart() {
    let of = |count: u32, density: f64| {
        let fiber = (density / f64::from(count)).sqrt();
        measured(count, fiber / (1.0 - fiber), Twist::NONE, 1.0, KnownPacking::default()).regularity
    };
    let (loose, dense) = (of(100, 0.2), of(100, 0.6));
    assert!((1.2..1.7).contains(&loose) && (0.4..1.1).contains(&dense), "{loose} {dense}");
    // Thin fibres are packed as fewer thick ones of the same share.
    assert!((of(10_000, 0.4) - of(1_000, 0.4)).abs() < 1e-9);
}

#[test]
fn lines_by_the_rim_meet_as_many_fibers_as_in_packings_and_pass_as_much() {
    // Others than those that are measured, down to one fibre and a half below the rim.
    for (count, density) in [(78u32, 0.2f64), (78, 0.4), (78, 0.6), (60, 0.35), (25, 0.5), (200, 0.55)] {
        let (lines, ply) = measured_ply(count, density, 1.0, KnownPacking::default());
        let radius = lines.radius;
        let packings: Vec<_> =
            (500..560).map(|seed| hard_discs(count, radius, Twist::NONE, &mut Stream::new(seed))).collect();
        let offsets: Vec<f64> = (0..15).map(|k| 1.0 + radius * (0.9 - 0.2 * f64::from(k))).collect();
        let (mut met, mut clear, mut looks) = (vec![0.0; 15], vec![0.0; 15], 0.0);
        lines.look(&packings, &offsets, |_, counts| {
            looks += 1.0;
            for (k, count) in counts.iter().enumerate() {
                met[k] += count.fibers;
                clear[k] += f64::from(u8::from(count.fibers == 0.0));
            }
        });
        let (mut off, mut passed, mut found, mut want) = (0.0, 0.0, 0.0, 0.0);
        for (k, offset) in offsets.iter().enumerate() {
            let (chord, length) = lines.chord(&ply, 0, *offset);
            let (model, counted) = ((-lines.met(&chord)).exp(), (-met[k] / looks).exp());
            off += (model - counted).abs();
            passed += counted;
            let gaps = PlyGaps::new(ply.dead_zone(&chord, *offset as f32, length));
            found += f64::from(gaps.unscattered(lines.met(&chord) as f32));
            want += clear[k] / looks;
        }
        // By one number, the second moment, .05 to .25 off.
        assert!(off < 0.08 * passed, "{count} at {density}: {off} of {passed}");
        assert!((found / want - 1.0).abs() < 0.16, "{count} at {density}: {found} {want}");
    }
}

#[test]
fn packings_that_give_way_are_measured_as_they_lie_then() {
    let of = |density: f64, stretch: f64| {
        let fiber = (density / 70.0).sqrt();
        measured(70, fiber / (1.0 - fiber), Twist::NONE, stretch, KnownPacking::default())
    };
    for density in [0.25, 0.5] {
        let (round, nearly, flat) = (of(density, 1.0), of(density, 1.01), of(density, 2.0));
        assert!((round.crowding - nearly.crowding).abs() < 0.01, "{round:?} {nearly:?}");
        assert!((round.regularity - nearly.regularity).abs() < 0.15, "{round:?} {nearly:?}");
        assert!((round.crowding - flat.crowding).abs() < 0.04, "{round:?} {flat:?}");
    }
    // Dense ones that were only pushed apart are in better order when they have given way to each other.
    assert!(of(0.5, 1.5).regularity > of(0.5, 1.0).regularity);
    assert!(
        measured(1, 1.0, Twist::NONE, 4.0, KnownPacking::default()).crowding.is_finite()
            && measured(3, 0.9, Twist::NONE, 100.0, KnownPacking::default()).regularity.is_finite()
    );
}

#[test]
fn a_seed_gives_one_packing() {
    let make = |seed| hard_discs(40, 0.08, Twist::NONE, &mut Stream::new(seed));
    assert_eq!(make(5), make(5));
    assert_ne!(make(5), make(6));
}
