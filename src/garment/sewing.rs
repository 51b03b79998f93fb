//! What is at the borders of panels: how much cloth is left out or turned in, and which yarns run along.

use std::collections::HashMap;

use glam::{DVec2, DVec3, IVec3};
use rayon::prelude::*;

use super::{
    border::is_picked_up,
    edges::{Edging, Finish, Way, ways},
    fold::Fold,
    hem::{Hem, Turnup},
    lattice::{Division, Lattice},
    lay::{CUT_END, turn},
    options::{Cloth, Options},
    seam::SeamKind,
    sheet::{Bends, Room},
    strain::Shapes,
    surface::{BorderEdge, Pose},
};
use crate::{math::special::smooth_step, pattern::StrandKind};

/// An overlock seam takes about so much of each panel, mm, in whole stitches, which are so many at most.
const TAKEN: f64 = 3.0;
const MOST_TAKEN: f64 = 6.0;
/// Radius of sewing threads, mm.
pub(super) const THREAD: f64 = 0.1;
/// Length of an overlock machine's and of a hem's stitches, mm.
pub(super) const STEP: f64 = 2.5;
/// Over a body cloth comes down from a seam within so many times its height.
const SLOPE: f64 = 3.0;

/// One cloth at borders.
struct Trim {
    stitch: DVec2,
    repeat: [u32; 2],
    knitted: bool,
    /// Distance of its yarns where they press on each other, the room of one that nothing presses, and its own radius, mm.
    diameter: f64,
    room: f64,
    radius: f64,
    free: DVec2,
    sewn: [[DVec2; 2]; SeamKind::COUNT],
    bends: Bends,
    turnup: Option<Turnup>,
    /// How far turns reach beyond what is turned in, mm.
    turn: f64,
}

/// All seams and edges of a garment.
pub(super) struct Sewing {
    trims: Vec<Trim>,
    cloth: Vec<usize>,
    /// The seam at each edge of each panel's border.
    seams: Vec<Vec<SeamKind>>,
    /// Whether the first row is picked up, at each edge.
    picked_up: Vec<Vec<bool>>,
    /// Whether it is hemmed, at each edge.
    hemmed: Vec<Vec<bool>>,
}

impl Trim {
    fn new(cloth: &Cloth, shapes: &Shapes, pressed: bool) -> Self {
        let (stitch, repeat) = (cloth.tile.stitch(), cloth.tile.counts);
        let knitted = cloth.tile.strands.iter().all(|s| s.kind == StrandKind::Course);
        let d = shapes.diameter;
        let mut free = DVec2::ZERO;
        for axis in 0..2 {
            // Sideways loops reach beyond their line; at its ends lines turn. Half a yarn is left to the border itself, and
            // under a chain some more.
            let beyond = shapes.reach[axis] * stitch[axis];
            let turned = if shapes.has_axis(axis) { turn(stitch[1 - axis], d) } else { 0.0 };
            free[axis] = beyond.max(turned) + if knitted { 1.2 * d } else { 1.1 * d };
        }
        let seams = SeamKind::ALL.map(|kind| Fold::new(kind, shapes.heights, d, knitted, pressed));
        // Edges that only meet: as far as yarns reach, and half a yarn.
        let ends = CUT_END * DVec2::new(turn(stitch.y, d), turn(stitch.x, d));
        let meets = match knitted {
            // Rows turn to the wrong side; first rows are knitted on: their feet go into the heads of the last ones.
            true => DVec2::new(0.56 * d, 0.0),
            false => ends + 0.51 * d,
        };
        let sewn = SeamKind::ALL.map(|kind| match &seams[kind as usize] {
            None => [meets; 2],
            Some(fold) => [-turned_in(kind, fold, stitch, d); 2],
        });
        let (room, radius, turn) = (2.0 * shapes.half_room, shapes.radius, turn(stitch.y, d));
        let fold = Fold::of_hem(shapes.heights, d);
        let turnup = cloth.hem.map(|hem| Turnup { hem, fold, aside: turn + 0.51 * d });
        let rooms = SeamKind::ALL.map(|kind| match &seams[kind as usize] {
            None => Room::default(),
            Some(seam) => {
                let over = -sewn[kind as usize][0].min_element();
                let deep = seam.depth(over) + fold.wrong_side();
                let within = over + seam.begin() + turn + d;
                Room { deep, within, until: within + SLOPE * deep }
            }
        });
        let bends = Bends { seams, hem: turnup.map(|t| t.fold), rooms };
        Self { stitch, repeat, knitted, diameter: d, room, radius, free, sewn, bends, turnup, turn }
    }
}

/// How much cloth goes on beyond a seam: whole stitches are behind what is seen.
fn turned_in(kind: SeamKind, fold: &Fold, stitch: DVec2, diameter: f64) -> DVec2 {
    let wanted = match kind {
        SeamKind::Overlock => (TAKEN / stitch).min(DVec2::splat(MOST_TAKEN)),
        // A stitch, or two rows.
        _ => 3.4 * diameter / stitch,
    };
    let least = fold.upright() / stitch + 0.3;
    wanted.max(least).ceil() * stitch - fold.upright()
}

/// Places near which cloth is kept further off a body.
struct Near {
    /// A place, how far cloth is kept off there, mm, and within which distance; it comes down beyond.
    places: Vec<(DVec3, f64, f64)>,
    least: f64,
    cells: HashMap<[i32; 3], Vec<usize>>,
    size: f64,
}

impl Near {
    /// Of places with how far cloth is kept off there, and within which distance; everywhere else it is `least`, mm.
    fn new(places: Vec<(DVec3, f64, f64)>, least: f64) -> Self {
        let size = places.iter().map(|s| s.2 + SLOPE * s.1).fold(0.0, f64::max);
        let mut near = Self { places, least, cells: HashMap::new(), size };
        for (i, place) in near.places.iter().enumerate() {
            near.cells.entry(near.cell(place.0).to_array()).or_default().push(i);
        }
        near
    }

    fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    fn cell(&self, p: DVec3) -> IVec3 {
        (p / self.size).floor().as_ivec3()
    }

    /// How far cloth is kept off at a place, mm.
    fn kept_off(&self, p: DVec3) -> f64 {
        if self.is_empty() {
            return self.least;
        }
        let around = (0..27).map(|k| self.cell(p) + IVec3::new(k % 3, k / 3 % 3, k / 9) - 1);
        let near = around.filter_map(|c| self.cells.get(&c.to_array())).flatten();
        let wanted = near.map(|&i| {
            let (at, depth, wide) = self.places[i];
            depth + (self.least - depth) * smooth_step((p.distance(at) - wide) / (SLOPE * depth))
        });
        wanted.fold(self.least, f64::max)
    }
}

impl Sewing {
    pub(super) fn new(options: &Options, shapes: &[Shapes], borders: &[Vec<BorderEdge>], cloth: &[usize]) -> Self {
        // Seams are pressed before an edge is turned up over them.
        let pressed = options.pressed || options.cloths.iter().any(|c| c.hem.is_some());
        let trim = |(cloth, shapes): (&Cloth, &Shapes)| Trim::new(cloth, shapes, pressed);
        let kind = |panel: usize, edge: &BorderEdge| {
            let other = edge.sewn_to.map_or(cloth[panel], |(other, _)| cloth[other as usize]);
            let [first, last] = [cloth[panel].min(other), cloth[panel].max(other)];
            options.cloths[last].seam.or(options.cloths[first].seam).unwrap_or(options.seam)
        };
        let of_panel = |(panel, border): (usize, &Vec<BorderEdge>)| border.iter().map(|e| kind(panel, e)).collect();
        let trims: Vec<Trim> = options.cloths.iter().zip(shapes).map(trim).collect();
        let picked_up = |panel: usize, edge: &BorderEdge| {
            let Some((other, mate)) = edge.sewn_to else { return false };
            let knitted = [panel, other as usize].iter().all(|&p| trims[cloth[p]].knitted);
            let mate = &borders[other as usize][mate as usize];
            knitted && kind(panel, edge) == SeamKind::None && is_picked_up(edge, mate)
        };
        let all = borders.iter().enumerate();
        let picked_up = all.map(|(panel, border)| border.iter().map(|e| picked_up(panel, e)).collect()).collect();
        let seams = borders.iter().enumerate().map(of_panel).collect();
        let is_hemmed = |panel: usize, e: &BorderEdge| e.sewn_to.is_none() && trims[cloth[panel]].turnup.is_some();
        let all = borders.iter().enumerate();
        let hemmed = all.map(|(panel, border)| border.iter().map(|e| is_hemmed(panel, e)).collect()).collect();
        Self { trims, cloth: cloth.to_vec(), seams, picked_up, hemmed }
    }

    /// How a cloth is bent where it is sewn or hemmed.
    pub(super) fn bends(&self, cloth: usize) -> &Bends {
        &self.trims[cloth].bends
    }

    /// How the free edges of a panel are hemmed.
    pub(super) fn hem(&self, panel: usize) -> Option<Hem> {
        self.trims[self.cloth[panel]].turnup.map(|turnup| turnup.hem)
    }

    /// Whether an edge of a panel's border is hemmed.
    pub(super) fn is_hemmed(&self, panel: usize, edge: usize) -> bool {
        self.hemmed[panel][edge]
    }

    /// The cloth of a panel, and the distance of its yarns where they press on each other, mm.
    pub(super) fn cloth(&self, panel: usize) -> (usize, f64) {
        (self.cloth[panel], self.trims[self.cloth[panel]].diameter)
    }

    /// How far each fine point of the sewn mesh is kept from a body's skin, mm: no less than `least`, and by seams and hems as
    /// much more as what is turned in takes. Empty where that is nowhere more.
    pub(super) fn clearances(&self, pose: &Pose, borders: &[Vec<BorderEdge>], least: f64) -> Vec<f32> {
        // Of seams and of hems: a place, how far cloth is kept off there, and within which distance.
        let mut places: [Vec<(DVec3, f64, f64)>; 2] = Default::default();
        for (panel, border) in borders.iter().enumerate() {
            let trim = &self.trims[self.cloth[panel]];
            for (i, edge) in border.iter().enumerate() {
                let kind = self.seams[panel][i];
                let hem = trim.turnup.filter(|_| self.hemmed[panel][i]);
                let seam = trim.bends.seams[kind as usize].filter(|_| edge.sewn_to.is_some());
                let (of, depth, wide) = match (hem, seam) {
                    (Some(Turnup { hem, fold, .. }), _) => (1, -fold.skins()[1], hem.width),
                    (None, Some(fold)) => {
                        let over = -trim.sewn[kind as usize][0].min_element();
                        (0, fold.depth(over), over + fold.begin())
                    }
                    (None, None) => continue,
                };
                places[of].extend(edge.vertices.map(|v| (pose.vertex(v).0, depth + 1.4 * trim.diameter, wide)));
            }
        }
        let [seams, hems] = places.map(|places| Near::new(places, least));
        if seams.is_empty() && hems.is_empty() {
            return Vec::new();
        }
        // What lies under a hem lies under the seams' allowances as well.
        let of = |p: &DVec3| (seams.kept_off(*p) + (hems.kept_off(*p) - least)) as f32;
        pose.points().par_iter().with_min_len(1024).map(of).collect()
    }

    /// How a panel is divided for its cloth.
    pub(super) fn division(&self, panel: usize) -> Division<'_> {
        let trim = &self.trims[self.cloth[panel]];
        let begin = trim.bends.seams.iter().flatten().map(Fold::begin).fold(0.0, f64::max);
        let over = trim.sewn.iter().map(|s| -s[0].min_element()).fold(0.0, f64::max);
        let room = trim.bends.widest_room();
        Division {
            stitch: trim.stitch,
            repeat: trim.repeat,
            free: trim.free,
            sewn: trim.sewn,
            seams: &self.seams[panel],
            picked_up: &self.picked_up[panel],
            round: trim.knitted,
            turnup: trim.turnup,
            hemmed: &self.hemmed[panel],
            bent: 2.0 * trim.stitch.max_element() + if trim.turnup.is_some() { room } else { begin + over },
        }
    }

    /// What runs along the edges of all panels, as they lie in the first frame.
    pub(super) fn edgings(&self, first: &Pose, borders: &[Vec<BorderEdge>], lattices: &[Lattice]) -> Vec<Edging> {
        let mut free = Vec::new();
        let mut sewn = Vec::new();
        for (panel, border) in borders.iter().enumerate() {
            for (i, edge) in border.iter().enumerate() {
                match edge.sewn_to {
                    None if self.hemmed[panel][i] => {}
                    None => free.push((edge.vertices, panel as u32, None)),
                    // Each seam once; what is knitted in the round has none.
                    Some((other, _)) => {
                        let kind = self.seams[panel][i];
                        if edge.is_first(panel as u32, i)
                            && kind != SeamKind::None
                            && !(other == panel as u32 && lattices[panel].ring)
                        {
                            sewn.push((edge.vertices, panel as u32, Some(other)));
                        }
                    }
                }
            }
        }
        let mut out = Vec::new();
        // An edge goes on from panel to panel as long as these are of one kind, of yarns as thick.
        let kind = |panel: u32| {
            let trim = &self.trims[self.cloth[panel as usize]];
            (trim.knitted, trim.radius.to_bits())
        };
        let mut kinds: Vec<_> = free.iter().map(|edge| kind(edge.1)).collect();
        kinds.sort_unstable();
        kinds.dedup();
        for of in kinds {
            let own: Vec<_> = free.iter().filter(|edge| kind(edge.1) == of).copied().collect();
            for way in ways(&own) {
                let cloth = self.cloth[way.panel as usize];
                let Trim { stitch, knitted, diameter: d, room, radius, .. } = &self.trims[cloth];
                let finish = if *knitted {
                    Finish::Chain { link: stitch.x.max(2.9 * room), room: *room, radius: *radius }
                } else {
                    let radius = 0.32 * d;
                    // Threads of open cloth are no reason for more turns than it has threads, about.
                    let step = (2.6 * radius).max(0.5 * stitch.min_element());
                    Finish::Overcast { step, radius, reach: 3.0 * d }
                };
                out.push(Edging::new(way, finish, cloth, first));
            }
        }
        // Ways of a seam keep to one pair of panels.
        let mut pairs: Vec<(u32, Option<u32>)> = sewn.iter().map(|s| (s.1, s.2)).collect();
        pairs.sort_unstable();
        pairs.dedup();
        for pair in pairs {
            let own: Vec<_> = sewn.iter().filter(|s| (s.1, s.2) == pair).copied().collect();
            let Some(other) = pair.1 else { continue };
            let joins = |e: &&BorderEdge| e.sewn_to.is_some_and(|(panel, _)| panel == other);
            let kind = borders[pair.0 as usize].iter().position(|e| joins(&e)).map(|i| self.seams[pair.0 as usize][i]);
            let kind = kind.unwrap_or(SeamKind::None);
            let over = [(pair.0, other), (other, pair.0)].map(|(panel, mate)| self.over(kind, panel, mate, borders));
            for way in ways(&own) {
                self.sew(kind, way, (other, over), first, &mut out);
            }
        }
        out
    }

    /// How much of a panel is turned in where it is sewn to another, in the mean, mm.
    fn over(&self, kind: SeamKind, panel: u32, mate: u32, borders: &[Vec<BorderEdge>]) -> f64 {
        let sewn = self.trims[self.cloth[panel as usize]].sewn[kind as usize][0];
        let own = borders[panel as usize].iter().filter(|e| e.sewn_to.is_some_and(|(panel, _)| panel == mate));
        let across = own.map(|e| e.direction().abs());
        let (sum, count) = across.fold((0.0, 0), |(sum, n), d| (sum - d.y * sewn.x - d.x * sewn.y, n + 1));
        sum / f64::from(count.max(1))
    }

    /// The yarns of one seam to another panel; so much is turned in on both sides, mm.
    fn sew(&self, kind: SeamKind, way: Way, (other, over): (u32, [f64; 2]), first: &Pose, out: &mut Vec<Edging>) {
        let cloth = self.cloth[way.panel as usize];
        let trims = [cloth, self.cloth[other as usize]].map(|c| &self.trims[c]);
        let sides = [0, 1].map(|side| (trims[side], over[side]));
        let (own, d) = (trims[0], trims[0].diameter);
        let fold = |trim: &Trim| trim.bends.seams[kind as usize];
        match kind {
            SeamKind::None => {}
            SeamKind::Mattress => {
                let radius = 0.3 * d;
                let hook = |(trim, over)| fold(trim).map_or([radius, 0.0], |f| f.before(-0.75 * over, radius));
                let finish =
                    Finish::Mattress { step: (2.0 * own.stitch.y).max(8.0 * radius), radius, hooks: sides.map(hook) };
                out.push(Edging::new(way, finish, cloth, first));
            }
            SeamKind::Overlock => {
                let Some(own_fold) = fold(own) else { return };
                let radius = THREAD.clamp(0.15 * d, 0.35 * d);
                let step = STEP.max(12.0 * radius);
                let line = |(trim, over): (&Trim, f64)| {
                    fold(trim).map_or([d, 0.0], |f| f.behind(0.35 * f.upright() - 0.3 * over, radius))
                };
                let edge = |(trim, over): (&Trim, f64)| {
                    let beyond = over + trim.turn + trim.diameter + 2.0 * radius;
                    fold(trim).map_or([d, 0.0], |f| f.behind(-beyond, radius))
                };
                let (line, edge) = (sides.map(line), sides.map(edge));
                // Both edges are as deep as the deeper one.
                let depth = edge[0][1].min(edge[1][1]);
                out.push(Edging::new(way.clone(), Finish::Needle { step, radius, line, fold: own_fold }, cloth, first));
                for (k, side) in [(0, 1.0), (1, -1.0)] {
                    let finish =
                        Finish::Looper { step, radius, line: line[k], edge: [edge[k][0], depth], side, fold: own_fold };
                    out.push(Edging::new(way.clone(), finish, cloth, first));
                }
            }
        }
    }
}
