//! Which segments may touch in the steps to come.

use glam::DVec2;
use rayon::prelude::*;

use super::{
    super::contact::{PointGrid, Walk, nearest},
    ALONG, APART, CHUNK, MARGIN, Neighbour, Rods, Work,
};

impl Rods {
    /// Finds what may touch in the steps to come.
    pub(super) fn search(&self, has: &[bool], work: &mut Work) {
        let n = self.points.len();
        self.edges(&mut work.edges);
        let edges = &work.edges;
        let halves: Vec<f64> = edges.iter().map(|e| 0.5 * e.length()).collect();
        // One that is stretched must not make all cells wide.
        let longest =
            2.0 * halves.iter().copied().fold(0.05, f64::max).min(1.5 * halves.iter().sum::<f64>() / n as f64);
        let reach = APART + MARGIN + longest;
        let mut middles = Vec::with_capacity(n);
        // The segment, and by how many periods its image is moved.
        let mut images: Vec<(u32, [i8; 2])> = Vec::with_capacity(n);
        let mut own_cells = vec![[0_i32; 2]; if self.period.is_some() { n } else { 0 }];
        for i in 0..n {
            let mut middle = self.points[i] + 0.5 * edges[i];
            if let Some(period) = self.period {
                let cell = (middle.truncate() / period).floor();
                own_cells[i] = [cell.x as i32, cell.y as i32];
                middle -= (cell * period).extend(0.0);
            }
            middles.push(middle);
            images.push((i as u32, [0, 0]));
        }
        if let Some(period) = self.period {
            let around = (DVec2::splat(reach) / period).ceil().as_ivec2();
            for y in -around.y..=around.y {
                for x in -around.x..=around.x {
                    if x == 0 && y == 0 {
                        continue;
                    }
                    let by = DVec2::new(f64::from(x), f64::from(y)) * period;
                    for i in 0..n {
                        let at = middles[i].truncate() + by;
                        if at.cmpgt(DVec2::splat(-reach)).all() && at.cmplt(period + reach).all() {
                            middles.push(middles[i] + by.extend(0.0));
                            images.push((i as u32, [x as i8, y as i8]));
                        }
                    }
                }
            }
        }
        let grid = PointGrid::new(&middles, reach, None);
        // How far along its strand each segment is, and the strand's number.
        let mut along = vec![0.0; n];
        let mut strand_of = vec![0_u32; n];
        let mut lengths = Vec::with_capacity(self.strands.len());
        for (k, s) in self.strands.iter().enumerate() {
            let mut sum = 0.0;
            for i in s.start..s.start + s.count {
                along[i] = sum;
                strand_of[i] = k as u32;
                sum += self.rest[i];
            }
            lengths.push(sum);
        }
        let touch = APART + MARGIN;
        let periodic = self.period.is_some();
        let of = |i: usize, found: &mut Vec<Neighbour>, walk: &mut Walk<'_>| {
            if !has[i] {
                return;
            }
            let half = halves[i];
            let most = (touch + half + 0.5 * longest).powi(2);
            let (p0, p1) = (middles[i] - 0.5 * edges[i], middles[i] + 0.5 * edges[i]);
            for near in walk.around(i) {
                // Most of what cells hold is too far away: tell that before anything else is looked at.
                let distance = near.at.distance_squared(middles[i]);
                if distance > most {
                    continue;
                }
                let (j, mut cells) = images[near.index as usize];
                let j = j as usize;
                // Each pair once. (Images do not lie in the grid as what they are of does.)
                let both = periodic || grid.share_cell(i, near.index as usize);
                if both && (j < i || (j == i && cells <= [0, 0])) {
                    continue;
                }
                let widest = touch + half + halves[j];
                if distance > widest * widest || !has[j] {
                    continue;
                }
                if strand_of[i] == strand_of[j] {
                    let length = lengths[strand_of[i] as usize];
                    let (by, round) = ((along[j] - along[i]).abs(), self.strands[strand_of[i] as usize].jump.is_some());
                    let by = if round { by.min(length - by) } else { by };
                    // Near along the yarn and in space: the same piece of it. (A yarn's image next door is near in space
                    // alone, unless the period is shorter than this.)
                    let image = near.at - middles[i];
                    if by < ALONG && image.length() < by + half + halves[j] {
                        continue;
                    }
                }
                let half_j = 0.5 * edges[j];
                let between = nearest(p0, p1, near.at - half_j, near.at + half_j).between.length();
                if between > touch {
                    continue;
                }
                if self.period.is_some() {
                    for k in 0..2 {
                        cells[k] += (own_cells[i][k] - own_cells[j][k]) as i8;
                    }
                }
                found.push(Neighbour { segment: j as u32, cells, gap: (between - APART) as f32 });
            }
        };
        let chunks: Vec<(Vec<u32>, Vec<Neighbour>)> = (0..n.div_ceil(CHUNK))
            .into_par_iter()
            .map(|c| {
                let mut walk = if periodic { grid.walk() } else { grid.walk_ahead() };
                let mut found = Vec::new();
                let counts = (c * CHUNK..((c + 1) * CHUNK).min(n))
                    .map(|i| {
                        let before = found.len();
                        of(i, &mut found, &mut walk);
                        (found.len() - before) as u32
                    })
                    .collect();
                (counts, found)
            })
            .collect();
        work.starts.clear();
        work.starts.push(0);
        work.neighbours.clear();
        let mut sum = 0;
        for (counts, found) in chunks {
            for count in counts {
                sum += count;
                work.starts.push(sum);
            }
            work.neighbours.extend(found);
        }
    }
}
