//! A chain of loops, as it runs along edges.

use glam::{DVec2, DVec3};

use super::TileStrand;
use crate::pattern::{
    StrandKind,
    relax::{Ends, Relaxation, Rope},
};

/// One link of a chain of loops, each drawn through the one before, as it relaxes with links `link` apart: control points
/// of a B-spline in yarn diameters, x along the chain, y across, z out of the front, where loops lie as a row of V. The
/// next link is the same, `link` further on.
pub fn chain(link: f64) -> Vec<DVec3> {
    const LINKS: usize = 4;
    const POINTS: usize = 16;
    // Out of the loop before, along the front, round, back, and behind to the next.
    let way = [
        [0.3, -0.3, 0.0],
        [0.8, -0.8, 0.8],
        [0.5 * link + 0.4, -1.0, 0.95],
        [link + 0.5, -0.95, 0.5],
        [link + 1.15, -0.35, 0.2],
        [link + 1.15, 0.35, 0.2],
        [link + 0.5, 0.95, 0.5],
        [0.5 * link + 0.4, 1.0, 0.95],
        [0.8, 0.8, 0.8],
        [0.3, 0.3, 0.0],
        [0.2, 0.2, -0.8],
        [0.6 * link, 0.0, -0.9],
    ];
    let period = DVec2::new(LINKS as f64 * link, 20.0);
    let strand = TileStrand {
        kind: StrandKind::Course,
        index: 0,
        points: (0..LINKS).flat_map(|k| way.map(|[x, y, z]| DVec3::new(x + k as f64 * link, y, z))).collect(),
        step: [1, 0],
        radius: 0.5,
        half_width: 1.0,
        sections: Vec::new(),
        coordinates: Vec::new(),
    };
    let places = strand.evenly(LINKS * 2 * POINTS, period);
    let points = places.iter().map(|p| strand.at(p.floor() as isize, p.fract(), period)).collect();
    let fine = TileStrand { points, ..strand };
    let length = fine.length(period);
    let count = fine.points.len();
    let rope = Rope {
        pinned: vec![false; count],
        ends: Ends::Joined(fine.jump(period)),
        rest: length / count as f64,
        points: fine.points.clone(),
    };
    let mut relaxation = Relaxation { ropes: vec![rope], period: Some(period), shear: 0.0 };
    relaxation.run(300, |_| {});
    let relaxed = TileStrand { points: relaxation.ropes.swap_remove(0).points, ..fine };
    let places = relaxed.evenly(LINKS * POINTS, period);
    relaxed.spline(&places, period).into_iter().take(POINTS).collect()
}
