//! Energies of a stack of fibres on one chord, in closed form: light that goes only forward or back (paper Eqs. 8 to 10).
//!
//! Each fibre sends a share a_F forward and a_B back. `loss` is 1 - a_F, the small number for white fibres, from which
//! everything here follows without cancellation; `n` is the number of fibres, real, or the mean of a Poisson number.
//! The appendix evaluated as printed loses every digit for white fibres, in double precision too.

/// x = -ln a_F.
#[inline]
fn depth_of(loss: f64) -> f64 {
    -(-loss.clamp(0.0, 1.0)).ln_1p()
}

/// a_F^n.
#[inline]
pub(crate) fn passed(loss: f64, n: f64) -> f64 {
    if n > 0.0 { (-depth_of(loss) * n).exp() } else { 1.0 }
}

/// a_1B / a_B of Eq. 9: sum over i < n of a_F^2i, continued to real n.
pub(crate) fn once_back(loss: f64, n: f64) -> f64 {
    let x = depth_of(loss);
    if n <= 0.0 {
        0.0
    } else if x == 0.0 {
        n
    } else {
        (-2.0 * n * x).exp_m1() / (-2.0 * x).exp_m1()
    }
}

/// a_3B / a_B^3 of Eq. 9, continued to real n; 0 for n <= 1, where the printed form turns negative.
///
/// = a_F^(2n-2) (sinh(m x) - m sinh x) / (4 sinh^3 x), m = 2n - 1; relative error below 1e-11.
pub(crate) fn thrice_back(loss: f64, n: f64) -> f64 {
    if n <= 1.0 {
        return 0.0;
    }
    let x = depth_of(loss);
    let m = 2.0 * n - 1.0;
    if m * x < 1.0 {
        // Power series with the factor m (m^2 - 1) x^3 taken out; all its terms are positive.
        let (mut p, mut power, mut factorial, mut sum) = (1.0, 1.0, 1.0, 0.0);
        for k in 1..=12 {
            let k = f64::from(k);
            factorial *= 2.0 * k * (2.0 * k + 1.0);
            sum += p / factorial;
            power *= m * x * m * x;
            p = p * x * x + power;
        }
        let round = if x < 1e-4 { 1.0 + x * x / 6.0 } else { x.sinh() / x };
        (-2.0 * (n - 1.0) * x).exp() * m * (m * m - 1.0) * sum / (4.0 * round.powi(3))
    } else if x < 0.3 {
        let s = x.sinh();
        x.exp() * (-0.5 * (-2.0 * m * x).exp_m1() - m * s * (-m * x).exp()) / (4.0 * s.powi(3))
    } else {
        let (q, u) = ((-2.0 * x).exp(), (-2.0 * n * x).exp());
        let e = -(-2.0 * x).exp_m1();
        ((q - u * u - m * u * e) / e.powi(3)).max(0.0)
    }
}

/// Over the paths of [`once_back`]: the mean number of fibres passed on the way in, which is that on the way out.
///
/// What Eq. 12 needs and the paper's appendix leaves out: v_B = beta_B^2 + 2 beta_F^2 of this. 0 for n <= 1.
pub(crate) fn mean_steps(loss: f64, n: f64) -> f64 {
    if n <= 1.0 {
        return 0.0;
    }
    let y = 2.0 * depth_of(loss);
    let mean =
        if n * y < 1e-2 { 0.5 * (n - 1.0) - (n * n - 1.0) * y / 12.0 } else { 1.0 / y.exp_m1() - n / (n * y).exp_m1() };
    mean.max(0.0)
}

/// (a_1B, a_3B) of Eq. 9 for infinitely many fibres: a_B / (1 - a_F^2) and a_B^3 a_F^2 / (1 - a_F^2)^3. `back`, a_B, is at
/// most `loss`, 1 - a_F, so that both are finite for fibres that lose nothing else.
pub(crate) fn endless_back(loss: f64, back: f64) -> (f64, f64) {
    // 1 - a_F^2
    let turned = loss * (2.0 - loss);
    if turned <= 0.0 {
        return (0.0, 0.0);
    }
    let once = back / turned;
    (once, once.powi(3) * (1.0 - loss) * (1.0 - loss))
}

/// The mean number of fibres passed on the way in (see [`mean_steps`]) for infinitely many fibres: a_F^2 / (1 - a_F^2), at most 1e6.
pub(crate) fn endless_steps(loss: f64) -> f64 {
    let turned = loss * (2.0 - loss);
    if turned > 1e-6 { (1.0 - turned) / turned } else { 1e6 }
}

/// E[a_F^N] for a Poisson number of mean n.
#[inline]
pub(crate) fn poisson_passed(loss: f64, n: f64) -> f64 {
    (-n * loss).exp()
}

/// `E[a_1B] / a_B` for a Poisson number of mean n.
pub(crate) fn poisson_once_back(loss: f64, n: f64) -> f64 {
    let e = loss * (2.0 - loss);
    if e > 0.0 { -(-n * e).exp_m1() / e } else { n }
}

/// `E[a_3B] / a_B^3` for a Poisson number of mean n; relative error below 1e-10.
pub(crate) fn poisson_thrice_back(loss: f64, n: f64) -> f64 {
    let e = loss * (2.0 - loss);
    let q = (1.0 - loss) * (1.0 - loss);
    let t = n * e;
    if t < 1.0 {
        // (1-q)^3 goes into the series of the exponentials; all its terms are positive.
        let mut sum = 0.0;
        let mut term = 0.5 * n * n; // n^2 t^(k-2) / k!
        let mut q_sum = 1.0; // 1 + q + ... + q^(k-2)
        let mut q_power = q; // q^(k-1)
        for k in 2..24 {
            sum += if k % 2 == 0 {
                term * q * q_sum
            } else if k == 3 {
                n * n * n / 6.0 * (q + q * q * q)
            } else {
                // n^3 t^(k-3) / k!
                term / e * (q + q_power * q)
            };
            term *= t / f64::from(k + 1);
            q_sum += q_power;
            q_power *= q;
            if term == 0.0 && k > 3 {
                break;
            }
        }
        (-t).exp() * sum
    } else {
        (q * -(-t).exp_m1() - (-t).exp() * (2.0 * t * q + (-t * q).exp_m1())) / (e * e * e)
    }
}

/// The mean number of fibres passed on the way in (see [`mean_steps`]) for a Poisson number of fibres of mean n; `beyond_first` leaves out paths that turn back at the
/// very first fibre, which are single scattering.
pub(crate) fn poisson_mean_steps(loss: f64, n: f64, beyond_first: bool) -> f64 {
    let e = loss * (2.0 - loss);
    let q = (1.0 - loss) * (1.0 - loss);
    let t = n * e;
    // sum over i of i q^i P(N > i) = q (1 - (1 + t) e^-t) / e^2
    let steps = if t < 1e-2 {
        q * n * n * (0.5 - t * (1.0 / 3.0 - t * (0.125 - t * (1.0 / 30.0 - t / 144.0))))
    } else {
        q * (-(-t).exp_m1() - t * (-t).exp()) / (e * e)
    };
    let all = poisson_once_back(loss, n);
    let least = if beyond_first { 1.0 } else { 0.0 };
    let paths = if beyond_first { all + (-n).exp_m1() } else { all };
    // Below this, two steps are as good as never taken and the difference above is all rounding.
    if paths > 1e-12 * n.min(1.0) { (steps / paths).max(least) } else { least }
}

/// (reflected, transmitted) by n fibres with all orders of turning back, light absorbed at the share `absorbed`:
/// Kubelka-Munk. Transmitted contains the unscattered e^-n.
pub(crate) fn two_stream(absorbed: f64, back: f64, n: f64) -> (f64, f64) {
    let k = absorbed + back;
    let g = (absorbed * (k + back)).max(0.0).sqrt();
    let z = 2.0 * g * n;
    let s = if z < 1e-4 { n * (1.0 - z * (0.5 - z * (1.0 / 6.0 - z / 24.0))) } else { -(-z).exp_m1() / (2.0 * g) };
    let den = k * s + 0.5 * (1.0 + (-z).exp());
    (back * s / den, (-0.5 * z).exp() / den)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOSSES: [f64; 11] = [0.0, 1e-12, 1e-9, 1e-6, 1e-3, 0.03, 0.2, 0.5, 0.9, 1.0 - 1e-6, 1.0];

    fn close(got: f64, want: f64, tolerance: f64, what: &str) {
        assert!((got - want).abs() <= tolerance * want.abs() + 1e-290, "{what}: {got}, not {want}");
    }

    /// The sums of Eq. 9 as printed.
    fn sums(a: f64, n: i32) -> (f64, f64) {
        let once = (0..n).map(|i| a.powi(2 * i)).sum();
        let mut thrice = 0.0;
        for i in 1..n {
            for j in 0..i {
                for k in j + 1..n {
                    thrice += a.powi(2 * (i - j - 1 + k));
                }
            }
        }
        (once, thrice)
    }

    #[test]
    fn endless_forms_are_the_limits_of_many_fibers() {
        for loss in [0.02, 0.3, 0.9, 1.0] {
            let back = 0.7 * loss;
            let (once, thrice) = endless_back(loss, back);
            assert!((once / (back * once_back(loss, 1e4)) - 1.0).abs() < 1e-9, "{loss}: {once}");
            let many = back.powi(3) * thrice_back(loss, 1e4);
            assert!((thrice - many).abs() <= 1e-9 * many, "{loss}: {thrice} {many}");
            assert!((endless_steps(loss) - mean_steps(loss, 1e4)).abs() < 1e-6 * (1.0 + endless_steps(loss)), "{loss}");
        }
        assert_eq!(endless_back(0.0, 0.0), (0.0, 0.0));
        assert!(endless_steps(0.0).is_finite());
    }

    #[test]
    fn closed_forms_are_the_sums_of_equation_nine() {
        for loss in LOSSES {
            for n in 1..=40 {
                let (once, thrice) = sums(1.0 - loss, n);
                let what = format!("loss {loss}, n {n}");
                close(once_back(loss, f64::from(n)), once, 1e-12, &what);
                close(thrice_back(loss, f64::from(n)), thrice, 1e-11, &what);
                close(passed(loss, f64::from(n)), (1.0 - loss).powi(n), 1e-12, &what);
                let steps: f64 = (0..n).map(|i| f64::from(i) * (1.0 - loss).powi(2 * i)).sum();
                let got = mean_steps(loss, f64::from(n));
                assert!((got - steps / once).abs() < 1e-9 * (1.0 + steps), "{what}: {got}, not {}", steps / once);
            }
        }
    }

    #[test]
    fn poisson_forms_are_means_of_the_sums() {
        for loss in LOSSES {
            for n in [1e-3, 0.03, 0.5, 1.0, 3.0, 12.0, 30.0] {
                let (mut chance, mut all) = (f64::exp(-n), [0.0; 5]);
                let mut once_so_far = 0.0;
                let mut steps_so_far = 0.0;
                for count in 0..140 {
                    if count > 0 {
                        chance *= n / f64::from(count);
                        let last = (1.0 - loss).powi(2 * (count - 1));
                        once_so_far += last;
                        steps_so_far += f64::from(count - 1) * last;
                    }
                    all[0] += chance * (1.0 - loss).powi(count);
                    all[1] += chance * once_so_far;
                    // Checked against the triple sum above.
                    all[2] += chance * thrice_back(loss, f64::from(count));
                    all[3] += chance * steps_so_far;
                    all[4] += chance * if count > 0 { once_so_far - 1.0 } else { 0.0 };
                }
                let what = format!("loss {loss}, n {n}");
                close(poisson_passed(loss, n), all[0], 1e-12, &what);
                close(poisson_once_back(loss, n), all[1], 1e-12, &what);
                close(poisson_thrice_back(loss, n), all[2], 1e-10, &what);
                let mean = poisson_mean_steps(loss, n, false);
                assert!(
                    (mean - all[3] / all[1]).abs() < 1e-8 * (1.0 + mean),
                    "{what}: {mean}, not {}",
                    all[3] / all[1]
                );
                if all[4] > 1e-9 {
                    close(poisson_mean_steps(loss, n, true), all[3] / all[4], 1e-6, &what);
                }
            }
        }
    }

    #[test]
    fn forms_are_smooth_and_finite_from_sparse_to_dense() {
        for loss in LOSSES {
            let mut before: Option<[f64; 7]> = None;
            for i in 0..=7000 {
                let n = 10f64.powf(-3.0 + f64::from(i) * 1e-3);
                let all = [
                    passed(loss, n),
                    once_back(loss, n),
                    thrice_back(loss, n),
                    mean_steps(loss, n),
                    poisson_once_back(loss, n),
                    poisson_thrice_back(loss, n),
                    poisson_mean_steps(loss, n, true),
                ];
                for (k, &value) in all.iter().enumerate() {
                    assert!(value.is_finite() && value >= 0.0, "loss {loss}, n {n}, form {k}: {value}");
                    if let Some(before) = before
                        && k > 0
                    {
                        // Growing with n, and never by more than its cube.
                        let (low, high) =
                            (before[k] * (1.0 - 1e-9), before[k] * 1.008 + 0.01 * n.min(1.0).powi(2) + 0.01);
                        assert!(
                            value >= low && value <= high.max(before[k] * 1.1),
                            "loss {loss}, n {n}, form {k}: {value} after {}",
                            before[k]
                        );
                    }
                }
                // No share of light comes back more often than it was sent: a_B <= 1 - a_F.
                let (once, thrice) = (loss * poisson_once_back(loss, n), loss.powi(3) * poisson_thrice_back(loss, n));
                assert!(poisson_passed(loss, n) + once + thrice <= 1.0 + 1e-12, "loss {loss}, n {n}: {once} {thrice}");
                before = Some(all);
            }
        }
        // Below one fibre: a part of one reflection, and no path that needs two fibres.
        assert_eq!(thrice_back(0.3, 0.7), 0.0);
        assert_eq!(mean_steps(0.3, 0.7), 0.0);
        assert!(once_back(0.3, 0.7) > 0.0 && once_back(0.3, 0.7) < 1.0);
        assert_eq!(once_back(1.0, 0.0), 0.0);
        assert_eq!(once_back(1.0, 3.0), 1.0);
    }

    #[test]
    fn the_two_streams_solve_their_equations_and_keep_all_light() {
        for n in [1e-3, 0.1, 1.0, 7.0, 100.0, 1e4] {
            for back in [0.0, 1e-8, 0.1, 0.5, 1.0] {
                let (r, t) = two_stream(0.0, back, n);
                close(r, back * n / (1.0 + back * n), 1e-12, "lossless reflection");
                close(r + t, 1.0, 1e-12, "lossless energy");
                for absorbed in [1e-12, 1e-6, 0.01, 0.3, 1.0] {
                    if absorbed + back > 1.0 {
                        continue;
                    }
                    let (r, t) = two_stream(absorbed, back, n);
                    assert!(r >= 0.0 && t >= 0.0 && r + t <= 1.0 + 1e-12);
                    // Two halves, one upon the other (adding).
                    let (r2, t2) = two_stream(absorbed, back, 0.5 * n);
                    close(r, r2 + t2 * t2 * r2 / (1.0 - r2 * r2), 1e-9, "adding reflections");
                    close(t, t2 * t2 / (1.0 - r2 * r2), 1e-6, "adding transmissions");
                }
            }
        }
    }
}
