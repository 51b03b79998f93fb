//! How packings lie, by lines through some of them.

use std::f64::consts::PI;

use glam::{DMat2, DVec2};
use rayon::prelude::*;

use super::{after::after, first::first, leaning_discs, lines::Lines};
use crate::{
    geometry::{
        density::{KnownPacking, PlyPacking},
        fiber::{
            slopes::{Slopes, Twist},
            yielding::{Ellipse, Yielding},
        },
    },
    math::sampler::Stream,
};

/// The most discs of a packing that is measured, about how many discs are looked at, and in how many packings.
const MOST_MEASURED: u32 = 100;
const MEASURED: u32 = 1500;
const LEAST_PACKINGS: u32 = 15;
const MOST_PACKINGS: u32 = 100;
/// At how many turns a packing is squeezed.
const SQUEEZED: u32 = 4;

/// How the packings that [`hard_discs`](super::hard_discs) makes of fibres with a twist lie, from some of them; `radius` is
/// in core radii. Where `stretch`, the long over the short axis of their ply's section, is above 1, discs have given way to
/// each other as [`Yielding`] has it.
///
/// The crowding and its depth are those with which lines by the rim meet as many discs as they do, by least squares of what
/// would pass if these lay at random. The regularity is that with which the gaps of
/// [`PlyGaps`](crate::geometry::gaps::PlyGaps) pass as much as pieces of lines away from the rim do; that by the rim with
/// which they pass as much as lines in all directions through the packings, by least squares of the roots over the ply's
/// width. The first fibre lies as deep as the first ones on random lines do. What is free after a fibre is that with which as much light
/// leaves that met one as on lines from the place where it did. Both are told from what the others say, `known` or measured.
///
/// Fibres are packed as they lean on the mean around the ply; lines meet them as they lean on the yarn's outside.
///
/// Of more than `MOST_MEASURED` discs some are packed as densely in their stead: the crowding is at the wall only, so it
/// falls with a disc's radius.
pub fn measured(count: u32, radius: f64, twist: Twist, stretch: f64, known: KnownPacking) -> PlyPacking {
    let packed = count.min(MOST_MEASURED);
    let fewer = (f64::from(packed) / f64::from(count.max(1))).sqrt();
    // The same area fraction of the ply, whose radius is 1 + radius.
    let share = radius / (1.0 + radius) / fewer;
    if packed == 0 || share >= 1.0 {
        return known.over(PlyPacking::evenly(1.0));
    }
    let radius = share / (1.0 - share);
    let twist = twist.scaled(twist.room(packed, share));
    let (mean, outside) = (twist.in_core(share), twist.outside(share));
    let packings: Vec<Vec<DVec2>> = (0..MEASURED.div_ceil(packed).clamp(LEAST_PACKINGS, MOST_PACKINGS))
        .into_par_iter()
        .map(|seed| leaning_discs(packed, radius, &mean, &mut Stream::new(seed)))
        .collect();
    let pressed = Ellipse::of(DMat2::from_diagonal(DVec2::new(stretch, 1.0)));
    let sections: Vec<Vec<DVec2>> = match &pressed {
        None => packings,
        Some(ellipse) => packings.iter().flat_map(|discs| squeezed(discs, share, &outside, ellipse)).collect(),
    };
    let lines = match &pressed {
        None => Lines { radius, stretch: 1.0, slopes: outside },
        Some(ellipse) => Lines { radius, stretch, slopes: ellipse.slopes_in(&outside) },
    };
    let mut ply = lines.ply(packed);
    lines.fit_wall(&sections, &mut ply);
    let core = pressed.as_ref().map_or(DVec2::ONE, |ellipse| ellipse.core(share) / (1.0 - share));
    let regularity = lines.inside(&sections, core);
    ply.regularity = regularity as f32;
    let rim = lines.rim(&sections, &ply);
    let (crowding, depth) = (f64::from(ply.crowding) * fewer, f64::from(ply.depth));
    let packing = known.over(PlyPacking { crowding, depth, rim, ..PlyPacking::evenly(regularity) });
    ply.pack(&PlyPacking { crowding: packing.crowding / fewer, ..packing });
    let first = Some(first(&lines, &sections, &ply));
    let after = Some(after(&lines, &sections, &ply));
    PlyPacking { first, after, ..packing }
}

/// A packing in an ellipse, at some turns; in core radii, as the packing. `share` is a disc's radius over the ply's.
pub(super) fn squeezed<'a>(
    discs: &'a [DVec2],
    share: f64,
    slopes: &Slopes,
    ellipse: &'a Ellipse,
) -> impl Iterator<Item = Vec<DVec2>> + 'a {
    let yielding = Yielding::new(discs, share, slopes, ellipse);
    let slopes = ellipse.slopes_in(slopes).per_ply_radius(share);
    (0..SQUEEZED).map(move |turn| {
        let mut out = Vec::with_capacity(discs.len());
        yielding.squeeze(DVec2::from_angle(PI * f64::from(turn) / f64::from(SQUEEZED)), ellipse, &slopes, &mut out);
        out.iter_mut().for_each(|at| *at /= 1.0 - share);
        out
    })
}
