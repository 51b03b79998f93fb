//! Edges of panels that are sewn, that are free, and that lie against each other as if they were to be sewn.

use std::collections::BTreeMap;

use glam::DVec3;
use rstar::{
    RTree,
    primitives::{GeomWithData, Line},
};

use super::{
    mesh::panel_in_words,
    panels::Panel,
    surface::{BorderEdge, Pose},
};

/// Free edges that are so near to each other were meant to be sewn, mm.
const NEAR: f64 = 1.0;
/// Shorter pieces of them are not told, mm.
const LEAST: f64 = 10.0;
/// Edges of one panel that are so near in the flat are neighbours, mm.
const BESIDE: f64 = 10.0;
/// More pairs of panels than these are not told.
const MOST: usize = 8;

/// Lengths of all seams and of all free edges, mm as cut; a seam has the length of its mean side.
pub(super) fn lengths(borders: &[Vec<BorderEdge>]) -> [f64; 2] {
    let mut lengths = [0.0; 2];
    for edge in borders.iter().flatten() {
        let length = edge.ends[0].distance(edge.ends[1]);
        match edge.sewn_to {
            Some(_) => lengths[0] += 0.5 * length,
            None => lengths[1] += length,
        }
    }
    lengths
}

/// Says which panels lie along each other and are not sewn: their corners are not quite at the same places, or divide the seam
/// in other ways.
pub(super) fn note_gaps(panels: &[Panel], borders: &[Vec<BorderEdge>], pose: &Pose, notes: &mut Vec<String>) {
    let free: Vec<(usize, &BorderEdge)> = (borders.iter().enumerate())
        .flat_map(|(panel, border)| border.iter().filter(|e| e.sewn_to.is_none()).map(move |e| (panel, e)))
        .collect();
    let ends = |edge: &BorderEdge| edge.vertices.map(|v| pose.vertex(v).0);
    let line = |(i, (_, edge)): (usize, &(usize, &BorderEdge))| {
        let [a, b] = ends(edge).map(|p: DVec3| p.to_array());
        GeomWithData::new(Line::new(a, b), i)
    };
    let tree = RTree::bulk_load(free.iter().enumerate().map(line).collect());
    // Length and widest gap between two panels, measured along the first.
    let mut gaps: BTreeMap<(usize, usize), (f64, f64)> = BTreeMap::new();
    for &(panel, edge) in &free {
        let [a, b] = ends(edge);
        let middle = (0.5 * (a + b)).to_array();
        let apart = |other: usize, mate: &BorderEdge| other != panel || edge.ends[0].distance(mate.ends[0]) > BESIDE;
        let near = tree.locate_within_distance(middle, NEAR * NEAR).filter_map(|line| {
            let (other, mate) = free[line.data];
            let distance = rstar::PointDistance::distance_2(line.geom(), &middle).sqrt();
            (other >= panel && apart(other, mate)).then_some((other, distance))
        });
        if let Some((other, distance)) = near.min_by(|a, b| a.1.total_cmp(&b.1)) {
            let (length, widest) = gaps.entry((panel, other)).or_default();
            *length += a.distance(b);
            *widest = distance.max(*widest);
        }
    }
    let named = |i: usize| {
        let Panel { group, line, .. } = &panels[i];
        let line = if *line > 0 { format!(", line {line}") } else { String::new() };
        format!("{} (number {}{line})", panel_in_words(group), i + 1)
    };
    for ((panel, other), (length, widest)) in gaps.into_iter().filter(|(_, (length, _))| *length >= LEAST).take(MOST) {
        let both = match panel == other {
            true => format!("two edges of {} lie", named(panel)),
            false => format!("{} and {} lie", named(panel), named(other)),
        };
        notes.push(format!(
            "{both} within {widest:.3} mm of each other along {length:.0} mm and are not sewn: give both sides the same \
             corners at the same places"
        ));
    }
}
