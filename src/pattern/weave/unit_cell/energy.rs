//! The energy of a repeat by the places and sections of its nodes and by its spacings, with its gradient.

use glam::DVec3;

use super::{
    super::minimize::{Precondition, Search, minimize},
    CellOptions, Node,
    beside::Beside,
    cut::Cut,
    full,
    spheroid::Spheroid,
};
use crate::pattern::draft::Draft;

/// Resistance of a section to being flattened, energy per crossing and squared logarithm of its width.
const SECTION: f64 = 20.0;
/// The same of yarns that stay round.
const ROUND: f64 = 2000.0;
/// Resistance to spacings below what fills the reed.
const WALL: f64 = 200.0;
/// Distance of wefts over that of warps, or the other way round, from which on one side hides the other.
const DENSE: f64 = 1.99;
/// Distance of such a side's yarns over that at which they lie side by side: floats lie upon each other where they dip, and
/// hide what crosses them.
const CLOSE: f64 = 0.75;
/// A yarn's node in the vector of variables: `[aside, height, ln(width / round)]`.
pub(super) const PER_NODE: usize = 3;
/// What a variable follows that stays as it is.
pub(super) const HELD: usize = usize::MAX;
/// Root mean square of the forces of what is at rest.
const AT_REST: f64 = 1e-3;
/// How equilibrium is looked for.
pub(super) const SEARCH: Search = Search { tolerance: AT_REST, longest: 0.3, most: 0, memory: 12 };

pub(super) struct Energy<'a> {
    pub(super) draft: &'a Draft,
    /// Mean of each side, in mean radii.
    pub(super) radius: [f64; 2],
    /// Thickness of each yarn over the mean of its side.
    pub(super) thickness: [Vec<f64>; 2],
    pub(super) rest: [f64; 2],
    /// Tension and bending of warp and weft relative to the mean.
    pub(super) stiffness: [f64; 2],
    /// Resistance of sections to being flattened.
    pub(super) section: f64,
    pub(super) beat: f64,
    pub(super) nodes: usize,
    pub(super) count: [usize; 2],
    pub(super) fixed: [Option<f64>; 2],
    /// Distance of wefts over that of warps, where it is fixed.
    pub(super) sett: Option<f64>,
    /// Spacings at which the reed is full.
    pub(super) densest: [f64; 2],
    /// How much a variable of spacing moves it.
    pub(super) gear: f64,
    /// What lies around a window of a larger repeat.
    pub(super) beside: Option<Beside>,
    /// For each crossing, those of the lowest weft first, whether what is there counts; all does where this is empty.
    pub(super) counted: Vec<bool>,
    /// The same of what is so near to these that it may touch them.
    pub(super) near: Vec<bool>,
}

#[derive(Clone, Copy, Default)]
pub(super) struct Tangent {
    pub(super) unit: DVec3,
    /// Length of the way from the node before to the one after.
    pub(super) length: f64,
}

/// Room that is used again by each evaluation of the energy.
#[derive(Default)]
pub(super) struct Scratch {
    tangents: Vec<Tangent>,
    axes: Vec<[f64; 2]>,
    spheroids: Vec<Spheroid>,
    cuts: Vec<Cut>,
    by_tangent: Vec<DVec3>,
    headings: Vec<f64>,
}

/// What the gradient of the energy is gathered in.
pub(super) struct Gradient<'a> {
    pub(super) nodes: &'a mut [f64],
    pub(super) spacing: [f64; 2],
    pub(super) tangents: &'a mut [DVec3],
    /// By the angle of each node's tangent in the plane.
    pub(super) headings: &'a mut [f64],
}

/// From along, aside and height of a warp or a weft to x, y, z.
pub(super) fn world(side: usize, [along, aside, height]: [f64; 3]) -> DVec3 {
    if side == 0 { DVec3::new(aside, along, height) } else { DVec3::new(along, aside, height) }
}

pub(super) fn local(side: usize, v: DVec3) -> [f64; 3] {
    if side == 0 { [v.y, v.x, v.z] } else { [v.x, v.y, v.z] }
}

impl<'a> Energy<'a> {
    /// What is minimised for one repeat of `draft`, in lengths of `unit`.
    pub(super) fn new(draft: &'a Draft, options: &CellOptions, unit: f64) -> Self {
        let count = [draft.warps(), draft.wefts()];
        let crimp = options.crimp.clamp(0.04, 0.96);
        let total = count[0] * count[1] * options.nodes;
        let mut energy = Self {
            draft,
            radius: options.radius.map(|r| r / unit),
            thickness: [0, 1].map(|side| match options.thickness[side].as_slice() {
                [] => vec![1.0; count[side]],
                given => given.to_vec(),
            }),
            rest: options.aspect.map(|a| 0.5 * a.ln()),
            // The stiffer side bends less: h1 / h2 = B2 / B1.
            stiffness: [2.0 * (1.0 - crimp), 2.0 * crimp],
            // What shall stay round does not give way.
            section: if options.aspect == [1.0; 2] { ROUND } else { SECTION },
            beat: options.beat,
            nodes: options.nodes,
            count,
            fixed: options.spacing.map(|s| s.map(|s| s / unit)),
            sett: options.sett.filter(|_| options.spacing == [None; 2] && !draft.twines()),
            densest: [0, 1].map(|side| full(draft, options, side) / unit),
            gear: 0.5 / (total as f64).sqrt(),
            beside: None,
            counted: Vec::new(),
            near: Vec::new(),
        };
        let floats = |sett: &f64| !(1.0 / DENSE..DENSE).contains(sett) && draft.pile().is_none();
        // What is round does not give way.
        if let Some(sett) = energy.sett.filter(floats).filter(|_| options.aspect != [1.0; 2]) {
            // Ends of a satin are set so close that they hide where one of them dips: the wall would keep them apart.
            let side = usize::from(sett < 1.0);
            let close = CLOSE * energy.densest[side];
            energy.fixed = [1.0, sett].map(|share| Some(share * if side == 0 { close } else { close / sett }));
            energy.sett = None;
        }
        if draft.twines() {
            // An open cloth: warps in pairs, hardly flattened, and room for a warp to pass between wefts.
            let [warp, weft] = energy.radius;
            energy.densest = [3.4 * warp, 3.4 * warp + 3.0 * weft];
            energy.rest[0] *= 0.3;
        }
        energy
    }

    /// Variables to start from: every yarn in its dent, above and below the others as the draft says, in an open cloth
    /// or in one of these spacings.
    pub(super) fn start(&self, spacing: Option<[f64; 2]>) -> Vec<f64> {
        let mut x = vec![0.0; self.variables()];
        let half = 0.5 * (self.radius[0] + self.radius[1]);
        for side in 0..2 {
            for (yarn, node) in (0..self.count[side]).flat_map(|y| (0..self.length(side)).map(move |n| (y, n))) {
                let over = |crossing: usize| {
                    let crossing = crossing % self.count[1 - side];
                    let (weft, warp) = if side == 0 { (crossing, yarn) } else { (yarn, crossing) };
                    if self.draft.warp_over(weft, warp) == (side == 0) { half } else { -half }
                };
                let share = (node % self.nodes) as f64 / self.nodes as f64;
                let smooth = 0.5 - 0.5 * (std::f64::consts::PI * share).cos();
                let crossing = node / self.nodes;
                x[self.at(side, yarn, node) + 1] = over(crossing) * (1.0 - smooth) + over(crossing + 1) * smooth;
            }
        }
        let n = x.len();
        for (x, spacing) in x[n - 2..].iter_mut().zip(spacing.unwrap_or([4.4 * half; 2])) {
            *x = spacing / self.gear;
        }
        if self.draft.twines() {
            self.twine(&mut x);
        }
        x
    }

    /// Leads every even warp from one side of its right neighbour to the other after each weft, below it.
    fn twine(&self, x: &mut [f64]) {
        let r = self.radius[0];
        // Both move from their dents to the middle between them.
        let together = 0.5 * self.spacing(x)[0];
        for warp in (0..self.count[0]).step_by(2) {
            for k in 0..self.length(0) {
                let turn = std::f64::consts::PI * k as f64 / self.nodes as f64;
                let (crossing, straight) = (self.at(0, warp, k), self.at(0, warp + 1, k));
                x[crossing] = together - 2.2 * r * turn.cos();
                x[straight] = -together;
                // At the top over each weft, at the bottom between two.
                x[crossing + 1] = 2.6 * r * (2.0 * turn).cos();
                x[straight + 1] = -r;
            }
        }
    }

    /// Puts nodes that are known, in lengths of which `unit` is one here, where they are; all others are as flat as at rest.
    /// Gives which variables stay.
    pub(super) fn begin_at(
        &self,
        x: &mut [f64],
        unit: f64,
        known: impl Fn([usize; 3]) -> Option<(Node, bool)>,
    ) -> Vec<bool> {
        let mut held = vec![false; x.len()];
        for side in 0..2 {
            for (yarn, node) in (0..self.count[side]).flat_map(|y| (0..self.length(side)).map(move |n| (y, n))) {
                let at = self.at(side, yarn, node);
                x[at + 2] = self.rest[side];
                if let Some((node, stays)) = known([side, yarn, node]) {
                    x[at] = node.aside / unit;
                    x[at + 1] = node.height / unit;
                    x[at + 2] = (node.axes[0] / unit / self.round(side, yarn)).ln().max(0.0);
                    held[at..at + PER_NODE].fill(stays);
                }
            }
        }
        held
    }

    /// Makes the energy least by at most so many steps, where what is alike stays alike and what is `held`, if anything, as it
    /// is.
    pub(super) fn minimize(&self, x: &mut [f64], held: &[bool], most: usize) {
        let alike = if held.is_empty() {
            self.alike()
        } else {
            let mut free = 0..;
            held.iter().map(|held| if *held { HELD } else { free.next().unwrap_or(HELD) }).collect()
        };
        // What is held counts as at rest.
        let free = alike.iter().filter(|&&i| i != HELD).count().max(1);
        let tolerance = AT_REST * if held.is_empty() { 1.0 } else { (x.len() as f64 / free as f64).sqrt() };
        let mut scratch = Scratch::default();
        let f = |x: &[f64], g: &mut [f64]| self.value(x, g, &mut scratch);
        minimize_alike(x, &alike, f, Search { tolerance, most, ..SEARCH }, None);
    }

    /// The nodes of the yarns of a side.
    pub(super) fn nodes_of(&self, side: usize, x: &[f64], unit: f64) -> Vec<Vec<Node>> {
        let node = |yarn: usize, node: usize| {
            let at = self.at(side, yarn, node);
            let axes = self.axes(side, yarn, x[at + 2].max(0.0));
            Node { aside: x[at] * unit, height: x[at + 1] * unit, axes: axes.map(|v| v * unit) }
        };
        let yarn = |yarn: usize| (0..self.length(side)).map(|n| node(yarn, n)).collect();
        (0..self.count[side]).map(yarn).collect()
    }

    /// Nodes of one yarn of a side.
    pub(super) fn length(&self, side: usize) -> usize {
        self.count[1 - side] * self.nodes
    }

    fn base(&self, side: usize) -> usize {
        if side == 0 { 0 } else { PER_NODE * self.count[0] * self.length(0) }
    }

    pub(super) fn at(&self, side: usize, yarn: usize, node: usize) -> usize {
        self.base(side) + PER_NODE * (yarn * self.length(side) + node)
    }

    pub(super) fn variables(&self) -> usize {
        self.base(1) + PER_NODE * self.count[1] * self.length(1) + 2
    }

    pub(super) fn spacing(&self, x: &[f64]) -> [f64; 2] {
        let n = x.len();
        if let Some(sett) = self.sett {
            return [1.0, sett].map(|share| share * x[n - 2] * self.gear);
        }
        [0, 1].map(|side| self.fixed[side].unwrap_or(x[n - 2 + side] * self.gear))
    }

    pub(super) fn value(&self, x: &[f64], g: &mut [f64], scratch: &mut Scratch) -> f64 {
        let (sum, by_spacing) = self.of_counted(x, g, scratch);
        let n = g.len();
        if let Some(sett) = self.sett {
            g[n - 2] = (by_spacing[0] + sett * by_spacing[1]) * self.gear;
            g[n - 1] = 0.0;
            return sum;
        }
        for side in 0..2 {
            g[n - 2 + side] = if self.fixed[side].is_some() { 0.0 } else { by_spacing[side] * self.gear };
        }
        sum
    }

    /// The energy of what is counted, with its derivatives by the spacings; fills its gradient by the nodes.
    pub(super) fn of_counted(&self, x: &[f64], g: &mut [f64], scratch: &mut Scratch) -> (f64, [f64; 2]) {
        g.fill(0.0);
        let spacing = self.spacing(x);
        self.sections(x, spacing, scratch);
        let Scratch { tangents, axes, spheroids, cuts, by_tangent, headings } = scratch;
        let mut gradient = Gradient { nodes: g, spacing: [0.0; 2], tangents: by_tangent, headings };
        let yarns = match self.counted.as_slice() {
            [] => (self.count[0] * self.count[1]) as f64,
            counted => counted.iter().filter(|counts| **counts).count() as f64,
        };
        let mut sum = 0.0;
        for side in 0..2 {
            sum += self.rods(side, x, spacing, gradient.nodes, &mut gradient.spacing);
            sum += self.neighbours(side, x, spacing, cuts, axes, &mut gradient);
            // Pile comes slack from a beam of its own: the reed does not straighten it.
            if self.draft.pile().is_none() {
                sum += match &self.beside {
                    Some(beside) => self.together_beside(beside, side, x, gradient.nodes),
                    None => self.together(side, x, gradient.nodes),
                };
            }
            // Each yarn of the other side is pressed together by the spacings of this one.
            let tight = (self.densest[side] - spacing[side]).max(0.0);
            sum += yarns * (self.beat * spacing[side] + 0.5 * WALL * tight * tight);
            gradient.spacing[side] += yarns * (self.beat - WALL * tight);
        }
        sum += self.crossings(x, spacing, spheroids, &mut gradient);
        let Gradient { nodes: g, spacing: mut by_spacing, tangents: by_tangent, headings } = gradient;
        for ((by, heading), tangent) in by_tangent.iter_mut().zip(headings.iter()).zip(tangents.iter()) {
            let t = tangent.unit;
            *by += *heading / t.truncate().length_squared().max(1e-6) * DVec3::new(-t.y, t.x, 0.0);
        }
        self.hand_on_tangents(by_tangent, tangents, g, &mut by_spacing);
        (sum, by_spacing)
    }

    /// Whether what a yarn of a side does at a crossing, and from there to the next, counts.
    pub(super) fn counts(&self, side: usize, yarn: usize, crossing: usize) -> bool {
        let (weft, warp) = if side == 0 { (crossing, yarn) } else { (yarn, crossing) };
        self.counted.is_empty() || self.counted[weft * self.count[0] + warp]
    }

    /// Whether what counts may touch a yarn of a side from a crossing to the next.
    fn is_near(&self, side: usize, yarn: usize, crossing: usize) -> bool {
        let (weft, warp) = if side == 0 { (crossing, yarn) } else { (yarn, crossing) };
        self.near.is_empty() || self.near[weft * self.count[0] + warp]
    }

    /// Radius of a yarn where it is round.
    pub(super) fn round(&self, side: usize, yarn: usize) -> f64 {
        self.radius[side] * self.thickness[side][yarn]
    }

    fn axes(&self, side: usize, yarn: usize, flat: f64) -> [f64; 2] {
        [self.round(side, yarn) * flat.exp(), self.round(side, yarn) * (-flat).exp()]
    }

    /// Unit tangents of all nodes that are near, in the world, with half the way between their neighbours along the yarn, and their
    /// sections. What by which the energy changes is cleared.
    fn sections(&self, x: &[f64], spacing: [f64; 2], scratch: &mut Scratch) {
        let count = x.len() / PER_NODE;
        let Scratch { tangents, axes, spheroids, cuts, by_tangent, headings } = scratch;
        tangents.resize(count, Tangent::default());
        axes.resize(count, [1.0; 2]);
        spheroids.resize_with(count, Spheroid::default);
        cuts.resize_with(count, Cut::default);
        by_tangent.clear();
        by_tangent.resize(count, DVec3::ZERO);
        headings.clear();
        headings.resize(count, 0.0);
        for side in 0..2 {
            let n = self.length(side);
            let along = 2.0 * spacing[1 - side] / self.nodes as f64;
            for yarn in 0..self.count[side] {
                for k in (0..n).filter(|k| self.is_near(side, yarn, k / self.nodes)) {
                    let (a, b) = (self.at(side, yarn, (k + n - 1) % n), self.at(side, yarn, (k + 1) % n));
                    let way = world(side, [along, x[b] - x[a], x[b + 1] - x[a + 1]]);
                    let length = way.length();
                    let at = self.at(side, yarn, k);
                    let node = at / PER_NODE;
                    tangents[node] = Tangent { unit: way / length, length };
                    axes[node] = self.axes(side, yarn, x[at + 2]);
                    spheroids[node] = Spheroid::new(axes[node], tangents[node].unit);
                    cuts[node] = Cut::of(local(side, tangents[node].unit));
                }
            }
        }
    }

    /// Hands the gradient by tangents on to nodes and spacings.
    fn hand_on_tangents(&self, by_tangent: &[DVec3], tangents: &[Tangent], g: &mut [f64], by_spacing: &mut [f64; 2]) {
        for side in 0..2 {
            let n = self.length(side);
            for yarn in 0..self.count[side] {
                for k in (0..n).filter(|k| self.is_near(side, yarn, k / self.nodes)) {
                    let (a, b) = (self.at(side, yarn, (k + n - 1) % n), self.at(side, yarn, (k + 1) % n));
                    let node = self.at(side, yarn, k) / PER_NODE;
                    let t = &tangents[node];
                    let by = by_tangent[node];
                    let [along, aside, height] = local(side, (by - by.dot(t.unit) * t.unit) / t.length);
                    by_spacing[1 - side] += 2.0 * along / self.nodes as f64;
                    g[b] += aside;
                    g[a] -= aside;
                    g[b + 1] += height;
                    g[a + 1] -= height;
                }
            }
        }
    }
}

/// Makes a function of variables least. Each of them follows the free one of a number, or is [`HELD`].
pub(super) fn minimize_alike(
    x: &mut [f64],
    follows: &[usize],
    mut f: impl FnMut(&[f64], &mut [f64]) -> f64,
    search: Search,
    precondition: Option<Precondition<'_>>,
) {
    let followers: Vec<(usize, usize)> = follows.iter().copied().enumerate().filter(|(_, i)| *i != HELD).collect();
    let mut free = vec![0.0; followers.iter().map(|(_, i)| i + 1).max().unwrap_or(0)];
    // Alike by what starts alike.
    followers.iter().for_each(|&(k, i)| free[i] = x[k]);
    let mut by_all = vec![0.0; x.len()];
    let mut value = |free: &[f64], by_free: &mut [f64]| {
        followers.iter().for_each(|&(k, i)| x[k] = free[i]);
        let value = f(x, &mut by_all);
        by_free.fill(0.0);
        followers.iter().for_each(|&(k, i)| by_free[i] += by_all[k]);
        value
    };
    minimize(&mut free, &mut value, search, precondition);
    followers.iter().for_each(|&(k, i)| x[k] = free[i]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gradient_is_that_of_the_energy() {
        let draft = Draft::named("twill 2/1").unwrap();
        let energy = Energy {
            draft: &draft,
            radius: [0.8, 1.2],
            thickness: [vec![1.3, 0.7, 1.0], vec![1.0, 0.9, 1.1]],
            rest: [0.2, 0.1],
            stiffness: [1.2, 0.8],
            section: SECTION,
            beat: 1.0,
            nodes: 4,
            count: [3, 3],
            fixed: [None; 2],
            sett: None,
            densest: [1.6, 2.4],
            gear: 0.1,
            beside: None,
            counted: Vec::new(),
            near: Vec::new(),
        };
        let n = energy.variables();
        let mut x: Vec<f64> = (0..n).map(|i| 0.3 * (i as f64 * 1.7).sin()).collect();
        for yarn in 0..3 {
            for k in 0..12 {
                let over = |side: usize, k: usize| {
                    if side == 0 { draft.warp_over(k / 4, yarn) } else { !draft.warp_over(yarn, k / 4) }
                };
                for side in 0..2 {
                    x[energy.at(side, yarn, k) + 1] += if over(side, k) { 0.8 } else { -0.8 };
                }
            }
        }
        (x[n - 2], x[n - 1]) = (22.0, 28.0);
        let mut g = vec![0.0; n];
        energy.value(&x, &mut g, &mut Scratch::default());
        let mut other = vec![0.0; n];
        for i in 0..n {
            let h = 1e-5;
            let mut at = |d: f64| {
                let mut y = x.clone();
                y[i] += d;
                energy.value(&y, &mut other, &mut Scratch::default())
            };
            let want = (at(h) - at(-h)) / (2.0 * h);
            assert!((g[i] - want).abs() < 1e-3 * (1.0 + want.abs()), "variable {i} of {n}: {} {want}", g[i]);
        }
    }
}
