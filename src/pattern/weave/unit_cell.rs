//! One repeat of a weave in equilibrium: where its yarns are, how flat, and how close the loom beats them up.
//!
//! An energy is minimised over all nodes of one repeat and its two spacings, with periodic borders:
//! bending and tension of each yarn, contact of crossing and of neighbouring yarns as soft elliptical tubes, the
//! resistance of sections to flattening (area kept), and the force that packs the cloth in its plane. Peirce's crimp
//! balance (h1 + h2 = D, shared by stiffness) and jamming follow from it, and so does what his geometry leaves out: yarns
//! that group, floats that slide over crossings, layers. Lengths here are in mean yarn radii. Large repeats are relaxed part by part
//! (`large`).

mod beside;
mod blocks;
mod contact;
mod cut;
mod energy;
mod large;
mod parts;
mod precondition;
mod regular;
mod rods;
mod spheroid;
mod symmetry;

use glam::DVec3;

use self::{
    energy::Energy,
    parts::{Part, Parts},
};
use super::{
    super::draft::Draft,
    intrusion::{Section, intrusion},
};

/// Distance of yarns, in half their width, at which the reed is full and they lie side by side: what presses harder makes
/// them climb over each other.
const FULL: f64 = 2.04;
/// Crossings from which on a repeat is relaxed part by part: together they would come to their spacings too slowly.
const LARGE: usize = 1024;
/// Most ends and picks of the part that gives the spacings of a repeat without regular ones.
const PART: usize = 24;
/// Most steps of a relaxation.
const MOST_STEPS: usize = 1500;
/// The same where most is at rest when it begins.
const STEPS_BESIDE: usize = 150;
/// Force on each yarn that packs the cloth, unless spacings are given.
pub(super) const BEAT: f64 = 1.0;

/// Share of that force while yarns find their places.
const FIRST_BEAT: f64 = 0.1;

/// What is woven.
#[derive(Clone, Debug)]
pub(super) struct CellOptions {
    /// Radii of warp and weft where they are round.
    pub(super) radius: [f64; 2],
    /// Width over height that a free yarn of each takes in cloth.
    pub(super) aspect: [f64; 2],
    /// The warp's share of the crimp, 0 to 1.
    pub(super) crimp: f64,
    /// Distances of warps and of wefts, where they are given.
    pub(super) spacing: [Option<f64>; 2],
    /// Distance of wefts over that of warps where neither is given; both find their own without it.
    pub(super) sett: Option<f64>,
    /// Force that packs the cloth.
    pub(super) beat: f64,
    /// Nodes of a yarn from one crossing to the next.
    pub(super) nodes: usize,
    /// Thickness of each yarn of the repeat over the mean; empty where all are alike.
    pub(super) thickness: [Vec<f64>; 2],
}

impl CellOptions {
    /// The mean radius, by which all is divided while it is relaxed.
    pub(super) fn unit(&self) -> f64 {
        0.5 * (self.radius[0] + self.radius[1])
    }
}

/// A place of a yarn in the cell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Node {
    /// Sideways from the yarn's own place in an even cloth.
    pub(super) aside: f64,
    /// Above the cloth's middle.
    pub(super) height: f64,
    /// Half width and half height of the section.
    pub(super) axes: [f64; 2],
}

/// One repeat, relaxed; lengths in the unit of the radii.
#[derive(Clone, Debug)]
pub(super) struct UnitCell {
    /// Distance of warps and of wefts.
    pub(super) spacing: [f64; 2],
    /// Nodes from one crossing to the next.
    pub(super) nodes: usize,
    /// For warps and wefts, for each yarn of the repeat: its nodes; node `i * nodes` is at crossing i.
    pub(super) yarns: [Vec<Vec<Node>>; 2],
}

/// The distance at which yarns of a side lie side by side, in the unit of the radii.
pub(super) fn full(draft: &Draft, options: &CellOptions, side: usize) -> f64 {
    FULL * options.radius[side] * options.aspect[side].sqrt() / draft.layers() as f64
}

impl UnitCell {
    /// Relaxes one repeat of `draft`.
    pub(super) fn relax(draft: &Draft, options: &CellOptions) -> Self {
        let simple = draft.layers() == 1 && !draft.twines() && draft.pile().is_none();
        if draft.warps() * draft.wefts() > LARGE && simple {
            return Self::relax_large(draft, options);
        }
        let whole = [Part { draft: draft.clone(), thickness: options.thickness.clone(), share: 1.0 }];
        let mut parts = Parts::new(&whole, options);
        parts.relax(options);
        Self::of(&parts.energies[0], &parts.x[0], options)
    }

    /// Relaxes one repeat of which some nodes are known about: of a `[side, yarn, node]`, and whether it stays there.
    pub(super) fn relax_beside(
        draft: &Draft,
        options: &CellOptions,
        known: impl Fn([usize; 3]) -> Option<(Node, bool)>,
    ) -> Self {
        let energy = Energy::new(draft, options, options.unit());
        let mut x = energy.start(None);
        let held = energy.begin_at(&mut x, options.unit(), known);
        energy.minimize(&mut x, &held, STEPS_BESIDE);
        Self::of(&energy, &x, options)
    }

    fn of(energy: &Energy<'_>, x: &[f64], options: &CellOptions) -> Self {
        let unit = options.unit();
        Self {
            spacing: energy.spacing(x).map(|s| s * unit),
            nodes: options.nodes,
            yarns: [0, 1].map(|side| energy.nodes_of(side, x, unit)),
        }
    }

    /// The deepest that yarns of a mean radius `unit` run into each other, in mean diameters, and the share of their surface
    /// deeper than 5 %.
    pub(super) fn overlap(&self, unit: f64) -> [f64; 2] {
        let (deepest, share) = intrusion(&self.sections(), 0.1 * unit);
        [deepest / (2.0 * unit), share]
    }

    /// The cross-sections of all yarns, with a crossing or more of the next repeats.
    fn sections(&self) -> Vec<Vec<Section>> {
        let mut all = Vec::new();
        for side in 0..2 {
            let (own, other) = (self.yarns[side].len() as i64, self.yarns[1 - side].len() as i64);
            for index in -2..own + 2 {
                let yarn = &self.yarns[side][index.rem_euclid(own) as usize];
                let (from, to) = (-2 * self.nodes as i64, (other + 2) * self.nodes as i64);
                let along = self.spacing[1 - side] / self.nodes as f64;
                let at = |k: i64| {
                    let node = &yarn[k.rem_euclid(yarn.len() as i64) as usize];
                    let (a, b) = (k as f64 * along, index as f64 * self.spacing[side] + node.aside);
                    if side == 0 { DVec3::new(b, a, node.height) } else { DVec3::new(a, b, node.height) }
                };
                all.push(
                    (from..=to)
                        .map(|k| {
                            let tangent = (at(k + 1) - at(k - 1)).normalize();
                            let minor = (DVec3::Z - tangent.z * tangent).normalize();
                            let axes = yarn[k.rem_euclid(yarn.len() as i64) as usize].axes;
                            Section { at: at(k), tangent, minor, axes }
                        })
                        .collect(),
                );
            }
        }
        all
    }

    /// Length of all yarns of a side in one repeat.
    pub(super) fn length(&self, side: usize) -> f64 {
        let along = self.spacing[1 - side] / self.nodes as f64;
        let step = |a: &Node, b: &Node| DVec3::new(along, b.aside - a.aside, b.height - a.height).length();
        let yarn = |y: &Vec<Node>| (0..y.len()).map(|k| step(&y[k], &y[(k + 1) % y.len()])).sum::<f64>();
        self.yarns[side].iter().map(yarn).sum()
    }

    /// Share of the plane that no yarn covers, seen along the normal of the cloth.
    pub(super) fn see_through(&self) -> f64 {
        const CELLS: usize = 24;
        const GOLDEN: f64 = 0.618_033_988_749_895;
        // Where a row or column of samples begins: else the edge of a straight yarn would lie alike in all of them.
        let begin = |step: usize| ((step as f64 + 0.5) * GOLDEN).fract();
        let count = [self.yarns[0].len(), self.yarns[1].len()];
        let size = [count[0] * CELLS, count[1] * CELLS];
        let mut covered = vec![false; size[0] * size[1]];
        for side in 0..2 {
            let n = self.yarns[side][0].len() as f64;
            let along = size[1 - side];
            for (index, yarn) in self.yarns[side].iter().enumerate() {
                for step in 0..along {
                    // Between nodes.
                    let place = (step as f64 + 0.5) / along as f64 * n;
                    let (k, share) = (place as usize, place.fract());
                    let (a, b) = (&yarn[k], &yarn[(k + 1) % yarn.len()]);
                    let mix = |p: f64, q: f64| p + share * (q - p);
                    let middle = index as f64 + mix(a.aside, b.aside) / self.spacing[side];
                    let half = mix(a.axes[0], b.axes[0]) / self.spacing[side];
                    // A sample is at (c + begin) / CELLS.
                    let first = ((middle - half) * CELLS as f64 - begin(step)).ceil() as i64;
                    let last = ((middle + half) * CELLS as f64 - begin(step)).floor() as i64;
                    for c in first..=last.min(first + size[side] as i64) {
                        let across = c.rem_euclid(size[side] as i64) as usize;
                        let cell = if side == 0 { step * size[0] + across } else { across * size[0] + step };
                        covered[cell] = true;
                    }
                }
            }
        }
        covered.iter().filter(|c| !**c).count() as f64 / covered.len() as f64
    }
}
