//! Light that leaves from the first fibre that it meets.

use glam::DVec2;

use super::*;
use crate::{
    geometry::fiber::{packing::hard_discs, slopes::Twist},
    math::sampler::Stream,
    scattering::testing::{first_disc, material, packed_ply, section},
};

/// Azimuths from the camera's direction, degrees.
const BINS: [[f64; 2]; 6] = [[0.0, 20.0], [20.0, 50.0], [50.0, 80.0], [80.0, 110.0], [110.0, 140.0], [140.0, 170.0]];

/// An azimuth of a bin, radians, of a number from -1 to 1.
fn azimuth([least, most]: [f64; 2], u: f64) -> f64 {
    (least + (most - least) * u.abs()).copysign(u).to_radians()
}

/// As much of it gets out to all sides as through packings of discs.
#[test]
fn light_leaves_the_first_fiber_as_through_discs() {
    for (fibers, density) in [(60, 0.2), (60, 0.4), (143, 0.19), (143, 0.4), (150, 0.55)] {
        let radius = (density / f64::from(fibers)).sqrt();
        let core = 1.0 - radius;
        let yarn = AggregatedYarn::new(
            packed_ply(fibers, density),
            &[&material(([0.0; 3], [0.0; 3], [0.5; 3]), [0.1, 0.1, 0.3])],
        );
        let mut stream = Stream::new(5);
        let (mut out, mut want, mut all, mut nodes) = ([0.0; BINS.len()], [0.0; BINS.len()], 0.0, 0.0);
        for seed in 0..400 {
            let discs: Vec<DVec2> = hard_discs(fibers, radius / core, Twist::NONE, &mut Stream::new(1000 + seed))
                .into_iter()
                .map(|disc| core * disc)
                .collect();
            let met = |from: DVec2, w: DVec2, but: Option<usize>| first_disc(&discs, radius, from, w, but);
            for _ in 0..200 {
                let h = 2.0 * f64::from(stream.next()) - 1.0;
                let azimuths = BINS.map(|bin| azimuth(bin, 2.0 * f64::from(stream.next()) - 1.0));
                let Some((first, at)) = met(DVec2::new(2.0, h), DVec2::NEG_X, None) else { continue };
                all += 1.0;
                for (want, azimuth) in want.iter_mut().zip(azimuths) {
                    *want += f64::from(u8::from(met(at, DVec2::from_angle(azimuth), Some(first)).is_none()));
                }
            }
        }
        for _ in 0..100_000 {
            let section = section(0.0, 2.0 * stream.next() - 1.0, 0.0);
            let mut crossings = Crossings::new();
            section.crossings(yarn.occluder().shape(), &mut crossings);
            let t0 = yarn.occluder().transparency(&crossings);
            let u = std::array::from_fn(|_| stream.next());
            let vertex = Vertex::new(&yarn, &section, &crossings, t0, Rgb::ONE, u, &mut stream);
            let Some(node) = vertex.node.get(&vertex.view) else { continue };
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
            let case = format!("{fibers} at {density}, {:?}", BINS[bin]);
            assert!((out - want).abs() < 0.004 + 0.02 * want, "{case}: {out} go out, {want} through discs");
        }
    }
}
