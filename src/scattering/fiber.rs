//! One fibre: R, TT and D (paper Eqs. 5 and 6, with the kernel of [`super::kernel`] in place of their Gaussians).
//!
//! S = sum over lobes of a_p M_p(theta_i, theta_o) N_p(phi). R and D have N = 1 / 2 pi; TT is a normal distribution
//! of standard deviation beta_n wrapped round phi = pi. (The paper prints it centred at 0, which by its own text is
//! the backward direction.)

use std::f32::consts::{FRAC_1_PI, PI, TAU};

use glam::Vec3A;

use super::LobeValues;
use super::kernel::{
    DIFFUSE, Latitudes, kappa_of_variance, normalisation, normalised_kernel, sample_sine, sample_sine_diffuse,
};
use super::lobe::normalised;
use crate::math::{
    Rgb,
    frame::sin_cos,
    sampler::Stream,
    special::{uneven_share_of_wrapped_normal, wrapped_normal},
    warp::normal,
};

/// The BCSDF of a fibre: albedos are linear Rec.709, widths standard deviations in radians.
#[derive(Clone, Debug, PartialEq)]
pub struct FiberMaterial {
    /// Albedo of R, reflection at the surface.
    pub r: [f64; 3],
    /// Albedo of TT, light that passes through.
    pub tt: [f64; 3],
    /// Albedo of D, light scattered diffusely inside.
    pub d: [f64; 3],
    /// Longitudinal width of R, in theta_h.
    pub beta_r: f64,
    /// Longitudinal width of TT, in theta_h.
    pub beta_tt: f64,
    /// Azimuthal width of TT.
    pub beta_n: f64,
}

impl FiberMaterial {
    /// The share of TT that goes on forward as a chain: what its azimuths have over the least of them, which the rest has all round.
    pub fn chain_share(&self) -> f64 {
        uneven_share_of_wrapped_normal(self.beta_n)
    }

    /// The mean cosine of the angle by which that share turns, across the fibre.
    pub(crate) fn chain_cosine(&self) -> f64 {
        let share = self.chain_share();
        if share > 1e-9 { ((-0.5 * self.beta_n * self.beta_n).exp() / share).min(1.0) } else { 1.0 }
    }

    /// The colour of thick cloth of such fibres under an even sky, for programs that show curves in one colour: what a
    /// half-space of isotropic scatterers of their albedo reflects (van de Hulst, Multiple Light Scattering, 1980). Linear
    /// Rec.709.
    pub fn cloth_color(&self) -> [f64; 3] {
        std::array::from_fn(|c| half_space((1.0 - self.albedo(c).clamp(0.0, 1.0)).sqrt()))
    }

    /// What TT and D of each channel are multiplied by, so that [`Self::cloth_color`] is `by` times as much: of white fibres
    /// hardly anything, for light meets so many of them. At least 0, and at most what makes no light.
    pub fn lightening(&self, by: f64) -> [f64; 3] {
        let colors = self.cloth_color();
        std::array::from_fn(|c| {
            let inside = self.tt[c] + self.d[c];
            let s = half_space_root((by * colors[c]).clamp(0.0, 1.0));
            if inside > 0.0 { ((1.0 - s * s - self.r[c]) / inside).max(0.0) } else { 1.0 }
        })
    }

    fn albedo(&self, channel: usize) -> f64 {
        self.r[channel] + self.tt[channel] + self.d[channel]
    }
}

/// What a half-space of isotropic scatterers reflects whose albedo is 1 - s^2.
fn half_space(s: f64) -> f64 {
    (1.0 - s) * (1.0 - 0.139 * s) / (1.0 + 1.17 * s)
}

/// The s of [`half_space`], for 0 to 1.
fn half_space_root(reflected: f64) -> f64 {
    let (left, b) = (1.0 - reflected, 1.139 + 1.17 * reflected);
    2.0 * left / (b + (b * b - 4.0 * 0.139 * left).sqrt())
}

/// A fibre's BCSDF made ready to evaluate: for explicit fibres, and the yardstick of every aggregate.
#[derive(Clone, Debug)]
pub struct FiberBcsdf {
    r: Rgb,
    tt: Rgb,
    d: Rgb,
    /// kappa of R and of TT, and the factors of their kernels.
    kappa: Rgb,
    factor: Rgb,
    beta_n: f32,
}

/// A direction drawn from a BCSDF: `weight` is value / density.
#[derive(Clone, Copy, Debug)]
pub struct FiberSample {
    /// Where the light comes from, in the frame of [`FiberBcsdf::evaluate`].
    pub wi: Vec3A,
    /// Value over density, per channel.
    pub weight: Rgb,
    /// Density per steradian.
    pub pdf: f32,
    /// The value of each lobe there, 1/steradian.
    pub lobes: LobeValues,
}

impl FiberBcsdf {
    /// From the material's albedos and widths.
    pub fn new(material: &FiberMaterial) -> Self {
        let variance = |beta: f64| (beta * beta) as f32;
        let kappa = kappa_of_variance(Rgb::new(variance(material.beta_r), variance(material.beta_tt), 1.0));
        Self {
            r: material.r.into(),
            tt: material.tt.into(),
            d: material.d.into(),
            kappa,
            factor: normalisation(kappa),
            beta_n: material.beta_n as f32,
        }
    }

    /// S cos(theta_i) of R, TT and D in 1/steradian and the density of [`Self::sample`] at `wi`. Frame: z along the fibre, the
    /// camera's direction at azimuth 0 with sine and cosine of its latitude given. `throughput` weighs the channels
    /// in the choice of a lobe and must be the same in both calls.
    ///
    /// ```
    /// use glam::Vec3A;
    /// use yarnray::{math::Rgb, scattering::fiber::{FiberBcsdf, FiberMaterial}};
    ///
    /// let material = FiberMaterial { r: [0.1; 3], tt: [0.5, 0.3, 0.2], d: [0.2; 3], ..FiberMaterial::default() };
    /// let fiber = FiberBcsdf::new(&material);
    /// // Camera and light across the fibre, the light behind it: what passes through is red.
    /// let (lobes, density) = fiber.evaluate(0.0, 1.0, Vec3A::NEG_X, Rgb::ONE);
    /// assert!(lobes.tt.to_array()[0] > lobes.tt.to_array()[2] && density > 0.0);
    /// ```
    #[inline]
    pub fn evaluate(&self, sin_o: f32, cos_o: f32, wi: Vec3A, throughput: Rgb) -> (LobeValues, f32) {
        let sin_i = wi.z;
        let cos_i = (1.0 - sin_i * sin_i).max(0.0).sqrt();
        let at = Latitudes::new(sin_o, cos_o, sin_i, cos_i);
        let [m_r, m_tt, _] = normalised_kernel(self.kappa, self.factor, at).to_array();
        let n_tt = if m_tt > 0.0 { wrapped_normal(wi.y.atan2(wi.x) - PI, self.beta_n) } else { 0.0 };
        let r = m_r * cos_i * (0.5 * FRAC_1_PI);
        let d = DIFFUSE * cos_i * (0.5 * FRAC_1_PI);
        let tt = m_tt * cos_i * n_tt;
        let [p_r, p_tt, p_d] = self.lobe_shares(throughput);
        let lobes = LobeValues { r: self.r * r, tt: self.tt * tt, d: self.d * d, ..LobeValues::default() };
        (lobes, p_r * r + p_tt * tt + p_d * d)
    }

    fn lobe_shares(&self, throughput: Rgb) -> [f32; 3] {
        normalised([self.r, self.tt, self.d].map(|a| a.weighted_mean(throughput)))
    }

    /// Draws a direction; `None` for a black fibre.
    #[inline]
    pub fn sample(
        &self,
        sin_o: f32,
        cos_o: f32,
        throughput: Rgb,
        u: [f32; 4],
        stream: &mut Stream,
    ) -> Option<FiberSample> {
        let [p_r, p_tt, p_d] = self.lobe_shares(throughput);
        if p_r + p_tt + p_d <= 0.0 {
            return None;
        }
        let lat = [u[1], u[2]];
        let [kappa_r, kappa_tt, _] = self.kappa.to_array();
        let (sin_i, phi) = if u[0] < p_r {
            (sample_sine(kappa_r, sin_o, cos_o, lat, stream), TAU * u[3])
        } else if u[0] < p_r + p_tt {
            (sample_sine(kappa_tt, sin_o, cos_o, lat, stream), PI + self.beta_n * normal(u[3]))
        } else {
            (sample_sine_diffuse(lat), TAU * u[3])
        };
        let cos_i = (1.0 - sin_i * sin_i).max(0.0).sqrt();
        let (s, c) = sin_cos(phi);
        let wi = Vec3A::new(cos_i * c, cos_i * s, sin_i);
        let (lobes, pdf) = self.evaluate(sin_o, cos_o, wi, throughput);
        (pdf > 0.0).then(|| FiberSample { wi, weight: lobes.sum() / pdf, pdf, lobes })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scattering::testing::{lossless, sphere};

    #[test]
    fn lightened_fibers_make_cloth_as_light_as_is_wanted() {
        let fiber = FiberMaterial { r: [0.04; 3], tt: [0.6, 0.3, 0.02], d: [0.33, 0.2, 0.1], ..lossless() };
        for by in [0.5, 0.9, 1.0, 1.1] {
            let factors = fiber.lightening(by);
            let times = |lobe: [f64; 3]| std::array::from_fn(|c| lobe[c] * factors[c]);
            let dyed = FiberMaterial { tt: times(fiber.tt), d: times(fiber.d), ..fiber.clone() };
            for (was, is) in fiber.cloth_color().iter().zip(dyed.cloth_color()) {
                assert!((is / was - by).abs() < 1e-9, "{by}: {is} of {was}");
            }
        }
        // Of white cloth a hundredth is a thousandth of what fibres pass on.
        let white = fiber.lightening(0.99)[0];
        assert!((0.997..0.999).contains(&white), "{white}");
        assert!(
            fiber
                .lightening(9.0)
                .iter()
                .zip(0..)
                .all(|(f, c)| fiber.r[c] + f * (fiber.tt[c] + fiber.d[c]) < 1.0 + 1e-9)
        );
        assert_eq!(fiber.lightening(0.0), [0.0; 3], "what the surface reflects stays");
        assert_eq!(FiberMaterial { tt: [0.0; 3], d: [0.0; 3], ..fiber }.lightening(2.0), [1.0; 3]);
    }

    #[test]
    fn a_white_fiber_keeps_all_light_from_every_side() {
        for theta in [0.0f64, 0.4, 1.0, 1.4] {
            for (br, btt, bn) in [(0.15, 0.12, 0.35), (0.5, 0.4, 1.2), (0.05, 0.05, 0.1)] {
                let m = FiberMaterial { beta_r: br, beta_tt: btt, beta_n: bn, ..lossless() };
                let bcsdf = FiberBcsdf::new(&m);
                let (s, c) = (theta.sin() as f32, theta.cos() as f32);
                let (mut energy, mut density) = (0.0, 0.0);
                for (wi, dw) in sphere(600, 400) {
                    let (value, pdf) = bcsdf.evaluate(s, c, wi, Rgb::ONE);
                    energy += f64::from(value.sum().mean()) * dw;
                    density += f64::from(pdf) * dw;
                }
                assert!((energy - 1.0).abs() < 1e-3, "theta {theta}: energy {energy}");
                assert!((density - 1.0).abs() < 1e-3, "theta {theta}: density {density}");
                let mut stream = Stream::new(9);
                for _ in 0..500 {
                    let u = [0; 4].map(|_| stream.next());
                    let sample = bcsdf.sample(s, c, Rgb::ONE, u, &mut stream).unwrap();
                    assert!((sample.weight.mean() - 1.0).abs() < 1e-4, "a weight of {:?}", sample.weight);
                }
            }
        }
    }

    #[test]
    fn the_bcsdf_is_reciprocal() {
        let bcsdf = FiberBcsdf::new(&lossless());
        for i in 0..100 {
            let (a, b) = (-1.4 + 0.028 * i as f32, 1.3 - 0.021 * i as f32);
            let phi = 0.06 * i as f32;
            let s = |theta_o: f32, theta_i: f32, phi: f32| {
                let wi = Vec3A::new(theta_i.cos() * phi.cos(), theta_i.cos() * phi.sin(), theta_i.sin());
                bcsdf.evaluate(theta_o.sin(), theta_o.cos(), wi, Rgb::ONE).0.sum().mean() / theta_i.cos()
            };
            let (there, back) = (s(a, b, phi), s(b, a, -phi));
            assert!((there / back - 1.0).abs() < 1e-4, "{there} {back}");
        }
    }

    #[test]
    fn a_black_fiber_scatters_nothing() {
        let m = FiberMaterial { r: [0.0; 3], tt: [0.0; 3], d: [0.0; 3], ..lossless() };
        let bcsdf = FiberBcsdf::new(&m);
        assert!(bcsdf.sample(0.1, 0.99, Rgb::ONE, [0.5; 4], &mut Stream::new(1)).is_none());
    }
}
