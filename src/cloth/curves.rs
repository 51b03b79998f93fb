//! What stands for the cloth: the one place that turns a mode into curves.

use std::{borrow::Cow, f64::consts::TAU};

use rayon::prelude::*;

use super::{
    estimate::{BuildError, DISTANCE_BYTES, Estimate, FLATTENING_BYTES, MATERIAL_INDEX_BYTES},
    material::{self, Scatterers, Shared},
};
use crate::{
    geometry::{
        curve::{Basis, Curve},
        fiber::{Plies, flyaway::Flyaways},
        material_indices::MaterialIndices,
        ply::PlyParameters,
        segment_uvs::SegmentUvs,
        strand::{Along, Folds, StrandMotion, StrandOptions, Strands, Unevenness},
        tube::Tubes,
        yarn::YarnShape,
    },
    scattering::{fiber::FiberBcsdf, yarn::YarnScatterer},
    scene::{CurveKind, Fabric, Mode, Sample, Scene, Tufts, Yarn},
    trace::{CurveGeometry, FiberGeometry, PerVariant, YarnGeometry},
};

/// Curves for Embree, and how they scatter.
pub(super) struct Piece {
    pub(super) curves: CurveGeometry,
    pub(super) scatterers: Scatterers,
}

/// A fabric's yarns with their frames: all that is needed to make any representation of them.
struct Prepared<'a> {
    index: usize,
    fabric: &'a Fabric,
    of: Of<'a>,
}

enum Of<'a> {
    /// The plies and the section are in radii of the tube that holds them.
    Yarns {
        yarn: &'a Yarn,
        plies: Vec<PlyParameters>,
        shape: Box<YarnShape>,
        strands: Strands,
    },
    Fibers {
        curves: Given<'a>,
        material: FiberBcsdf,
    },
}

/// The curves of a fabric: the scene's, or taken out of it.
pub(super) type Given<'a> = Cow<'a, [(Curve, Vec<f64>)]>;

/// A scene's cloth before it is turned into curves for Embree.
pub(super) struct Preparation<'a> {
    scene: &'a Scene,
    fabrics: Vec<Prepared<'a>>,
}

impl<'a> Preparation<'a> {
    /// The curves of each fabric of a scene, refused if all would take more memory than `limit` with what is taken `beside`,
    /// bytes. Curves handed over are freed on the way, and so is what is prepared as soon as it is known to be too much: the
    /// rest is made one fabric at a time, only to tell what all would take.
    pub(super) fn checked(
        scene: &'a Scene,
        curves: impl IntoIterator<Item = Given<'a>>,
        limit: Option<u64>,
        beside: u64,
    ) -> Result<Self, BuildError> {
        let mut fabrics = Vec::with_capacity(scene.fabrics.len());
        let mut needed = Estimate::default();
        let too_much = |needed: &Estimate| limit.filter(|limit| needed.bytes() + beside > *limit);
        for (prepared, estimate) in prepared(scene, curves) {
            needed = [needed, estimate].into_iter().sum();
            if too_much(&needed).is_some() {
                fabrics = Vec::new();
            } else {
                fabrics.push(prepared);
            }
        }
        match too_much(&needed) {
            Some(limit) => Err(BuildError::Memory { needed, beside, limit }),
            None => Ok(Self { scene, fabrics }),
        }
    }

    /// The curves for Embree, one entry for each geometry, with how they scatter.
    pub(super) fn pieces(self) -> Vec<Piece> {
        let (mode, model) = (self.scene.render.mode, self.scene.render.model);
        let whole = self.fabrics.iter().filter(|_| mode == Mode::Yarn).filter_map(Prepared::whole_yarn);
        let shared = Shared::new(whole, model);
        let of_fabric = |prepared: Prepared<'_>| prepared.pieces(mode, &shared);
        let mut all: Vec<Piece> = match mode {
            // Nothing is left but to find how they scatter.
            Mode::Yarn => self.fabrics.into_par_iter().flat_map_iter(of_fabric).collect(),
            // One after the other, so that only one has all that its curves are made of beside them.
            Mode::Ply | Mode::Fiber => self.fabrics.into_iter().flat_map(of_fabric).collect(),
        };
        // A yarn too short to hold a hair leaves nothing for Embree.
        all.retain(|piece| piece.curves.count() > 0);
        all
    }
}

/// Each fabric of a scene with what it will take, made when it is asked for.
fn prepared<'a>(
    scene: &'a Scene,
    curves: impl IntoIterator<Item = Given<'a>>,
) -> impl Iterator<Item = (Prepared<'a>, Estimate)> {
    let numbered = scene.fabrics.iter().zip(curves).enumerate();
    numbered.map(|(index, (fabric, curves))| Prepared::new(scene, index, fabric, curves))
}

/// What each fabric of a scene will take, also of curves that a survey has not made, and where its yarns fold, of curves that there are. Only
/// one of them is in memory at a time.
pub(super) fn estimates(scene: &Scene) -> Vec<(Estimate, Option<Folds>)> {
    let prepared = |fabric: &Fabric| {
        let (prepared, estimate) = Prepared::new(scene, 0, fabric, Cow::Borrowed(&*fabric.curves));
        let folds = match &prepared.of {
            Of::Yarns { strands, .. } => strands.folds(),
            Of::Fibers { .. } => None,
        };
        (estimate, folds)
    };
    let of_all = |fabric: &Fabric| match fabric.kind {
        CurveKind::Yarn(yarn) => match fabric.sample(scene.yarns[yarn].radius) {
            Some(Sample { fabric, times }) => (prepared(&fabric).0.times(times), None),
            None => prepared(fabric),
        },
        CurveKind::Fiber(_) => prepared(fabric),
    };
    scene.fabrics.iter().map(of_all).collect()
}

impl<'a> Prepared<'a> {
    /// The curves of a fabric, with what they will take.
    fn new(scene: &'a Scene, index: usize, fabric: &'a Fabric, curves: Given<'a>) -> (Self, Estimate) {
        let of = match fabric.kind {
            CurveKind::Yarn(yarn) => {
                let yarn = &scene.yarns[yarn];
                let shape = Box::new(yarn.shape());
                let strands = strands(fabric, curves, yarn, &shape);
                Of::Yarns { yarn, plies: yarn.plies_in_tube(), shape, strands }
            }
            CurveKind::Fiber(fiber) => Of::Fibers { curves, material: FiberBcsdf::new(&scene.fibers[fiber].1) },
        };
        let prepared = Self { index, fabric, of };
        let estimate = prepared.estimate(scene.render.mode, scene.render.compact_bvh);
        (prepared, estimate)
    }

    fn estimate(&self, mode: Mode, compact: bool) -> Estimate {
        let mut estimate = Estimate::default();
        match &self.of {
            Of::Fibers { curves, .. } => {
                let points: u64 = curves.iter().map(|(c, _)| c.points.len() as u64).sum();
                estimate.add(points, points, false, compact);
            }
            Of::Yarns { yarn, plies, shape, strands } => {
                estimate.tight_bends = strands.tight_bends().len();
                let plies = plies_of(self.fabric, yarn, plies, shape, strands);
                match mode {
                    Mode::Yarn => {
                        let (points, segments) = (strands.points().len(), strands.segments().len());
                        estimate.add(points as u64, segments as u64, true, compact);
                        if strands.flattened() {
                            estimate.geometry_bytes += points as u64 * FLATTENING_BYTES;
                        }
                    }
                    Mode::Ply => {
                        let (points, segments) = plies.ply_counts();
                        estimate.add(points, segments, true, compact);
                        // What is round across the yarn is not across a ply that turns about it.
                        if strands.flattened() || shape.elliptical || shape.ply_rate != 0.0 {
                            estimate.geometry_bytes += points * FLATTENING_BYTES;
                        }
                    }
                    Mode::Fiber => {
                        let (points, segments) = plies.fiber_counts();
                        estimate.add(points, segments, false, compact);
                    }
                }
                if self.fabric.shows_fibers {
                    estimate.geometry_bytes += estimate.points * DISTANCE_BYTES;
                }
                if let Some(flyaways) = yarn.flyaways_in_tube() {
                    let (points, segments) = plies.flyaway_counts(&flyaways);
                    estimate.add(points, segments, false, compact);
                }
            }
        }
        if !self.fabric.variants.is_empty() {
            estimate.geometry_bytes += estimate.segments * MATERIAL_INDEX_BYTES;
        }
        estimate
    }

    /// Its yarns, if they are no single fibres, and long over short axis of their sections.
    fn whole_yarn(&self) -> Option<(&'a Yarn, f64)> {
        match &self.of {
            Of::Yarns { yarn, strands, .. } => Some((yarn, stretch(strands.mean_flattening()))),
            Of::Fibers { .. } => None,
        }
    }

    fn pieces(self, mode: Mode, shared: &Shared<'_>) -> Vec<Piece> {
        let (index, fabric) = (self.index, self.fabric);
        let (yarn, in_tube, shape, strands) = match self.of {
            Of::Yarns { yarn, plies, shape, strands } => (yarn, plies, shape, strands),
            Of::Fibers { curves, material } => return vec![Piece::of_lone_fibers(index, &curves, material)],
        };
        let plies = plies_of(fabric, yarn, &in_tube, &shape, &strands);
        let (variants, shows_fibers) = (&fabric.variants[..], fabric.shows_fibers);
        let wound = Wound { index, yarn, variants, shape: &shape, strands: &strands, plies, shows_fibers };
        let slots = 0..yarn.plies.len();
        let mut all: Vec<Piece> = match mode {
            Mode::Yarn => Vec::new(),
            Mode::Ply => slots.clone().map(|ply| wound.ply(ply, shared)).collect(),
            Mode::Fiber => slots.clone().map(|ply| wound.fibers(ply)).collect(),
        };
        if let Some(flyaways) = yarn.flyaways_in_tube() {
            all.extend(slots.map(|ply| wound.flyaways(ply, &flyaways)));
        }
        if mode == Mode::Yarn {
            let scatterers = shared.of_yarns(yarn, &fabric.variants, stretch(strands.mean_flattening()));
            all.push(Piece::of_yarns(index, 0, strands, scatterers));
        }
        all
    }
}

/// Long over short axis of sections, by how flat they are on the mean: to a hundredth, so that panels of one cloth and frames of one film
/// count as the same.
fn stretch(mean_flattening: f64) -> f64 {
    (mean_flattening.recip() * 100.0).round() / 100.0
}

impl Piece {
    /// Yarns, or plies from the ply `first_ply` on.
    fn of_yarns(fabric: usize, first_ply: usize, strands: Strands, scatterers: PerVariant<YarnScatterer>) -> Self {
        let occluders = material::occluders(&scatterers);
        let curves = CurveGeometry::Yarns(YarnGeometry { fabric, first_ply, strands, occluders });
        Self { curves, scatterers: Scatterers::Yarns(scatterers) }
    }

    /// Fibres that are no part of a yarn.
    fn of_lone_fibers(fabric: usize, curves: &[(Curve, Vec<f64>)], material: FiberBcsdf) -> Self {
        let curves = CurveGeometry::Fibers(FiberGeometry {
            fabric,
            ply: 0,
            first_tubes: Vec::new(),
            tubes: Tubes::new(curves),
            material_indices: MaterialIndices::default(),
            uvs: SegmentUvs::default(),
        });
        Self { curves, scatterers: Scatterers::Fibers(PerVariant::same(material)) }
    }
}

/// Yarns of a fabric with all that their plies and fibres are made of.
struct Wound<'a> {
    index: usize,
    yarn: &'a Yarn,
    variants: &'a [Yarn],
    shape: &'a YarnShape,
    strands: &'a Strands,
    plies: Plies<'a>,
    shows_fibers: bool,
}

impl Wound<'_> {
    /// One ply of all yarns, each as a yarn of its own.
    fn ply(&self, ply: usize, shared: &Shared<'_>) -> Piece {
        let (mut strands, alone) = ply_strands(&self.plies, self.shape, ply, self.shows_fibers);
        strands.set_material_indices(self.plies.material_indices_along(1));
        strands.set_uvs(self.plies.uvs_along(1));
        let alone = (alone, stretch(self.plies.mean_flattening()));
        let scatterers = shared.of_plies(self.yarn, self.variants, ply, alone);
        Piece::of_yarns(self.index, ply, strands, scatterers)
    }

    /// All fibres of one ply.
    fn fibers(&self, ply: usize) -> Piece {
        let (tubes, first_tubes) = self.plies.fibers(ply, self.yarn.placement);
        let count = self.yarn.plies[ply].fibers as usize;
        self.piece(FiberGeometry {
            fabric: self.index,
            ply,
            first_tubes,
            tubes,
            material_indices: self.plies.material_indices_along(count),
            uvs: self.plies.uvs_along(count),
        })
    }

    /// The fibres that leave one ply. A hair has the material and the texture coordinates of the place where it leaves.
    fn flyaways(&self, ply: usize, flyaways: &Flyaways) -> Piece {
        let (tubes, first_tubes, from) = self.plies.flyaways(ply, flyaways);
        let root = |segment| from[tubes.tube_of(segment)];
        let segments = tubes.segments().len() as u32;
        let material_indices = (0..segments).filter_map(|s| self.strands.material_index(root(s))).collect();
        let material_indices = MaterialIndices::new(material_indices, false);
        let own = self.strands.uvs();
        let placed = if own.is_empty() { 0 } else { segments };
        let uvs = SegmentUvs::constant((0..placed).map(|s| own.at(root(s), 0.0)));
        self.piece(FiberGeometry { fabric: self.index, ply, first_tubes, tubes, material_indices, uvs })
    }

    fn piece(&self, fibers: FiberGeometry) -> Piece {
        let scatterers = Scatterers::Fibers(material::of_fibers(self.yarn, self.variants, fibers.ply));
        Piece { curves: CurveGeometry::Fibers(fibers), scatterers }
    }
}

/// The plies of a yarn, of which lengths are in radii of the tube that holds them, wound around its strands.
fn plies_of<'a>(
    fabric: &Fabric,
    yarn: &Yarn,
    plies: &'a [PlyParameters],
    shape: &'a YarnShape,
    strands: &'a Strands,
) -> Plies<'a> {
    let plies = Plies::new(strands, plies, shape, fabric.seed);
    match &fabric.tufts {
        Tufts { yarns: 0, .. } => plies,
        Tufts { yarns, strands } => plies.with_opened(yarn.radius * yarn.tube(), strands.len() as f64 / *yarns as f64),
    }
}

fn strands(fabric: &Fabric, curves: Given<'_>, yarn: &Yarn, shape: &YarnShape) -> Strands {
    Strands::with(
        curves,
        Along { material_indices: &fabric.material_indices, blended: fabric.printed, uvs: &fabric.uvs },
        StrandMotion { later: &fabric.motion.later, rest: fabric.motion.rest.as_deref(), flow: &fabric.motion.flow },
        &StrandOptions {
            basis: fabric.basis,
            tolerance: fabric.tolerance,
            longest_segment: fabric.longest_segment,
            ply_rate: f64::from(shape.ply_rate),
            symmetry: shape.symmetry,
            phases: fabric.phases.clone(),
            distances: fabric.shows_fibers,
            unevenness: (yarn.unevenness > 0.0).then_some(Unevenness { spread: yarn.unevenness, seed: fabric.seed }),
            tube: yarn.tube(),
        },
    )
}

/// One ply of all yarns as yarns of their own, and the section of such a yarn: one ply that fills it.
fn ply_strands(plies: &Plies<'_>, of: &YarnShape, slot: usize, distances: bool) -> (Strands, YarnShape) {
    let ply = plies.parameters(slot);
    let strands = Strands::new(
        plies.ply_curves(slot),
        &StrandOptions {
            basis: Basis::BSpline,
            tolerance: 0.0,
            longest_segment: f64::INFINITY,
            ply_rate: 0.0,
            symmetry: TAU,
            phases: vec![0.0],
            distances,
            unevenness: None,
            tube: 1.0,
        },
    );
    let (wp, wf) = (f64::from(of.ply_rate), f64::from(of.plies[slot].fiber_rate));
    // A ply at angle alpha is longer than its yarn by 1 / cos(alpha), and its rotation-minimising frame turns with the
    // helix: the axis to the yarn turns by cos^2(alpha) of what it turns in the yarn's frame.
    let cos = 1.0 / (wp * ply.distance).hypot(1.0);
    let wide = plies.mean_width(&strands);
    let flatter = (strands.mean_flattening() / plies.mean_flattening()).sqrt();
    let fiber_twist = (((wf - wp) * cos + wp * cos * cos) * wide).atan();
    let alone = PlyParameters {
        radius: 1.0,
        aspect: 1.0,
        distance: 0.0,
        angle: 0.0,
        fibers: ply.fibers,
        fiber_radius: ply.fiber_radius / (wide * flatter),
        fiber_twist,
    };
    let shape = YarnShape::new(&[alone], 0.0, of.tilted);
    (strands, shape)
}
