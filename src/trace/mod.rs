//! Rays against the cloth: curves in Embree, the filters that let rays through gaps, and what a hit is.
//!
//! Both filters are pure functions of ray and hit (the shadow filter also of the hits it has seen, by which repeats
//! are told), allocate nothing and may be called in any order. Exit hits never count: Embree as built by Debian does
//! not cull the back faces of curves, and a ray born inside a yarn must leave it.

mod filter;

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use glam::Vec3A;

use crate::{
    ffi::embree::{BvhLayout, CommittedScene, CurveBasis, Device, EmbreeError, RawHit, Ray, SceneBuilder},
    geometry::{
        curve::Basis,
        section::{Crossings, Section},
        strand::{StrandOptions, Strands, TightBend},
    },
    scattering::{
        aggregated::AggregatedYarn,
        lobes::{ChordModel, ChordYarn},
        yarn::YarnScatterer,
    },
    scene::{Fabric, Model, Scene, Yarn},
};
use filter::{GapFilter, ShadowFilter};

/// Curves of one kind of yarn with all that its rays need.
#[derive(Debug)]
pub struct Weave {
    /// Control points, frames and phases.
    pub strands: Strands,
    /// Cross-section and scattering.
    pub yarn: YarnScatterer,
}

/// The scene's cloth, ready for rays.
#[derive(Debug)]
pub struct World {
    scene: CommittedScene,
    device: Arc<Device>,
    weaves: Vec<Weave>,
}

/// What making a [`World`] took.
#[derive(Clone, Copy, Debug, Default)]
pub struct BuildTimes {
    /// Resampling, frames and phases.
    pub generate: Duration,
    /// Embree's BVH.
    pub build: Duration,
}

/// A place where a ray meets cloth and does not slip between plies.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    /// Distance along the ray.
    pub t: f32,
    /// Index of the weave.
    pub weave: usize,
    /// Segment within it.
    pub segment: u32,
    /// Outward unit normal of the yarn.
    pub normal: Vec3A,
    /// The yarn's cross-section as this ray sees it.
    pub section: Section,
}

impl World {
    /// Prepares the scene's curves and builds Embree's BVH with `threads` threads.
    ///
    /// # Errors
    /// What Embree says, mostly that memory is short.
    pub fn new(scene: &Scene, threads: usize) -> Result<(Self, BuildTimes), EmbreeError> {
        let started = Instant::now();
        let weaves: Vec<Weave> = scene
            .fabrics
            .iter()
            .map(|fabric| Weave::new(fabric, &scene.yarns[fabric.yarn], scene.render.model))
            .collect();
        let generate = started.elapsed();
        let started = Instant::now();
        let device = Device::new(threads)?;
        let layout = if scene.render.compact_bvh { BvhLayout::Compact } else { BvhLayout::Fast };
        let mut builder = SceneBuilder::new(&device, layout)?;
        for weave in &weaves {
            let basis = match weave.strands.basis() {
                Basis::BSpline => CurveBasis::BSpline,
                Basis::CatmullRom | Basis::Linear => CurveBasis::CatmullRom,
            };
            builder.add_round_curves(
                basis,
                Arc::clone(weave.strands.points()),
                Arc::clone(weave.strands.segments()),
            )?;
        }
        let committed = builder.commit()?;
        let world = Self { scene: committed, device, weaves };
        Ok((world, BuildTimes { generate, build: started.elapsed() }))
    }

    /// The cloth, one entry for each fabric of the scene.
    pub fn weaves(&self) -> &[Weave] {
        &self.weaves
    }

    /// Bytes of control points, indices and what is kept for each point.
    pub fn geometry_bytes(&self) -> u64 {
        self.weaves.iter().map(|w| w.strands.bytes()).sum()
    }

    /// Bytes that Embree reports for its BVH.
    pub fn bvh_bytes(&self) -> u64 {
        self.device.memory().bytes()
    }

    /// Embree's version.
    pub fn embree_version(&self) -> String {
        self.device.version()
    }

    /// The nearest cloth on a ray. A ray that is not finite meets nothing.
    #[inline]
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        if !ray.is_finite() {
            return None;
        }
        let mut filter = GapFilter::new(&self.weaves, ray);
        let raw = self.scene.intersect(ray, &mut filter)?;
        Some(Hit {
            t: raw.t,
            weave: raw.geometry as usize,
            segment: raw.segment,
            normal: raw.normal.normalize_or(-ray.direction),
            section: filter.section(&raw),
        })
    }

    /// The share of light that comes through along a ray: 0 or the product of what each yarn lets pass.
    #[inline]
    pub fn transmittance(&self, ray: &Ray, crossings: &mut Crossings) -> f32 {
        if !ray.is_finite() {
            return 0.0;
        }
        let mut filter = ShadowFilter::new(&self.weaves, ray, crossings);
        if self.scene.occluded(ray, &mut filter) { 0.0 } else { filter.passed() }
    }

    /// Places where a yarn bends more tightly than its radius allows: weave, then the place.
    pub fn tight_bends(&self) -> impl Iterator<Item = (usize, &TightBend)> {
        self.weaves.iter().enumerate().flat_map(|(i, w)| w.strands.tight_bends().iter().map(move |b| (i, b)))
    }
}

/// The cross-section at a candidate hit: what filter and shading both look at.
#[inline]
fn section_at(weave: &Weave, ray: &Ray, raw: &RawHit) -> Section {
    let place = weave.strands.place(raw.segment, raw.u);
    Section::new(&place, ray.origin, ray.direction, weave.yarn.shape().tilted)
}

impl Weave {
    fn new(fabric: &Fabric, yarn: &Yarn, model: Model) -> Self {
        let scatterer = scatterer(yarn, model);
        let shape = scatterer.shape();
        let strands = Strands::new(
            &fabric.curves,
            &StrandOptions {
                basis: fabric.basis,
                tolerance: fabric.tolerance,
                longest_segment: fabric.longest_segment,
                ply_rate: f64::from(shape.ply_rate),
                symmetry: shape.symmetry,
                phases: fabric.phases.clone(),
            },
        );
        Self { strands, yarn: scatterer }
    }
}

/// A yarn with one of the models.
pub fn scatterer(yarn: &Yarn, model: Model) -> YarnScatterer {
    let materials: Vec<_> = yarn.fibers.iter().map(|(_, m)| m).collect();
    let chord = |model| YarnScatterer::Chord(ChordYarn::new(yarn.shape(), &materials, model));
    match model {
        Model::Aggregated => YarnScatterer::Aggregated(AggregatedYarn::new(yarn.shape(), &materials)),
        Model::TwoStream => chord(ChordModel::TwoStream),
        Model::Paper => chord(ChordModel::Paper),
        Model::Printed => chord(ChordModel::Printed),
    }
}
