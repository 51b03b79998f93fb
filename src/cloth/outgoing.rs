//! A scene's cloth as curves for files: each with the number of its yarn, its ply, and its colour.
//!
//! Yarns are as the scene has them; plies and fibres are those that Embree would get. Lengths are millimetres, where the
//! scene's file has them.

use super::{BuildError, Preparation, borrowed};
use crate::{
    geometry::curve::{Curve, CurveSet},
    scene::{CurveKind, Fabric, Mode, Scene, Yarn},
    trace::CurveGeometry,
};

/// What is said of curves whose colour changes along them.
const MEAN_COLORS: &str = "colours along a yarn are told as their mean: curves have one colour each";

/// The yarns of a scene.
fn yarns(scene: &Scene) -> CurveSet {
    let mut set = CurveSet { unit_mm: Some(1.0), up_axis: Some(1), ..CurveSet::default() };
    let mut mixed = false;
    for fabric in &scene.fabrics {
        let palette = Palette::new(scene, fabric, None);
        for (yarn, (curve, radii)) in fabric.curves.iter().enumerate() {
            let mut curve = Curve { radii: Some(radii.clone()), ..curve.clone() };
            curve.points.iter_mut().for_each(|p| *p += scene.middle);
            curve.make_round();
            set.ids.push(Some(set.curves.len() as i64));
            set.colors.push(Some(palette.mean(fabric.material_indices.get(yarn).into_iter().flatten(), &mut mixed)));
            set.curves.push(curve);
        }
    }
    set.notes.extend(mixed.then(|| MEAN_COLORS.to_owned()));
    set
}

/// The curves that a scene's cloth is in its mode: yarns as the scene has them, without frames or fly-aways; plies and
/// fibres as Embree would get them. Yarns are numbered through all fabrics, also those that plies and fibres are of.
///
/// # Errors
/// If plies or fibres would take more memory than `limit`, bytes.
pub fn curves(scene: &Scene, limit: Option<u64>) -> Result<CurveSet, BuildError> {
    match scene.render.mode {
        Mode::Yarn => Ok(yarns(scene)),
        Mode::Ply | Mode::Fiber => plies_or_fibers(scene, limit),
    }
}

fn plies_or_fibers(scene: &Scene, limit: Option<u64>) -> Result<CurveSet, BuildError> {
    let pieces = Preparation::checked(scene, borrowed(scene), limit, 0)?.pieces();
    let first_yarns: Vec<usize> = scene.fabrics.iter().scan(0, |sum, f| Some(next(sum, f.curves.len()))).collect();
    let mut set = CurveSet { unit_mm: Some(1.0), up_axis: Some(1), ..CurveSet::default() };
    let mut mixed = false;
    for geometry in pieces.into_iter().map(|piece| piece.curves) {
        let (index, ply) = match &geometry {
            CurveGeometry::Yarns(own) => (own.fabric, Some(own.first_ply)),
            CurveGeometry::Fibers(own) => (own.fabric, (!own.first_tubes.is_empty()).then_some(own.ply)),
        };
        let fabric = &scene.fabrics[index];
        let palette = Palette::new(scene, fabric, ply);
        let mut add = |yarn: usize, curve: Curve, color: [f32; 3]| {
            set.ids.push(Some((first_yarns[index] + yarn) as i64));
            set.plies.push(ply.map(|ply| ply as i64));
            set.colors.push(Some(color));
            set.curves.push(curve);
        };
        match &geometry {
            CurveGeometry::Yarns(own) => {
                for (yarn, curve) in own.strands.curves() {
                    let segments = own.strands.segments_of(yarn);
                    let indices: Vec<u16> = segments.filter_map(|s| own.strands.material_index(s)).collect();
                    add(yarn, curve, palette.mean(&indices, &mut mixed));
                }
            }
            CurveGeometry::Fibers(own) => {
                for (tube, curve) in own.tubes.curves().enumerate() {
                    // Fibres that are no part of a yarn are numbered themselves.
                    let yarn = match own.first_tubes.partition_point(|&first| first as usize <= tube) {
                        0 => tube,
                        after => after - 1,
                    };
                    let segments = own.tubes.segments_of(tube);
                    let indices: Vec<u16> = segments.filter_map(|s| own.material_index(s as u32)).collect();
                    add(yarn, curve, palette.mean(&indices, &mut mixed));
                }
            }
        }
    }
    for point in set.curves.iter_mut().flat_map(|c| &mut c.points) {
        *point += scene.middle;
    }
    if set.plies.iter().all(Option::is_none) {
        set.plies = Vec::new();
    }
    set.notes.extend(mixed.then(|| MEAN_COLORS.to_owned()));
    Ok(set)
}

/// Adds, and gives what was before.
fn next(sum: &mut usize, count: usize) -> usize {
    let before = *sum;
    *sum += count;
    before
}

/// The colours that the curves of a fabric may have.
struct Palette {
    own: [f32; 3],
    variants: Vec<[f32; 3]>,
}

impl Palette {
    /// Those of one ply, or of whole yarns.
    fn new(scene: &Scene, fabric: &Fabric, ply: Option<usize>) -> Self {
        let of_yarn = |yarn: &Yarn| {
            let plies = ply.map_or(0..yarn.fibers.len(), |ply| ply..ply + 1);
            let count = plies.len() as f64;
            let colors = yarn.fibers[plies].iter().map(|(_, fiber)| fiber.cloth_color());
            let sum = colors.fold([0.0; 3], |a, b| [a[0] + b[0], a[1] + b[1], a[2] + b[2]]);
            sum.map(|c| (c / count) as f32)
        };
        let own = match fabric.kind {
            CurveKind::Yarn(yarn) => of_yarn(&scene.yarns[yarn]),
            CurveKind::Fiber(fiber) => scene.fibers[fiber].1.cloth_color().map(|c| c as f32),
        };
        Self { own, variants: fabric.variants.iter().map(of_yarn).collect() }
    }

    /// That of a curve with these material indices; notes whether they differ.
    fn mean<'i>(&self, indices: impl IntoIterator<Item = &'i u16>, mixed: &mut bool) -> [f32; 3] {
        let mut sum = [0.0f64; 3];
        let mut count = 0.0;
        let mut first = None;
        for &index in indices {
            let color = self.variants[usize::from(index)];
            sum.iter_mut().zip(color).for_each(|(s, c)| *s += f64::from(c));
            count += 1.0;
            *mixed |= *first.get_or_insert(color) != color;
        }
        if count == 0.0 { self.own } else { sum.map(|s| (s / count) as f32) }
    }
}
