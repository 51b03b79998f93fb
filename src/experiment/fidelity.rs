//! How faithful pictures are to explicit fibres: many fabrics under many lights, each rendered by every method with the same
//! number of samples, in two halves, so that noise can be told from error, and of several packings of the fibres, since light from behind
//! differs by a tenth from packing to packing: each half has packings of its own. Nothing is timed. Half of the fabrics may be held out of
//! development; the table tells both halves apart.

use std::path::Path;

use super::{
    converged::Converged,
    suite::{Case, Suite},
    table3::{BenchError, Job, Renderer, converge, model_error},
};
use crate::{
    image::metric::{Halves, Pair},
    math::stats::Estimate,
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
        packings: suite.packings,
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
    let mut pictures = |method, set: &[String]| -> Result<Vec<Converged>, BenchError> {
        // Of several packings each is in one half, so that what lies between the halves is noise of packings too.
        let several = case.packings > 1;
        let spp = if several { (2 * suite.max_spp).div_ceil(case.packings) } else { suite.max_spp };
        let mut of_two = |first: u32| {
            let seeds = [first, first + 1];
            // What a way sets itself stands over the packing.
            let sets = seeds.map(|seed| -> Vec<String> {
                several.then(|| format!("fabric.0.seed={seed}")).into_iter().chain(set.iter().cloned()).collect()
            });
            let job =
                |half: usize| Job { case, method, set: &sets[half], spp, noise: None, seed: seeds[half], lobes: false };
            Ok(converge(suite, [job(0), job(1)], None, renderer, directory, say)?.0)
        };
        (1..=case.packings).step_by(2).map(&mut of_two).collect()
    };
    let references = pictures(suite.reference, &[])?;
    let reference = together(&references)?;
    let none: &[String] = &[];
    let tested = (suite.tested.to_string(), suite.tested, none);
    let others = suite.others.iter().map(|other| (other.name.clone(), other.method, other.set.as_slice()));
    let mut ways = Vec::new();
    let mut mean_error = None;
    for (name, method, set) in std::iter::once(tested).chain(others) {
        let found = pictures(method, set)?;
        mean_error.get_or_insert_with(|| error_of_mean(case.packings, &references, &found, &reference));
        let found = together(&found)?;
        ways.push(Way {
            name,
            error: model_error(&found, &reference)?,
            blocks: block_error(&found.mean(), &reference.mean(), &reference),
        });
    }
    let [first, second] = &reference.colors;
    Ok(Row {
        name: case.name.clone(),
        held_out: case.held_out,
        within: case.within,
        packings: case.packings,
        spp: references.iter().map(|picture| picture.spp).sum(),
        mean: cloth_mean(&reference.mean(), &reference),
        mean_error: mean_error.unwrap_or_default(),
        // The mean of two halves is off by half of what they are apart.
        block_noise: block_error(first, second, &reference).map(|error| 0.5 * error),
        ways,
    })
}

/// The mean of several pictures: of their first halves, and of their second ones.
fn together(pictures: &[Converged]) -> Result<Halves, BenchError> {
    let (first, others) = pictures.split_first().ok_or_else(|| BenchError::Case("no picture".to_owned()))?;
    let mut mean = first.halves.clone();
    if others.iter().any(|other| other.halves.alpha.len() != mean.alpha.len()) {
        return Err(BenchError::Case("pictures of one case differ in size".to_owned()));
    }
    let share = 1.0 / pictures.len() as f32;
    let average = |mean: &mut [f32], of: &dyn Fn(&Halves) -> &[f32]| {
        for other in others {
            mean.iter_mut().zip(of(&other.halves)).for_each(|(mean, value)| *mean += value);
        }
        mean.iter_mut().for_each(|mean| *mean *= share);
    };
    for half in 0..2 {
        average(mean.colors[half].as_flattened_mut(), &|halves| halves.colors[half].as_flattened());
    }
    average(&mut mean.alpha, &|halves| &halves.alpha);
    Ok(mean)
}

/// By how much the reference's mean on the cloth may be off. Of one packing: half of what its halves are apart. Of several, one in each half:
/// the standard error over packings of what it is beside the tested picture's, in which plies lie alike.
fn error_of_mean(packings: u32, references: &[Converged], found: &[Converged], all: &Halves) -> [f64; 3] {
    let means = |pictures: &[Converged]| -> Vec<[f64; 3]> {
        pictures.iter().flat_map(|picture| &picture.halves.colors).map(|half| cloth_mean(half, all)).collect()
    };
    let references = means(references);
    if packings == 1 {
        return std::array::from_fn(|k| 0.5 * (references[0][k] - references[1][k]).abs());
    }
    let pairs: Vec<_> = references.into_iter().zip(means(found)).collect();
    let of_all = cloth_mean(&all.mean(), all);
    std::array::from_fn(|k| {
        let beside: Vec<f64> = pairs.iter().map(|(reference, found)| reference[k] / found[k].max(1e-30)).collect();
        let share = Estimate::of(&beside).filter(|e| e.mean > 0.0).and_then(|e| e.relative_deviation()).unwrap_or(0.0);
        share / (pairs.len() as f64).sqrt() * of_all[k]
    })
}

fn cloth_mean(colors: &[[f32; 3]], reference: &Halves) -> [f64; 3] {
    let counted: Vec<&[f32; 3]> =
        colors.iter().zip(reference.partly_covered()).filter(|(_, counted)| *counted).map(|(color, _)| color).collect();
    std::array::from_fn(|k| counted.iter().map(|c| f64::from(c[k])).sum::<f64>() / counted.len().max(1) as f64)
}

/// Mean over channels and blocks of 8 x 8 pixels of |test - reference| / (reference + 0.05 of its mean), on the cloth; `None`
/// where it fills no block.
fn block_error(test: &[[f32; 3]], reference: &[[f32; 3]], of: &Halves) -> Option<f64> {
    let pair = Pair {
        width: of.width,
        test: test.to_vec(),
        reference: reference.to_vec(),
        counted: of.partly_covered(),
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

    #[test]
    fn pictures_of_several_packings_are_averaged_and_tell_how_far_the_mean_may_be_off() {
        let picture = |values: [f32; 2]| {
            let colors = values.map(|value| vec![[value, 2.0 * value, 4.0]; 64]);
            let halves = Halves { width: 8, colors, alpha: vec![values[0]; 64] };
            Converged { halves, spp: 8.0, sample_seconds: 1.0, lobes: None }
        };
        let references = [picture([0.9, 1.1]), picture([0.9, 1.1])];
        let all = together(&references).unwrap();
        assert_eq!(all.colors[1][3], [1.1, 2.2, 4.0]);
        assert_eq!(all.alpha[5], 0.9);
        // Twice as bright as the second of each, and alike beside the first: ratios of 1 and .5 have a mean of .75 and an error of
        // .25 sqrt(4 / 3) / sqrt(4).
        let found = [picture([0.9, 2.2]), picture([0.9, 2.2])];
        let error = error_of_mean(4, &references, &found, &all);
        assert!((error[0] - 0.25 / 0.75 / 3.0_f64.sqrt()).abs() < 1e-6 && error[2] == 0.0, "{error:?}");
        let halves = error_of_mean(1, &[picture([0.9, 1.1])], &found, &all);
        assert!((halves[0] - 0.1).abs() < 1e-6, "{halves:?}");
        let mut small = picture([1.0, 1.0]);
        small.halves.alpha.pop();
        assert!(together(&[picture([1.0, 1.0]), small]).is_err());
    }
}
