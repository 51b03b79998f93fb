//! Small statistics: means with their uncertainty, straight lines, where a falling series reaches a value.

/// The 0.975 quantile of Student's distribution for 1 to 30 degrees of freedom.
const STUDENT: [f64; 30] = [
    12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160, 2.145, 2.131, 2.120,
    2.110, 2.101, 2.093, 2.086, 2.080, 2.074, 2.069, 2.064, 2.060, 2.056, 2.052, 2.048, 2.045, 2.042,
];

/// Mean and spread of repeated measurements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Estimate {
    /// Their mean.
    pub mean: f64,
    /// Their standard deviation (n - 1 in the denominator); not known from one measurement.
    pub deviation: Option<f64>,
    /// Their number.
    pub count: usize,
}

impl Estimate {
    /// Of these measurements; `None` for none.
    pub(crate) fn of(values: &[f64]) -> Option<Self> {
        let count = values.len();
        if count == 0 {
            return None;
        }
        let mean = values.iter().sum::<f64>() / count as f64;
        let square: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
        let deviation = (count > 1).then(|| (square / (count - 1) as f64).sqrt());
        Some(Self { mean, deviation, count })
    }

    /// Half the width of the interval that holds the expected value with 95 % (Student); not known from one measurement.
    pub(crate) fn half_width(&self) -> Option<f64> {
        let quantile = STUDENT.get(self.count.checked_sub(2)?).copied().unwrap_or(1.96 + 2.5 / self.count as f64);
        Some(quantile * self.deviation? / (self.count as f64).sqrt())
    }

    /// Deviation over mean.
    pub(crate) fn relative_deviation(&self) -> Option<f64> {
        Some(self.deviation? / self.mean.abs())
    }
}

/// The ratio of two means and its standard deviation, from the relative deviations of both (they vary independently), where
/// these are known.
pub(crate) fn ratio(above: &Estimate, below: &Estimate) -> (f64, Option<f64>) {
    let ratio = above.mean / below.mean;
    let deviation = || Some(ratio.abs() * above.relative_deviation()?.hypot(below.relative_deviation()?));
    (ratio, deviation())
}

/// A power law through points: value = scale x argument^slope.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PowerLaw {
    /// The exponent.
    pub slope: f64,
    /// Standard error of the exponent; not known from two points.
    pub slope_error: Option<f64>,
    /// log10 of the value where the argument is 1.
    pub log_scale: f64,
}

impl PowerLaw {
    /// The line of least squares through the logarithms. `None` unless there are two points with different arguments;
    /// points that are not positive are left out.
    pub(crate) fn fit(points: &[(f64, f64)]) -> Option<Self> {
        let logs: Vec<(f64, f64)> = points
            .iter()
            .filter(|(x, y)| *x > 0.0 && *y > 0.0 && x.is_finite() && y.is_finite())
            .map(|(x, y)| (x.log10(), y.log10()))
            .collect();
        let n = logs.len() as f64;
        let (mx, my) = logs.iter().fold((0.0, 0.0), |(a, b), (x, y)| (a + x / n, b + y / n));
        let sxx: f64 = logs.iter().map(|(x, _)| (x - mx).powi(2)).sum();
        if logs.len() < 2 || sxx < 1e-12 {
            return None;
        }
        let slope = logs.iter().map(|(x, y)| (x - mx) * (y - my)).sum::<f64>() / sxx;
        let log_scale = my - slope * mx;
        let rest: f64 = logs.iter().map(|(x, y)| (y - log_scale - slope * x).powi(2)).sum();
        let slope_error = (logs.len() > 2).then(|| (rest / (n - 2.0) / sxx).sqrt());
        Some(Self { slope, slope_error, log_scale })
    }

    /// The value at an argument.
    pub(crate) fn at(&self, x: f64) -> f64 {
        10f64.powf(self.log_scale + self.slope * x.log10())
    }
}

/// When a falling series gets to a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Reached {
    /// Between two points, or at one.
    At(f64),
    /// Beyond the last point, if the error goes on falling as one over time.
    Later(f64),
    /// Not within the series; and it is not known how it goes on.
    Unknown,
}

/// The argument at which `points`, sorted by argument, first fall to `value`, along straight lines between logarithms.
/// Before the first point and beyond the last the value is taken to fall as one over the argument, but beyond only
/// if `goes_on`.
pub(crate) fn reach(points: &[(f64, f64)], value: f64, goes_on: bool) -> Reached {
    let mut before: Option<(f64, f64)> = None;
    for &(x, y) in points {
        if y <= value {
            return Reached::At(match before {
                Some((x0, y0)) if y0 > y && y > 0.0 => {
                    let share = (y0 / value).ln() / (y0 / y).ln();
                    x0 * (x / x0).powf(share)
                }
                // A value at or below zero is noise about nothing: all that is known is that it was reached by then.
                Some(_) => x,
                None => x * (y / value).max(0.0),
            });
        }
        before = Some((x, y));
    }
    match before {
        Some((x, y)) if goes_on => Reached::Later(x * y / value),
        _ => Reached::Unknown,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_and_intervals() {
        let e = Estimate::of(&[1.0, 2.0, 3.0, 4.0, 5.0]).unwrap();
        assert_eq!((e.mean, e.count), (3.0, 5));
        assert!((e.deviation.unwrap() - 2.5f64.sqrt()).abs() < 1e-12);
        assert!((e.half_width().unwrap() - 2.776 * (2.5f64 / 5.0).sqrt()).abs() < 1e-12);
        assert_eq!(Estimate::of(&[7.0]).unwrap().half_width(), None);
        assert_eq!(Estimate::of(&[]), None);
        let many = Estimate { mean: 0.0, deviation: Some(1.0), count: 100 };
        assert!((many.half_width().unwrap() - 0.1984).abs() < 2e-4, "{:?}", many.half_width());
    }

    #[test]
    fn ratios_carry_both_uncertainties() {
        let (a, b) = (Estimate::of(&[9.0, 10.0, 11.0]).unwrap(), Estimate::of(&[1.8, 2.0, 2.2]).unwrap());
        let (value, deviation) = ratio(&a, &b);
        assert!((value - 5.0).abs() < 1e-12 && (deviation.unwrap() - 5.0 * 0.02f64.sqrt()).abs() < 1e-12);
        assert_eq!(ratio(&a, &Estimate::of(&[2.0]).unwrap()), (5.0, None));
    }

    #[test]
    fn power_laws_are_found_again() {
        let points: Vec<(f64, f64)> = (0..8).map(|i| 2f64.powi(i)).map(|x| (x, 3.0 * x.powf(-1.0))).collect();
        let fit = PowerLaw::fit(&points).unwrap();
        assert!((fit.slope + 1.0).abs() < 1e-12 && fit.slope_error.unwrap() < 1e-7 && (fit.at(1.0) - 3.0).abs() < 1e-9);
        let noisy: Vec<(f64, f64)> =
            points.iter().enumerate().map(|(i, (x, y))| (*x, y * if i % 2 == 0 { 1.1 } else { 1.0 / 1.1 })).collect();
        let fit = PowerLaw::fit(&noisy).unwrap();
        assert!((fit.slope + 1.0).abs() < 3.0 * fit.slope_error.unwrap() && fit.slope_error.unwrap() > 0.01, "{fit:?}");
        assert_eq!(PowerLaw::fit(&[(1.0, 1.0), (1.0, 2.0)]), None);
        assert_eq!(PowerLaw::fit(&[(1.0, 1.0), (2.0, -1.0)]), None);
    }

    #[test]
    fn values_are_reached_where_the_lines_say() {
        // A law of 8 / t with a floor of 0.5.
        let law = |t: f64| 8.0 / t;
        let noise: Vec<(f64, f64)> = [1.0, 2.0, 4.0, 8.0].map(|t| (t, law(t))).into();
        let near = |reached: Reached, expected: f64| match reached {
            Reached::At(t) | Reached::Later(t) => assert!((t - expected).abs() < 1e-9 * expected, "{t}"),
            Reached::Unknown => panic!("not reached"),
        };
        near(reach(&noise, 3.0, true), 8.0 / 3.0);
        near(reach(&noise, 4.0, true), 2.0);
        near(reach(&noise, 16.0, true), 0.5);
        assert!(matches!(reach(&noise, 0.1, true), Reached::Later(_)));
        near(reach(&noise, 0.1, true), 80.0);
        let floor: Vec<(f64, f64)> = noise.iter().map(|(t, e)| (*t, e + 0.5)).collect();
        assert_eq!(reach(&floor, 0.4, false), Reached::Unknown);
        assert!(matches!(reach(&floor, 5.0, false), Reached::At(t) if t > 1.0 && t < 2.0));
        assert_eq!(reach(&[(1.0, 2.0), (2.0, -0.1)], 1.0, true), Reached::At(2.0));
        assert_eq!(reach(&[], 1.0, true), Reached::Unknown);
    }
}
