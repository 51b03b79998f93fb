//! Large repeats, as of damask: the weaves of figure and ground are relaxed as small repeats at common spacings and put where they
//! belong; then what lies about their borders is relaxed block by block.

use super::{
    CellOptions, PART, UnitCell,
    blocks::Whole,
    energy::{Energy, PER_NODE},
    parts::{Part, Parts},
    regular::{Place, Regular},
};
use crate::{math::special::smooth_step, pattern::draft::Draft};

/// Most steps of blocks in each sweep.
const STEPS: [usize; 3] = [60, 60, 40];
/// Most corrections of the spacings.
const CORRECTIONS: usize = 3;
/// Share of a spacing by which it may be wrong.
const EXACT: f64 = 0.002;
/// The largest share by which it is corrected at once.
const LEAP: f64 = 0.05;
/// Most steps of a small repeat when spacings change a little.
const AGAIN: usize = 300;

impl UnitCell {
    /// Relaxes a large repeat of one layer.
    pub(super) fn relax_large(draft: &Draft, options: &CellOptions) -> Self {
        let energy = Energy::new(draft, options, options.unit());
        let regular = Regular::find(&energy);
        let nearest = regular.nearest(&energy);
        let samples = if regular.parts.is_empty() { vec![middle(&energy)] } else { regular.parts };
        let mut parts = Parts::new(&samples, options);
        parts.relax(options);
        let (directions, spacing) = (free_directions(&energy), parts.spacing());
        let x = energy.start(Some(spacing));
        let mut whole = Whole { energy, options, x, kinds: regular.kinds, stays: regular.stays };
        whole.take(spacing, &mut parts, &nearest, false);
        let stiffness = if directions.is_empty() { Vec::new() } else { parts.stiffness(&directions, AGAIN) };
        for _ in 0..CORRECTIONS {
            if directions.is_empty() {
                break;
            }
            let by = correction(&directions, &stiffness, whole.forces());
            let spacing = whole.energy.spacing(&whole.x);
            if (0..2).all(|side| by[side].abs() < EXACT * spacing[side]) {
                break;
            }
            let most = |side: usize| LEAP * spacing[side];
            let spacing = [0, 1].map(|side| spacing[side] + by[side].clamp(-most(side), most(side)));
            whole.take(spacing, &mut parts, &nearest, true);
        }
        Self::of(&whole.energy, &whole.x, options)
    }
}

/// The middle of a repeat that has no regular parts.
fn middle(energy: &Energy<'_>) -> Part {
    let count = energy.count.map(|n| n.min(PART));
    Part::of(energy, [0, 1].map(|side| (energy.count[side] - count[side]) / 2), count)
}

/// The directions in which spacings are free to change.
fn free_directions(energy: &Energy<'_>) -> Vec<[f64; 2]> {
    if let Some(sett) = energy.sett {
        return vec![[1.0, sett]];
    }
    let sides = [[1.0, 0.0], [0.0, 1.0]].into_iter().zip(energy.fixed);
    sides.filter(|(_, fixed)| fixed.is_none()).map(|(direction, _)| direction).collect()
}

/// How spacings must change in some directions for the forces on them to vanish there, by how these change with a step in each.
fn correction(directions: &[[f64; 2]], stiffness: &[[f64; 2]], forces: [f64; 2]) -> [f64; 2] {
    let along = |a: [f64; 2], b: [f64; 2]| a[0] * b[0] + a[1] * b[1];
    let by = match (directions, stiffness) {
        ([d], [c]) => vec![-along(*d, forces) / along(*d, *c)],
        ([_, _], [c, e]) => {
            let det = c[0] * e[1] - c[1] * e[0];
            vec![(e[0] * forces[1] - e[1] * forces[0]) / det, (c[1] * forces[0] - c[0] * forces[1]) / det]
        }
        _ => Vec::new(),
    };
    let steps = || directions.iter().zip(&by);
    [0, 1].map(|side| steps().map(|(d, by)| d[side] * by).sum::<f64>()).map(|v| if v.is_finite() { v } else { 0.0 })
}

impl Whole<'_> {
    /// Relaxes all at these spacings, from the parts or, once it has been `relaxed`, from what it came to.
    fn take(&mut self, spacing: [f64; 2], parts: &mut Parts<'_>, nearest: &[Option<Place>], relaxed: bool) {
        (self.energy.fixed, self.energy.sett) = (spacing.map(Some), None);
        parts.relax_at(spacing, AGAIN);
        self.place(parts, nearest, relaxed);
        for (sweep, most) in STEPS.into_iter().enumerate() {
            if sweep > 0 {
                self.even_out();
            }
            self.sweep(sweep % 2 == 1, most);
        }
    }

    /// Puts nodes as they are in the parts that they are of or go on with; if it has been `relaxed`, only those that stay.
    fn place(&mut self, parts: &Parts<'_>, nearest: &[Option<Place>], relaxed: bool) {
        let nodes = self.energy.nodes;
        for side in 0..2 {
            for yarn in 0..self.energy.count[side] {
                for node in 0..self.energy.length(side) {
                    let (between, stays) = (node % nodes, self.stays(side, yarn, node));
                    if relaxed && !stays {
                        continue;
                    }
                    let at = self.energy.at(side, yarn, node);
                    let begun = [self.x[at], self.x[at + 1], self.energy.rest[side]];
                    let [here, next] = self.energy.between(side, yarn, node).map(|crossing| nearest[crossing]);
                    let of = |place: Option<Place>, step: usize, back: usize| {
                        place.map_or(begun, |place| in_part(parts, place, side, step, back))
                    };
                    // From the shape about one crossing to that about the next.
                    let a = of(here, between, 0);
                    let b = if stays || between == 0 { a } else { of(next, between, nodes) };
                    let share = smooth_step(between as f64 / nodes as f64);
                    for c in 0..PER_NODE {
                        self.x[at + c] = a[c] + share * (b[c] - a[c]);
                    }
                }
            }
        }
    }
}

/// A node so many after a crossing of a part, less so many `back`.
fn in_part(parts: &Parts<'_>, place: Place, side: usize, step: usize, back: usize) -> [f64; PER_NODE] {
    let energy = &parts.energies[place.part];
    let length = energy.length(side);
    let node = (place.at[1 - side] * energy.nodes + step + length - back) % length;
    let at = energy.at(side, place.at[side], node);
    std::array::from_fn(|c| parts.x[place.part][at + c])
}

#[cfg(test)]
mod tests {
    use super::{super::Node, *};

    /// A square of satin on a ground of sateen, and how it is woven.
    fn figured(warps: usize, wefts: usize) -> (Draft, CellOptions) {
        let [satin, sateen] = ["satin 8", "sateen 8"].map(|name| Draft::named(name).unwrap());
        let draft = Draft::from_fn(warps, wefts, |i, j| {
            if j < warps / 2 && i < wefts / 2 { satin.warp_over(i, j) } else { sateen.warp_over(i, j) }
        });
        let options = CellOptions {
            radius: [1.0; 2],
            aspect: [1.5; 2],
            crimp: 0.5,
            spacing: [None; 2],
            sett: Some(0.68),
            beat: 1.0,
            nodes: 4,
            thickness: [Vec::new(), Vec::new()],
        };
        (draft, options)
    }

    /// Measured: spacings differ by 0.002 %, nodes by 0.09 radii aside and 0.13 up and down in the mean of squares, most of it where
    /// floats lie on each other the other way round.
    #[test]
    fn blocks_agree_with_the_whole_relaxed_together() {
        let (draft, options) = figured(44, 40);
        let blocks = UnitCell::relax(&draft, &options);
        let whole = [Part { draft: draft.clone(), thickness: options.thickness.clone(), share: 1.0 }];
        let mut together = Parts::new(&whole, &options);
        // It would not come to its spacings by itself in many more steps.
        together.x[0] = together.energies[0].start(Some(blocks.spacing));
        together.relax(&options);
        let whole = UnitCell::of(&together.energies[0], &together.x[0], &options);
        for side in 0..2 {
            assert!((blocks.spacing[side] / whole.spacing[side] - 1.0).abs() < 1e-3, "{:?}", blocks.spacing);
        }
        let nodes = || blocks.yarns.iter().flatten().flatten().zip(whole.yarns.iter().flatten().flatten());
        let count = nodes().count() as f64;
        let rms = |of: fn(&Node) -> f64| (nodes().map(|(a, b)| (of(a) - of(b)).powi(2)).sum::<f64>() / count).sqrt();
        let off = [rms(|n| n.aside), rms(|n| n.height), rms(|n| n.axes[0])];
        assert!(off[0] < 0.15 && off[1] < 0.2 && off[2] < 0.02, "{off:?}");
        assert!((blocks.see_through() - whole.see_through()).abs() < 0.002);
        let [deepest, share] = blocks.overlap(1.0);
        assert!(deepest < 0.2 && share < 0.005, "{deepest} {share}");
    }

    #[test]
    fn blocks_come_to_the_same_on_any_number_of_threads() {
        let (draft, options) = figured(100, 12);
        let [one, two] = [1, 2].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| UnitCell::relax(&draft, &options))
        });
        assert_eq!(one.spacing, two.spacing);
        assert_eq!(one.yarns, two.yarns);
    }

    /// What is far from borders is as in the weave itself at these spacings, and there is no seam between blocks.
    #[test]
    fn regular_parts_are_as_their_weaves() {
        let (draft, options) = figured(112, 16);
        let cell = UnitCell::relax(&draft, &options);
        let n = cell.nodes;
        for weft in 0..2 {
            // Sateen goes on from 56 to 111; blocks of both sweeps end within.
            let far = |warp: usize, k: usize| cell.yarns[1][weft][(warp * n + k) % cell.yarns[1][weft].len()];
            for k in 0..8 * n {
                for warp in [72, 80, 88] {
                    let [a, b] = [far(64, k), far(warp, k)];
                    assert!(
                        (a.height - b.height).abs() < 0.05 && (a.aside - b.aside).abs() < 0.05,
                        "{warp} {k}: {a:?} {b:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn corrections_take_forces_away() {
        let columns = [[3.0, 1.0], [-1.0, 2.0]];
        let by = correction(&[[1.0, 0.0], [0.0, 1.0]], &columns, [0.7, -0.4]);
        for side in 0..2 {
            let change = columns[0][side] * by[0] + columns[1][side] * by[1];
            assert!((change + [0.7, -0.4][side]).abs() < 1e-12, "{by:?}");
        }
        let by = correction(&[[1.0, 0.5]], &[[3.0, 1.0]], [0.7, 0.0]);
        assert!((by[0] - 2.0 * by[1]).abs() < 1e-12 && (by[0] * 3.5 + 0.7).abs() < 1e-12, "{by:?}");
    }
}
