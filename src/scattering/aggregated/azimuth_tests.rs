//! Where a ply sends light, against explicit fibres.

use std::f64::consts::PI;

use super::*;
use crate::scattering::testing::{material, packed_ply, section};

/// What a straight, untwisted ply of fibres that only scatter evenly sends to each 30 degrees of azimuth, 0 towards the camera, of what it
/// sends anywhere, by channels.
fn around(fibers: u32, density: f64, m: &FiberMaterial) -> [[f64; 3]; 6] {
    let yarn = AggregatedYarn::new(packed_ply(fibers, density), &[m]);
    let (mut sums, mut all) = ([[0.0; 3]; 6], [0.0; 3]);
    let mut stream = Stream::new(4);
    for i in 0..60_000 {
        let section = section(0.0, -1.0 + 2.0 * (i as f32 + 0.5) / 60_000.0, 0.0);
        let mut crossings = Crossings::new();
        section.crossings(yarn.occluder().shape(), &mut crossings);
        let t0 = yarn.occluder().transparency(&crossings);
        let u = [0; 4].map(|_| stream.next());
        let vertex = Vertex::new(&yarn, &section, &crossings, t0, Rgb::ONE, u, &mut stream);
        let u = [0; 3].map(|_| stream.next());
        if let Some(next) = vertex.sample(u, &mut stream) {
            let azimuth = next.direction.y.atan2(next.direction.x).abs();
            let place = ((f64::from(azimuth) / PI * 6.0) as usize).min(5);
            for (c, weight) in next.weight.to_array().into_iter().enumerate() {
                sums[place][c] += f64::from(weight * (1.0 - t0));
                all[c] += f64::from(weight * (1.0 - t0));
            }
        }
    }
    sums.map(|part| std::array::from_fn(|c| part[c] / all[c]))
}

#[test]
fn thick_plies_send_light_back_as_their_fibers_do() {
    // Too little goes straight on: .85 of light that is scattered once. Of what white fibres scatter more often twice as much went there once.
    // `yarnray scatter` of organzine as one untwisted ply of 210 fibres, albedos .02, .3 and .9: 400000 paths.
    let truth = [
        [0.3545, 0.3545, 0.3617],
        [0.2659, 0.2673, 0.2787],
        [0.1899, 0.1891, 0.1910],
        [0.1192, 0.1164, 0.1097],
        [0.0558, 0.0537, 0.0477],
        [0.0166, 0.0158, 0.0136],
    ];
    let found = around(210, 0.5, &material(([0.0; 3], [0.0; 3], [0.02, 0.3, 0.9]), [0.15, 0.12, 0.35]));
    for (found, truth) in found.iter().zip(truth) {
        for (found, truth) in found.iter().zip(truth) {
            assert!((found / truth - 1.0).abs() < 0.16, "{found:.4} of all light, not {truth:.4}");
        }
    }
}
