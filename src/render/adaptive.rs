//! Adaptive sampling: more samples where a first few say that they are needed, without bias.
//!
//! Pixels are coloured like a chessboard. After [`PILOT`] samples everywhere, the samples of the black pixels decide
//! how many more the white pixels of each tile get, and the other way round; that plan then stands until the end. So
//! the number of a pixel's samples never depends on its own samples, which are independent of its neighbours', and its
//! plain mean has the right expectation. (Deciding again later would undo that: a pixel's samples would act on its own
//! number by way of its neighbours.)
//!
//! A tile's error per sample is e = mean of variance / (mean^2 + 0.01), its cost c the mean number of rays; in a given time
//! the sum of e / n is least for n in proportion to the square root of e / c. By the inequality of Cauchy and Schwarz
//! that is never worse than the same n everywhere, as far as the pilot knows e and c.

use crate::film::{Film, Tile};

/// Samples of every pixel before the plan is made.
pub(super) const PILOT: u32 = 16;
/// Least and most samples of a tile, as multiples of the mean: the pilot may have missed a rare light, or met one.
const SHARES: [f64; 2] = [0.2, 6.0];

/// How far each tile is to be sampled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Target {
    /// All pixels alike, up to this sample.
    Even(u32),
    /// By the tiles' shares, of which the even and the odd pixels have each their own unit.
    Shares([f64; 2]),
}

impl Target {
    /// The sample before which the even and the odd pixels of a tile stop.
    pub(super) fn of(self, tile: &Tile) -> [u32; 2] {
        match self {
            Self::Even(end) => [end; 2],
            Self::Shares(units) => {
                std::array::from_fn(|k| (units[k] * f64::from(tile.share[k])).round() as u32).map(|n: u32| n.max(PILOT))
            }
        }
    }

    /// That all pixels have `level` samples in the mean, by the shares of a film that has been planned.
    pub(super) fn of_plan(film: &Film, level: u32) -> Self {
        if level <= PILOT {
            return Self::Even(level);
        }
        Self::Shares(std::array::from_fn(|k| {
            let groups: Vec<(f64, f64)> =
                film.tiles().iter().map(|t| (f64::from(t.pixels_of(k)), f64::from(t.share[k]))).collect();
            let wanted = f64::from(level) * groups.iter().map(|g| g.0).sum::<f64>();
            let taken =
                |unit: f64| groups.iter().map(|(n, share)| n * (unit * share).max(f64::from(PILOT))).sum::<f64>();
            // The number of samples grows with the unit.
            let (mut low, mut high) = (0.0, f64::from(level) / SHARES[0] + 1.0);
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if taken(middle) < wanted { low = middle } else { high = middle }
            }
            high
        }))
    }
}

/// Gives every tile its shares, from a film that has [`PILOT`] samples everywhere.
pub(super) fn plan(film: &mut Film) {
    for k in 0..2 {
        // What the other colour says; where a tile has no such pixel, the mean.
        let wants: Vec<(f64, Option<f64>)> = film
            .tiles()
            .iter()
            .map(|t| {
                let want = t.error_per_sample(1 - k).zip(t.rays_per_sample(1 - k));
                (f64::from(t.pixels_of(k)), want.map(|(error, rays)| (error / rays.max(1.0)).sqrt()))
            })
            .collect();
        let known: Vec<(f64, f64)> = wants.iter().filter_map(|&(n, want)| Some((n, want?))).collect();
        let pixels: f64 = known.iter().map(|k| k.0).sum();
        let mean = known.iter().map(|(n, want)| n * want).sum::<f64>() / pixels.max(1.0);
        for (tile, (_, want)) in film.tiles_mut().iter_mut().zip(wants) {
            let share = want.filter(|_| mean > 0.0).map_or(1.0, |w| (w / mean).clamp(SHARES[0], SHARES[1]));
            tile.share[k] = share as f32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        film::Sample,
        math::{Rgb, sampler::Stream},
        scene::Layers,
    };

    /// Adds the samples up to a target: noise of a size that grows to the right.
    fn fill(film: &mut Film, target: Target, random: &mut Stream) {
        for tile in film.tiles_mut() {
            let to = target.of(tile);
            for y in 0..tile.height {
                for x in 0..tile.width {
                    let k = tile.color_of(x, y);
                    for _ in tile.next[k]..to[k] {
                        let size = (tile.x + x) as f32 / 64.0;
                        let radiance = Rgb::splat(1.0 + size * (random.next() - 0.5));
                        assert!(tile.add(x, y, &Sample { radiance, ..Sample::default() }));
                    }
                }
            }
            tile.next = to;
        }
    }

    #[test]
    fn samples_go_where_the_noise_is_and_add_up() {
        let mut random = Stream::new(1);
        let (mut adaptive, mut even) = (
            Film::new([0, 0, 64, 40], Layers::NONE, 1.0).unwrap(),
            Film::new([0, 0, 64, 40], Layers::NONE, 1.0).unwrap(),
        );
        fill(&mut adaptive, Target::Even(PILOT), &mut random);
        plan(&mut adaptive);
        for level in [32, 64, 128] {
            let before: Vec<_> = adaptive.tiles().iter().map(|t| t.next).collect();
            let target = Target::of_plan(&adaptive, level);
            fill(&mut adaptive, target, &mut random);
            fill(&mut even, Target::Even(level), &mut random);
            assert!((adaptive.samples().1 / f64::from(level) - 1.0).abs() < 0.02, "{:?}", adaptive.samples());
            assert!(adaptive.tiles().iter().zip(before).all(|(t, b)| t.next[0] >= b[0] && t.next[1] >= b[1]));
        }
        let [left, right] = [0, 3].map(|i| adaptive.tiles()[i].next);
        assert!(3 * left[0] < right[0] && 3 * left[1] < right[1], "{left:?} {right:?}");
        let [adaptive, even] = [adaptive, even].map(|f| f.noise().unwrap().estimate);
        assert!(adaptive < 0.9 * even, "{adaptive} against {even}");
    }

    #[test]
    fn an_even_picture_stays_even() {
        let mut film = Film::new([0, 0, 48, 48], Layers::NONE, 1.0).unwrap();
        let mut random = Stream::new(2);
        for tile in film.tiles_mut() {
            for i in 0..tile.width * tile.height * PILOT {
                let radiance = Rgb::splat(random.next());
                let (x, y) = (i % tile.width, i / tile.width % tile.height);
                tile.add(x, y, &Sample { radiance, ..Sample::default() });
            }
        }
        plan(&mut film);
        assert!(film.tiles().iter().all(|t| t.share.iter().all(|s| (s - 1.0).abs() < 0.1)));
        // Without any noise there is nothing to go by.
        let mut film = Film::new([0, 0, 20, 16], Layers::NONE, 1.0).unwrap();
        plan(&mut film);
        assert!(film.tiles().iter().all(|t| t.share == [1.0; 2]));
        assert_eq!(Target::of_plan(&film, 40).of(&film.tiles()[1]), [40, 40]);
    }

    /// The mean over many renders of pixels whose samples are very uneven: a rule that looked at a pixel's own samples
    /// would come out wrong.
    #[test]
    fn the_mean_is_unbiased() {
        let (mut sum, mut square, runs) = (0.0, 0.0, 300);
        for run in 0..runs {
            let mut random = Stream::new(1000 + run);
            let mut film = Film::new([0, 0, 34, 2], Layers::NONE, 1.0).unwrap();
            for target in [None, Some(24)] {
                let target = target.map_or(Target::Even(PILOT), |level| Target::of_plan(&film, level));
                for tile in film.tiles_mut() {
                    let to = target.of(tile);
                    for i in 0..tile.width * tile.height {
                        let (x, y) = (i % tile.width, i / tile.width);
                        let k = tile.color_of(x, y);
                        for _ in tile.next[k]..to[k] {
                            let v = if random.next() < 0.02 { 50.0 } else { 0.0 };
                            tile.add(x, y, &Sample { radiance: Rgb::splat(v), ..Sample::default() });
                        }
                    }
                    tile.next = to;
                }
                if target == Target::Even(PILOT) {
                    plan(&mut film);
                }
            }
            let pixels = (0..2).flat_map(|y| (0..34).map(move |x| (x, y)));
            let mean = pixels.map(|(x, y)| f64::from(film.pixel(x, y).color[0])).sum::<f64>() / 68.0;
            sum += mean;
            square += mean * mean;
        }
        let n = f64::from(runs);
        let error = ((square / n - (sum / n).powi(2)) / n).sqrt();
        assert!((sum / n - 1.0).abs() < 3.0 * error, "{} +- {error}", sum / n);
        assert!(error < 0.02, "{error}");
    }
}
