//! Closed forms against fifty digits, and their branches against each other.

use super::{Case, Checks, Group::Scattering, Scale, digits};
use crate::{
    math::{
        Rgb,
        special::{bessel_i1_scaled, front_share_of_wrapped_normal, uneven_share_of_wrapped_normal, wrapped_normal},
    },
    scattering::{
        closed_forms::{
            mean_steps, once_back, passed, poisson_mean_steps, poisson_once_back, poisson_passed, poisson_thrice_back,
            thrice_back, two_stream,
        },
        kernel::{Latitudes, kernel_scalar},
        medium::extinction_rate,
    },
};

pub(super) const CASES: &[Case] = &[
    Case {
        group: Scattering,
        name: "closed_forms",
        about: "energies of stacks of fibres against fifty digits: 1 - a_F from 0 to 1, 0.001 to 10 000 fibres",
        run: stacks,
    },
    Case {
        group: Scattering,
        name: "extinction_rate",
        about: "extinction in packed fibres against fifty digits: losses from 1e-15, densities from 1e-5 to 0.85",
        run: rates,
    },
    Case {
        group: Scattering,
        name: "single_precision",
        about: "kernels and wrapped normals in single precision against fifty digits, widths from 1e-5 to 10 rad",
        run: single_precision,
    },
    Case { group: Scattering, name: "branches", about: "continuity where a formula changes its form", run: branches },
];

fn off(got: f64, want: f64) -> f64 {
    if got == want { 0.0 } else { (got - want).abs() / want.abs().max(1e-280) }
}

fn stacks(_: Scale, checks: &mut Checks) {
    for row in digits::STACKS {
        let [loss, n, p, once, thrice, steps, pp, p_once, p_thrice] = row;
        let at = || format!("1 - a_F = {loss:e}, n = {n}");
        // a_F^n itself magnifies a rounding of a_F by n.
        if p > 1e-250 {
            checks.at_most("a_F^n, relative error", off(passed(loss, n), p), 1e-12, &at);
        }
        checks.at_most("once back, relative error", off(once_back(loss, n), once), 1e-13, &at);
        checks.at_most("thrice back, relative error", off(thrice_back(loss, n), thrice), 1e-11, &at);
        checks.at_most("steps inward, relative error", off(mean_steps(loss, n), steps), 1e-8, &at);
        if pp > 1e-250 {
            checks.at_most("Poisson a_F^N, relative error", off(poisson_passed(loss, n), pp), 1e-12, &at);
        }
        checks.at_most("Poisson once back, relative error", off(poisson_once_back(loss, n), p_once), 1e-13, &at);
        let thrice = off(poisson_thrice_back(loss, n), p_thrice);
        checks.at_most("Poisson thrice back, relative error", thrice, 1e-10, &at);
    }
    for [absorbed, back, n, r, t] in digits::TWO_STREAMS {
        let at = || format!("absorbed {absorbed:e}, back {back:e}, n = {n}");
        let (got_r, got_t) = two_stream(absorbed, back, n);
        checks.at_most("two streams reflected, relative error", off(got_r, r), 1e-12, &at);
        if t > 1e-250 {
            checks.at_most("two streams transmitted, relative error", off(got_t, t), 1e-11, &at);
        }
    }
}

fn rates(_: Scale, checks: &mut Checks) {
    for [loss, density, want] in digits::RATES {
        let at = || format!("loss {loss:e}, density {density}");
        // Below b = 1e-4 the loss itself stands for the rate: off by b / 2 at most.
        let bound = if density < 1e-4 { "thin packings, relative error" } else { "relative error" };
        let most = if density < 1e-4 { 1e-4 } else { 1e-10 };
        checks.at_most(bound, off(extinction_rate(loss, density), want), most, &at);
    }
    for [x, want] in digits::BESSEL {
        checks.at_most("scaled Bessel function, relative error", off(bessel_i1_scaled(x), want), 1e-14, &|| {
            format!("x = {x}")
        });
    }
}

fn single_precision(_: Scale, checks: &mut Checks) {
    for [kappa, si, ci, so, co, want] in digits::KERNELS {
        let at = || format!("kappa {kappa:.4e}, latitudes {:.4} {:.4}", si.atan2(ci), so.atan2(co));
        let latitudes = Latitudes::new(si as f32, ci as f32, so as f32, co as f32);
        let got = f64::from(kernel_scalar(kappa as f32, latitudes));
        // The exponent -kappa/2 ((c - c)^2 + (s + s)^2) is a difference of singles: its own rounding sets its digits.
        let exponent = 0.5 * kappa * ((ci - co).powi(2) + (si + so).powi(2));
        let slack = 2e-5 + 4e-7 * exponent + kappa * 1.2e-7 * ((ci - co).abs() + (si + so).abs());
        checks.at_most("kernel, error over what rounding of the sines allows", off(got, want) / slack, 1.0, &at);
        if slack < 1e-4 {
            checks.at_most("kernel near its peak, relative error", off(got, want), 1e-4, &at);
        }
    }
    for [d, sigma, want, front] in digits::WRAPPED {
        let at = || format!("sigma {sigma:.4e}, distance {d}");
        if want > 1e-12 {
            let got = f64::from(wrapped_normal(d as f32, sigma as f32));
            let slack = 1e-6 * (1.0 + 0.5 * (d / sigma).powi(2));
            checks.at_most("wrapped normal, error over its rounding", off(got, want) / slack, 1.0, &at);
        }
        let got = front_share_of_wrapped_normal(sigma);
        checks.at_most("share within a quarter turn, error", (got - front).abs(), 1e-12, &at);
    }
}

/// Values on both sides of each place where a formula changes.
fn branches(_: Scale, checks: &mut Checks) {
    let mut both = |name: &'static str, below: f64, above: f64, bound: f64| {
        checks.at_most(name, off(below, above), bound, &|| format!("{below:.9e} and {above:.9e}"));
    };
    let e = 1e-9;
    for n in [2.0, 7.5, 300.0] {
        let m = 2.0 * n - 1.0;
        // x = -ln a_F at which the branch lies, as a loss.
        let loss = |x: f64| -(-x).exp_m1();
        let at = |x: f64| (thrice_back(loss(x * (1.0 - e)), n), thrice_back(loss(x * (1.0 + e)), n));
        let (a, b) = at(1.0 / m);
        both("thrice back, series to closed form", a, b, 1e-7);
        let (a, b) = at(0.3);
        both("thrice back, small to large depths", a, b, 1e-6);
        let x = 0.5e-2 / n;
        both("steps inward", mean_steps(loss(x * (1.0 - e)), n), mean_steps(loss(x * (1.0 + e)), n), 1e-7);
        // t = n loss (2 - loss)
        let of_t = |t: f64| 1.0 - (1.0 - t / n).max(0.0).sqrt();
        let (low, high) = (of_t(1.0 - e), of_t(1.0 + e));
        both("Poisson thrice back", poisson_thrice_back(low, n), poisson_thrice_back(high, n), 1e-7);
        let (low, high) = (of_t(1e-2 * (1.0 - e)), of_t(1e-2 * (1.0 + e)));
        both("Poisson steps", poisson_mean_steps(low, n, true), poisson_mean_steps(high, n, true), 1e-7);
        both("once back, white fibres", once_back(0.0, n), once_back(1e-15, n), 1e-11);
        both("Poisson once back, white fibres", poisson_once_back(0.0, n), poisson_once_back(1e-15, n), 1e-11);
        let back = 0.3;
        // z = 2 g n = 1e-4, g^2 = k (k + 2 b) nearly 2 b k.
        let absorbed = (0.5e-4 / n).powi(2) / (2.0 * back);
        let (a, b) = (two_stream(absorbed * (1.0 - e), back, n), two_stream(absorbed * (1.0 + e), back, n));
        both("two streams reflected", a.0, b.0, 1e-9);
        both("two streams transmitted", a.1, b.1, 1e-9);
    }
    both("thrice back at one fibre", 1.0 + thrice_back(0.2, 1.0), 1.0 + thrice_back(0.2, 1.0 + e), 1e-8);
    for density in [1e-3, 0.3, 0.85] {
        let (a, b) = (extinction_rate(0.5 - e, density), extinction_rate(0.5 + e, density));
        both("extinction rate, small to large losses", a, b, 1e-7);
        let (a, b) = (extinction_rate(1.0 - 1e-14, density), extinction_rate(1.0, density));
        both("extinction rate, black", a, b, 1e-10);
    }
    for loss in [1e-6, 0.3, 0.9] {
        let density = 1e-4 / (1.0 + 1e-4);
        let (a, b) = (extinction_rate(loss, density * (1.0 - e)), extinction_rate(loss, density * (1.0 + e)));
        both("extinction rate, thin packings", a, b, 1e-4);
    }
    for d in [0.0, 0.7, 3.0] {
        both(
            "wrapped normal, images to waves",
            wrapped_normal(d, 2.5).into(),
            wrapped_normal(d, 2.500_000_2).into(),
            2e-6,
        );
    }
    both(
        "share within a quarter turn",
        front_share_of_wrapped_normal(4.0),
        front_share_of_wrapped_normal(4.0 + e),
        1e-8,
    );
    both(
        "uneven share of a wrapped normal",
        uneven_share_of_wrapped_normal(1.5),
        uneven_share_of_wrapped_normal(1.5 + e),
        1e-7,
    );
    both("scaled Bessel function", bessel_i1_scaled(20.0 - e), bessel_i1_scaled(20.0), 1e-9);
    let one = |x: f32| f64::from(Rgb::splat(x).one_minus_exp_neg().to_array()[0]);
    both("1 - e^-x, series to exponential", one(0.029_999_998), one(0.030_000_001), 5e-6);
    // The kernel: asymptotic normalisation, and its spread near the poles.
    let peak = |kappa: f32| f64::from(kernel_scalar(kappa, Latitudes::new(0.5, 0.75f32.sqrt(), -0.5, 0.75f32.sqrt())));
    both("kernel, fit to asymptote", peak(99_999.99), peak(100_000.01), 1e-5);
    let grazing = |cos: f32| {
        let sin = (1.0 - cos * cos).sqrt();
        f64::from(kernel_scalar(11.0, Latitudes::new(sin, cos, -sin, cos)))
    };
    // x = 2 kappa c^2 passes 1e-6.
    let c = (1e-6f32 / 22.0).sqrt();
    both("kernel near the poles", grazing(c * 0.999), grazing(c * 1.001), 1e-5);
}
