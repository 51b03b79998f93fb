//! Yarns as elastic rods: they resist stretching and bending, and do not pass through each other.
//!
//! The energy is that of discrete rods (after Bergou et al., "Discrete Elastic Rods", 2008, without twist) and of contact
//! between segments; it is made least by FIRE (Bitzek et al., "Structural Relaxation Made Simple", 2006), the size of a
//! periodic cell too, if it is free. No step is longer than a small share of the diameter, so that no yarn passes through
//! another. The unit of length is the yarn's diameter, that of force its bending stiffness over the diameter's square.
//! Sums are taken in a fixed order: the result is the same for any number of threads.

mod energy;
#[cfg(test)]
pub(super) mod passing;
mod relaxation;
mod search;

use std::ops::Range;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::geometry::contact::nearest;
use search::OnStrands;

/// One yarn: some of the points, in order.
#[derive(Clone, Debug)]
pub(super) struct Strand {
    pub(super) start: usize,
    pub(super) count: usize,
    /// What is added to the first point to make it follow the last: zero for a ring, a period for a yarn that crosses a
    /// periodic cell.
    pub(super) jump: Option<DVec3>,
}

/// Yarns of diameter 1.
#[derive(Clone, Debug, Default)]
pub(super) struct Rods {
    pub(super) points: Vec<DVec3>,
    pub(super) strands: Vec<Strand>,
    /// Length at rest of the segment that begins at each point.
    pub(super) rest: Vec<f64>,
    /// Points that stay where they are; none, or one for each point.
    pub(super) fixed: Vec<bool>,
    /// Size of the cell that repeats along x and y.
    pub(super) period: Option<DVec2>,
}

/// How long and how to relax.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run {
    /// Most steps.
    pub(super) steps: usize,
    /// Steps during which yarns grow to their thickness, and the share of it at which they begin.
    pub(super) growing: usize,
    pub(super) thin: f64,
    /// Whether the cell may change its width and its height.
    pub(super) free: [bool; 2],
    /// Pull on the cloth across and along, force by length.
    pub(super) load: DVec2,
    /// How firmly cloth is pressed flat: force by length of yarn, for each unit of distance from the middle of its depth.
    pub(super) press: f64,
    /// How firm contact is, against what a relaxation begins with.
    pub(super) firm: f64,
    /// Stops when no force is larger.
    pub(super) calm: f64,
}

impl Run {
    /// That by which yarns of a piece, which begin so thin, find room beside each other.
    pub(super) fn finding_room(steps: usize, thin: f64) -> Self {
        Self { steps, growing: steps / 3, thin, free: [false; 2], load: DVec2::ZERO, press: 0.0, firm: 2.0, calm: 0.02 }
    }
}

/// Stiffness against stretching: a yarn under the forces of a loop becomes longer by about a hundredth.
const STRETCH: f64 = 80.0;
/// Stiffness of contact, for each pair of segments.
const CONTACT: f64 = 90.0;
/// Nearer than this, contact becomes firmer by the square of the distance.
const DEEP: f64 = 0.4;
/// Yarns are kept this far apart: a little more than they need, for what a spline does between points and what forces
/// press together.
pub(super) const APART: f64 = 1.02;
/// Contacts are looked for this much beyond touching.
const MARGIN: f64 = 0.65;
/// If one in so many points has gone far, all are looked for again.
const MANY: usize = 8;
/// The longest step of a point.
const STEP: f64 = 0.06;
/// The longest step in time.
const TIME: f64 = 0.07;
/// Along a yarn, closer than this is not contact but bending.
const ALONG: f64 = 2.2;
/// Points that are worked through at once; sums are taken over these, whatever the number of threads.
const CHUNK: usize = 4096;

/// Another segment that may touch; each pair is kept once.
#[derive(Clone, Copy)]
struct Neighbour {
    segment: u32,
    /// By how many periods it must be moved.
    cells: [i8; 2],
    /// They do not touch before both together have travelled so far.
    until: f32,
}

/// What the segments of one chunk may touch.
#[derive(Default)]
struct Touching {
    /// Those of its segment i are from `starts[i]` to `starts[i + 1]`.
    starts: Vec<u32>,
    neighbours: Vec<Neighbour>,
}

/// Pushes of contact on both ends of a segment.
#[derive(Clone, Copy, Default)]
struct Push {
    from: DVec3,
    to: DVec3,
}

impl Push {
    /// A push at a share of the way along.
    fn at(by: DVec3, along: f64) -> Self {
        Self { from: by * (1.0 - along), to: by * along }
    }

    fn add(&mut self, other: &Self) {
        self.from += other.from;
        self.to += other.to;
    }
}

/// What contact does beyond the chunk of segments in which it was found.
#[derive(Default)]
struct Outside {
    /// Segments of other chunks, and what they are pushed by.
    pushes: Vec<(u32, Push)>,
    /// Derivative of the energy by the logarithms of the cell's width and height.
    virial: DVec2,
}

/// Points, their speeds and steps, the forces on them, and where they were before.
type Moving<'a> = (&'a mut [DVec3], &'a mut [DVec3], &'a mut [f32], &'a [DVec3], &'a [DVec3]);

/// What is worked out anew in each step.
#[derive(Default)]
struct Work {
    edges: Vec<DVec3>,
    bends: Vec<DVec3>,
    pulls: Vec<DVec3>,
    pushes: Vec<Push>,
    forces: Vec<DVec3>,
    /// The last step of each point.
    steps: Vec<f32>,
    /// How far each segment has travelled, in all its steps since all neighbours were looked for.
    travelled: Vec<f32>,
    /// Where segments are on their strands.
    on_strands: OnStrands,
    /// For each chunk of segments.
    touching: Vec<Touching>,
}

impl Work {
    /// What a segment may touch.
    fn neighbours(&self, segment: usize) -> &[Neighbour] {
        let of_chunk = &self.touching[segment / CHUNK];
        &of_chunk.neighbours[of_chunk.range(segment % CHUNK)]
    }
}

impl Touching {
    /// Where those of a segment are.
    fn range(&self, segment: usize) -> Range<usize> {
        self.starts[segment] as usize..self.starts[segment + 1] as usize
    }

    /// What a segment may touch.
    fn of_mut(&mut self, segment: usize) -> &mut [Neighbour] {
        let range = self.range(segment);
        &mut self.neighbours[range]
    }
}

/// How far segments so far apart may come nearer before they touch, less than what sums of steps are rounded by.
fn gap(distance: f64) -> f32 {
    (distance - APART) as f32 - 1e-4
}

/// How FIRE goes on: its step in time, and how much speeds turn towards forces.
pub(super) struct Fire {
    /// The longest step.
    longest: f64,
    pub(super) dt: f64,
    alpha: f64,
    /// Steps in a row in which energy fell.
    downhill: u32,
}

impl Fire {
    pub(super) fn new(longest: f64) -> Self {
        Self { longest, dt: 0.5 * longest, alpha: 0.1, downhill: 0 }
    }

    /// Goes faster while energy falls by the `power` of forces, and starts anew where it rises; gives the share of speeds
    /// to keep, and what to add to them of forces.
    pub(super) fn adapt(&mut self, power: f64, force: f64, speed: f64) -> (f64, f64) {
        if power > 0.0 {
            self.downhill += 1;
            if self.downhill > 5 {
                self.dt = (self.dt * 1.1).min(self.longest);
                self.alpha *= 0.99;
            }
        } else {
            self.downhill = 0;
            self.dt = (0.5 * self.dt).max(0.02 * self.longest);
            self.alpha = 0.1;
        }
        match power > 0.0 && force > 0.0 {
            true => (1.0 - self.alpha, self.alpha * speed / force),
            false => (0.0, 0.0),
        }
    }
}

/// One step of all points.
#[derive(Clone, Copy)]
struct Step {
    /// Share of the speeds that is kept.
    keep: f64,
    /// How much of the forces is added to them.
    push: f64,
    /// In time.
    dt: f64,
    /// Square of the distance beyond which a point has gone too far.
    far: f64,
}

impl Rods {
    /// Whether a segment begins at a point.
    fn has_segment(&self) -> Vec<bool> {
        let mut has = vec![true; self.points.len()];
        for s in self.strands.iter().filter(|s| s.jump.is_none()) {
            has[s.start + s.count - 1] = false;
        }
        has
    }

    fn edges(&self, edges: &mut Vec<DVec3>) {
        let points = &self.points;
        fill(edges, points.len(), |i| points.get(i + 1).map_or(DVec3::ZERO, |next| *next - points[i]));
        for s in &self.strands {
            let last = s.start + s.count - 1;
            edges[last] = s.jump.map_or(DVec3::ZERO, |jump| self.points[s.start] + jump - self.points[last]);
        }
    }

    /// Presses points towards the middle of the depth.
    fn press(&self, firm: f64, forces: &mut [DVec3]) {
        let middle = self.points.iter().map(|p| p.z).sum::<f64>() / self.points.len() as f64;
        for ((force, p), rest) in forces.iter_mut().zip(&self.points).zip(&self.rest) {
            force.z -= firm * rest * (p.z - middle);
        }
    }

    /// Moves all points by one step; tells whether any is farther than `step.far` (squared) from where it was before.
    fn advance(&mut self, speeds: &mut [DVec3], work: &mut Work, before: &[DVec3], step: Step) -> bool {
        let Step { keep, push, dt, far } = step;
        let limit = STEP / dt;
        let Work { forces, steps, .. } = work;
        steps.resize(self.points.len(), 0.0);
        let advance = |(points, speeds, steps, forces, before): Moving<'_>| -> bool {
            let mut gone = false;
            for ((((p, v), s), f), b) in points.iter_mut().zip(speeds).zip(steps).zip(forces).zip(before) {
                *v = *v * keep + *f * push;
                let size = v.length();
                if size > limit {
                    *v *= limit / size;
                }
                *p += *v * dt;
                *s = (size.min(limit) * dt) as f32;
                gone |= p.distance_squared(*b) > far;
            }
            gone
        };
        if self.points.len() <= CHUNK {
            return advance((&mut self.points, speeds, steps, forces, before));
        }
        let parts = self.points.par_chunks_mut(CHUNK).zip(speeds.par_chunks_mut(CHUNK));
        let parts = parts.zip(steps.par_chunks_mut(CHUNK)).zip(forces.par_chunks(CHUNK)).zip(before.par_chunks(CHUNK));
        parts.map(|((((p, v), s), f), b)| advance((p, v, s, f, b))).reduce(|| false, |a, b| a | b)
    }

    /// Adds the last step to what segments have travelled, and half of what the cell was `strained` in it.
    fn travel(&self, strained: f64, work: &mut Work) {
        let Work { steps, travelled, .. } = work;
        let more = |i: usize| steps[i].max(steps[(i + 1).min(steps.len() - 1)]) + 0.5 * strained as f32;
        let add = |(first, own): (usize, &mut [f32])| {
            own.iter_mut().zip(first..).for_each(|(travelled, i)| *travelled += more(i));
        };
        if travelled.len() <= CHUNK {
            add((0, travelled));
        } else {
            travelled.par_chunks_mut(CHUNK).enumerate().for_each(|(c, own)| add((c * CHUNK, own)));
        }
        for s in self.strands.iter().filter(|s| s.jump.is_some()) {
            // More than it was.
            travelled[s.start + s.count - 1] += steps[s.start];
        }
    }

    /// The segments of which an end is one of some points.
    fn segments_of(&self, points: &[bool]) -> Vec<bool> {
        let mut of: Vec<bool> = points.windows(2).map(|ends| ends[0] || ends[1]).collect();
        of.extend(points.last());
        for s in self.strands.iter().filter(|s| s.jump.is_some()) {
            let last = s.start + s.count - 1;
            of[last] = points[last] || points[s.start];
        }
        of
    }

    /// Pushes of segments that touch; gives the derivative of their energy by the logarithms of the cell's width and height.
    fn contact(&self, apart: f64, stiffness: f64, work: &mut Work) -> DVec2 {
        let mut pushes = std::mem::take(&mut work.pushes);
        pushes.clear();
        pushes.resize(self.points.len(), Push::default());
        let mut touching = std::mem::take(&mut work.touching);
        let touch = |(c, (own, near)): (usize, (&mut [Push], &mut Touching))| {
            self.touch(c * CHUNK, own, near, [apart, stiffness], work)
        };
        let outside: Vec<Outside> = if pushes.len() <= CHUNK {
            pushes.chunks_mut(CHUNK).zip(&mut touching).enumerate().map(touch).collect()
        } else {
            pushes.par_chunks_mut(CHUNK).zip(&mut touching).enumerate().map(touch).collect()
        };
        work.touching = touching;
        // In their order, whatever the number of threads.
        let mut virial = DVec2::ZERO;
        for chunk in outside {
            virial += chunk.virial;
            chunk.pushes.iter().for_each(|(j, push)| pushes[*j as usize].add(push));
        }
        work.pushes = pushes;
        virial
    }

    /// Pushes of the segments of one chunk, from `first` on, by what is near them, and what they push elsewhere.
    fn touch(
        &self,
        first: usize,
        own: &mut [Push],
        near: &mut Touching,
        [apart, stiffness]: [f64; 2],
        work: &Work,
    ) -> Outside {
        let Work { edges, travelled, .. } = work;
        let period = self.period.unwrap_or_default();
        let mut outside = Outside::default();
        for i in first..first + own.len() {
            let (p0, p1) = (self.points[i], self.points[i] + edges[i]);
            for other in near.of_mut(i - first) {
                let j = other.segment as usize;
                let together = travelled[i] + travelled[j];
                if other.until > together {
                    continue;
                }
                let [x, y] = other.cells.map(f64::from);
                let q0 = self.points[j] + DVec3::new(x * period.x, y * period.y, 0.0);
                let near = nearest(p0, p1, q0, q0 + edges[j]);
                let square = near.between.length_squared();
                if square >= apart * apart {
                    other.until = together + gap(square.sqrt());
                    continue;
                }
                let distance = square.sqrt().max(1e-6);
                // Firmer where they are deep in each other, so that they do not pass.
                let firm = (DEEP / distance).max(1.0).powi(2);
                let by = near.between * (stiffness * firm * (apart - distance) / distance);
                own[i - first].add(&Push::at(-by, near.s));
                let push = Push::at(by, near.t);
                match own.get_mut(j.wrapping_sub(first)) {
                    Some(beside) => beside.add(&push),
                    None => outside.pushes.push((other.segment, push)),
                }
                outside.virial -= (by * near.between).truncate();
            }
        }
        outside
    }

    /// Makes a periodic cell wider and higher.
    pub(super) fn scale(&mut self, by: DVec2) {
        let by = by.extend(1.0);
        self.points.iter_mut().for_each(|p| *p *= by);
        for s in &mut self.strands {
            s.jump = s.jump.map(|j| j * by);
        }
        self.period = self.period.map(|p| p * by.truncate());
    }

    /// Forces on points; gives the derivative of the energy by the logarithms of the cell's width and height.
    fn forces(&self, has: &[bool], apart: f64, contact: f64, work: &mut Work) -> DVec2 {
        self.edges(&mut work.edges);
        self.bends(has, &work.edges, &mut work.bends);
        let mut virial = self.pulls(has, work);
        virial += self.contact(apart, contact, work);
        // What pulls at a point: the segment after it, and the one before it the other way.
        let Work { pulls, pushes, forces, .. } = work;
        let force = |i: usize, before: Option<usize>| {
            let (pull, push) = before.map_or((DVec3::ZERO, DVec3::ZERO), |k| (pulls[k], pushes[k].to));
            pulls[i] - pull + pushes[i].from + push
        };
        fill(forces, self.points.len(), |i| force(i, i.checked_sub(1)));
        for s in &self.strands {
            forces[s.start] = force(s.start, s.jump.map(|_| s.start + s.count - 1));
        }
        virial
    }

    /// The bend at each point: difference of the tangents, over the mean length of both segments.
    fn bends(&self, has: &[bool], edges: &[DVec3], bends: &mut Vec<DVec3>) {
        let bend = |a: usize, b: usize| {
            let (la, lb) = (self.rest[a], self.rest[b]);
            (edges[b] / lb - edges[a] / la) / (0.5 * (la + lb))
        };
        fill(bends, self.points.len(), |i| match i {
            i if i > 0 && has[i] && has[i - 1] => bend(i - 1, i),
            _ => DVec3::ZERO,
        });
        for s in &self.strands {
            bends[s.start] = s.jump.map_or(DVec3::ZERO, |_| bend(s.start + s.count - 1, s.start));
        }
    }

    /// The pull along each segment: the derivative of the energy by its vector. Gives that by the cell's size.
    fn pulls(&self, has: &[bool], work: &mut Work) -> DVec2 {
        let Work { edges, bends, pulls, .. } = work;
        let pull = |i: usize, next: usize| {
            let (e, rest) = (edges[i], self.rest[i]);
            let length = e.length().max(1e-9);
            e * (STRETCH * (1.0 / rest - 1.0 / length)) + (bends[i] - bends[next]) / rest
        };
        fill(pulls, self.points.len(), |i| if has[i] { pull(i, (i + 1).min(has.len() - 1)) } else { DVec3::ZERO });
        for s in self.strands.iter().filter(|s| s.jump.is_some()) {
            let last = s.start + s.count - 1;
            pulls[last] = pull(last, s.start);
        }
        match self.period {
            Some(_) => pulls.iter().zip(edges).map(|(pull, e)| (*pull * *e).truncate()).sum(),
            None => DVec2::ZERO,
        }
    }
}

/// Makes a list of what `of` gives for each number below `count`, on all threads if there are many.
fn fill<T: Send + Copy>(out: &mut Vec<T>, count: usize, of: impl Fn(usize) -> T + Sync + Send) {
    if count <= CHUNK {
        out.clear();
        out.extend((0..count).map(of));
    } else {
        (0..count).into_par_iter().with_min_len(CHUNK).map(of).collect_into_vec(out);
    }
}

/// Of forces and speeds: their product, both their squares, and the largest square of a force.
fn sums(forces: &[DVec3], speeds: &[DVec3]) -> [f64; 4] {
    let part = |(forces, speeds): (&[DVec3], &[DVec3])| {
        let mut sum = [0.0; 4];
        for (f, v) in forces.iter().zip(speeds) {
            let square = f.length_squared();
            sum[0] += f.dot(*v);
            sum[1] += square;
            sum[2] += v.length_squared();
            sum[3] = f64::max(sum[3], square);
        }
        sum
    };
    if forces.len() <= CHUNK {
        return part((forces, speeds));
    }
    let parts: Vec<[f64; 4]> = forces.par_chunks(CHUNK).zip(speeds.par_chunks(CHUNK)).map(part).collect();
    parts.into_iter().fold([0.0; 4], |a, b| [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3].max(b[3])])
}
