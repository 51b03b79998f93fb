//! How faithful pictures are to explicit fibres: many fabrics under many lights, each rendered by every method with the same
//! number of samples, twice, so that noise can be told from error. Nothing is timed. Half of the fabrics may be held out of
//! development; the table tells both halves apart.

use std::path::Path;

use super::{
    converged::Converged,
    suite::{Case, Suite},
    table3::{BenchError, Job, Renderer, converge, model_error},
};
use crate::{
    image::metric::{Halves, Pair},
    report::{
        fidelity::{Row, Table, Way},
        machine,
        table3::Missing,
    },
};

/// Runs a suite of measure "fidelity". Converged pictures are kept in `directory`, so that a run begun again goes on. After
/// every row `saved` gets the table so far; `say` is told what is being done.
///
/// # Errors
/// [`BenchError::Suite`] or [`BenchError::Interrupted`]; cases that fail are listed as missing.
pub(crate) fn run(
    suite: &Suite,
    renderer: &mut impl Renderer,
    directory: &Path,
    mut say: impl FnMut(&str),
    mut saved: impl FnMut(&Table) -> Result<(), BenchError>,
) -> Result<Table, BenchError> {
    let missing = suite.missing.iter().map(|(name, reason)| Missing { name: name.clone(), reason: reason.clone() });
    let mut table = Table {
        title: suite.title.clone(),
        suite: suite.path.clone(),
        commit: machine::commit().to_owned(),
        reference: suite.reference.to_string(),
        rows: Vec::new(),
        missing: missing.collect(),
    };
    for case in &suite.cases {
        match measure(suite, case, renderer, directory, &mut say) {
            Ok(row) => table.rows.push(row),
            Err(BenchError::Case(reason)) => {
                say(&format!("{}: {reason}", case.name));
                table.missing.push(Missing { name: case.name.clone(), reason });
            }
            Err(error) => return Err(error),
        }
        saved(&table)?;
    }
    Ok(table)
}

fn measure(
    suite: &Suite,
    case: &Case,
    renderer: &mut impl Renderer,
    directory: &Path,
    say: &mut impl FnMut(&str),
) -> Result<Row, BenchError> {
    let mut picture = |method, set: &[String]| -> Result<Converged, BenchError> {
        let job = Job { case, method, set, spp: suite.max_spp, noise: None, seed: 0, lobes: false };
        Ok(converge(suite, &job, None, renderer, directory, say)?.0)
    };
    let reference = picture(suite.reference, &[])?;
    let none: &[String] = &[];
    let tested = (suite.tested.to_string(), suite.tested, none);
    let others = suite.others.iter().map(|other| (other.name.clone(), other.method, other.set.as_slice()));
    let mut ways = Vec::new();
    for (name, method, set) in std::iter::once(tested).chain(others) {
        let found = picture(method, set)?;
        ways.push(Way {
            name,
            error: model_error(&found.halves, &reference.halves)?,
            blocks: block_error(&found.halves.mean(), &reference.halves.mean(), &reference.halves),
        });
    }
    let [first, second] = &reference.halves.colors;
    Ok(Row {
        name: case.name.clone(),
        held_out: case.held_out,
        within: case.within,
        spp: reference.spp,
        mean: cloth_mean(&reference.halves.mean(), &reference.halves),
        mean_error: {
            let [a, b] = [first, second].map(|half| cloth_mean(half, &reference.halves));
            std::array::from_fn(|k| 0.5 * (a[k] - b[k]).abs())
        },
        // The mean of two halves is off by half of what they are apart.
        block_noise: block_error(first, second, &reference.halves).map(|error| 0.5 * error),
        ways,
    })
}

/// Which pixels the reference covers, if only in part: of half-covered ones alone, methods would be told apart by which of them
/// have a little more of their yarns' edges.
fn cloth(reference: &Halves) -> Vec<bool> {
    reference.alpha.iter().map(|alpha| *alpha > 0.0).collect()
}

fn cloth_mean(colors: &[[f32; 3]], reference: &Halves) -> [f64; 3] {
    let counted: Vec<&[f32; 3]> =
        colors.iter().zip(cloth(reference)).filter(|(_, counted)| *counted).map(|(color, _)| color).collect();
    std::array::from_fn(|k| counted.iter().map(|c| f64::from(c[k])).sum::<f64>() / counted.len().max(1) as f64)
}

/// Mean over channels and blocks of 8 x 8 pixels of |test - reference| / (reference + 0.05 of its mean), on the cloth; `None`
/// where it fills no block.
fn block_error(test: &[[f32; 3]], reference: &[[f32; 3]], of: &Halves) -> Option<f64> {
    let pair = Pair {
        width: of.width,
        test: test.to_vec(),
        reference: reference.to_vec(),
        counted: cloth(of),
        variance: None,
        non_finite: [0, 0],
    };
    let blocks = pair.downsampled(8)?;
    let counted = |i: &usize| blocks.counted[*i];
    let n = (0..blocks.counted.len()).filter(counted).count();
    let mean = |k: usize| {
        let sum: f64 = (0..blocks.counted.len()).filter(counted).map(|i| f64::from(blocks.reference[i][k])).sum();
        sum / n as f64
    };
    let level: [f64; 3] = std::array::from_fn(mean);
    let sum: f64 = (0..blocks.counted.len())
        .filter(counted)
        .flat_map(|i| (0..3).map(move |k| (i, k)))
        .map(|(i, k)| {
            let (t, r) = (f64::from(blocks.test[i][k]), f64::from(blocks.reference[i][k]));
            (t - r).abs() / (r + 0.05 * level[k]).max(1e-12)
        })
        .sum();
    (n > 0).then(|| sum / (3 * n) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_of_blocks_is_that_of_their_means() {
        // Two blocks, of 1 and 3; the test is off by +-0.5 from pixel to pixel, which a block does not see, and by 10 %.
        let halves = |f: &dyn Fn(usize) -> f32| {
            let colors: Vec<[f32; 3]> = (0..128).map(|i| [f(i); 3]).collect();
            Halves { width: 16, colors: [colors.clone(), colors], alpha: vec![1.0; 128] }
        };
        let reference = halves(&|i| if i % 16 < 8 { 1.0 } else { 3.0 });
        let test = halves(&|i| (if i % 16 < 8 { 1.1 } else { 3.3 }) + if i % 2 == 0 { 0.5 } else { -0.5 });
        let error = block_error(&test.mean(), &reference.mean(), &reference).unwrap();
        let want = 0.5 * (0.1 / 1.1 + 0.3 / 3.1);
        assert!((error - want).abs() < 1e-6, "{error}, not {want}");
        let mut bare = reference.clone();
        bare.alpha.fill(0.0);
        assert_eq!(block_error(&test.mean(), &reference.mean(), &bare), None);
    }
}
