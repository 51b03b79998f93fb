//! Blocks of a large repeat, each relaxed beside the others as they are: a Schwarz method (Smith, Bjorstad and Gropp, "Domain
//! Decomposition", 1996). Blocks are coloured as a checkerboard; those of one colour are relaxed at the same time, beside what the
//! other colour came to, so that the same comes of any number of threads. Their borders move from one sweep to the next.

use std::{collections::HashMap, ops::Range};

use rayon::prelude::*;

use super::{
    super::minimize::Search,
    CellOptions,
    beside::Beside,
    energy::{Energy, HELD, PER_NODE, SEARCH, Scratch, minimize_alike},
    parts::Part,
    precondition::{Preconditioner, Stretch},
};

/// About how many warps and wefts a block has.
const BLOCK: usize = 40;
/// Crossings as far as which yarns feel each other, at most.
const MOST_FELT: usize = 6;
/// Pairs of steps that a block remembers.
const MEMORY: usize = 8;

/// A large repeat while it is relaxed.
pub(super) struct Whole<'a> {
    pub(super) energy: Energy<'a>,
    pub(super) options: &'a CellOptions,
    /// All variables of `energy`.
    pub(super) x: Vec<f64>,
    /// A number of what surrounds each crossing; those of the lowest weft first.
    pub(super) kinds: Vec<usize>,
    /// Which crossings stay as they are.
    pub(super) stays: Vec<bool>,
}

/// Some warps and wefts of a repeat, with those around them that they feel.
struct Block {
    /// First warp and weft in the whole.
    first: [usize; 2],
    count: [usize; 2],
    /// Those that are its own, counted from the first.
    own: [Range<usize>; 2],
}

impl Block {
    /// Whether a warp and a weft of it are its own.
    fn owns(&self, place: [usize; 2]) -> bool {
        (0..2).all(|side| self.own[side].contains(&place[side]))
    }
}

/// What of a block is free.
struct Free {
    /// Its first variable in the block and in the whole, for each node.
    nodes: Vec<(usize, usize)>,
    /// For each crossing, those of the lowest weft first, whether there is any.
    crossings: Vec<bool>,
    stretches: Vec<Stretch>,
}

impl Whole<'_> {
    /// Crossings as far as which yarns touch.
    fn felt(&self) -> usize {
        let thickest = |side: usize| {
            self.energy.thickness[side].iter().fold(1.0, |m: f64, t| m.max(*t)) * self.energy.radius[side]
        };
        let spacing = self.energy.spacing(&self.x);
        let reach = 1.6 * (thickest(0) + thickest(1)) / spacing[0].min(spacing[1]);
        (reach.ceil() as usize + 1).min(MOST_FELT)
    }

    /// Blocks of both colours; they may be moved by half of one.
    fn blocks(&self, moved: bool) -> [Vec<Block>; 2] {
        // What acts on a block's own nodes, and what that reaches in turn.
        let margin = 2 * self.felt();
        let along = |side: usize| -> Vec<(usize, usize, Range<usize>)> {
            let whole = self.energy.count[side];
            let pairs = (whole as f64 / (2 * BLOCK) as f64).round() as usize;
            if pairs == 0 || whole / (2 * pairs) + 1 + 2 * margin >= whole {
                return vec![(0, whole, 0..whole)];
            }
            let border = |k: usize| k * whole / (2 * pairs) + if moved { whole / (4 * pairs) } else { 0 };
            let block = |k: usize| {
                let own = border(k + 1) - border(k);
                ((border(k) + whole - margin) % whole, own + 2 * margin, margin..margin + own)
            };
            (0..2 * pairs).map(block).collect()
        };
        let (columns, rows) = (along(0), along(1));
        let mut colors = [const { Vec::new() }; 2];
        for (y, row) in rows.iter().enumerate() {
            for (x, column) in columns.iter().enumerate() {
                let block = Block {
                    first: [column.0, row.0],
                    count: [column.1, row.1],
                    own: [column.2.clone(), row.2.clone()],
                };
                colors[(x + y) % 2].push(block);
            }
        }
        colors
    }

    /// Relaxes each block once by at most so many steps.
    pub(super) fn sweep(&mut self, moved: bool, most: usize) {
        for color in self.blocks(moved) {
            let lines = [0, 1].map(|side| self.energy.out_of_line(side, &self.x));
            let found: Vec<_> = color.par_iter().map(|block| self.relax_block(block, &lines, most)).collect();
            for (at, node) in found.into_iter().flatten() {
                self.x[at..at + PER_NODE].copy_from_slice(&node);
            }
        }
    }

    /// Brings what is alike to its mean.
    pub(super) fn even_out(&mut self) {
        let mut often: HashMap<usize, usize> = HashMap::new();
        self.kinds.iter().for_each(|kind| *often.entry(*kind).or_default() += 1);
        let mut alike: HashMap<[usize; 4], Vec<usize>> = HashMap::new();
        for_nodes(&self.energy, |side, yarn, node| {
            let kinds = self.energy.between(side, yarn, node).map(|crossing| self.kinds[crossing]);
            if !self.stays(side, yarn, node) && kinds.iter().all(|kind| often[kind] > 1) {
                let key = [side, node % self.energy.nodes, kinds[0], kinds[1]];
                alike.entry(key).or_default().push(self.energy.at(side, yarn, node));
            }
        });
        for nodes in alike.values() {
            for c in 0..PER_NODE {
                let mean = nodes.iter().map(|at| self.x[at + c]).sum::<f64>() / nodes.len() as f64;
                nodes.iter().for_each(|at| self.x[at + c] = mean);
            }
        }
    }

    /// The force on each spacing, for each crossing.
    pub(super) fn forces(&self) -> [f64; 2] {
        let force = |block: &Block| {
            let part = Part::of(&self.energy, block.first, block.count);
            let mut energy = self.energy_of(&part);
            let crossings = (0..block.count[1]).flat_map(|weft| (0..block.count[0]).map(move |warp| [warp, weft]));
            energy.counted = crossings.map(|at| block.owns(at)).collect();
            let x = self.variables(block, &energy);
            energy.of_counted(&x, &mut vec![0.0; x.len()], &mut Scratch::default()).1
        };
        let blocks: Vec<Block> = self.blocks(false).into_iter().flatten().collect();
        let forces: Vec<[f64; 2]> = blocks.par_iter().map(force).collect();
        let all = self.kinds.len() as f64;
        [0, 1].map(|side| forces.iter().map(|force| force[side]).sum::<f64>() / all)
    }

    /// Where in the whole the free nodes of a block are, and what they came to.
    fn relax_block(&self, block: &Block, lines: &[Vec<f64>; 2], most: usize) -> Vec<(usize, [f64; PER_NODE])> {
        let part = Part::of(&self.energy, block.first, block.count);
        let mut energy = self.energy_of(&part);
        let Free { nodes, crossings, stretches } = self.free(block, &energy);
        if nodes.is_empty() {
            return Vec::new();
        }
        let around = [0, 1].map(|side| block.count[side] == self.energy.count[side]);
        energy.counted = near(&crossings, block.count, around, self.felt());
        energy.near = near(&energy.counted, block.count, around, self.felt());
        let mut x = self.variables(block, &energy);
        energy.beside = Some(self.beside(block, &energy, &x, lines));
        let mut follows = vec![HELD; x.len()];
        for (free, (at, _)) in nodes.iter().enumerate() {
            (0..PER_NODE).for_each(|c| follows[at + c] = PER_NODE * free + c);
        }
        let mut scratch = Scratch::default();
        let f = |x: &[f64], g: &mut [f64]| energy.value(x, g, &mut scratch);
        let preconditioner = Preconditioner::new(&energy, &stretches, self.energy.spacing(&self.x));
        let search = Search { most, memory: MEMORY, ..SEARCH };
        minimize_alike(&mut x, &follows, f, search, Some(&|v: &mut [f64]| preconditioner.solve(v)));
        nodes.into_iter().map(|(at, there)| (there, std::array::from_fn(|c| x[at + c]))).collect()
    }

    /// That of a block, at the spacings of the whole.
    fn energy_of<'b>(&self, part: &'b Part) -> Energy<'b> {
        let spacing = self.energy.spacing(&self.x).map(|s| Some(s * self.options.unit()));
        part.energy(&CellOptions { spacing, ..self.options.clone() })
    }

    /// Where in the whole a node of a block is.
    fn there(&self, block: &Block, side: usize, yarn: usize, node: usize) -> usize {
        let yarn = (block.first[side] + yarn) % self.energy.count[side];
        let length = self.energy.length(side);
        self.energy.at(side, yarn, (block.first[1 - side] * self.energy.nodes + node) % length)
    }

    fn variables(&self, block: &Block, energy: &Energy<'_>) -> Vec<f64> {
        let mut x = vec![0.0; energy.variables()];
        for_nodes(energy, |side, yarn, node| {
            let (at, there) = (energy.at(side, yarn, node), self.there(block, side, yarn, node));
            x[at..at + PER_NODE].copy_from_slice(&self.x[there..there + PER_NODE]);
        });
        x
    }

    /// What of a block is free: its own nodes but those that stay.
    fn free(&self, block: &Block, energy: &Energy<'_>) -> Free {
        let mut free =
            Free { nodes: Vec::new(), crossings: vec![false; block.count[0] * block.count[1]], stretches: Vec::new() };
        let mut last = None;
        for_nodes(energy, |side, yarn, node| {
            let here = node / energy.nodes;
            let place = if side == 0 { [yarn, here] } else { [here, yarn] };
            let at = [0, 1].map(|s| (block.first[s] + place[s]) % self.energy.count[s]);
            let [own, along] = [at[side], at[1 - side] * energy.nodes + node % energy.nodes];
            if !block.owns(place) || self.stays(side, own, along) {
                return;
            }
            match free.stretches.last_mut() {
                Some(stretch) if last == Some((side, yarn, node)) => stretch.nodes += 1,
                _ => free.stretches.push(Stretch { side, yarn, first: PER_NODE * free.nodes.len(), nodes: 1 }),
            }
            last = Some((side, yarn, node + 1));
            free.nodes.push((energy.at(side, yarn, node), self.energy.at(side, own, along)));
            free.crossings[place[1] * block.count[0] + place[0]] = true;
        });
        free
    }

    /// Whether a node stays as it is.
    pub(super) fn stays(&self, side: usize, yarn: usize, node: usize) -> bool {
        self.energy.between(side, yarn, node).into_iter().all(|crossing| self.stays[crossing])
    }

    fn beside(&self, block: &Block, energy: &Energy<'_>, x: &[f64], lines: &[Vec<f64>; 2]) -> Beside {
        let whole = self.energy.count;
        let aside = [0, 1].map(|side| {
            let places = (0..energy.count[side]).flat_map(|yarn| (0..energy.count[1 - side]).map(move |c| (yarn, c)));
            places.map(|(yarn, c)| energy.aside(side, yarn, c, x)).collect()
        });
        let mut beside = Beside { whole, aside, line: Default::default() };
        for side in 0..2 {
            let around = whole[side] == energy.count[side];
            let before = if around { 0 } else { beside.many(side) - 1 };
            let groups = (0..before + energy.count[side])
                .map(|group| (block.first[side] + group + whole[side] - before) % whole[side]);
            let crossings = |yarn: usize| {
                let along = whole[1 - side];
                (0..energy.count[1 - side]).map(move |c| yarn * along + (block.first[1 - side] + c) % along)
            };
            beside.line[side] = groups.flat_map(crossings).map(|index| lines[side][index]).collect();
        }
        beside
    }
}

fn for_nodes(energy: &Energy<'_>, mut f: impl FnMut(usize, usize, usize)) {
    for side in 0..2 {
        for yarn in 0..energy.count[side] {
            (0..energy.length(side)).for_each(|node| f(side, yarn, node));
        }
    }
}

/// Crossings at most so far from some of a block; a side of it that is whole goes around.
fn near(some: &[bool], count: [usize; 2], around: [bool; 2], far: usize) -> Vec<bool> {
    let spread = |some: &[bool], side: usize| -> Vec<bool> {
        let (along, step) = (count[side], if side == 0 { 1 } else { count[0] });
        let any = |c: usize| {
            let place = c / step % along;
            (0..=2 * far).any(|k| match (place + k).checked_sub(far) {
                Some(at) if at < along => some[c - place * step + at * step],
                _ => around[side] && some[c - place * step + (place + k + far * along - far) % along * step],
            })
        };
        (0..some.len()).map(any).collect()
    };
    // Along the wefts, then across them.
    spread(&spread(some, 0), 1)
}
