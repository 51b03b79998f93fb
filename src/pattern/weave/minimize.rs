//! Minimising a smooth function of many variables: L-BFGS (Nocedal and Wright, "Numerical Optimization", 2006, Ch. 7).

use std::collections::VecDeque;

/// Pairs of steps and changes of the gradient that stand for the curvature.
const MEMORY: usize = 12;
/// Share of the decrease promised by the slope that a step must bring (Armijo).
const DECREASE: f64 = 1e-4;

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Moves `x` downhill until the root mean square of the gradient is below `tolerance`, no step goes down any more, or
/// `most` steps are taken. `f` gives the value and fills the gradient; no variable moves by more than `longest` in a step.
pub(super) fn minimize(
    x: &mut [f64],
    f: &mut dyn FnMut(&[f64], &mut [f64]) -> f64,
    tolerance: f64,
    longest: f64,
    most: usize,
) {
    let n = x.len();
    let mut gradient = vec![0.0; n];
    let mut value = f(x, &mut gradient);
    let mut history: VecDeque<(Vec<f64>, Vec<f64>, f64)> = VecDeque::with_capacity(MEMORY);
    let (mut trial, mut trial_gradient) = (vec![0.0; n], vec![0.0; n]);
    let rms = |g: &[f64]| (dot(g, g) / n.max(1) as f64).sqrt();
    for _ in 0..most {
        if rms(&gradient) <= tolerance {
            break;
        }
        let mut direction: Vec<f64> = gradient.iter().map(|g| -g).collect();
        let mut shares = Vec::with_capacity(history.len());
        for (s, y, rho) in history.iter().rev() {
            let share = rho * dot(s, &direction);
            direction.iter_mut().zip(y).for_each(|(d, y)| *d -= share * y);
            shares.push(share);
        }
        if let Some((s, y, _)) = history.back() {
            let scale = dot(s, y) / dot(y, y);
            direction.iter_mut().for_each(|d| *d *= scale);
        }
        for ((s, y, rho), share) in history.iter().zip(shares.iter().rev()) {
            let back = rho * dot(y, &direction);
            direction.iter_mut().zip(s).for_each(|(d, s)| *d += (share - back) * s);
        }
        let mut slope = dot(&direction, &gradient);
        if slope >= 0.0 {
            history.clear();
            direction = gradient.iter().map(|g| -g).collect();
            slope = -dot(&gradient, &gradient);
        }
        let widest = direction.iter().fold(0.0f64, |w, d| w.max(d.abs()));
        let mut step = if widest > longest { longest / widest } else { 1.0 };
        if history.is_empty() {
            step = step.min(0.1 * longest / widest);
        }
        let mut found = false;
        for _ in 0..20 {
            for i in 0..n {
                trial[i] = x[i] + step * direction[i];
            }
            let there = f(&trial, &mut trial_gradient);
            if there <= value + DECREASE * step * slope {
                let s: Vec<f64> = trial.iter().zip(x.iter()).map(|(a, b)| a - b).collect();
                let y: Vec<f64> = trial_gradient.iter().zip(&gradient).map(|(a, b)| a - b).collect();
                let curvature = dot(&s, &y);
                if curvature > 1e-12 * dot(&y, &y) {
                    if history.len() == MEMORY {
                        history.pop_front();
                    }
                    history.push_back((s, y, 1.0 / curvature));
                }
                x.copy_from_slice(&trial);
                std::mem::swap(&mut gradient, &mut trial_gradient);
                value = there;
                found = true;
                break;
            }
            step *= 0.5;
        }
        if !found {
            if history.is_empty() {
                break;
            }
            history.clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bottom_of_a_curved_valley_is_found() {
        // Rosenbrock's function in ten variables.
        let mut f = |x: &[f64], g: &mut [f64]| {
            g.fill(0.0);
            let mut sum = 0.0;
            for i in 0..x.len() - 1 {
                let (a, b) = (x[i + 1] - x[i] * x[i], 1.0 - x[i]);
                sum += 100.0 * a * a + b * b;
                g[i + 1] += 200.0 * a;
                g[i] -= 400.0 * a * x[i] + 2.0 * b;
            }
            sum
        };
        let mut x: Vec<f64> = (0..10).map(|i| if i % 2 == 0 { -0.4 } else { 0.6 }).collect();
        minimize(&mut x, &mut f, 1e-9, 1.0, 2000);
        assert!(x.iter().all(|v| (v - 1.0).abs() < 1e-6), "{x:?}");
    }
}
