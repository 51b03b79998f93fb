//! Light that goes back the way that it came.

use super::*;
use crate::{
    geometry::fiber::{packing::hard_discs, slopes::Twist},
    math::{sampler::Stream, warp::normal},
    scattering::testing::{first_disc, material, packed_ply, section},
};
use glam::DVec2;

/// Azimuths from the camera's direction, degrees.
const BINS: [[f64; 2]; 5] = [[0.0, 8.0], [8.0, 16.0], [16.0, 25.0], [25.0, 40.0], [40.0, 60.0]];
/// Directions that are looked at from each place.
const TURNS: usize = 4;

/// An azimuth of a bin, radians, of a number from -1 to 1.
fn azimuth([least, most]: [f64; 2], u: f64) -> f64 {
    (least + (most - least) * u.abs()).copysign(u).to_radians()
}

/// What TT bends at the first fibre and another one scatters gets out past what both ways left clear, unless the first fibre is in its way: as in
/// packings of discs, for fibres of which TT bends light much and little.
#[test]
fn light_that_was_passed_on_once_goes_back_as_through_discs() {
    const FIBERS: u32 = 60;
    // What is hardly bent meets the fibre again that it came by: little of it gets out.
    let cases = [
        (0.35, 26.0f64, [0.1, 0.09, 0.06, 0.05, 0.05]),
        (0.35, 5.0, [0.35, 0.08, 0.08, 0.1, 0.06]),
        (0.5, 26.0, [0.06, 0.07, 0.06, 0.05, 0.09]),
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
            let discs: Vec<DVec2> = hard_discs(FIBERS, radius / core, Twist::NONE, &mut Stream::new(seed))
                .into_iter()
                .map(|disc| core * disc)
                .collect();
            let met = |from: DVec2, w: DVec2, but: Option<usize>| first_disc(&discs, radius, from, w, but);
            for _ in 0..400 {
                let (h, turn) =
                    (2.0 * f64::from(stream.next()) - 1.0, bend.to_radians() * f64::from(normal(stream.next())));
                let azimuths: [f64; TURNS] = std::array::from_fn(|_| 2.0 * f64::from(stream.next()) - 1.0);
                let Some((first, at)) = met(DVec2::new(2.0, h), DVec2::NEG_X, None) else { continue };
                let w = DVec2::from_angle(turn).rotate(DVec2::NEG_X);
                let Some((second, at)) = met(at, w, Some(first)) else { continue };
                all += 1.0;
                for (want, bin) in want.iter_mut().zip(BINS) {
                    for u in azimuths {
                        let is_out = met(at, DVec2::from_angle(azimuth(bin, u)), Some(second)).is_none();
                        *want += f64::from(u8::from(is_out)) / TURNS as f64;
                    }
                }
            }
        }
        for _ in 0..400_000 {
            let section = section(0.0, 2.0 * stream.next() - 1.0, 0.0);
            let mut crossings = Crossings::new();
            section.crossings(yarn.occluder().shape(), &mut crossings);
            let t0 = yarn.occluder().transparency(&crossings);
            let u = std::array::from_fn(|_| stream.next());
            let vertex = Vertex::new(&yarn, &section, &crossings, t0, Rgb::ONE, u, &mut stream);
            let Some(node) = vertex.node.get(&vertex.view).filter(|node| node.way_in.before == 1.0) else { continue };
            let weight = f64::from((1.0 - t0) * node.amplitude.mean());
            nodes += weight;
            for (out, bin) in out.iter_mut().zip(BINS) {
                let (sin, cos) = azimuth(bin, 2.0 * f64::from(stream.next()) - 1.0).sin_cos();
                let w = Vec3A::new(cos as f32, sin as f32, 0.0);
                *out += weight * f64::from(node.toward(&vertex.view, w).clear.mean());
            }
        }
        for (bin, (out, want)) in out.iter().zip(want).enumerate() {
            let (out, want) = (out / nodes, want / all);
            let case = format!("{density}, bent by {bend}, {:?}", BINS[bin]);
            assert!((out / want - 1.0).abs() < bounds[bin], "{case}: {out} go out, {want} through discs");
        }
    }
}
