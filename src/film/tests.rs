use super::{
    tile::{Sums, add_bytes, for_all_sums},
    *,
};
use crate::math::{Rgb, sampler::Stream};

#[test]
fn pixels_are_found_again_and_average() {
    let mut film = Film::new([5, 7, 45, 40], Layers::ALL, 1.0).unwrap();
    for tile in film.tiles_in_order() {
        for y in 0..tile.height {
            for x in 0..tile.width {
                for k in 0..4u32 {
                    let v = (tile.x + x) as f32 + 100.0 * (tile.y + y) as f32 + k as f32;
                    let sample = Sample { radiance: Rgb::splat(v), alpha: 1.0, depth: v, ..Sample::default() };
                    assert!(tile.add(x, y, &sample));
                }
                let bad = Sample { radiance: Rgb::splat(f32::NAN), ..Sample::default() };
                assert!(!tile.add(x, y, &bad), "a NaN is refused");
            }
        }
    }
    for y in 0..33 {
        for x in 0..40 {
            let p = film.pixel(x, y);
            let want = (5 + x) as f32 + 100.0 * (7 + y) as f32 + 1.5;
            assert_eq!((p.color[1], p.samples, p.alpha, p.depth), (want, 4, 1.0, want));
            // Variance of 0, 1, 2, 3 is 5/3 (unbiased); of their mean a quarter of it.
            assert!((p.variance[0] - 5.0 / 12.0).abs() < 1e-3, "{:?}", p.variance);
        }
    }
    assert_eq!(film.samples(), (4, 4.0, 4));
    let noise = film.noise().unwrap();
    assert!(0.0 < noise.low && noise.low < noise.estimate && noise.estimate < noise.high, "{noise:?}");
}

#[test]
fn added_samples_bring_what_they_cost() {
    let [mut whole, mut part] =
        [[0, 0, 64, 64], [32, 32, 64, 64]].map(|crop| Film::new(crop, Layers::NONE, 1.0).unwrap());
    let rays =
        |film: &Film| film.tiles().iter().fold([0; 2], |sum, tile| [sum[0] + tile.rays[0], sum[1] + tile.rays[1]]);
    whole.tiles_mut().iter_mut().for_each(|tile| tile.rays = [2, 3]);
    part.tiles_mut().iter_mut().for_each(|tile| tile.rays = [70, 500]);
    let [before, added] = [rays(&whole), rays(&part)];
    whole.add(&part);
    assert_eq!(rays(&whole), [before[0] + added[0], before[1] + added[1]]);
}

/// Over many renders the interval must be about as wide as the estimates differ, or wider where the picture has edges.
#[test]
fn the_interval_of_the_noise_is_as_wide_as_estimates_differ() {
    for (edges, narrowest, widest) in [(0.0, 0.7, 1.4), (0.8, 0.7, 4.0)] {
        let (mut sum, mut square, mut reach) = (0.0, 0.0, 0.0);
        let runs = 40;
        for run in 0..runs {
            let mut random = Stream::new(run);
            let mut film = Film::new([0, 0, 48, 32], Layers::NONE, 1.0).unwrap();
            for tile in film.tiles_mut() {
                for i in 0..tile.width * tile.height * 16 {
                    let (x, y) = (i % tile.width, i / tile.width % tile.height);
                    let size = if (tile.x + x) % 8 < 4 { 1.0 } else { 1.0 - edges };
                    // Exponential: as skewed as a path tracer's samples.
                    let v = -size * (1.0 - random.next()).ln();
                    tile.add(x, y, &Sample { radiance: Rgb::splat(v), ..Sample::default() });
                }
            }
            let noise = film.noise().unwrap();
            sum += noise.estimate;
            square += noise.estimate * noise.estimate;
            reach += noise.high - noise.estimate;
        }
        let n = f64::from(runs);
        let deviation = (square / n - (sum / n).powi(2)).sqrt();
        let ratio = reach / n / 1.96 / deviation;
        assert!((narrowest..widest).contains(&ratio), "edges {edges}: {ratio}");
    }
}

#[test]
fn tiles_come_back_from_their_bytes() {
    let layers = Layers::ALL;
    assert_eq!(Tile::bytes_per_pixel(Layers::NONE), 84);
    assert_eq!(Tile::bytes_per_pixel(Layers::DEFAULT), 144);
    assert_eq!(Tile::bytes_per_pixel(layers), 720);
    let mut tile = Tile::new(0, 0, 3, 2, layers, 1.0).unwrap();
    let matte = Some(MatteId { fabric: 1, yarn: 70_000, ply: 2 });
    for x in 0..3 {
        let radiance = Rgb::splat(0.3 + x as f32);
        tile.add(x, 1, &Sample { radiance, alpha: 1.0, depth: -2.5, normal: Vec3A::X, matte, ..Sample::default() });
    }
    let mut bytes = Vec::new();
    tile.save(&mut bytes);
    assert_eq!(bytes.len(), 6 * 720 + 3 * 16);
    let mut again = Tile::new(0, 0, 3, 2, layers, 1.0).unwrap();
    assert_eq!(again.load(&bytes, usize::MAX), Some(()));
    assert_eq!((&again.sums, &again.matte), (&tile.sums, &tile.matte));
    for cut in [0, 5, bytes.len() - 1] {
        assert_eq!(again.load(&bytes[..cut], usize::MAX), None);
    }
    bytes.push(0);
    assert_eq!(again.load(&bytes, usize::MAX), None);
}

/// What `info` says beforehand, and what a picture of a cinema's size may take.
#[test]
fn a_film_is_as_small_as_it_says() {
    let crop = [0, 0, 3840, 2160];
    let per_pixel = Film::bytes(crop, Layers::DEFAULT) as f64 / (3840.0 * 2160.0);
    assert!((144.0..150.0).contains(&per_pixel), "{per_pixel} bytes a pixel");
    for layers in [Layers::NONE, Layers::DEFAULT, Layers { lobes: true, light_groups: 3, ..Layers::DEFAULT }] {
        let sums = Sums::new(5, layers).unwrap();
        let mut bytes = 0;
        for_all_sums!(&sums, add_bytes, &mut bytes);
        assert_eq!(bytes, 5 * Tile::bytes_per_pixel(layers));
        // In memory they are as tight as in the file.
        assert_eq!(size_of_val(&*sums.color) + size_of_val(&*sums.square), 5 * 72);
    }
}

/// A kilometre away, in as many samples as anybody takes.
#[test]
fn far_positions_do_not_reach_the_limit_of_their_sums() {
    let mut film = Film::new([0, 0, 1, 1], Layers::ALL, 1.0).unwrap();
    let position = Vec3A::new(1e6, -1e6, 3.5);
    film.tiles_mut()[0].add(0, 0, &Sample { alpha: 1.0, position, ..Sample::default() });
    for _ in 0..16 {
        let twice = film.clone();
        film.add(&twice);
    }
    let pixel = film.pixel(0, 0);
    assert_eq!((pixel.samples, pixel.position), (65_536, position.to_array()));
}

#[test]
fn no_memory_is_an_error() {
    let too_large = Film::new([0, 0, u32::MAX, 65_536], Layers::ALL, 1.0).unwrap_err();
    assert!(too_large.to_string().starts_with("no memory for a film of "), "{too_large}");
}

#[test]
fn every_tile_is_rendered_once() {
    let mut film = Film::new([0, 0, 100, 33], Layers::NONE, 1.0).unwrap();
    let mut seen: Vec<(u32, u32)> = film.tiles_in_order().iter().map(|t| (t.x, t.y)).collect();
    seen.sort_unstable();
    seen.dedup();
    assert_eq!(seen.len(), 7 * 3);
}
