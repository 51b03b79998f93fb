//! Lights: how to draw a direction towards one, with what density, and what it sends.
//!
//! Units: area and environment lights have a radiance, distant lights the irradiance on a surface that faces them, points
//! and spots a radiant intensity (in a scene file per square of its unit, here radiance times square millimetres).
//! No light blocks another or casts a shadow; one that the camera sees hides from it what is behind.

mod chooser;
mod environment;
mod shape;

use std::f32::consts::PI;

use glam::{DVec3, Vec2, Vec3A};

pub use chooser::{Chosen, LightChooser};
pub use environment::{Environment, EnvironmentMap};
pub use shape::Shape;

use crate::math::{Rgb, frame::orthonormal_basis, special::smooth_step_f32, warp};

/// A light of the scene.
#[derive(Clone, Debug)]
pub enum Light {
    /// Light from all directions, from infinitely far away.
    Environment(Environment),
    /// Parallel light, or light from a small disc of the sky. Only shadow rays find it: camera and bounced rays pass.
    Distant {
        /// Unit vector towards the light.
        towards: Vec3A,
        /// 1 - cos of the angular radius; 0 for parallel light.
        one_minus_cos: f32,
        /// Irradiance on a surface that faces it, of the whole disc.
        irradiance: Rgb,
    },
    /// Light from one point.
    Point {
        /// Where it is, millimetres about the scene's middle.
        position: Vec3A,
        /// Radiant intensity, per steradian, in radiance times square millimetres.
        intensity: Rgb,
    },
    /// Light from one point into a cone.
    Spot {
        /// Where it is, millimetres about the scene's middle.
        position: Vec3A,
        /// Unit vector along its axis, away from it.
        axis: Vec3A,
        /// Radiant intensity on the axis, as of a point.
        intensity: Rgb,
        /// Cosine of the angle from the axis up to which it is as bright as on the axis.
        cos_inner: f32,
        /// Cosine of the angle at which it is dark.
        cos_outer: f32,
    },
    /// Light from a surface, the same radiance in all directions.
    Area(AreaLight),
}

/// A surface that emits light.
#[derive(Clone, Copy, Debug)]
pub struct AreaLight {
    /// Where it is.
    pub shape: Shape,
    /// Its radiance.
    pub radiance: Rgb,
    /// Whether a flat shape emits to both sides.
    pub two_sided: bool,
    /// Whether the camera sees it; it lights the cloth in any case.
    pub visible: bool,
}

/// A direction towards a light.
#[derive(Clone, Copy, Debug)]
pub struct LightSample {
    /// Unit vector towards the light.
    pub direction: Vec3A,
    /// How far a shadow ray must be free.
    pub distance: f32,
    /// Radiance over density.
    pub weight: Rgb,
    /// Density per steradian against which direction sampling is weighed; infinite where no other ray can find this light.
    pub pdf: f32,
}

/// The least share of a light's power that one which is seen edge on is chosen by: its centre does not tell all of it.
const FACING_AWAY: f32 = 0.05;

impl Light {
    /// A measure of how much it lights the cloth: about the irradiance at the scene's middle, and above 0 for every light
    /// that shines somewhere, also where [`Self::most_at`] would be 0 there.
    pub fn irradiance_at_middle(&self) -> f32 {
        match self {
            Self::Environment(environment) => PI * environment.mean().mean(),
            Self::Distant { irradiance, .. } => irradiance.mean(),
            Self::Point { position, intensity } => intensity.mean() / position.length_squared().max(1e-6),
            Self::Spot { position, axis, intensity, cos_inner, cos_outer } => {
                let towards_middle = (-*position).normalize_or(*axis);
                let share = spot_share(axis.dot(towards_middle), *cos_inner, *cos_outer);
                share.max(FACING_AWAY) * intensity.mean() / position.length_squared().max(1e-6)
            }
            Self::Area(light) => {
                let (centre, area) = (light.shape.centre(), light.shape.area());
                let cos = light.shape.normal().map_or(1.0, |n| {
                    let cos = n.dot((-centre).normalize_or(n));
                    if light.two_sided { cos.abs() } else { cos }
                });
                // That of a disk of the same area, which never exceeds pi times the radiance.
                cos.max(FACING_AWAY) * light.radiance.mean() * area / (area / PI + centre.length_squared())
            }
        }
    }

    /// About the irradiance at a place where nothing stands in the way, on a surface that faces the light; 0 only if the
    /// light gives nothing there.
    #[inline]
    pub(super) fn most_at(&self, at: Vec3A) -> f32 {
        match self {
            Self::Environment(_) | Self::Distant { .. } => self.irradiance_at_middle(),
            Self::Point { position, intensity } => intensity.mean() / (*position - at).length_squared().max(1e-8),
            Self::Spot { position, axis, intensity, cos_inner, cos_outer } => {
                let way = at - *position;
                let square = way.length_squared().max(1e-8);
                spot_share(axis.dot(way) / square.sqrt(), *cos_inner, *cos_outer) * intensity.mean() / square
            }
            Self::Area(light) => {
                let way = at - light.shape.centre();
                let square = way.length_squared();
                let cos = match light.shape.normal() {
                    None => 1.0,
                    Some(normal) => {
                        let along = normal.dot(way);
                        if along <= 0.0 && !light.two_sided {
                            return 0.0;
                        }
                        (along.abs() / square.max(1e-20).sqrt()).max(FACING_AWAY)
                    }
                };
                let area = light.shape.area();
                cos * light.radiance.mean() * area / (area / PI + square)
            }
        }
    }

    /// What is wrong with its numbers, whoever made it.
    pub fn problem(&self) -> Option<&'static str> {
        let (color, places, units) = match self {
            Self::Environment(environment) => (environment.radiance, vec![], vec![]),
            Self::Distant { towards, irradiance, .. } => (*irradiance, vec![], vec![*towards]),
            Self::Point { position, intensity } => (*intensity, vec![*position], vec![]),
            Self::Spot { position, axis, intensity, .. } => (*intensity, vec![*position], vec![*axis]),
            Self::Area(AreaLight { shape, radiance, .. }) => match *shape {
                Shape::Rectangle { corner, x, y, .. } => (*radiance, vec![corner], vec![x, y]),
                Shape::Disk { centre, normal, .. } => (*radiance, vec![centre], vec![normal]),
                Shape::Sphere { centre, .. } => (*radiance, vec![centre], vec![]),
            },
        };
        let positive = |size: f32| size > 0.0 && size.is_finite();
        let has_size = match self {
            Self::Area(AreaLight { shape: Shape::Rectangle { size, .. }, .. }) => positive(size.x) && positive(size.y),
            Self::Area(AreaLight { shape: Shape::Disk { radius, .. } | Shape::Sphere { radius, .. }, .. }) => {
                positive(*radius)
            }
            Self::Distant { one_minus_cos, .. } => (0.0..=1.0).contains(one_minus_cos),
            Self::Spot { cos_inner, cos_outer, .. } => {
                -1.0 <= *cos_outer && cos_outer <= cos_inner && *cos_inner <= 1.0
            }
            Self::Environment(_) | Self::Point { .. } => true,
        };
        if !(color.is_finite() && color.min_channel() >= 0.0) {
            Some("expected finite light, 0 or more")
        } else if !places.iter().all(|place| place.is_finite()) {
            Some("expected a finite position")
        } else if !units.iter().all(|unit| unit.is_normalized()) {
            Some("expected directions of length 1")
        } else {
            (!has_size).then_some("expected sizes above 0 and angles in their range")
        }
    }

    /// Whether shadow rays must look for it. An even environment is left to the
    /// sampled directions, which all end in it.
    pub fn needs_shadow_rays(&self) -> bool {
        match self {
            Self::Environment(environment) => environment.image.is_some(),
            Self::Distant { .. } | Self::Point { .. } | Self::Spot { .. } | Self::Area(_) => true,
        }
    }

    /// Moves it. Lights at infinity stay.
    pub fn translate(&mut self, by: DVec3) {
        match self {
            Self::Environment(_) | Self::Distant { .. } => {}
            Self::Point { position, .. } | Self::Spot { position, .. } => {
                *position = (position.as_dvec3() + by).as_vec3a();
            }
            Self::Area(light) => light.shape = light.shape.moved(by.as_vec3a()),
        }
    }

    /// Draws a direction from `at` towards the light.
    #[inline]
    pub fn sample(&self, at: Vec3A, u: Vec2) -> Option<LightSample> {
        match self {
            Self::Environment(environment) => {
                let map = environment.image.as_ref()?;
                let (direction, pdf) = map.sample(u)?;
                let weight = environment.radiance * map.radiance(direction) / pdf;
                Some(LightSample { direction, distance: f32::INFINITY, weight, pdf })
            }
            Self::Distant { towards, one_minus_cos, irradiance } => {
                let direction = if *one_minus_cos > 0.0 {
                    let (x, y) = orthonormal_basis(*towards);
                    let w = warp::cone(u, *one_minus_cos);
                    w.x * x + w.y * y + w.z * *towards
                } else {
                    *towards
                };
                // Directions are drawn evenly from the disc, whose mean cosine is 1 - (1 - cos) / 2.
                let weight = *irradiance / (1.0 - 0.5 * one_minus_cos);
                Some(LightSample { direction, distance: f32::INFINITY, weight, pdf: f32::INFINITY })
            }
            Self::Point { position, intensity } => from_point(*position - at, *intensity),
            Self::Spot { position, axis, intensity, cos_inner, cos_outer } => {
                let sample = from_point(*position - at, *intensity)?;
                let share = spot_share(-sample.direction.dot(*axis), *cos_inner, *cos_outer);
                (share > 0.0).then(|| LightSample { weight: sample.weight * share, ..sample })
            }
            Self::Area(light) => {
                let sample = light.shape.sample(at, u, light.two_sided)?;
                Some(LightSample {
                    direction: sample.direction,
                    distance: sample.distance,
                    weight: light.radiance / sample.pdf,
                    pdf: sample.pdf,
                })
            }
        }
    }
}

/// Light of an intensity over `way`.
#[inline]
fn from_point(way: Vec3A, intensity: Rgb) -> Option<LightSample> {
    let square = way.length_squared();
    let distance = square.sqrt();
    // A light within a yarn is seen from as near as single precision resolves, not from distance 0.
    (distance > 0.0).then(|| LightSample {
        direction: way / distance,
        distance,
        weight: intensity / square.max(1e-8),
        pdf: f32::INFINITY,
    })
}

/// The share of its intensity that a spot sends at an angle from its axis: 1 inside, a smooth edge, 0 outside.
#[inline]
fn spot_share(cos: f32, cos_inner: f32, cos_outer: f32) -> f32 {
    if cos >= cos_inner {
        return 1.0;
    }
    smooth_step_f32((cos - cos_outer) / (cos_inner - cos_outer))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lights_send_what_they_say() {
        let sun = Light::Distant { towards: Vec3A::Z, one_minus_cos: 1e-3, irradiance: Rgb::splat(2.0) };
        let s = sun.sample(Vec3A::ZERO, Vec2::new(0.9, 0.2)).unwrap();
        assert!(s.direction.z >= 1.0 - 1.001e-3 && s.pdf == f32::INFINITY);
        assert!((s.weight.mean() - 2.0 / 0.9995).abs() < 1e-6, "{:?}", s.weight);
        let lamp = Light::Point { position: Vec3A::new(0.0, 2.0, 0.0), intensity: Rgb::splat(8.0) };
        let s = lamp.sample(Vec3A::ZERO, Vec2::ZERO).unwrap();
        assert_eq!((s.distance, s.weight), (2.0, Rgb::splat(2.0)));
        assert!(lamp.sample(Vec3A::new(0.0, 2.0, 0.0), Vec2::ZERO).is_none());
    }

    #[test]
    fn a_spot_is_full_inside_dark_outside_and_smooth_between() {
        let angles = [0.3f32, 0.5];
        let spot = Light::Spot {
            position: Vec3A::new(0.0, 4.0, 0.0),
            axis: Vec3A::NEG_Y,
            intensity: Rgb::splat(16.0),
            cos_inner: angles[0].cos(),
            cos_outer: angles[1].cos(),
        };
        // Irradiance on the floor: I cos^3 / h^2, times the share of the angle.
        let at = |angle: f32| {
            let s = spot.sample(Vec3A::new(4.0 * angle.tan(), 0.0, 0.0), Vec2::ZERO);
            s.map_or(0.0, |s| s.weight.mean() * s.direction.y / angle.cos().powi(3))
        };
        for i in 0..100 {
            let angle = i as f32 * 0.01;
            let value = at(angle);
            match angle {
                a if a < angles[0] - 1e-3 => assert!((value - 1.0).abs() < 1e-4, "{a}: {value}"),
                a if a > angles[1] + 1e-3 => assert_eq!(value, 0.0, "{a}"),
                a => {
                    assert!((-1e-6..=1.0001).contains(&value), "{a}: {value}");
                    assert!((at(a + 0.01) - value).abs() < 0.12 && at(a + 0.01) <= value + 1e-4, "{a}");
                }
            }
        }
        assert!(at(0.4) > 0.3 && at(0.4) < 0.7);
    }

    #[test]
    fn every_light_that_shines_can_be_chosen() {
        let disk = |normal, two_sided| {
            let shape = Shape::Disk { centre: Vec3A::new(0.0, 10.0, 0.0), normal, radius: 2.0 };
            Light::Area(AreaLight { shape, radiance: Rgb::ONE, two_sided, visible: true }).irradiance_at_middle()
        };
        let want = PI * 4.0 / 104.0;
        assert!((disk(Vec3A::NEG_Y, false) / want - 1.0).abs() < 1e-5);
        assert!(disk(Vec3A::Y, false) > 0.0 && disk(Vec3A::Y, false) < 0.1 * want);
        assert_eq!(disk(Vec3A::Y, true), disk(Vec3A::NEG_Y, true));
        let mut lamp = Light::Point { position: Vec3A::ZERO, intensity: Rgb::ONE };
        lamp.translate(DVec3::new(1.0, 2.0, 3.0));
        assert!(matches!(lamp, Light::Point { position, .. } if position == Vec3A::new(1.0, 2.0, 3.0)));
    }
}
