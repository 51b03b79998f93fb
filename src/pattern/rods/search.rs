//! Which segments may touch in the steps to come.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::{ALONG, APART, CHUNK, MARGIN, Neighbour, Rods, Touching, Work, fill, gap};
use crate::geometry::contact::{PointGrid, Walk};

/// Segments by their middles, with the images that a periodic cell has of them.
struct Middles {
    /// Of the segments, and after them of their images; within the cell if there is one.
    points: Vec<DVec3>,
    /// For each of them the segment, and by how many periods its image is moved.
    images: Vec<(u32, [i8; 2])>,
    /// The cell in which each segment lies; empty without a period.
    own_cells: Vec<[i32; 2]>,
}

/// Where each segment is on its strand.
#[derive(Default)]
pub(super) struct OnStrands {
    /// How far along it.
    along: Vec<f64>,
    /// The strand's number.
    strand: Vec<u32>,
    /// Length of each strand.
    lengths: Vec<f64>,
}

/// All that tells which segments may touch.
struct Search<'a> {
    rods: &'a Rods,
    has: &'a [bool],
    /// Those around which is looked, where that is not all.
    moved: Option<&'a [bool]>,
    /// How far each has travelled.
    travelled: &'a [f32],
    edges: &'a [DVec3],
    halves: &'a [f64],
    /// The longest segment, but for few.
    longest: f64,
    /// How near those are that may touch.
    touch: f64,
    middles: &'a Middles,
    grid: &'a PointGrid,
    on_strands: &'a OnStrands,
}

impl Rods {
    /// Finds what may touch in the steps to come.
    pub(super) fn search(&self, has: &[bool], work: &mut Work) {
        self.edges(&mut work.edges);
        work.travelled.clear();
        work.travelled.resize(self.points.len(), 0.0);
        work.touching.clear();
        self.find_touching(has, None, work);
    }

    /// The same around segments alone that have `moved`; what others may touch among themselves stays.
    pub(super) fn search_again(&self, has: &[bool], moved: &[bool], work: &mut Work) {
        self.edges(&mut work.edges);
        self.find_touching(has, Some(moved), work);
    }

    /// Finds what may touch, for each chunk of segments: around those that have moved anew.
    fn find_touching(&self, has: &[bool], moved: Option<&[bool]>, work: &mut Work) {
        let n = self.points.len();
        let known = std::mem::take(&mut work.touching);
        let edges = &work.edges;
        let mut halves = Vec::new();
        fill(&mut halves, n, |i| 0.5 * edges[i].length());
        // One that is stretched must not make all cells wide.
        let longest =
            2.0 * halves.iter().copied().fold(0.05, f64::max).min(1.5 * halves.iter().sum::<f64>() / n as f64);
        // What is not looked at again may have gone on its way, and come back.
        let touch = APART + if moved.is_some() { 1.5 * MARGIN } else { MARGIN };
        let reach = touch + longest;
        let middles = self.middles(edges, reach);
        let grid = PointGrid::new(&middles.points, reach, None);
        let search = Search {
            rods: self,
            has,
            moved,
            travelled: &work.travelled,
            edges,
            halves: &halves,
            longest,
            touch,
            middles: &middles,
            grid: &grid,
            on_strands: &work.on_strands,
        };
        let anew = |c: usize, known: &Touching| {
            let mut walk = if search.finds_both() { grid.walk() } else { grid.walk_ahead() };
            let mut found = Touching { starts: vec![0], neighbours: Vec::with_capacity(known.neighbours.len()) };
            for (at, i) in (c * CHUNK..((c + 1) * CHUNK).min(n)).enumerate() {
                match moved {
                    Some(moved) if !moved[i] => {
                        let stays = |other: &&Neighbour| !moved[other.segment as usize];
                        found.neighbours.extend(known.neighbours[known.range(at)].iter().filter(stays));
                    }
                    _ => search.around(i, &mut found.neighbours, &mut walk),
                }
                found.starts.push(found.neighbours.len() as u32);
            }
            found
        };
        let Some(moved) = moved else {
            work.touching = (0..n.div_ceil(CHUNK)).into_par_iter().map(|c| anew(c, &Touching::default())).collect();
            return;
        };
        let of_chunk = |(c, (known, moved_here)): (usize, (Touching, &[bool]))| {
            let as_before =
                !moved_here.contains(&true) && known.neighbours.iter().all(|other| !moved[other.segment as usize]);
            if as_before { known } else { anew(c, &known) }
        };
        work.touching = known.into_par_iter().zip(moved.par_chunks(CHUNK)).enumerate().map(of_chunk).collect();
    }

    /// Whether both ends of a segment stay where they are.
    fn stays(&self, i: usize) -> bool {
        self.fixed.get(i..i + 2).is_some_and(|ends| ends[0] && ends[1])
    }

    /// Middles of segments, with those of images that are within `reach` of the cell.
    fn middles(&self, edges: &[DVec3], reach: f64) -> Middles {
        let n = self.points.len();
        let mut points = Vec::new();
        fill(&mut points, n, |i| self.points[i] + 0.5 * edges[i]);
        let mut images: Vec<(u32, [i8; 2])> = (0..n as u32).map(|i| (i, [0, 0])).collect();
        let mut own_cells = Vec::new();
        if let Some(period) = self.period {
            for middle in &mut points {
                let cell = (middle.truncate() / period).floor();
                own_cells.push([cell.x as i32, cell.y as i32]);
                *middle -= (cell * period).extend(0.0);
            }
            let around = (DVec2::splat(reach) / period).ceil().as_ivec2();
            let all = (-around.y..=around.y).flat_map(|y| (-around.x..=around.x).map(move |x| (x, y)));
            for (x, y) in all.filter(|cell| *cell != (0, 0)) {
                let by = DVec2::new(f64::from(x), f64::from(y)) * period;
                for i in 0..n {
                    let at = points[i].truncate() + by;
                    if at.cmpgt(DVec2::splat(-reach)).all() && at.cmplt(period + reach).all() {
                        points.push(points[i] + by.extend(0.0));
                        images.push((i as u32, [x as i8, y as i8]));
                    }
                }
            }
        }
        Middles { points, images, own_cells }
    }

    pub(super) fn on_strands(&self) -> OnStrands {
        let n = self.points.len();
        let (mut along, mut strand) = (vec![0.0; n], vec![0_u32; n]);
        let mut lengths = Vec::with_capacity(self.strands.len());
        for (k, s) in self.strands.iter().enumerate() {
            let mut sum = 0.0;
            for i in s.start..s.start + s.count {
                along[i] = sum;
                strand[i] = k as u32;
                sum += self.rest[i];
            }
            lengths.push(sum);
        }
        OnStrands { along, strand, lengths }
    }
}

impl Search<'_> {
    /// Whether each of a pair is found around the other. (Images do not lie in the grid as what they are of does.)
    fn finds_both(&self) -> bool {
        self.rods.period.is_some() || self.moved.is_some()
    }

    /// What segment `i` may touch: each pair once.
    fn around(&self, i: usize, found: &mut Vec<Neighbour>, walk: &mut Walk<'_>) {
        let Self { has, moved, travelled, edges, halves, middles, touch, .. } = self;
        if !has[i] {
            return;
        }
        let periodic = self.rods.period.is_some();
        let (half, middle, stays) = (halves[i], middles.points[i], self.rods.stays(i));
        let p0 = middle - 0.5 * edges[i];
        let per_square = 1.0 / edges[i].length_squared().max(1e-18);
        // Most of what cells hold is too far away: that is told of many at once.
        walk.within(middle, touch + half + 0.5 * self.longest, |near| {
            let (j, mut cells) = middles.images[near.index as usize];
            let j = j as usize;
            let both = self.finds_both() || self.grid.share_cell(i, near.index as usize);
            let looks = moved.is_none_or(|moved| moved[j]);
            if both && looks && (j < i || (j == i && cells <= [0, 0])) {
                return;
            }
            // No nearer than its middle is, less half of its length.
            let off = near.at - p0;
            let beside = off - edges[i] * (off.dot(edges[i]) * per_square).clamp(0.0, 1.0);
            let widest = touch + halves[j];
            let apart = beside.length_squared() > widest * widest || (stays && self.rods.stays(j));
            if apart || !has[j] || self.same_piece(i, j, near.at - middle) {
                return;
            }
            let between = beside.length() - halves[j];
            if periodic {
                let own = middles.own_cells[i].iter().zip(&middles.own_cells[j]);
                cells.iter_mut().zip(own).for_each(|(cell, (a, b))| *cell += (a - b) as i8);
            }
            found.push(Neighbour { segment: j as u32, cells, until: travelled[i] + travelled[j] + gap(between) });
        });
    }

    /// Whether two segments, `away` from each other, are near along the yarn and in space: the same piece of it. (A yarn's
    /// image next door is near in space alone, unless the period is shorter than this.)
    #[inline]
    fn same_piece(&self, i: usize, j: usize, away: DVec3) -> bool {
        let OnStrands { along, strand, lengths } = self.on_strands;
        if strand[i] != strand[j] {
            return false;
        }
        let strand = strand[i] as usize;
        let by = (along[j] - along[i]).abs();
        let by = if self.rods.strands[strand].jump.is_some() { by.min(lengths[strand] - by) } else { by };
        by < ALONG && away.length() < by + self.halves[i] + self.halves[j]
    }
}
