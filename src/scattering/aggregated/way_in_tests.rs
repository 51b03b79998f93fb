//! Light that goes back the way that it came.

use super::*;
use crate::{
    geometry::fiber::{packing::hard_discs, slopes::Twist},
    math::{sampler::Stream, warp::normal},
    scattering::testing::{material, packed_ply, section},
};
use glam::DVec2;

/// Azimuths from the camera's direction, degrees.
const BINS: [[f64; 2]; 5] = [[0.0, 8.0], [8.0, 16.0], [16.0, 25.0], [25.0, 40.0], [40.0, 60.0]];
/// Directions that are looked at from each place.
const TURNS: usize = 4;

/// Discs of a radius in the circle of radius 1 around all of them.
struct Discs<'a> {
    centers: &'a [DVec2],
    radius: f64,
}

impl Discs<'_> {
    /// The first disc but one that a ray meets, and how far away.
    fn first(&self, from: DVec2, w: DVec2, but: Option<usize>) -> Option<(usize, f64)> {
        let meets = |(index, center): (usize, &DVec2)| {
            let way = *center - from;
            let (along, off) = (way.dot(w), way.dot(w.perp()));
            let is_met = but != Some(index) && along >= 0.0 && off.abs() < self.radius;
            is_met.then(|| (index, along - (self.radius * self.radius - off * off).sqrt()))
        };
        self.centers.iter().enumerate().filter_map(meets).min_by(|a, b| a.1.total_cmp(&b.1))
    }
}

/// What TT bends at the first fibre and another one scatters gets out past what both ways left clear, unless the first fibre is in its way: as in
/// packings of discs, for fibres of which TT bends light much and little.
#[test]
fn light_that_was_passed_on_once_goes_back_as_through_discs() {
    const FIBERS: u32 = 60;
    // What is hardly bent meets the fibre again that it came by: little of it gets out.
    let cases = [
        (0.35, 26.0f64, [0.05, 0.05, 0.05, 0.05, 0.12]),
        (0.35, 5.0, [0.35, 0.05, 0.13, 0.15, 0.12]),
        (0.5, 26.0, [0.05, 0.05, 0.05, 0.05, 0.17]),
    ];
    for (density, bend, bounds) in cases {
        let radius = (density / f64::from(FIBERS)).sqrt();
        let core = 1.0 - radius;
        let widths = [0.1, 0.01, bend.to_radians()];
        let yarn =
            AggregatedYarn::new(packed_ply(FIBERS, density), &[&material(([0.0; 3], [0.02; 3], [0.2; 3]), widths)]);
        let mut stream = Stream::new(5);
        let (mut out, mut want, mut all, mut nodes) = ([0.0; BINS.len()], [0.0; BINS.len()], 0.0, 0.0);
        for seed in 0..300 {
            let centers: Vec<DVec2> = hard_discs(FIBERS, radius / core, Twist::NONE, &mut Stream::new(seed))
                .into_iter()
                .map(|center| core * center)
                .collect();
            let discs = Discs { centers: &centers, radius };
            for _ in 0..400 {
                let (h, turn) =
                    (2.0 * f64::from(stream.next()) - 1.0, bend.to_radians() * f64::from(normal(stream.next())));
                let azimuths: [f64; TURNS] = std::array::from_fn(|_| 2.0 * f64::from(stream.next()) - 1.0);
                let from = DVec2::new(2.0, h);
                let Some((first, far)) = discs.first(from, DVec2::NEG_X, None) else { continue };
                let at = from - far * DVec2::X;
                let w = DVec2::from_angle(turn).rotate(DVec2::NEG_X);
                let Some((second, far)) = discs.first(at, w, Some(first)) else { continue };
                let at = at + far * w;
                all += 1.0;
                for (bin, [least, most]) in BINS.iter().enumerate() {
                    for azimuth in azimuths {
                        let angle = (least + (most - least) * azimuth.abs()).copysign(azimuth).to_radians();
                        let is_out = discs.first(at, DVec2::from_angle(angle), Some(second)).is_none();
                        want[bin] += f64::from(u8::from(is_out)) / TURNS as f64;
                    }
                }
            }
        }
        for _ in 0..150_000 {
            let section = section(0.0, 2.0 * stream.next() - 1.0, 0.0);
            let mut crossings = Crossings::new();
            section.crossings(yarn.occluder().shape(), &mut crossings);
            let t0 = yarn.occluder().transparency(&crossings);
            let u = std::array::from_fn(|_| stream.next());
            let vertex = Vertex::new(&yarn, &section, &crossings, t0, Rgb::ONE, u, &mut stream);
            let Some(node) = vertex.node.get(&vertex.view).filter(|node| node.way_in.before == 1.0) else { continue };
            let weight = f64::from((1.0 - t0) * node.amplitude.mean());
            nodes += weight;
            for (bin, [least, most]) in BINS.iter().enumerate() {
                let azimuth = 2.0 * f64::from(stream.next()) - 1.0;
                let angle = (least + (most - least) * azimuth.abs()).copysign(azimuth).to_radians() as f32;
                let w = Vec3A::new(angle.cos(), angle.sin(), 0.0);
                out[bin] += weight * f64::from(node.toward(&vertex.view, w).clear.mean());
            }
        }
        for (bin, (out, want)) in out.iter().zip(want).enumerate() {
            let (out, want) = (out / nodes, want / all);
            let case = format!("{density}, bent by {bend}, {:?}", BINS[bin]);
            assert!((out / want - 1.0).abs() < bounds[bin], "{case}: {out} go out, {want} through discs");
        }
    }
}
