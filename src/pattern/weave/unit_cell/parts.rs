//! Weaves that share one loom: each a periodic cell of its own, all at the same spacings.

use super::{
    super::minimize::Search,
    CellOptions, FIRST_BEAT, MOST_STEPS,
    energy::{Energy, SEARCH, Scratch, minimize_alike},
};
use crate::pattern::draft::Draft;

/// Least share of a cloth by which a part of it counts.
const LEAST_SHARE: f64 = 0.02;
/// How much spacings are changed to see how forces change.
const NUDGE: f64 = 0.002;

/// A part of a cloth, as a repeat.
#[derive(Clone, Debug)]
pub(super) struct Part {
    pub(super) draft: Draft,
    /// Thickness of its warps and wefts.
    pub(super) thickness: [Vec<f64>; 2],
    /// Its share of the cloth.
    pub(super) share: f64,
}

impl Part {
    /// So many warps and wefts of a whole, from `first` on.
    pub(super) fn of(whole: &Energy<'_>, first: [usize; 2], count: [usize; 2]) -> Self {
        let thickness = [0, 1].map(|side| {
            let of = |yarn: usize| whole.thickness[side][(first[side] + yarn) % whole.count[side]];
            (0..count[side]).map(of).collect()
        });
        Self { draft: whole.draft.part(first, count), thickness, share: 1.0 }
    }

    /// What it is relaxed by as a repeat; spacings are those of `options`.
    pub(super) fn energy(&self, options: &CellOptions) -> Energy<'_> {
        let options = CellOptions { thickness: self.thickness.clone(), ..options.clone() };
        Energy::new(&self.draft, &options, options.unit())
    }
}

/// Parts of a cloth, each with what it is relaxed by and its variables.
pub(super) struct Parts<'a> {
    pub(super) energies: Vec<Energy<'a>>,
    /// Of each part, the spacings last.
    pub(super) x: Vec<Vec<f64>>,
    /// How much each counts.
    weights: Vec<f64>,
}

impl<'a> Parts<'a> {
    /// Parts in an open cloth.
    pub(super) fn new(parts: &'a [Part], options: &CellOptions) -> Self {
        let mut energies: Vec<Energy<'a>> = parts.iter().map(|part| part.energy(options)).collect();
        let crossings = |energy: &Energy<'_>| (energy.count[0] * energy.count[1]) as f64;
        let all: f64 = energies.iter().map(crossings).sum();
        let weights =
            energies.iter().zip(parts).map(|(e, part)| part.share.max(LEAST_SHARE) * all / crossings(e)).collect();
        let gear = 0.5 / (all * options.nodes as f64).sqrt();
        energies.iter_mut().for_each(|energy| energy.gear = gear);
        let x = energies.iter().map(|energy| energy.start(None)).collect();
        Self { energies, x, weights }
    }

    /// Lets yarns find their places, then all give way.
    ///
    /// Round yarns first find their places, hardly packed. Where a repeat leaves them a choice, as beside the turns of a
    /// herringbone, the full force would push each aside another way. If one spacing is given, the other would grow far too wide
    /// meanwhile.
    pub(super) fn relax(&mut self, options: &CellOptions) {
        let packed = if options.spacing == [None; 2] { FIRST_BEAT } else { 1.0 };
        let rest: Vec<[f64; 2]> = self.energies.iter().map(|energy| energy.rest).collect();
        for energy in &mut self.energies {
            (energy.rest, energy.beat) = ([0.0; 2], packed * options.beat);
        }
        self.minimize(400);
        for (energy, rest) in self.energies.iter_mut().zip(rest) {
            (energy.rest, energy.beat) = (rest, options.beat);
        }
        self.minimize(MOST_STEPS);
    }

    pub(super) fn spacing(&self) -> [f64; 2] {
        self.energies[0].spacing(&self.x[0])
    }

    /// Takes spacings, and relaxes all parts again by at most so many steps.
    pub(super) fn relax_at(&mut self, spacing: [f64; 2], most: usize) {
        for energy in &mut self.energies {
            (energy.fixed, energy.sett) = (spacing.map(Some), None);
        }
        self.minimize(most);
    }

    fn minimize(&mut self, most: usize) {
        // Nodes of all parts, one after the other, then the spacings of all.
        let (mut x, mut follows) = (Vec::new(), Vec::new());
        for (energy, own) in self.energies.iter().zip(&self.x) {
            let nodes = own.len() - 2;
            let before = follows.iter().max().map_or(0, |m| m + 1);
            x.extend_from_slice(&own[..nodes]);
            follows.extend(energy.alike()[..nodes].iter().map(|i| before + i));
        }
        let nodes = follows.iter().max().map_or(0, |m| m + 1);
        follows.extend([nodes, nodes + 1]);
        let last = &self.x[0];
        x.extend_from_slice(&last[last.len() - 2..]);
        let mut gradients: Vec<Vec<f64>> = self.x.iter().map(|x| vec![0.0; x.len()]).collect();
        let mut scratch: Vec<Scratch> = self.x.iter().map(|_| Scratch::default()).collect();
        let (energies, weights, own) = (&self.energies, &self.weights, &mut self.x);
        let value = |x: &[f64], g: &mut [f64]| {
            hand_out(x, own);
            let (mut sum, mut nodes) = (0.0, g);
            let spacing = nodes.split_off_mut(x.len() - 2..).expect("spacings are last");
            spacing.fill(0.0);
            let rooms = own.iter().zip(&mut gradients).zip(&mut scratch);
            for ((energy, weight), ((own, gradient), scratch)) in energies.iter().zip(weights).zip(rooms) {
                sum += weight * energy.value(own, gradient, scratch);
                let (by_nodes, by_spacing) = gradient.split_at(own.len() - 2);
                let of_part = nodes.split_off_mut(..by_nodes.len()).expect("every part has its nodes");
                of_part.iter_mut().zip(by_nodes).for_each(|(g, by)| *g = weight * by);
                spacing.iter_mut().zip(by_spacing).for_each(|(g, by)| *g += weight * by);
            }
            sum
        };
        minimize_alike(&mut x, &follows, value, Search { most, ..SEARCH }, None);
        hand_out(&x, &mut self.x);
    }

    /// The force on each spacing, for each crossing of the cloth.
    fn forces(&self) -> [f64; 2] {
        let mut forces = [0.0; 2];
        for ((energy, x), weight) in self.energies.iter().zip(&self.x).zip(&self.weights) {
            let (_, by_spacing) = energy.of_counted(x, &mut vec![0.0; x.len()], &mut Scratch::default());
            (0..2).for_each(|side| forces[side] += weight * by_spacing[side]);
        }
        let all: usize = self.energies.iter().map(|e| e.count[0] * e.count[1]).sum();
        forces.map(|force| force / all as f64)
    }

    /// How the forces on spacings change with the part of each that is free to change: columns of a matrix, one for each of
    /// `directions`.
    pub(super) fn stiffness(&mut self, directions: &[[f64; 2]], most: usize) -> Vec<[f64; 2]> {
        let spacing = self.spacing();
        let at_rest = (self.forces(), self.x.clone());
        let column = |direction: &[f64; 2]| {
            let by = NUDGE * spacing[0].max(spacing[1]);
            self.relax_at([0, 1].map(|side| spacing[side] + by * direction[side]), most);
            let forces = self.forces();
            self.x.clone_from(&at_rest.1);
            [0, 1].map(|side| (forces[side] - at_rest.0[side]) / by)
        };
        let columns = directions.iter().map(column).collect();
        self.relax_at(spacing, 0);
        columns
    }
}

/// Gives each part its own of the variables of all: nodes of one part after the other, then the spacings of all.
fn hand_out(x: &[f64], parts: &mut [Vec<f64>]) {
    let (mut nodes, spacing) = x.split_at(x.len() - 2);
    for own in parts {
        let (of_part, rest) = nodes.split_at(own.len() - 2);
        own[..of_part.len()].copy_from_slice(of_part);
        own[of_part.len()..].copy_from_slice(spacing);
        nodes = rest;
    }
}
