//! What is told of a render: before it, while it runs, and after it.

use std::{
    io::IsTerminal as _,
    path::PathBuf,
    time::{Duration, Instant},
};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::{
    super::{folds_in_words, log},
    options::RenderArgs,
};
use crate::{
    math::words::{bytes_in_words, counted},
    render::{Progress, Rendered},
    report::{self, Phases},
    scene::Scene,
    trace::World,
};

/// `yarns` are the numbers of yarns of each fabric.
pub(super) fn warn(args: &RenderArgs, scene: &Scene, world: &World, yarns: &[usize]) {
    for warning in &scene.warnings {
        tracing::warn!("{warning}");
    }
    // Of several frames once: they say nearly the same.
    if args.frames.is_none() || args.options.frames.is_some() {
        scene.garments.iter().flat_map(|g| &g.repairs).for_each(|note| tracing::info!("note: {note}"));
    }
    for (i, fabric) in scene.fabrics.iter().enumerate() {
        let Some(folds) = world.folds(i) else { continue };
        let told = folds_in_words(scene, fabric, &folds, yarns[i]);
        if folds.are_seen() {
            let more = if args.log.verbose > 0 { "" } else { " (-v shows all)" };
            tracing::warn!("{told}{more}");
        } else {
            tracing::debug!("{told}");
        }
        let bends = world.tight_bends(i);
        for (bend, at) in bends {
            let at = at + scene.middle;
            let (yarn, segment, fold) = (bend.yarn, bend.segment, bend.fold);
            tracing::debug!("yarn {yarn} folds at segment {segment} by {fold:.2} of its radius, at {at:.1} mm");
        }
    }
}

pub(super) fn bar(args: &RenderArgs) -> ProgressBar {
    if args.log.quiet || args.log.log_json || !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::with_draw_target(Some(1000), ProgressDrawTarget::stderr());
    let style = ProgressStyle::with_template("{wide_bar} {percent}%  {msg}  {elapsed}");
    bar.set_style(style.expect("the template is well formed"));
    log::past(Some(&bar));
    bar
}

/// Shows the progress on the bar; tells it at most once a second, or of every wave with -vv.
pub(super) fn show(bar: &ProgressBar, last_line: &mut Option<Instant>, p: &Progress<'_>) {
    let noise = p.noise.map_or(String::new(), |n| format!(", noise {n:.2e}"));
    let left = p.left.as_secs_f64();
    bar.set_position((p.share * 1000.0) as u64);
    bar.set_message(format!("{} of {} spp{noise}  (left: {left:.0} s)", p.spp, p.spp_end));
    let seconds = p.elapsed.as_secs_f64();
    let line = format!("{} of {} spp{noise}, {seconds:.1} s, about {left:.0} s left", p.spp, p.spp_end);
    let (spp, spp_end, share, noise) = (p.spp, p.spp_end, p.share, p.noise);
    if last_line.is_none_or(|t: Instant| t.elapsed() >= Duration::from_secs(1)) {
        *last_line = Some(Instant::now());
        tracing::debug!(phase = "render", spp, spp_end, share, noise, seconds, seconds_left = left, "{line}");
    } else {
        tracing::trace!(phase = "render", spp, spp_end, share, noise, seconds, seconds_left = left, "{line}");
    }
}

pub(super) fn summary(world: &World, rendered: &Rendered, phases: &Phases, outputs: &[PathBuf]) {
    let s = |d: Duration| format!("{:.2} s", d.as_secs_f64());
    let (least, spp, most) = rendered.film.samples();
    let c = &rendered.counters;
    for path in outputs {
        tracing::info!(path = %path.display(), "wrote {}", path.display());
    }
    let denoise = if phases.denoise.is_zero() { String::new() } else { format!(", denoised in {}", s(phases.denoise)) };
    tracing::info!(
        spp,
        stopped_by = rendered.stop.name(),
        seconds = phases.total.as_secs_f64(),
        "{spp:.0} spp in {} ({:.2} M samples/s), stopped by {}; load {}, curves {}, BVH {}{denoise}, total {}",
        s(rendered.elapsed),
        c.camera as f64 / 1e6 / rendered.elapsed.as_secs_f64().max(1e-9),
        rendered.stop.name(),
        s(phases.load),
        s(phases.made.generate),
        s(phases.made.build),
        s(phases.total),
    );
    tracing::debug!(
        "curves {}, BVH {}, peak memory {}; rays: {} from the camera, {} bounced, {} to lights",
        bytes_in_words(world.geometry_bytes()),
        bytes_in_words(world.bvh_bytes()),
        bytes_in_words(report::peak_rss_bytes()),
        c.camera,
        c.bounce,
        c.shadow
    );
    if c.invalid > 0 {
        tracing::warn!("{} not finite, left out", counted(c.invalid, "sample"));
    }
    if least == 0 && c.invalid > 0 {
        tracing::warn!("some pixels have no sample that is finite, and are black");
    } else if least == 0 && most > 0 {
        tracing::warn!("some pixels have no sample and are black: the time was too short for one sample each");
    }
}
