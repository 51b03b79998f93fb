//! What stands for the cloth in each mode, and how much memory it takes, known before it is made.

use std::{borrow::Cow, f64::consts::TAU, fmt, iter::Sum};

use super::{CurveGeometry, FiberGeometry, YarnGeometry, scatterer_in, shape_for, yarn_scatterer};
use crate::{
    ffi::embree::EmbreeError,
    geometry::{
        curve::{Basis, Curve},
        fiber::Plies,
        segment_uvs::SegmentUvs,
        strand::{Along, StrandMotion, StrandOptions, Strands},
        tube::Tubes,
        yarn::{PlyParameters, YarnShape},
    },
    scattering::fiber::FiberBcsdf,
    scene::{CurveKind, Fabric, Mode, Model, Scene, Yarn},
};

/// Bytes of Embree's BVH for a cubic segment: compact and fast, measured on fibres and on yarns.
const BVH_BYTES: [f64; 2] = [44.0, 119.0];
/// Bytes of a control point with its radius.
const POINT_BYTES: u64 = 16;
/// Bytes that a yarn keeps beside each point.
const FRAME_BYTES: u64 = 12;
/// Of what presses a point's section flat, in yarns that are.
const FLATTENING_BYTES: u64 = 8;
/// Bytes of a segment's index.
const SEGMENT_BYTES: u64 = 4;
/// Bytes of the material index of each segment, in a fabric with variants.
const MATERIAL_INDEX_BYTES: u64 = 2;

/// Why a scene could not be made ready for rays.
#[derive(Clone, Debug, PartialEq)]
pub enum BuildError {
    /// What Embree said.
    Embree(EmbreeError),
    /// It would take more memory than it may.
    Memory {
        /// What it would take.
        needed: Estimate,
        /// What the render takes besides, such as its film; bytes.
        beside: u64,
        /// What all may take, bytes.
        limit: u64,
    },
}

impl From<EmbreeError> for BuildError {
    fn from(error: EmbreeError) -> Self {
        Self::Embree(error)
    }
}

impl fmt::Display for BuildError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Embree(error) => error.fmt(f),
            Self::Memory { needed, beside, limit } => {
                let gigabytes = |bytes: u64| bytes as f64 / 1e9;
                write!(
                    f,
                    "the scene needs about {:.2} GB ({:.2} GB of curves, {:.2} GB of BVH, {} segments, {:.2} GB of film and \
                     textures), but may take {:.2} GB",
                    gigabytes(needed.bytes() + beside),
                    gigabytes(needed.geometry_bytes),
                    gigabytes(needed.bvh_bytes),
                    needed.segments,
                    gigabytes(*beside),
                    gigabytes(*limit)
                )
            }
        }
    }
}

impl std::error::Error for BuildError {}

/// What curves will take, and where they cannot be followed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// Control points.
    pub points: u64,
    /// Segments.
    pub segments: u64,
    /// Bytes of control points, indices and what is kept for each point.
    pub geometry_bytes: u64,
    /// Bytes of Embree's BVH.
    pub bvh_bytes: u64,
    /// Yarns that bend more tightly somewhere than their radius allows.
    pub tight_bends: usize,
}

impl Sum for Estimate {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::default(), |a, b| Self {
            points: a.points + b.points,
            segments: a.segments + b.segments,
            geometry_bytes: a.geometry_bytes + b.geometry_bytes,
            bvh_bytes: a.bvh_bytes + b.bvh_bytes,
            tight_bends: a.tight_bends + b.tight_bends,
        })
    }
}

impl Estimate {
    /// All bytes.
    pub fn bytes(&self) -> u64 {
        self.geometry_bytes + self.bvh_bytes
    }

    /// That of aggregated yarns of so many control points in all.
    pub fn of_yarns(points: u64, compact: bool) -> Self {
        let mut estimate = Self::default();
        estimate.add(points, points, true, compact);
        estimate
    }

    fn add(&mut self, points: u64, segments: u64, framed: bool, compact: bool) {
        self.points += points;
        self.segments += segments;
        self.geometry_bytes += points * (POINT_BYTES + if framed { FRAME_BYTES } else { 0 }) + segments * SEGMENT_BYTES;
        self.bvh_bytes += (segments as f64 * BVH_BYTES[usize::from(!compact)]) as u64;
    }
}

/// A fabric's yarns with their frames: all that is needed to make any representation of them.
struct Prepared<'a> {
    index: usize,
    fabric: &'a Fabric,
    of: Of<'a>,
}

enum Of<'a> {
    Yarns { yarn: &'a Yarn, shape: Box<YarnShape>, strands: Strands },
    Fibers { curves: Given<'a>, material: FiberBcsdf },
}

/// The curves of a fabric: the scene's, or taken out of it.
pub(super) type Given<'a> = Cow<'a, [(Curve, Vec<f64>)]>;

/// A scene's cloth before it is turned into curves for Embree.
pub(super) struct Preparation<'a> {
    scene: &'a Scene,
    fabrics: Vec<Prepared<'a>>,
}

impl<'a> Preparation<'a> {
    /// For the curves of each fabric of a scene; those handed over are freed on the way.
    pub(super) fn new(scene: &'a Scene, curves: impl IntoIterator<Item = Given<'a>>) -> Self {
        let fabrics = scene
            .fabrics
            .iter()
            .zip(curves)
            .enumerate()
            .map(|(index, (fabric, curves))| {
                let of = match fabric.kind {
                    CurveKind::Yarn(yarn) => {
                        let yarn = &scene.yarns[yarn];
                        let shape = Box::new(yarn.shape());
                        let strands = strands(fabric, curves, &shape);
                        Of::Yarns { yarn, shape, strands }
                    }
                    CurveKind::Fiber(fiber) => Of::Fibers { curves, material: FiberBcsdf::new(&scene.fibers[fiber].1) },
                };
                Prepared { index, fabric, of }
            })
            .collect();
        Self { scene, fabrics }
    }

    /// As [`Self::new`], refused if all would take more memory than `limit` with what is taken `beside`, bytes.
    pub(super) fn checked(
        scene: &'a Scene,
        curves: impl IntoIterator<Item = Given<'a>>,
        limit: Option<u64>,
        beside: u64,
    ) -> Result<Self, BuildError> {
        let preparation = Self::new(scene, curves);
        let needed: Estimate = preparation.estimates().sum();
        match limit {
            Some(limit) if needed.bytes() + beside > limit => Err(BuildError::Memory { needed, beside, limit }),
            _ => Ok(preparation),
        }
    }

    /// What each fabric will take.
    pub(super) fn estimates(&self) -> impl Iterator<Item = Estimate> {
        self.fabrics.iter().map(|prepared| {
            let mut estimate = Estimate::default();
            let compact = self.scene.render.compact_bvh;
            let colored = !prepared.fabric.variants.is_empty();
            match &prepared.of {
                Of::Fibers { curves, .. } => {
                    let points: u64 = curves.iter().map(|(c, _)| c.points.len() as u64).sum();
                    estimate.add(points, points, false, compact);
                }
                Of::Yarns { yarn, shape, strands } => {
                    estimate.tight_bends = strands.tight_bends().len();
                    let plies = Plies::new(strands, &yarn.plies, shape, prepared.fabric.seed);
                    match self.scene.render.mode {
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
                    if let Some(flyaways) = &yarn.flyaways {
                        let (points, segments) = plies.flyaway_counts(flyaways);
                        estimate.add(points, segments, false, compact);
                    }
                }
            }
            if colored {
                estimate.geometry_bytes += estimate.segments * MATERIAL_INDEX_BYTES;
            }
            estimate
        })
    }

    /// The curves for Embree, one entry for each geometry.
    pub(super) fn geometries(self) -> Vec<CurveGeometry> {
        let (mode, model) = (self.scene.render.mode, self.scene.render.model);
        let mut all = Vec::new();
        for prepared in self.fabrics {
            let index = prepared.index;
            match prepared.of {
                Of::Fibers { curves, material } => all.push(CurveGeometry::Fibers(FiberGeometry {
                    fabric: index,
                    ply: 0,
                    first_tubes: Vec::new(),
                    tubes: Tubes::new(&curves),
                    fiber: material,
                    variants: Vec::new(),
                    material_indices: Vec::new(),
                    uvs: SegmentUvs::default(),
                })),
                Of::Yarns { yarn, shape, strands } => {
                    let kinds = &prepared.fabric.variants;
                    let plies = Plies::new(&strands, &yarn.plies, &shape, prepared.fabric.seed);
                    let fibers = |ply: usize, tubes, first_tubes, material_indices, uvs| {
                        let fiber = |of: &Yarn| FiberBcsdf::new(&of.fibers[ply].1);
                        let (fiber, variants) = (fiber(yarn), kinds.iter().map(fiber).collect());
                        CurveGeometry::Fibers(FiberGeometry {
                            fabric: index,
                            ply,
                            first_tubes,
                            tubes,
                            fiber,
                            variants,
                            material_indices,
                            uvs,
                        })
                    };
                    let slots = 0..yarn.plies.len();
                    match mode {
                        Mode::Yarn => {}
                        Mode::Ply => all.extend(slots.clone().map(|ply| {
                            let (mut strands, alone) = ply_strands(&plies, &yarn.plies[ply], &shape, ply);
                            let shape = match model {
                                Model::Aggregated => alone.packed(&yarn.packings()[ply..=ply]),
                                _ => alone,
                            };
                            strands.set_material_indices(plies.material_indices_along(1));
                            strands.set_uvs(plies.uvs_along(1));
                            let scatterer = |of: &Yarn| yarn_scatterer(shape.clone(), &[&of.fibers[ply].1], model);
                            let (yarn, variants) = (scatterer(yarn), kinds.iter().map(scatterer).collect());
                            CurveGeometry::Yarns(YarnGeometry {
                                fabric: index,
                                first_ply: ply,
                                strands,
                                yarn,
                                variants,
                            })
                        })),
                        Mode::Fiber => all.extend(slots.clone().map(|ply| {
                            let (tubes, first) = plies.fibers(ply, yarn.placement);
                            let count = yarn.plies[ply].fibers as usize;
                            fibers(ply, tubes, first, plies.material_indices_along(count), plies.uvs_along(count))
                        })),
                    }
                    if let Some(flyaways) = &yarn.flyaways {
                        all.extend(slots.map(|ply| {
                            let (tubes, first, from) = plies.flyaways(ply, flyaways);
                            let index = |segment| strands.material_index(from[tubes.tube_of(segment)]);
                            let material_indices = (0..tubes.segments().len() as u32).filter_map(index).collect();
                            // A hair has the coordinates of the place where it leaves the yarn.
                            let own = strands.uvs();
                            let segments = if own.is_empty() { 0 } else { tubes.segments().len() as u32 };
                            let uv = |segment| own.at(from[tubes.tube_of(segment)], 0.0);
                            let uvs = SegmentUvs::constant((0..segments).map(uv));
                            fibers(ply, tubes, first, material_indices, uvs)
                        }));
                    }
                    if mode == Mode::Yarn {
                        let flattening = strands.mean_flattening();
                        let pressed = |of: &Yarn| shape_for(of, model).pressed(flattening);
                        let shape = pressed(yarn);
                        let scatterer = |of: &Yarn| {
                            let alike = of.plies == yarn.plies && of.placement == yarn.placement;
                            scatterer_in(if alike { shape.clone() } else { pressed(of) }, of, model)
                        };
                        let (yarn, variants) = (scatterer(yarn), kinds.iter().map(scatterer).collect());
                        all.push(CurveGeometry::Yarns(YarnGeometry {
                            fabric: index,
                            first_ply: 0,
                            strands,
                            yarn,
                            variants,
                        }));
                    }
                }
            }
        }
        // A yarn too short to hold a hair leaves nothing for Embree.
        all.retain(|geometry| geometry.count() > 0);
        all
    }
}

fn strands(fabric: &Fabric, curves: Given<'_>, shape: &YarnShape) -> Strands {
    Strands::with(
        curves,
        Along { material_indices: &fabric.material_indices, uvs: &fabric.uvs },
        StrandMotion { later: &fabric.motion.later, rest: fabric.motion.rest.as_deref(), flow: &fabric.motion.flow },
        &StrandOptions {
            basis: fabric.basis,
            tolerance: fabric.tolerance,
            longest_segment: fabric.longest_segment,
            ply_rate: f64::from(shape.ply_rate),
            symmetry: shape.symmetry,
            phases: fabric.phases.clone(),
        },
    )
}

/// One ply of all yarns as yarns of their own, and the section of such a yarn: one ply that fills it.
fn ply_strands(plies: &Plies<'_>, ply: &PlyParameters, of: &YarnShape, slot: usize) -> (Strands, YarnShape) {
    let strands = Strands::new(
        plies.ply_curves(slot),
        &StrandOptions {
            basis: Basis::BSpline,
            tolerance: 0.0,
            longest_segment: f64::INFINITY,
            ply_rate: 0.0,
            symmetry: TAU,
            phases: vec![0.0],
        },
    );
    let (wp, wf) = (f64::from(of.ply_rate), f64::from(of.plies[slot].fiber_rate));
    // A ply at angle alpha is longer than its yarn by 1 / cos(alpha), and its rotation-minimising frame turns with the
    // helix: the axis to the yarn turns by cos^2(alpha) of what it turns in the yarn's frame.
    let cos = 1.0 / (wp * ply.distance).hypot(1.0);
    let wide = plies.mean_width(&strands);
    let fiber_twist = (((wf - wp) * cos + wp * cos * cos) * wide).atan();
    let alone = PlyParameters {
        radius: 1.0,
        aspect: 1.0,
        distance: 0.0,
        angle: 0.0,
        fibers: ply.fibers,
        fiber_radius: ply.fiber_radius / wide,
        fiber_twist,
    };
    let shape = YarnShape::new(&[alone], 0.0, of.tilted).pressed(strands.mean_flattening());
    (strands, shape)
}
