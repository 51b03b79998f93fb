//! Minimising a smooth function of many variables: L-BFGS (Nocedal and Wright, "Numerical Optimization", 2006, Ch. 7).

use std::{
    collections::VecDeque,
    mem::{replace, swap},
};

/// Share of the decrease promised by the slope that a step must bring (Armijo).
const DECREASE: f64 = 1e-4;
/// Length from which on products are added up in lanes, as processors do it fastest.
const LONG: usize = 1 << 15;
/// Sums that are added up beside each other.
const LANES: usize = 8;

/// How a minimum is looked for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Search {
    /// Root mean square of the gradient at which it ends.
    pub(super) tolerance: f64,
    /// How far a variable moves in a step at most.
    pub(super) longest: f64,
    /// Most steps.
    pub(super) most: usize,
    /// Pairs of steps and changes of the gradient that stand for the curvature.
    pub(super) memory: usize,
}

/// Takes a gradient to a better step than itself, by what is known of the curvature.
pub(super) type Precondition<'a> = &'a dyn Fn(&mut [f64]);

fn dot(a: &[f64], b: &[f64]) -> f64 {
    if a.len() < LONG {
        return a.iter().zip(b).map(|(x, y)| x * y).sum();
    }
    let mut lanes = [0.0; LANES];
    let (parts_a, parts_b) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let rest: f64 = parts_a.remainder().iter().zip(parts_b.remainder()).map(|(x, y)| x * y).sum();
    for (a, b) in parts_a.zip(parts_b) {
        lanes.iter_mut().zip(a.iter().zip(b)).for_each(|(lane, (x, y))| *lane += x * y);
    }
    lanes.iter().sum::<f64>() + rest
}

/// Moves `x` downhill until the root mean square of the gradient is below the tolerance, no step goes down any more, or the most
/// steps are taken. `f` gives the value and fills the gradient; of the
/// curvature it learns from steps what no `precondition` tells.
pub(super) fn minimize(
    x: &mut [f64],
    f: &mut dyn FnMut(&[f64], &mut [f64]) -> f64,
    search: Search,
    precondition: Option<Precondition<'_>>,
) {
    let Search { tolerance, longest, most, memory } = search;
    let n = x.len();
    let mut gradient = vec![0.0; n];
    let mut value = f(x, &mut gradient);
    let mut history: VecDeque<(Vec<f64>, Vec<f64>, f64)> = VecDeque::with_capacity(memory);
    let (mut trial, mut trial_gradient, mut direction) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    // Room for the next pair.
    let (mut s, mut y) = (vec![0.0; n], vec![0.0; n]);
    let rms = |g: &[f64]| (dot(g, g) / n.max(1) as f64).sqrt();
    for _ in 0..most {
        if rms(&gradient) <= tolerance {
            break;
        }
        direction.iter_mut().zip(&gradient).for_each(|(d, g)| *d = -g);
        let mut shares = Vec::with_capacity(history.len());
        for (s, y, rho) in history.iter().rev() {
            let share = rho * dot(s, &direction);
            direction.iter_mut().zip(y).for_each(|(d, y)| *d -= share * y);
            shares.push(share);
        }
        if let Some((s, y, _)) = history.back() {
            let size = match precondition {
                None => dot(y, y),
                Some(precondition) => {
                    precondition(&mut direction);
                    // The trial is not needed here.
                    trial.copy_from_slice(y);
                    precondition(&mut trial);
                    dot(y, &trial)
                }
            };
            let scale = dot(s, y) / size;
            direction.iter_mut().for_each(|d| *d *= scale);
        } else if let Some(precondition) = precondition {
            precondition(&mut direction);
        }
        for ((s, y, rho), share) in history.iter().zip(shares.iter().rev()) {
            let back = rho * dot(y, &direction);
            direction.iter_mut().zip(s).for_each(|(d, s)| *d += (share - back) * s);
        }
        let mut slope = dot(&direction, &gradient);
        if slope >= 0.0 {
            history.clear();
            direction.iter_mut().zip(&gradient).for_each(|(d, g)| *d = -g);
            if let Some(precondition) = precondition {
                precondition(&mut direction);
            }
            slope = dot(&direction, &gradient);
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
                (0..n).for_each(|i| {
                    s[i] = trial[i] - x[i];
                    y[i] = trial_gradient[i] - gradient[i];
                });
                let curvature = dot(&s, &y);
                if curvature > 1e-12 * dot(&y, &y) {
                    let full = history.len() == memory;
                    let oldest = if full { history.pop_front() } else { None };
                    let (next_s, next_y, _) = oldest.unwrap_or_else(|| (vec![0.0; n], vec![0.0; n], 0.0));
                    history.push_back((replace(&mut s, next_s), replace(&mut y, next_y), 1.0 / curvature));
                }
                x.copy_from_slice(&trial);
                swap(&mut gradient, &mut trial_gradient);
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
        minimize(&mut x, &mut f, Search { tolerance: 1e-9, longest: 1.0, most: 2000, memory: 12 }, None);
        assert!(x.iter().all(|v| (v - 1.0).abs() < 1e-6), "{x:?}");
    }
}
