//! Special functions in `f64`, for set-up and tables, and what of them rays need in `f32`.

use std::f64::consts::{FRAC_PI_2, PI, SQRT_2};

use glam::DVec3;

/// From 0 to 1 as x does, level at both ends and beyond them.
pub(crate) fn smooth_step(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// As [`smooth_step`], in single precision.
#[inline]
pub(crate) fn smooth_step_f32(x: f32) -> f32 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// The cubic that leaves `from` with one slope and comes to `to` with another, at `t` in 0..1: Hermite's.
pub(crate) fn hermite([from, to]: [DVec3; 2], [start, end]: [DVec3; 2], t: f64) -> DVec3 {
    let s = 1.0 - t;
    s * s * ((1.0 + 2.0 * t) * from + t * start) + t * t * ((1.0 + 2.0 * s) * to - s * end)
}

/// e^-x I1(x), the scaled modified Bessel function of the first kind, order 1, for x >= 0.
///
/// Power series below 20, asymptotic series above; relative error below 1e-14.
pub(crate) fn bessel_i1_scaled(x: f64) -> f64 {
    if x < 20.0 {
        // I1(x) = x/2 sum_k (x^2/4)^k / (k! (k+1)!)
        let q = 0.25 * x * x;
        let (mut term, mut sum, mut k) = (1.0, 1.0, 0.0);
        while term > sum * 1e-17 {
            k += 1.0;
            term *= q / (k * (k + 1.0));
            sum += term;
        }
        0.5 * x * sum * (-x).exp()
    } else {
        // I1(x) e^-x = (2 pi x)^-1/2 sum_k (-1)^k prod_j (4 - (2j-1)^2) / (k! (8x)^k), stopped at its smallest term.
        let (mut term, mut sum) = (1.0_f64, 1.0);
        for k in 1..60 {
            let odd = f64::from(2 * k - 1);
            let next = -term * (4.0 - odd * odd) / (f64::from(k) * 8.0 * x);
            if next.abs() > term.abs() || next.abs() < 1e-17 {
                break;
            }
            term = next;
            sum += term;
        }
        sum / (2.0 * PI * x).sqrt()
    }
}

/// The share of a wrapped normal distribution of standard deviation `sigma` (radians) that lies within a
/// quarter turn of its centre. 1 for sigma -> 0, 1/2 for sigma -> infinity.
pub(crate) fn front_share_of_wrapped_normal(sigma: f64) -> f64 {
    if sigma > 4.0 {
        return 0.5 + 2.0 / PI * (-0.5 * sigma * sigma).exp();
    }
    share_of_wrapped_normal([-FRAC_PI_2, FRAC_PI_2], sigma)
}

/// The share of it between two angles of its circle, radians, of any width up to 4.
pub(crate) fn share_of_wrapped_normal([from, to]: [f64; 2], sigma: f64) -> f64 {
    let scale = 1.0 / (sigma.max(1e-300) * SQRT_2);
    (-6..=6)
        .map(|k| {
            let shift = 2.0 * PI * f64::from(k);
            0.5 * (libm::erf((to + shift) * scale) - libm::erf((shift + from) * scale))
        })
        .sum()
}

/// What a wrapped normal distribution of standard deviation `sigma` (radians) has over its least density, which is that opposite to its
/// centre, as a share of the whole: what is not the same all round. 1 for sigma -> 0, 0 for sigma -> infinity.
pub(crate) fn uneven_share_of_wrapped_normal(sigma: f64) -> f64 {
    if sigma > 1.5 {
        // The alternating sum of its harmonics; the images below cancel there.
        let harmonic = |k: i32| f64::from(k % 2 * 2 - 1) * (-0.5 * (f64::from(k) * sigma).powi(2)).exp();
        return 2.0 * (1..=6).map(harmonic).sum::<f64>();
    }
    let image = |k: i32| (-0.5 * (PI * f64::from(2 * k + 1) / sigma.max(1e-300)).powi(2)).exp();
    1.0 - 2.0 * (2.0 * PI).sqrt() / sigma.max(1e-300) * (0..3).map(image).sum::<f64>()
}

/// Density (1/radian) at distance `d` radians from the centre of a normal distribution wrapped round the circle.
#[inline]
pub(crate) fn wrapped_normal(d: f32, sigma: f32) -> f32 {
    use std::f32::consts::{PI, TAU};
    let d = d - TAU * (d / TAU).round_ties_even();
    if sigma > 2.5 {
        // Fourier form: the images no longer decay, its terms do (below 4e-8 beyond the third).
        let q = (-0.5 * sigma * sigma).exp();
        let c = d.cos();
        let (c2, c3) = (2.0 * c * c - 1.0, c * (4.0 * c * c - 3.0));
        return (1.0 + 2.0 * (q * c + q.powi(4) * c2 + q.powi(9) * c3)) / (2.0 * PI);
    }
    let sigma = sigma.max(1e-6);
    let inv = 1.0 / sigma;
    let gauss = |x: f32| (-0.5 * (x * inv) * (x * inv)).exp();
    // Only images within six deviations can matter.
    let reach = ((6.0 * sigma + d.abs()) / TAU).ceil().min(3.0);
    let mut sum = gauss(d);
    let mut k = 1.0;
    while k <= reach {
        sum += gauss(d + TAU * k) + gauss(d - TAU * k);
        k += 1.0;
    }
    sum * inv * 0.398_942_3
}

/// The escape probability of light born evenly within a disc of optical radius `t`: Pade-like fit, 0.2 %.
pub(crate) fn escape_probability_of_disc(t: f64) -> f64 {
    const V: [f64; 3] = [0.512_569_29, 0.209_805_44, 0.832_947_66];
    (1.0 + V[0] * t + V[1] * t * t)
        / (1.0 + (V[0] + 8.0 / (3.0 * PI)) * t + V[2] * t * t + V[1] * FRAC_PI_2 * t * t * t)
}

/// The nodes of two-point Gauss-Legendre quadrature over 0 to 1, whose weights are alike.
pub(crate) const GAUSS_LEGENDRE_2: [f64; 2] = [0.211_324_865_405_187_1, 0.788_675_134_594_812_9];

/// Nodes and weights of Gauss-Legendre quadrature with four points on [0, 1].
pub(crate) const GAUSS_LEGENDRE_4: [(f64, f64); 4] = [
    (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
    (0.330_009_478_207_571_87, 0.326_072_577_431_273_07),
    (0.669_990_521_792_428_1, 0.326_072_577_431_273_07),
    (0.930_568_155_797_026_3, 0.173_927_422_568_726_93),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bessel_agrees_with_its_integral() {
        // I1(x) = 1/pi int_0^pi e^(x cos t) cos t dt
        for x in [1e-3, 0.1, 1.0, 5.0, 19.9, 20.1, 50.0, 1e3, 1e5] {
            let n = 20_000;
            let width: f64 = f64::min(PI, 60.0 / f64::sqrt(x));
            let mean = (0..n)
                .map(|i| {
                    let t = (f64::from(i) + 0.5) / f64::from(n) * width;
                    (-2.0 * x * (0.5 * t).sin().powi(2)).exp() * t.cos()
                })
                .sum::<f64>()
                / f64::from(n);
            let want = mean * width / PI;
            assert!((bessel_i1_scaled(x) / want - 1.0).abs() < 1e-7, "x = {x}: {} {want}", bessel_i1_scaled(x));
        }
        assert!((bessel_i1_scaled(20.0 - 1e-9) / bessel_i1_scaled(20.0 + 1e-9) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn the_wrapped_normal_is_a_density_at_every_width() {
        for sigma in [1e-3, 0.05, 0.35, 1.0, 2.0, 2.499, 2.501, 5.0, 50.0] {
            let n = 200_000;
            let (mut total, mut front) = (0.0, 0.0);
            for i in 0..n {
                let d = (f64::from(i) + 0.5) / f64::from(n) * 2.0 * PI - PI;
                let p = f64::from(wrapped_normal(d as f32, sigma as f32));
                assert!(p >= 0.0);
                total += p;
                front += if d.abs() < FRAC_PI_2 { p } else { 0.0 };
            }
            let step = 2.0 * PI / f64::from(n);
            assert!((total * step - 1.0).abs() < 2e-5, "sigma {sigma}: mass {}", total * step);
            let want = front_share_of_wrapped_normal(sigma);
            assert!((front * step - want).abs() < 3e-5, "sigma {sigma}: front {} not {want}", front * step);
            let least = 2.0 * PI * f64::from(wrapped_normal(std::f32::consts::PI, sigma as f32));
            let uneven = uneven_share_of_wrapped_normal(sigma);
            assert!((uneven + least - 1.0).abs() < 2e-6, "sigma {sigma}: uneven {uneven}, least {least}");
        }
    }
}
