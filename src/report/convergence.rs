//! Error against run time, as CSV, JSON and a plot.

use std::fmt::Write as _;

use serde_json::{Value, json};

use super::{
    csv_cell,
    plot::{self, Series},
    plus_minus,
};
use crate::{
    image::metric::EPSILON,
    math::{
        stats::{Estimate, PowerLaw, Reached, reach},
        words::counted,
    },
};

/// What was measured of one scene.
#[derive(Clone, Debug)]
pub(crate) struct Convergence {
    /// The scene file.
    pub scene: String,
    /// Size of the pictures.
    pub size: [usize; 2],
    /// Threads of every render.
    pub threads: usize,
    /// Independent seeds behind every point.
    pub seeds: usize,
    /// The method whose converged picture counts as true, where there is one.
    pub reference: Option<String>,
    /// Error for which times are told.
    pub target: f64,
    /// One curve for each method.
    pub curves: Vec<Curve>,
}

/// One method's error against its time.
#[derive(Clone, Debug)]
pub(crate) struct Curve {
    /// Mode and model: "fiber", "yarn:aggregated".
    pub method: String,
    /// Seconds before the first sample: loading, curves, BVH.
    pub setup_seconds: f64,
    /// Samples per pixel of its own converged picture.
    pub converged_spp: f64,
    /// After each wave.
    pub points: Vec<Point>,
}

/// Where a render stood after a wave; means and spread over seeds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Point {
    /// Samples per pixel.
    pub spp: u32,
    /// Seconds of rendering. With [`Curve::setup_seconds`] the total clock.
    pub seconds: Estimate,
    /// relMSE against the method's own converged picture: noise.
    pub noise: Estimate,
    /// relMSE against the reference: noise and model error. `None` for the reference itself.
    pub error: Option<Estimate>,
}

impl Curve {
    /// Time against noise.
    fn noise(&self) -> Vec<(f64, f64)> {
        self.points.iter().map(|p| (p.seconds.mean, p.noise.mean)).collect()
    }

    /// Time against noise and model error; against noise for the reference.
    fn error(&self) -> Vec<(f64, f64)> {
        self.points.iter().map(|p| (p.seconds.mean, p.error.unwrap_or(p.noise).mean)).collect()
    }

    /// The law that the noise follows; -1 is expected of independent samples.
    pub(crate) fn noise_fit(&self) -> Option<PowerLaw> {
        PowerLaw::fit(&self.noise())
    }

    /// The law that noise and model error follow together.
    pub(crate) fn error_fit(&self) -> Option<PowerLaw> {
        PowerLaw::fit(&self.error())
    }

    /// Seconds of rendering until the noise is at the target.
    pub(crate) fn time_of_noise(&self, target: f64) -> Reached {
        reach(&self.noise(), target, true)
    }

    /// Seconds of rendering until noise and model error together are at the target.
    pub(crate) fn time_of_error(&self, target: f64) -> Reached {
        // Model error stays: nothing is said of what comes after the last wave, except of the reference.
        reach(&self.error(), target, self.points.iter().all(|p| p.error.is_none()))
    }
}

/// What keeps a curve from its target: where its last wave stood.
fn not_reached(curve: &Curve) -> String {
    curve.points.last().map_or_else(
        || "not reached: there are no points".to_owned(),
        |p| {
            let error = p.error.unwrap_or(p.noise).mean;
            format!(
                "not reached: {error:.2e} at {} spp, of which {:.2e} are noise; the rest stays",
                p.spp, p.noise.mean
            )
        },
    )
}

fn reached_json(reached: Reached) -> Value {
    match reached {
        Reached::At(t) => json!({"seconds": t, "extrapolated": false}),
        Reached::Later(t) => json!({"seconds": t, "extrapolated": true}),
        Reached::Unknown => Value::Null,
    }
}

/// A time for people.
pub(crate) fn reached_text(reached: Reached) -> String {
    match reached {
        Reached::At(t) => format!("{t:.3} s"),
        Reached::Later(t) => format!("{t:.3} s (extrapolated)"),
        Reached::Unknown => "not reached".to_owned(),
    }
}

impl Convergence {
    /// One line for each point.
    pub(crate) fn to_csv(&self) -> String {
        let mut out = "method,spp,render_seconds,total_seconds,seeds,noise_relmse,noise_half_width_95,error_relmse,error_half_width_95\n"
            .to_owned();
        for curve in &self.curves {
            for p in &curve.points {
                let t = p.seconds.mean;
                let _ =
                    write!(out, "{},{},{t:.6},{:.6},{}", curve.method, p.spp, t + curve.setup_seconds, p.noise.count);
                for e in [Some(p.noise), p.error] {
                    match e {
                        Some(e) => {
                            let _ = write!(out, ",{:.6e},{}", e.mean, csv_cell(e.half_width(), |w| format!("{w:.6e}")));
                        }
                        None => out += ",,",
                    }
                }
                out.push('\n');
            }
        }
        out
    }

    /// Everything.
    pub(crate) fn to_json(&self) -> Value {
        let estimate = |e: Estimate| json!({"mean": e.mean, "deviation": e.deviation, "half_width_95": e.half_width()});
        let fit = |f: Option<PowerLaw>| {
            f.map(|f| json!({"slope": f.slope, "slope_error": f.slope_error, "at_one_second": f.at(1.0)}))
        };
        // Without a reference nobody has measured a model's error.
        let against_reference = self.reference.is_some();
        let curves: Vec<Value> = self
            .curves
            .iter()
            .map(|c| {
                let points: Vec<Value> = c
                    .points
                    .iter()
                    .map(|p| {
                        json!({
                            "spp": p.spp, "render_seconds": estimate(p.seconds),
                            "total_seconds": p.seconds.mean + c.setup_seconds,
                            "noise": estimate(p.noise), "error": p.error.map(estimate),
                        })
                    })
                    .collect();
                json!({
                    "method": c.method, "setup_seconds": c.setup_seconds, "converged_spp": c.converged_spp,
                    "noise_fit": fit(c.noise_fit()), "error_fit": fit(c.error_fit().filter(|_| against_reference)),
                    "time_of_noise": reached_json(c.time_of_noise(self.target)),
                    "time_of_error": if against_reference { reached_json(c.time_of_error(self.target)) } else { Value::Null },
                    "points": points,
                })
            })
            .collect();
        json!({
            "machine": super::machine::describe(), "commit": super::machine::commit(),
            "scene": self.scene, "width": self.size[0], "height": self.size[1], "threads": self.threads,
            "seeds": self.seeds, "reference": self.reference, "metric": "relMSE", "epsilon": EPSILON,
            "target": self.target, "curves": curves,
        })
    }

    /// Both errors of each method against the time of rendering.
    pub(crate) fn to_svg(&self) -> String {
        let mut series = Vec::new();
        for (group, c) in self.curves.iter().enumerate() {
            let slope = |f: Option<PowerLaw>| {
                f.map_or(String::new(), |f| {
                    format!(", slope {:.2}{}", f.slope, plus_minus(f.slope_error, " ± ", |v| format!("{v:.2}")))
                })
            };
            let points = |get: &dyn Fn(&Point) -> Option<Estimate>| -> Vec<[f64; 3]> {
                c.points
                    .iter()
                    .filter_map(|p| get(p).map(|e| [p.seconds.mean, e.mean, e.half_width().unwrap_or(0.0)]))
                    .collect()
            };
            let name = format!("{}: noise{}", c.method, slope(c.noise_fit()));
            let fit = c.noise_fit();
            series.push(Series { name, points: points(&|p| Some(p.noise)), group, dashed: false, fit });
            if c.points.iter().any(|p| p.error.is_some()) {
                let name = format!("{}: noise and model error{}", c.method, slope(c.error_fit()));
                series.push(Series { name, points: points(&|p| p.error), group, dashed: true, fit: None });
            }
        }
        let title = format!("{}, {} x {}, {}", self.scene, self.size[0], self.size[1], counted(self.seeds, "seed"));
        plot::log_log(&title, ["seconds of rendering", "relMSE"], &series, Some(self.target))
    }

    /// Slopes and times, a line for each method.
    pub(crate) fn to_text(&self) -> String {
        let mut out = String::new();
        for c in &self.curves {
            let error = |f: PowerLaw| plus_minus(f.slope_error, " +- ", |v| format!("{v:.3}"));
            let slope = c.noise_fit().map_or("?".to_owned(), |f| format!("{:.3}{}", f.slope, error(f)));
            let noise = reached_text(c.time_of_noise(self.target));
            let _ = write!(
                out,
                "{:20} noise falls with slope {slope}; relMSE {} by noise after {noise}",
                c.method, self.target
            );
            if self.reference.is_some() {
                let with_model = match c.time_of_error(self.target) {
                    Reached::Unknown => not_reached(c),
                    reached => reached_text(reached),
                };
                let _ = write!(out, ", with model error {with_model}");
            }
            out.push('\n');
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A method whose noise is `scale` / seconds, and whose model error is `floor`.
    fn curve(method: &str, scale: f64, floor: Option<f64>) -> Curve {
        let points = (0..6).map(|i| {
            let t = 0.1 * 2f64.powi(i);
            let noise = scale / t;
            let spread = |e: f64| Estimate { mean: e, deviation: Some(0.05 * e), count: 5 };
            Point { spp: 1 << i, seconds: spread(t), noise: spread(noise), error: floor.map(|f| spread(noise + f)) }
        });
        Curve { method: method.to_owned(), setup_seconds: 0.5, converged_spp: 512.0, points: points.collect() }
    }

    #[test]
    fn reports_tell_slopes_and_times() {
        let result = Convergence {
            scene: "s.toml".to_owned(),
            size: [64, 48],
            threads: 2,
            seeds: 5,
            reference: Some("fiber".to_owned()),
            target: 0.02,
            curves: vec![curve("fiber", 0.1, None), curve("yarn:aggregated", 0.01, Some(0.015))],
        };
        let [fiber, yarn] = [&result.curves[0], &result.curves[1]];
        assert!((fiber.noise_fit().unwrap().slope + 1.0).abs() < 1e-9);
        assert!(yarn.error_fit().unwrap().slope > -0.9, "model error does not fall");
        assert!(matches!(fiber.time_of_error(0.02), Reached::Later(t) if (t - 5.0).abs() < 1e-9));
        assert!(matches!(yarn.time_of_noise(0.02), Reached::At(t) if (t - 0.5).abs() < 1e-9));
        assert!(matches!(yarn.time_of_error(0.02), Reached::At(t) if t > 1.6 && t < 2.4));
        assert_eq!(yarn.time_of_error(0.015), Reached::Unknown);

        let csv = result.to_csv();
        assert_eq!(csv.lines().count(), 13);
        assert!(csv.lines().all(|l| l.matches(',').count() == 8), "{csv}");
        assert!(csv.contains("\nfiber,1,0.100000,0.600000,5,1.000000e0,"), "{csv}");
        let json = result.to_json();
        assert_eq!(json["curves"][0]["points"][0]["spp"], 1);
        assert_eq!(json["curves"][0]["time_of_error"]["extrapolated"], true);
        assert_eq!(json["curves"][1]["points"].as_array().unwrap().len(), 6);
        let svg = result.to_svg();
        assert!(svg.contains("yarn:aggregated: noise and model error") && svg.contains("slope -1.00"));
        assert!(result.to_text().contains("extrapolated") && result.to_text().contains("with model error"));
        let alone = Convergence { reference: None, curves: vec![curve("fiber", 0.1, None)], ..result };
        assert!(!alone.to_text().contains("model error"), "{}", alone.to_text());
        let json = alone.to_json();
        assert!(json["curves"][0]["time_of_error"].is_null() && json["curves"][0]["error_fit"].is_null());
        assert!(json["curves"][0]["time_of_noise"]["seconds"].is_number());
        // Of one seed nothing is known of the spread, and of two waves nothing of the line's.
        let mut one = alone.clone();
        one.curves[0].points.truncate(2);
        one.curves[0].points.iter_mut().for_each(|p| p.noise.deviation = None);
        assert!(one.to_csv().lines().nth(1).unwrap().ends_with("e0,,,"), "{}", one.to_csv());
        assert!(one.to_text().contains("slope -1.000; "), "{}", one.to_text());
        let json = one.to_json();
        assert!(json["curves"][0]["points"][0]["noise"]["half_width_95"].is_null());
        assert!(json["curves"][0]["noise_fit"]["slope_error"].is_null());
    }
}
