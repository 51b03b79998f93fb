//! Which light a shadow ray looks for, where there are several.

use glam::Vec3A;

use super::Light;
use crate::math::sampler::OneOf;

/// Chooses between lights by what each can give at a place: power over distance, cone and facing, without what stands
/// in the way. A light that gives nothing there is not chosen.
#[derive(Clone, Debug)]
pub struct LightChooser<'a> {
    /// Each with its place among all lights.
    lights: Vec<(usize, &'a Light)>,
}

/// A light that was drawn.
#[derive(Clone, Copy, Debug)]
pub struct Chosen<'a> {
    /// Its place among all lights.
    pub index: usize,
    /// The light.
    pub light: &'a Light,
    /// The chance that it had.
    pub chance: f32,
}

impl<'a> LightChooser<'a> {
    /// Between those of `lights` that need shadow rays and shine.
    pub fn new(lights: &'a [Light]) -> Self {
        let looked_for = |light: &Light| light.needs_shadow_rays() && light.irradiance_at_middle() > 0.0;
        Self { lights: lights.iter().enumerate().filter(|(_, light)| looked_for(light)).collect() }
    }

    /// Whether there is none to choose: what light there is only paths find.
    pub fn is_empty(&self) -> bool {
        self.lights.is_empty()
    }

    /// Draws a light for the place `at` by `u` in [0, 1); `None` if none gives anything.
    #[inline]
    pub fn choose(&self, at: Vec3A, u: f32) -> Option<Chosen<'a>> {
        if let &[(index, light)] = self.lights.as_slice() {
            return Some(Chosen { index, light, chance: 1.0 });
        }
        let mut one = OneOf::new(u);
        for &(index, light) in &self.lights {
            let given = light.most_at(at);
            one.offer(given, (index, light, given));
        }
        one.drawn.map(|(index, light, given)| Chosen { index, light, chance: given / one.total })
    }

    /// The chance of a light, by its place among all, in [`Self::choose`] at a place; 0 if shadow rays never look for it.
    #[inline]
    pub fn chance(&self, index: usize, at: Vec3A) -> f32 {
        let Some((_, light)) = self.lights.iter().find(|one| one.0 == index) else { return 0.0 };
        if self.lights.len() == 1 {
            return 1.0;
        }
        let given = light.most_at(at);
        if given > 0.0 { given / self.lights.iter().map(|(_, light)| light.most_at(at)).sum::<f32>() } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;
    use crate::{
        light::{AreaLight, Shape},
        math::{Rgb, sampler::Stream},
    };

    fn lights() -> Vec<Light> {
        let disk = |y: f32, normal| {
            let shape = Shape::Disk { centre: Vec3A::new(2.0, y, 0.0), normal, radius: 1.0 };
            Light::Area(AreaLight { shape, radiance: Rgb::splat(2.0), two_sided: false, visible: true })
        };
        let spot = |x: f32| Light::Spot {
            position: Vec3A::new(x, 5.0, 0.0),
            axis: Vec3A::NEG_Y,
            intensity: Rgb::splat(40.0),
            cos_inner: 0.99,
            cos_outer: 0.97,
        };
        vec![
            Light::Point { position: Vec3A::new(0.0, 1.0, 3.0), intensity: Rgb::splat(3.0) },
            Light::Distant { towards: Vec3A::Y, one_minus_cos: 0.0, irradiance: Rgb::splat(0.2) },
            spot(0.0),
            spot(9.0),
            disk(4.0, Vec3A::NEG_Y),
            disk(4.0, Vec3A::Y),
        ]
    }

    #[test]
    fn lights_are_drawn_by_the_chances_that_are_told() {
        let lights = lights();
        let chooser = LightChooser::new(&lights);
        for at in [Vec3A::ZERO, Vec3A::new(9.0, 0.1, 0.0), Vec3A::new(2.0, 6.0, 0.0)] {
            let n = 200_000;
            let mut counts = [0; 6];
            for i in 0..n {
                let chosen = chooser.choose(at, (i as f32 + 0.5) / n as f32).expect("a point shines everywhere");
                assert!((chooser.chance(chosen.index, at) / chosen.chance - 1.0).abs() < 1e-5);
                counts[chosen.index] += 1;
            }
            for (index, count) in counts.into_iter().enumerate() {
                let chance = chooser.chance(index, at);
                assert!(
                    (f64::from(count) / f64::from(n) - f64::from(chance)).abs() < 1e-3,
                    "{at}: {index} {count} {chance}"
                );
            }
        }
        // A spot far beside, and the backs of disks.
        assert_eq!(chooser.chance(3, Vec3A::ZERO), 0.0);
        assert_eq!(chooser.chance(5, Vec3A::ZERO), 0.0);
        assert_eq!(chooser.chance(4, Vec3A::new(2.0, 6.0, 0.0)), 0.0);
    }

    #[test]
    fn what_gives_light_can_be_chosen() {
        let lights = lights();
        let chooser = LightChooser::new(&lights);
        let mut stream = Stream::new(8);
        for _ in 0..20_000 {
            let at = Vec3A::new(stream.next(), stream.next(), stream.next()) * 24.0 - 12.0;
            for (index, light) in lights.iter().enumerate() {
                let given = light.sample(at, Vec2::new(stream.next(), stream.next())).map_or(0.0, |s| s.weight.mean());
                assert!(given <= 0.0 || chooser.chance(index, at) > 0.0, "{light:?} at {at}");
            }
        }
    }
}
