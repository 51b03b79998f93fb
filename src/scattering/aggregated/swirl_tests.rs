//! How far light turns about a ply whose fibres lean, beside walks from fibre to fibre in a circle.

use std::f32::consts::TAU;

use glam::Vec2;

use super::tests::build;
use crate::{math::sampler::Stream, scattering::testing::material};

const WALKS: u32 = 60_000;
/// Of fibres that only reflect.
const ALBEDO: f32 = 0.95;

/// Light in a ply's section, a circle of radius 1.
#[derive(Clone, Copy)]
struct Walk {
    at: Vec2,
    way: Vec2,
    /// Its part along the fibres, for each unit of their own along the axis, and their slope at the circle; `None` of fibres that do not lean.
    leans: Option<[f32; 2]>,
}

impl Walk {
    /// How many more fibres lie on the way, per length across the ply, than if they did not lean.
    fn more(&self, at: Vec2) -> f32 {
        let Some([axial, slope]) = self.leans else { return 1.0 };
        let slope_ahead = slope * at.perp_dot(self.way);
        // sin(psi) + slope_ahead cos(psi) = axial, with psi the angle of the light against the section.
        let steep = (1.0 + slope_ahead * slope_ahead).sqrt();
        let cos = ((axial / steep).clamp(-1.0, 1.0).asin() - slope_ahead.atan()).cos().max(1e-3);
        let square = 1.0 + slope * slope * at.length_squared();
        (1.0 - axial * axial / square).max(0.0).sqrt() * square.sqrt() / cos
    }

    /// Goes on to the next fibre, of which `density` lie on a length of 1 where they do not lean. Whether there is one.
    fn meets(&mut self, density: f32, stream: &mut Stream) -> bool {
        const STEPS: usize = 24;
        let along = self.at.dot(self.way);
        let rim = (along * along + 1.0 - self.at.length_squared()).max(0.0).sqrt() - along;
        let step = rim / STEPS as f32;
        let mut left = -(-stream.next()).ln_1p();
        for k in 0..STEPS {
            let met = density * step * self.more(self.at + (k as f32 + 0.5) * step * self.way);
            if left < met {
                self.at += (k as f32 + left / met) * step * self.way;
                return true;
            }
            left -= met;
        }
        false
    }

    /// A fibre sends it on, evenly about itself.
    fn turns(&mut self, stream: &mut Stream) {
        let way = Vec2::from_angle(TAU * stream.next());
        let Some([axial, slope]) = self.leans else {
            self.way = way;
            return;
        };
        let outwards = self.at.normalize_or(Vec2::X);
        let (sin, cos) = (slope * self.at.length()).atan().sin_cos();
        let along = (axial * cos).clamp(-1.0, 1.0);
        let [out, aside] = ((1.0 - along * along).sqrt() * way).to_array();
        self.way = (out * outwards + (along * sin + aside * cos) * outwards.perp()).normalize_or(Vec2::X);
    }
}

/// The mean cosine against straight on of light that fibres sent on twice and more, which comes across the ply: from walks, as if fibres did
/// not lean after the first, and turned from there as the model does.
fn cosines(density: f32, slope: f32, swirl: impl Fn(f32) -> f32) -> [f32; 3] {
    let mut stream = Stream::new(3);
    let mut sums = [[0.0; 2]; 3];
    for _ in 0..WALKS {
        let aside = 2.0 * stream.next() - 1.0;
        let axial = -slope * aside;
        let at = Vec2::new(-(1.0 - aside * aside).sqrt(), aside);
        let mut first = Walk { at, way: Vec2::X, leans: Some([axial, slope]) };
        if !first.meets(density, &mut stream) {
            continue;
        }
        first.turns(&mut stream);
        for leans in [first.leans, None] {
            // The way on from the first fibre is the same for both.
            let mut walk = first;
            let (mut kept, mut events) = (ALBEDO, 1);
            while walk.meets(density, &mut stream) {
                walk.leans = leans;
                walk.turns(&mut stream);
                (kept, events) = (kept * ALBEDO, events + 1);
            }
            if events > 1 {
                let turned = Vec2::from_angle(swirl(axial)).rotate(walk.way);
                let ways: &[(usize, Vec2)] =
                    if leans.is_some() { &[(0, walk.way)] } else { &[(1, walk.way), (2, turned)] };
                for &(which, way) in ways {
                    sums[which][0] += kept;
                    sums[which][1] += kept * way.x;
                }
            }
        }
    }
    sums.map(|[all, forward]| forward / all)
}

#[test]
fn light_turns_about_a_twisted_ply_as_on_walks() {
    let reflects = material(([ALBEDO.into(); 3], [0.0; 3], [0.0; 3]), [0.02, 0.12, 0.35]);
    let mut far = 0;
    for twist in [0.26, 0.44, 0.67] {
        for area in [0.2, 0.35, 0.55] {
            let (yarn, _) = build((1, 150, area, 0.0, twist, 0.0, 0.0, 0.0), None, &reflects);
            let ply = &yarn.occluder().shape().plies[0];
            let density = 2.0 * 150.0 * ply.fiber_radius / (std::f32::consts::PI * ply.core_radius);
            let slope = ply.fiber_rate * ply.core_radius;
            let [walked, even, turned] = cosines(density, slope, |axial| yarn.plies[0].swirl(axial));
            let told = format!("twist {twist}, area fraction {area}: walked {walked:.3}, even {even:.3}, {turned:.3}");
            assert!((turned - walked).abs() < 0.04, "{told}");
            far += usize::from((even - walked).abs() > 0.04);
        }
    }
    assert!(far >= 4, "{far} cases that need it");
}
