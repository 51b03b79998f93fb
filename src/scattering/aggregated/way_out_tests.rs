//! Light that leaves from the first fibre that it meets.

use std::ops::Range;

use glam::DVec2;

use super::*;
use crate::{
    geometry::fiber::{packing::hard_discs, slopes::Twist},
    math::sampler::Stream,
    scattering::testing::{first_disc, material, packed_ply, section},
};

/// What gets out of a ply from first fibres in directions of some ranges of angles, degrees, over what these send there: through discs, and by the
/// model. `azimuth` is the one from the camera's direction, radians, of an angle where the camera's ray is h beside the ply's axis.
fn ways_out<const N: usize>(
    (fibers, density): (u32, f64),
    ranges: &[Range<f64>; N],
    azimuth: impl Fn(f64, f64) -> f64,
) -> [[f64; 2]; N] {
    let radius = (density / f64::from(fibers)).sqrt();
    let core = 1.0 - radius;
    let yarn =
        AggregatedYarn::new(packed_ply(fibers, density), &[&material(([0.0; 3], [0.0; 3], [0.5; 3]), [0.1, 0.1, 0.3])]);
    let mut stream = Stream::new(5);
    let mut next = || f64::from(stream.next());
    let mut angle = |range: &Range<f64>| {
        let angle = range.start + (range.end - range.start) * next();
        angle.copysign(next() - 0.5).to_radians()
    };
    let mut others = Stream::new(6);
    let mut beside = || 2.0 * others.next() - 1.0;
    let (mut want, mut all) = ([0.0; N], 0.0);
    for seed in 0..400 {
        let packing = hard_discs(fibers, radius / core, Twist::NONE, &mut Stream::new(1000 + seed));
        let discs: Vec<DVec2> = packing.into_iter().map(|disc| core * disc).collect();
        for _ in 0..200 {
            let h = f64::from(beside());
            let met = |from: DVec2, w: DVec2, but: Option<usize>| first_disc(&discs, radius, from, w, but);
            let Some((first, at)) = met(DVec2::new(2.0, h), DVec2::NEG_X, None) else { continue };
            all += 1.0;
            for (want, range) in want.iter_mut().zip(ranges) {
                let w = DVec2::from_angle(azimuth(angle(range), h));
                *want += f64::from(u8::from(met(at, w, Some(first)).is_none()));
            }
        }
    }
    let (mut out, mut nodes) = ([0.0; N], 0.0);
    for _ in 0..100_000 {
        let h = beside();
        let section = section(0.0, h, 0.0);
        let mut crossings = Crossings::new();
        section.crossings(yarn.occluder().shape(), &mut crossings);
        let t0 = yarn.occluder().transparency(&crossings);
        let u = std::array::from_fn(|_| 0.5 * (beside() + 1.0));
        let vertex = Vertex::new(&yarn, &section, &crossings, t0, Rgb::ONE, u, &mut Stream::new(beside().to_bits()));
        let Some(node) = vertex.node.get(&vertex.view) else { continue };
        let weight = f64::from((1.0 - t0) * node.amplitude.mean());
        nodes += weight;
        for (out, range) in out.iter_mut().zip(ranges) {
            let w = DVec2::from_angle(azimuth(angle(range), f64::from(h))).as_vec2();
            *out += weight * f64::from(node.toward(&vertex.view, Vec3A::new(w.x, w.y, 0.0)).clear.mean());
        }
    }
    std::array::from_fn(|range| [out[range] / nodes, want[range] / all])
}

const PACKINGS: [(u32, f64); 7] = [(60, 0.2), (60, 0.4), (143, 0.19), (143, 0.4), (150, 0.55), (70, 0.5), (40, 0.5)];

/// As much of it gets out to all sides as through packings of discs.
#[test]
fn light_leaves_the_first_fiber_as_through_discs() {
    let turns = [0.0..20.0, 20.0..50.0, 50.0..80.0, 80.0..110.0, 110.0..140.0, 140.0..180.0];
    for packing in PACKINGS {
        for (turn, [out, want]) in turns.iter().zip(ways_out(packing, &turns, |angle, _| angle)) {
            assert!(
                (out - want).abs() < 0.004 + 0.03 * want,
                "{packing:?}, {turn:?}: {out} go out, {want} through discs"
            );
        }
    }
}

/// And as much along the ply's surface and a little below it, where only fibres by the wall are seen.
#[test]
fn light_leaves_the_first_fiber_along_the_surface() {
    // From the outward direction where the ray comes in.
    let ranges = [60.0..75.0, 75.0..90.0, 90.0..105.0];
    for packing in PACKINGS {
        for (range, [out, want]) in ranges.iter().zip(ways_out(packing, &ranges, |angle, h| angle + h.asin())) {
            assert!(
                (out - want).abs() < 0.005 + 0.08 * want,
                "{packing:?}, {range:?}: {out} go out, {want} through discs"
            );
        }
    }
}
