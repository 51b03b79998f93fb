//! Curves that move: files numbered by frame and stages with times. The curves of one frame, how they move while the
//! shutter is open, and how they lie at rest.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use glam::DVec3;

use super::{
    super::{FabricMotion, animation::Files},
    Context,
    cloth::{CurveFile, Detail},
};
use crate::{files::stage, geometry::curve::Curve, input::diagnostic::Span};

/// Curves with their radii, millimetres.
type Curves = Vec<(Curve, Vec<f64>)>;

/// Reads the curves of a file at a frame, or of the file of the frame. Gives the file's name as well. `read` takes a file
/// and, of a stage, a frame (`None` for its first).
pub(super) fn read(
    file: &CurveFile,
    detail: &Detail,
    context: &Context<'_>,
    read: &mut impl FnMut(&Path, Option<f64>) -> Option<Curves>,
) -> Option<(PathBuf, Curves, FabricMotion)> {
    if stage::is_stage(&file.path) && file.path.exists() {
        return of_stage(file, detail, context, read);
    }
    let read = &mut |path: &Path| read(path, None);
    let rest_of = |curves: &Curves, rest: Curves| same_shape(curves, &rest).map(|()| points_of(rest));
    let tell = |problem: String, other: &Path| {
        let message = format!("{}: {problem}", other.display());
        context.error(file.span, message, Some("yarns keep their points from file to file".to_owned()));
    };
    let Some(there) = Files::about(&file.path, detail.frame) else {
        let curves = read(&file.path)?;
        let mut motion = FabricMotion::default();
        if let Some(path) = &file.rest {
            let rest = read(path)?;
            motion.rest = Some(rest_of(&curves, rest).map_err(|problem| tell(problem, path)).ok()?);
        }
        return Some((file.path.clone(), curves, motion));
    };

    // Between two files yarns move evenly from one to the other.
    let Times { all: times, shown } = Times::of(detail);
    let mut files: BTreeMap<u32, Curves> = BTreeMap::new();
    let mut around = Vec::new();
    for &time in &times {
        let [before, after] = [time.floor(), time.ceil()].map(|frame| there.number_at(frame));
        around.push((before, after, time - time.floor()));
        for number in [before, after] {
            if !files.contains_key(&number) {
                let path = there.file(number);
                let curves = read(&path)?;
                if let Some(first) = files.values().next() {
                    same_shape(first, &curves).map_err(|problem| tell(problem, &path)).ok()?;
                }
                files.insert(number, curves);
            }
        }
    }
    let pose = |&(before, after, share): &(u32, u32, f64)| -> Vec<Vec<DVec3>> {
        let pairs = files[&before].iter().zip(&files[&after]);
        pairs.map(|((a, _), (b, _))| a.points.iter().zip(&b.points).map(|(a, b)| a.lerp(*b, share)).collect()).collect()
    };
    let mut curves = files[&around[0].0].clone();
    let first = pose(&around[0]);
    let mut later: Vec<_> = around[1..].iter().map(pose).collect();
    let flow = moving_on(later.split_off(shown - 1));
    if later.iter().all(|points| *points == first) {
        later.clear();
    }
    check_moves(&later, &flow, file.span, detail, context)?;
    for ((curve, _), points) in curves.iter_mut().zip(first) {
        curve.points = points;
    }
    let rest = match &file.rest {
        Some(path) => Some(path.clone()),
        None => Some(there.first()).filter(|n| *n != detail.frame).map(|n| there.file(n)),
    };
    let rest = match rest {
        // At rest is where the curves are, or the first of them.
        None if later.is_empty() => None,
        None => Some(points_of(read(&there.file(detail.frame))?)),
        Some(path) => {
            let rest = read(&path)?;
            Some(rest_of(&curves, rest).map_err(|problem| tell(problem, &path)).ok()?)
        }
    };
    Some((there.file(detail.frame), curves, FabricMotion { later, rest, flow }))
}

/// The curves of a stage while the shutter is open; plies wind as in its first frame, or in the file `rest`.
fn of_stage(
    file: &CurveFile,
    detail: &Detail,
    context: &Context<'_>,
    read: &mut impl FnMut(&Path, Option<f64>) -> Option<Curves>,
) -> Option<(PathBuf, Curves, FabricMotion)> {
    let path = file.path.display();
    let tell = |time: f64, problem: String| {
        let message = format!("{path}: at frame {time}: {problem}");
        let hint =
            "yarns keep their points while the shutter is open; shutter = [0, 0] shows them at the frame's own time";
        context.error(file.span, message, Some(hint.to_owned()));
    };
    let Times { all: times, shown } = Times::of(detail);
    let curves = read(&file.path, Some(times[0]))?;
    let mut later = Vec::with_capacity(shown - 1);
    for &time in &times[1..shown] {
        let pose = read(&file.path, Some(time))?;
        same_shape(&curves, &pose).map_err(|problem| tell(time, problem)).ok()?;
        later.push(points_of(pose));
    }
    let first = points_of(curves.clone());
    // What is seen from the next frame on does not move until then.
    let mut flow = Vec::new();
    for &time in &times[shown..] {
        let pose = read(&file.path, Some(time))?;
        match same_shape(&curves, &pose) {
            Ok(()) => flow.push(points_of(pose)),
            Err(problem) => {
                let message =
                    format!("{path}: at frame {time}: {problem}: the layer of motion takes its yarns to stand still");
                context.warning_once(file.span, message);
                flow.clear();
                break;
            }
        }
    }
    let flow = moving_on(flow);
    if later.iter().all(|points| *points == first) {
        later.clear();
    }
    check_moves(&later, &flow, file.span, detail, context)?;
    let rest = read(file.rest.as_deref().unwrap_or(&file.path), None)?;
    let rest = match (same_shape(&curves, &rest), &file.rest) {
        (Ok(()), _) => points_of(rest),
        (Err(problem), Some(rest)) => {
            let message = format!("{}: {problem}", rest.display());
            context.error(file.span, message, Some("yarns at rest have the points that they have here".to_owned()));
            return None;
        }
        (Err(problem), None) => {
            let message = format!("{path}: in its first frame {problem}: plies wind as in the frame that is shown");
            context.warning_once(file.span, message);
            first.clone()
        }
    };
    let rest = Some(rest).filter(|rest| *rest != first || !later.is_empty());
    Some((file.path.clone(), curves, FabricMotion { later, rest, flow }))
}

/// When to know what moves, in frames.
pub(super) struct Times {
    /// While the shutter is open; then, for the layer of motion, the frame's own time and one frame later.
    pub(super) all: Vec<f64>,
    /// How many of them are those of the shutter.
    pub(super) shown: usize,
}

impl Times {
    pub(super) fn of(detail: &Detail) -> Self {
        let mut all = times(detail.frame, detail.shutter);
        let shown = all.len();
        if detail.flow {
            all.extend([f64::from(detail.frame), f64::from(detail.frame) + 1.0]);
        }
        Self { all, shown }
    }
}

/// Two poses, if anything moves from one to the other.
fn moving_on(poses: Vec<Vec<Vec<DVec3>>>) -> Vec<Vec<Vec<DVec3>>> {
    if poses.windows(2).all(|pair| pair[0] == pair[1]) { Vec::new() } else { poses }
}

/// Tells where yarns move in a mode in which they cannot.
pub(super) fn check_moves<T>(
    later: &[T],
    flow: &[T],
    span: Span,
    detail: &Detail,
    context: &Context<'_>,
) -> Option<()> {
    let (message, hint) = match (later, flow) {
        _ if detail.can_move => return Some(()),
        ([], []) => return Some(()),
        ([], _) => {
            ("the layer of motion needs mode = \"yarn\" for yarns that move", "leave `motion` out of output.layers")
        }
        _ => (
            "yarns that move while the shutter is open need mode = \"yarn\"",
            "shutter = [0, 0] shows them at the frame's own time",
        ),
    };
    context.error(span, message, Some(hint.to_owned()));
    None
}

/// Times at which to know the curves, evenly spaced from the opening of the shutter to its closing, in frames.
pub(super) fn times(frame: u32, shutter: Option<[f64; 2]>) -> Vec<f64> {
    let frame = f64::from(frame);
    let Some([open, close]) = shutter else { return vec![frame] };
    let (open, close) = (frame + open, frame + close);
    // Within one step from file to file all goes straight.
    let steps = if close <= open.floor() + 1.0 { 1 } else { 2 * (close - open).ceil() as usize };
    (0..=steps).map(|i| open + (close - open) * i as f64 / steps as f64).collect()
}

fn points_of(curves: Curves) -> Vec<Vec<DVec3>> {
    curves.into_iter().map(|(curve, _)| curve.points).collect()
}

/// Whether two files hold the same yarns, if elsewhere.
fn same_shape(a: &Curves, b: &Curves) -> Result<(), String> {
    if a.len() != b.len() {
        return Err(format!("{} curves, where another frame has {}", b.len(), a.len()));
    }
    for (i, ((a, _), (b, _))) in a.iter().zip(b).enumerate() {
        if a.points.len() != b.points.len() || a.closed != b.closed || a.basis != b.basis {
            let kind = |c: &Curve| format!("{} points, {}", c.points.len(), if c.closed { "closed" } else { "open" });
            return Err(format!("curve {i} is not as in another frame: {}, there {}", kind(b), kind(a)));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_meet_the_files_where_they_can() {
        assert_eq!(times(7, None), [7.0]);
        assert_eq!(times(7, Some([0.0, 0.5])), [7.0, 7.5]);
        assert_eq!(times(7, Some([0.0, 1.0])), [7.0, 8.0]);
        assert_eq!(times(7, Some([-0.25, 0.25])), [6.75, 7.0, 7.25]);
        assert_eq!(times(7, Some([-0.5, 1.5])), [6.5, 7.0, 7.5, 8.0, 8.5]);
    }
}
