//! `yarnray compare`

use std::path::{Path, PathBuf};

use clap::Args;

use super::{
    Failure,
    files::{Attempts, Files},
    log,
    terminal::print,
    write_text,
};
use crate::{
    files::has_extension,
    image::{
        self, Image,
        metric::{Comparison, Pair, flip, map},
        output::Format,
    },
    report::{
        compare::{METRICS, exceeds, metric, to_html, to_json, to_text},
        page::Picture,
    },
};

const EXAMPLES: &str = "Examples:
  yarnray compare yarns.exr fibers.exr                        all metrics; the second picture is the reference
  yarnray compare a.exr b.exr --json                          the same for programs
  yarnray compare a.exr b.exr --mask alpha -o map.png         only where both pictures show something; a map of FLIP
  yarnray compare a.exr b.exr -o page.html                    metrics, slider and map on one page
  yarnray compare a.exr b.exr --threshold flip_hdr=0.05 --threshold mean_ratio=0.02
                                                              exit status 1 if a metric is worse

relMSE is the square error over the square of the reference + 0.01; names of metrics for --threshold: mean_ratio (largest
distance of a channel from 1), ssim, flip_ldr, flip_hdr, rmse, relmse, relmse_trimmed; the last three also with _2, _4, _8
behind them, after averaging boxes of so many pixels.";

#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(super) struct CompareArgs {
    /// The picture that is tested.
    test: PathBuf,
    /// The reference.
    reference: PathBuf,
    /// Print JSON.
    #[arg(long)]
    json: bool,
    /// Count only pixels that are at least half white in this picture, or `alpha`: at least half covered in both.
    #[arg(long, value_name = "FILE|alpha")]
    mask: Option<PathBuf>,
    /// End with status 1 if the metric is worse than this (repeatable).
    #[arg(long, value_name = "METRIC=VALUE", value_parser = threshold)]
    threshold: Vec<(String, f64)>,
    /// Where to write: an error map (.png) or a page with metrics and pictures (.html). Repeatable.
    #[arg(short, long = "out", value_name = "PATH")]
    out: Vec<PathBuf>,
    /// Only the result, without notes.
    #[arg(long, short)]
    quiet: bool,
    /// What the error map shows: FLIP from 0 to 1, or the root of each pixel's relMSE up to its 99.9th percentile.
    #[arg(long, value_parser = ["flip", "relative"], default_value = "flip")]
    map: String,
}

/// Reads METRIC=VALUE.
fn threshold(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.split_once('=').ok_or("expected METRIC=VALUE, as in flip_hdr=0.05")?;
    let base = ["_2", "_4", "_8"].iter().find_map(|end| name.strip_suffix(end));
    let known = METRICS.contains(&name) || base.is_some_and(|b| ["rmse", "relmse", "relmse_trimmed"].contains(&b));
    if !known {
        return Err(format!("unknown metric `{name}`; known are {}", METRICS.join(", ")));
    }
    let value: f64 = value.parse().map_err(|_| format!("expected a number after `{name}=`, found `{value}`"))?;
    if !value.is_finite() {
        return Err(format!("the limit of `{name}` must be finite"));
    }
    Ok((name.to_owned(), value))
}

pub(super) fn run(args: &CompareArgs) -> Result<(), Failure> {
    for path in &args.out {
        if !has_extension(path, "png") && !has_extension(path, "html") {
            return Err(Failure::Input(format!(
                "error: cannot write {}: expected a name that ends in .png (an error map) or .html (a page)",
                path.display()
            )));
        }
    }
    Files::default()
        .reads("TEST", [&args.test])
        .reads("REFERENCE", [&args.reference])
        .reads("--mask", args.mask.iter().filter(|m| *m != Path::new("alpha")))
        .writes("-o", &args.out)
        .check(args.quiet)?;
    let names = [&args.test, &args.reference].map(|path| path.display().to_string());
    let [test, reference] = [image::read(&args.test)?, image::read(&args.reference)?];
    let mut pair = Pair::new(&test, &reference)
        .map_err(|mismatch| Failure::Input(format!("error: {} and {}: {mismatch}", names[0], names[1])))?;
    if let Some(mask) = &args.mask {
        pair.restrict(&read_mask(mask, [&test, &reference], &names)?);
    }
    let comparison = Comparison::new(&pair).ok_or_else(|| {
        Failure::Input(format!(
            "error: {} and {}: no pixel to compare: {} and {} of {} pixels are not finite{}",
            names[0],
            names[1],
            pair.non_finite[0],
            pair.non_finite[1],
            pair.counted.len(),
            if args.mask.is_some() { ", and the mask leaves no other" } else { "" }
        ))
    })?;
    let names = names.each_ref().map(String::as_str);
    if let Some((shown, linear)) = of_different_kinds([&args.test, &args.reference])
        && !args.quiet
    {
        log::say(&format!(
            "note: {shown} holds colours for a screen with the exposure and tone curve that it was written with, \
             {linear} radiance: compare pictures of one kind"
        ));
    }
    let mut attempts = Attempts::default();
    for path in &args.out {
        if has_extension(path, "png") {
            let (values, most) = error_map(&pair, &args.map);
            attempts.note(map::write(path, &values, pair.width, most));
        } else {
            let picture = |colors: &[[f32; 3]]| Picture { width: pair.width, colors: colors.to_vec() };
            let flip = flip::ldr(&pair.test, &pair.reference, pair.width);
            let pictures = [&picture(&pair.test), &picture(&pair.reference)];
            let page = to_html(&comparison, names, pictures, &Picture::of_map(&flip, pair.width, map::magma));
            attempts.note(write_text(path, &page));
        }
    }
    if args.json {
        print(&(serde_json::to_string_pretty(&to_json(&comparison)).expect("numbers and text become JSON") + "\n"))?;
    } else {
        print(&to_text(&comparison, names))?;
    }
    attempts.finish()?;
    let worse: Vec<String> = args
        .threshold
        .iter()
        .filter_map(|(name, limit)| {
            let value = metric(&comparison, name)?;
            exceeds(name, value, *limit).then(|| match value.is_nan() {
                true => format!("{name} has no value: the pictures are too small or too dark for it"),
                false => format!("{name} is {value:.6}, worse than {limit}"),
            })
        })
        .collect();
    if worse.is_empty() { Ok(()) } else { Err(Failure::Check(worse.join("\n"))) }
}

/// The picture for a screen and the one of radiance, where the two are not of one kind.
fn of_different_kinds(paths: [&PathBuf; 2]) -> Option<(String, String)> {
    let format = |path: &Path| Format::of(path).ok();
    let shown = paths.map(|path| matches!(format(path), Some(Format::Png | Format::Screen)));
    // A TIFF may be either.
    let linear =
        paths.map(|path| format(path) == Some(Format::Exr) || ["hdr", "pfm"].iter().any(|e| has_extension(path, e)));
    let (a, b) = match (shown, linear) {
        ([true, _], [_, true]) => (0, 1),
        ([_, true], [true, _]) => (1, 0),
        _ => return None,
    };
    Some((paths[a].display().to_string(), paths[b].display().to_string()))
}

/// Values of the error map and where its scale ends.
fn error_map(pair: &Pair, kind: &str) -> (Vec<f32>, f32) {
    if kind == "flip" {
        return (flip::ldr(&pair.test, &pair.reference, pair.width), 1.0);
    }
    let values = map::relative_error(pair);
    let mut sorted = values.clone();
    sorted.sort_by(f32::total_cmp);
    let most = sorted[(sorted.len() - 1) * 999 / 1000];
    (values, if most > 0.0 { most } else { 1.0 })
}

/// Which pixels a mask lets count.
fn read_mask(mask: &Path, pictures: [&Image; 2], names: &[String; 2]) -> Result<Vec<bool>, Failure> {
    if mask == Path::new("alpha") {
        let mut out = vec![true; pictures[0].width * pictures[0].height];
        for (picture, name) in pictures.into_iter().zip(names) {
            let alpha = picture
                .channel("A")
                .ok_or_else(|| Failure::Input(format!("error: {name} has no alpha channel `A` for --mask alpha")))?;
            out.iter_mut().zip(alpha).for_each(|(out, alpha)| *out &= *alpha >= 0.5);
        }
        return Ok(out);
    }
    let image = image::read(mask)?;
    let refused = |reason: String| Failure::Input(format!("error: the mask {}: {reason}", mask.display()));
    if [image.width, image.height] != [pictures[0].width, pictures[0].height] {
        return Err(refused(format!(
            "its size, {} x {}, is not that of the pictures, {} x {}",
            image.width, image.height, pictures[0].width, pictures[0].height
        )));
    }
    let [r, g, b] = image.rgb().ok_or_else(|| refused("it has no colours".to_owned()))?;
    // Half of white as a screen shows it, for masks are painted.
    let limit = 3.0 * image::png::srgb_to_linear(0.5);
    Ok(r.iter().zip(g).zip(b).map(|((r, g), b)| r + g + b >= limit).collect())
}
