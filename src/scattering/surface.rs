//! Surfaces of meshes and of the ground: diffuse, or diffuse under a rough dielectric coat.
//!
//! All directions are in a frame whose z is the normal on the camera's side. The coat is a GGX microfacet surface
//! (Walter et al., EGSR 2007; sampled by visible normals, Heitz, JCGT 2018). What it does not reflect is refracted,
//! scatters diffusely below, and is partly held back on its way out, as often as it takes:
//!
//! f = (1 - E(wo)) (1 - E(wi)) rho / (pi eta^2 (1 - rho K)),  K = 1 - (1 - E_mean) / eta^2
//!
//! with E the coat's directional albedo, tabulated when the material is made, and K what it reflects of diffuse light
//! from below. This is reciprocal; a white base under it reflects exactly all light, a dark one looks darker and more
//! saturated than without the coat.

use std::f32::consts::{FRAC_1_PI, TAU};

use glam::{Vec2, Vec3A};

use crate::math::{Rgb, frame::sin_cos, warp};

/// How a surface scatters.
#[derive(Clone, Debug)]
pub struct SurfaceMaterial {
    albedo: Rgb,
    coat: Option<Box<Coat>>,
}

/// A rough dielectric layer.
#[derive(Clone, Debug)]
struct Coat {
    /// Width of the microfacet distribution.
    alpha: f32,
    /// Refractive index against air.
    eta: f32,
    /// Directional albedo by the square root of the cosine.
    reflected: [f32; TABLE],
    /// Of diffuse light from below, the share reflected back.
    held_back: f32,
}

/// A direction drawn from a surface.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceSample {
    /// Unit direction in the surface's frame.
    pub wi: Vec3A,
    /// Value over density.
    pub weight: Rgb,
    /// Density, 1/steradian.
    pub pdf: f32,
}

const TABLE: usize = 64;
/// Points along each axis of the quadrature behind an entry of the table.
const QUADRATURE: usize = 32;

impl SurfaceMaterial {
    /// A diffuse surface.
    pub fn diffuse(albedo: Rgb) -> Self {
        Self { albedo, coat: None }
    }

    /// A diffuse surface under a coat of a roughness (above 0 to 1, squared for the width of the microfacets) and a
    /// refractive index above 1.
    pub fn coated(albedo: Rgb, roughness: f32, eta: f32) -> Self {
        Self { albedo, coat: Some(Box::new(Coat::new(roughness * roughness, eta))) }
    }

    /// Whether it has a coat.
    pub fn is_coated(&self) -> bool {
        self.coat.is_some()
    }

    /// The albedo of the diffuse part.
    pub fn albedo(&self) -> Rgb {
        self.albedo
    }

    /// Value with the cosine (1/steradian) for light from `wi`, seen from `wo`, and the density with which
    /// [`Self::sample`] draws `wi`. `albedo` is that of the diffuse part, texture and all.
    #[inline]
    pub fn evaluate(&self, albedo: Rgb, wo: Vec3A, wi: Vec3A) -> (Rgb, f32) {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return (Rgb::ZERO, 0.0);
        }
        let even = wi.z * FRAC_1_PI;
        let Some(coat) = &self.coat else { return (albedo * even, even) };
        let (base, chance) = coat.base(albedo, wo);
        let base = base * ((1.0 - coat.reflected(wi.z)) * even);
        let (specular, pdf) = coat.specular(wo, wi);
        (base + specular, chance * pdf + (1.0 - chance) * even)
    }

    /// Draws a direction from three uniform numbers.
    #[inline]
    pub fn sample(&self, albedo: Rgb, wo: Vec3A, u: [f32; 3]) -> Option<SurfaceSample> {
        if wo.z <= 0.0 {
            return None;
        }
        let point = Vec2::new(u[1], u[2]);
        let Some(coat) = &self.coat else {
            let wi = warp::cosine_hemisphere(point);
            return Some(SurfaceSample { wi, weight: albedo, pdf: (wi.z * FRAC_1_PI).max(1e-9) });
        };
        let (_, chance) = coat.base(albedo, wo);
        let wi = if u[0] < chance {
            let h = coat.visible_normal(wo, point);
            2.0 * wo.dot(h) * h - wo
        } else {
            warp::cosine_hemisphere(point)
        };
        let (value, pdf) = self.evaluate(albedo, wo, wi);
        (pdf > 0.0).then(|| SurfaceSample { wi, weight: value / pdf, pdf })
    }
}

impl Coat {
    fn new(alpha: f32, eta: f32) -> Self {
        let mut coat = Self { alpha, eta, reflected: [0.0; TABLE], held_back: 0.0 };
        for i in 0..TABLE {
            let root = i as f32 / (TABLE - 1) as f32;
            coat.reflected[i] = coat.integrate((root * root).max(1e-4));
        }
        // Mean over the cosine, with mu = x^2: 2 E mu dmu = 4 E x^3 dx, E linear from entry to entry as it is looked up.
        let steps = 16 * (TABLE - 1);
        let mean: f64 = (0..steps)
            .map(|i| {
                let x = (f64::from(i as u32) + 0.5) / steps as f64;
                4.0 * x.powi(3) * f64::from(coat.reflected((x * x) as f32)) / steps as f64
            })
            .sum();
        coat.held_back = (1.0 - (1.0 - mean) / f64::from(eta * eta)) as f32;
        coat
    }

    /// The directional albedo at a cosine, by quadrature over visible normals.
    fn integrate(&self, mu: f32) -> f32 {
        let wo = Vec3A::new((1.0 - mu * mu).max(0.0).sqrt(), 0.0, mu);
        let n = QUADRATURE;
        let sum: f64 = (0..n * n)
            .map(|k| {
                let u = Vec2::new(((k % n) as f32 + 0.5) / n as f32, ((k / n) as f32 + 0.5) / n as f32);
                let h = self.visible_normal(wo, u);
                let wi = 2.0 * wo.dot(h) * h - wo;
                if wi.z <= 0.0 {
                    return 0.0;
                }
                let (value, pdf) = self.specular(wo, wi);
                if pdf > 0.0 { f64::from(value / pdf) } else { 0.0 }
            })
            .sum();
        (sum / (n * n) as f64) as f32
    }

    /// Directional albedo, from the table.
    #[inline]
    fn reflected(&self, cos: f32) -> f32 {
        let x = cos.clamp(0.0, 1.0).sqrt() * (TABLE - 1) as f32;
        let i = (x as usize).min(TABLE - 2);
        let (a, b) = (self.reflected[i], self.reflected[i + 1]);
        a + (b - a) * (x - i as f32)
    }

    /// The diffuse part but for the light's side, and the chance with which the specular part is sampled.
    #[inline]
    fn base(&self, albedo: Rgb, wo: Vec3A) -> (Rgb, f32) {
        let reflected = self.reflected(wo.z);
        let out = albedo * (1.0 - reflected) / (Rgb::ONE - albedo * self.held_back) / (self.eta * self.eta);
        let diffuse = out.mean() * (1.0 - self.held_back) * self.eta * self.eta;
        (out, (reflected / (reflected + diffuse).max(1e-20)).clamp(0.05, 1.0))
    }

    /// Smith's Lambda of GGX.
    #[inline]
    fn lambda(&self, cos: f32) -> f32 {
        let tan_squared = (1.0 - cos * cos).max(0.0) / (cos * cos).max(1e-12);
        0.5 * ((1.0 + self.alpha * self.alpha * tan_squared).sqrt() - 1.0)
    }

    /// The specular part with the cosine, and its density.
    #[inline]
    fn specular(&self, wo: Vec3A, wi: Vec3A) -> (f32, f32) {
        let h = (wo + wi).normalize_or(Vec3A::Z);
        let (a, c) = (self.alpha * self.alpha, h.z * h.z);
        // h.x, h.y in place of 1 - c: no cancellation for narrow distributions.
        let spread = (h.x * h.x + h.y * h.y) + a * c;
        let d = a * FRAC_1_PI / (spread * spread).max(1e-30);
        let (lo, li) = (self.lambda(wo.z), self.lambda(wi.z));
        let common = d / (4.0 * wo.z);
        (fresnel(wo.dot(h), self.eta) * common / (1.0 + lo + li), common / (1.0 + lo))
    }

    /// A microfacet's normal among those that `wo` sees.
    #[inline]
    fn visible_normal(&self, wo: Vec3A, u: Vec2) -> Vec3A {
        let v = Vec3A::new(self.alpha * wo.x, self.alpha * wo.y, wo.z).normalize();
        let across = v.x * v.x + v.y * v.y;
        let x = if across > 1e-12 { Vec3A::new(-v.y, v.x, 0.0) / across.sqrt() } else { Vec3A::X };
        let y = v.cross(x);
        let radius = u.x.sqrt();
        let (sin, cos) = sin_cos(TAU * u.y);
        let p = radius * cos;
        let s = 0.5 * (1.0 + v.z);
        let q = (1.0 - s) * (1.0 - p * p).max(0.0).sqrt() + s * radius * sin;
        let h = p * x + q * y + (1.0 - p * p - q * q).max(0.0).sqrt() * v;
        Vec3A::new(self.alpha * h.x, self.alpha * h.y, h.z.max(1e-6)).normalize()
    }
}

/// Reflectance of a smooth dielectric of relative index `eta`, unpolarised.
#[inline]
fn fresnel(cos: f32, eta: f32) -> f32 {
    let cos = cos.clamp(0.0, 1.0);
    let refracted = (1.0 - (1.0 - cos * cos) / (eta * eta)).max(0.0).sqrt();
    let parallel = (eta * cos - refracted) / (eta * cos + refracted);
    let perpendicular = (cos - eta * refracted) / (cos + eta * refracted);
    0.5 * (parallel * parallel + perpendicular * perpendicular)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::Stream;

    fn direction(cos: f32, phi: f32) -> Vec3A {
        let sin = (1.0 - cos * cos).sqrt();
        Vec3A::new(sin * phi.cos(), sin * phi.sin(), cos)
    }

    fn materials(albedo: f32) -> Vec<SurfaceMaterial> {
        let mut out = vec![SurfaceMaterial::diffuse(Rgb::splat(albedo))];
        for roughness in [0.1, 0.3, 0.6, 1.0] {
            for eta in [1.05, 1.5, 2.2] {
                out.push(SurfaceMaterial::coated(Rgb::splat(albedo), roughness, eta));
            }
        }
        out
    }

    #[test]
    fn white_surfaces_reflect_all_light_and_no_surface_more() {
        for (albedo, white) in [(1.0, true), (0.5, false), (0.0, false)] {
            for material in materials(albedo) {
                for cos in [0.05, 0.2, 0.5, 0.8, 1.0] {
                    let wo = direction(cos, 0.4);
                    let mut stream = Stream::new(3);
                    let n = 40_000;
                    let mut sum = 0.0;
                    for _ in 0..n {
                        let u = [stream.next(), stream.next(), stream.next()];
                        if let Some(s) = material.sample(material.albedo(), wo, u) {
                            assert!(s.weight.is_finite() && s.pdf > 0.0);
                            sum += f64::from(s.weight.mean()) / f64::from(n);
                        }
                    }
                    let name = material.coat.as_ref().map(|c| (c.alpha, c.eta));
                    if white {
                        assert!((sum - 1.0).abs() < 0.012, "{name:?} at {cos}: {sum}");
                    } else {
                        assert!(sum < 0.9, "{name:?} at {cos}: {sum}");
                    }
                }
            }
        }
    }

    #[test]
    fn light_goes_both_ways_alike() {
        for material in materials(0.6) {
            for (a, b) in [((0.9, 0.0), (0.4, 2.0)), ((0.1, 1.0), (0.7, 4.0)), ((0.3, 0.0), (0.32, 3.1))] {
                let (a, b) = (direction(a.0, a.1), direction(b.0, b.1));
                let forth = material.evaluate(material.albedo(), a, b).0.mean() * a.z;
                let back = material.evaluate(material.albedo(), b, a).0.mean() * b.z;
                assert!((forth / back - 1.0).abs() < 1e-4, "{forth} {back}");
            }
        }
    }

    #[test]
    fn sampling_and_density_agree_with_uniform_directions() {
        for material in materials(0.7) {
            if material.coat.as_ref().is_some_and(|c| c.alpha < 0.05) {
                continue; // too narrow for uniform directions
            }
            for cos in [0.15, 0.6, 1.0] {
                let wo = direction(cos, 1.0);
                let mut stream = Stream::new(8);
                let n = 60_000;
                // Energy and its mean direction, sampled and uniform; the density's mass within the hemisphere.
                let (mut own, mut uniform, mut mass) = (Vec3A::ZERO, Vec3A::ZERO, 0.0);
                for _ in 0..n {
                    let u = [stream.next(), stream.next(), stream.next()];
                    if let Some(s) = material.sample(material.albedo(), wo, u) {
                        own += s.wi * (s.weight.mean() / n as f32);
                    }
                    let wi = direction(stream.next(), TAU * stream.next());
                    let (value, pdf) = material.evaluate(material.albedo(), wo, wi);
                    uniform += wi * (value.mean() * TAU / n as f32);
                    mass += pdf * TAU / n as f32;
                }
                let name = material.coat.as_ref().map(|c| (c.alpha, c.eta));
                assert!((own - uniform).length() < 0.04 * uniform.length(), "{name:?} at {cos}: {own} {uniform}");
                // A little of the specular density points into the surface.
                assert!(mass < 1.03 && mass > 0.7, "{name:?} at {cos}: mass {mass}");
            }
        }
    }

    #[test]
    fn fresnel_is_right_where_it_is_known() {
        assert!((fresnel(1.0, 1.5) - 0.04).abs() < 1e-6);
        assert!((fresnel(0.0, 1.5) - 1.0).abs() < 1e-6);
        // Brewster's angle: only the perpendicular half is left.
        let cos = (1.0f32 / (1.0 + 1.5 * 1.5)).sqrt();
        let want = 0.5 * ((1.5f32 * 1.5 - 1.0) / (1.5 * 1.5 + 1.0)).powi(2);
        assert!((fresnel(cos, 1.5) - want).abs() < 1e-5);
    }

    #[test]
    fn a_coat_shines_and_darkens() {
        let plain = SurfaceMaterial::diffuse(Rgb::splat(0.5));
        let coated = SurfaceMaterial::coated(Rgb::splat(0.5), 0.2, 1.5);
        let wo = direction(0.7, 0.0);
        let mirror = direction(0.7, std::f32::consts::PI);
        let aside = direction(0.7, 1.5);
        let value = |m: &SurfaceMaterial, wi| m.evaluate(m.albedo(), wo, wi).0.mean();
        assert!(value(&coated, mirror) > 5.0 * value(&plain, mirror));
        assert!(value(&coated, aside) < 0.9 * value(&plain, aside));
    }
}
