//! Rays against cloth and meshes: curves and triangles in Embree, the filters that let rays through gaps, and what a hit is.
//!
//! Nothing here knows light: yarns have a shape and a transparency, segments a material index, and
//! [`crate::cloth`] says what scatters there.
//!
//! Both filters are pure functions of ray and hit (and of the hits they have seen, by which repeats are told, and which yarn
//! has the nearer ply), and allocate nothing. Embree as built by Debian does not cull the back faces of curves. Where a ray
//! leaves a yarn is no hit of its own: a ray that was scattered within must leave. But it tells of a yarn whose tube the ray
//! started in while its plies are still ahead. Tubes are round and yarns may be pressed flat, so that they overlap where
//! yarns touch: light that leaves one of them mostly starts within the other's tube ([`crate::geometry::ray::DoneWith`]).

mod filter;
mod mesh;
mod variants;

use std::sync::Arc;

use glam::{DVec3, Vec3A, Vec4};

pub use crate::ffi::embree::EmbreeError;
use crate::{
    ffi::{
        embree::{BvhLayout, CommittedScene, CurveBasis, Device, RawHit, RawRay, SceneBuilder},
        heap,
    },
    geometry::{
        curve::Basis,
        material_indices::MaterialIndices,
        occluder::Occluder,
        ray::{Ray, YarnPlace},
        section::{Crossings, Section},
        segment_uvs::SegmentUvs,
        strand::{Folds, Strands, TightBend},
        tube::{TubePlace, Tubes},
        walk::Walker,
    },
};
use filter::{Counting, GapFilter, ShadowFilter};
pub use mesh::{SurfacePlace, TriangleMesh};
pub use variants::PerVariant;

/// Curves of one kind of yarn with all that rays need.
#[derive(Debug)]
pub struct YarnGeometry {
    /// The fabric of the scene that it belongs to.
    pub fabric: usize,
    /// Which ply of the scene's yarn is the first one of `occluders`: not 0 where each ply is a curve of its own.
    pub first_ply: usize,
    /// Control points, frames and phases.
    pub strands: Strands,
    /// Cross-section and transparency; variants are mostly of other colours only, and the same here.
    pub occluders: PerVariant<Occluder>,
}

/// Explicit fibres.
#[derive(Debug)]
pub struct FiberGeometry {
    /// The fabric of the scene that they belong to.
    pub fabric: usize,
    /// The ply of the scene's yarn that they belong to.
    pub ply: usize,
    /// The first fibre of each yarn; none where fibres are no part of a yarn.
    pub first_tubes: Vec<u32>,
    /// The fibres.
    pub tubes: Tubes,
    /// Material indices: which of the fabric's variants each segment is made of; empty without variants.
    pub material_indices: MaterialIndices,
    /// Texture coordinates along all segments.
    pub uvs: SegmentUvs,
}

/// What one geometry of Embree stands for.
#[derive(Debug)]
#[allow(clippy::large_enum_variant, reason = "there are few of them, and rays look at them all the time")]
pub enum CurveGeometry {
    /// Yarns, or plies, each as a yarn of one ply; their fibres are no curves.
    Yarns(YarnGeometry),
    /// Fibres.
    Fibers(FiberGeometry),
}

/// The scene's cloth, ready for rays.
#[derive(Debug)]
pub struct World {
    scene: CommittedScene,
    device: Arc<Device>,
    geometries: Vec<CurveGeometry>,
    /// Their geometries in Embree come after those of the cloth.
    meshes: Vec<TriangleMesh>,
}

/// A place where a ray meets cloth and does not slip between plies, or meets a mesh.
#[derive(Clone, Copy, Debug)]
pub struct Hit<'a> {
    /// Distance along the ray to the tube or triangle.
    pub t: f32,
    /// Distance to what is met there: in a yarn, about to its first ply.
    pub distance: f32,
    /// Index into [`World::geometries`]; no index of it where a mesh was met.
    pub geometry: usize,
    /// Segment or triangle within it.
    pub segment: u32,
    /// How far along that segment, 0 to 1.
    pub u: f32,
    /// Outward unit normal of the yarn, fibre or triangle.
    pub normal: Vec3A,
    /// What was met.
    pub place: HitPlace<'a>,
}

impl Hit<'_> {
    /// The place of the yarn that was met.
    #[inline]
    pub fn yarn_place(&self) -> YarnPlace {
        YarnPlace { geometry: self.geometry as u32, segment: self.segment }
    }
}

/// What a ray met.
#[derive(Clone, Copy, Debug)]
pub enum HitPlace<'a> {
    /// A yarn: its cross-section as this ray sees it.
    Yarn(Section<'a>),
    /// A fibre.
    Fiber(TubePlace),
    /// A mesh.
    Surface(SurfacePlace),
}

impl World {
    /// Builds Embree's BVH of curves and meshes with `threads` threads: the compact one, or one up to 10 % faster.
    ///
    /// # Errors
    /// What Embree says, mostly that memory is short.
    pub fn new(
        cloth: Vec<CurveGeometry>,
        meshes: Vec<TriangleMesh>,
        compact_bvh: bool,
        threads: usize,
    ) -> Result<Self, EmbreeError> {
        // What curves were made of.
        heap::give_back();
        let device = Device::new(threads)?;
        let layout = if compact_bvh { BvhLayout::Compact } else { BvhLayout::Fast };
        let mut builder = SceneBuilder::new(&device, layout)?;
        for geometry in &cloth {
            let (basis, _, segments) = geometry.curves();
            let basis = match basis {
                Basis::BSpline => CurveBasis::BSpline,
                Basis::CatmullRom | Basis::Linear => CurveBasis::CatmullRom,
            };
            builder.add_round_curves(basis, geometry.points_in_time(), Arc::clone(segments))?;
        }
        for mesh in &meshes {
            builder.add_triangles(Arc::clone(&mesh.points), Arc::clone(&mesh.triangles))?;
        }
        Ok(Self { scene: builder.commit()?, device, geometries: cloth, meshes })
    }

    /// The cloth, one entry for each geometry of Embree.
    pub fn geometries(&self) -> &[CurveGeometry] {
        &self.geometries
    }

    /// The cloth of one fabric of the scene.
    pub fn of_fabric(&self, fabric: usize) -> impl Iterator<Item = &CurveGeometry> {
        self.geometries.iter().filter(move |geometry| geometry.fabric() == fabric)
    }

    /// Bytes of control points, indices and what is kept for each point, of cloth and meshes.
    pub fn geometry_bytes(&self) -> u64 {
        let meshes: u64 = self.meshes.iter().map(TriangleMesh::bytes).sum();
        meshes + self.geometries.iter().map(CurveGeometry::bytes).sum::<u64>()
    }

    /// Bytes that Embree reports for its BVH.
    pub fn bvh_bytes(&self) -> u64 {
        self.device.memory().bytes()
    }

    /// Embree's version.
    pub fn embree_version(&self) -> String {
        self.device.version()
    }

    /// The nearest cloth or mesh on a ray. A ray that is not finite meets nothing.
    #[inline]
    pub fn intersect<'a>(&'a self, ray: &Ray) -> Option<Hit<'a>> {
        if !ray.is_finite() {
            return None;
        }
        let mut filter = GapFilter::new(&self.geometries, ray);
        let raw = self.scene.intersect(&raw_ray(ray), &mut filter)?;
        Some(self.hit(ray, &raw, &filter))
    }

    #[inline]
    fn hit<'a>(&'a self, ray: &Ray, raw: &RawHit, filter: &GapFilter<'a, '_>) -> Hit<'a> {
        let geometry = raw.geometry as usize;
        let mut raw = *raw;
        let place = match self.geometries.get(geometry) {
            Some(CurveGeometry::Yarns(yarns)) => {
                let met = filter.met(yarns, &raw);
                raw = met.hit;
                HitPlace::Yarn(met.section)
            }
            Some(CurveGeometry::Fibers(fibers)) => HitPlace::Fiber(fibers.tubes.place(raw.segment, raw.u)),
            None => {
                let index = geometry - self.geometries.len();
                HitPlace::Surface(self.meshes[index].place(index, ray, &raw))
            }
        };
        let normal = raw.normal.normalize_or(-ray.direction);
        Hit { t: raw.t, distance: filter.nearest(), geometry, segment: raw.segment, u: raw.u, normal, place }
    }

    /// The nearest hit and the transmittance of a ray, and how many hits Embree offered to the filter of each: what a ray
    /// costs beyond its traversal.
    pub fn probe<'a>(&'a self, ray: &Ray, crossings: &mut Crossings) -> (Option<Hit<'a>>, f32, [u32; 2]) {
        if !ray.is_finite() {
            return (None, 0.0, [0; 2]);
        }
        let mut nearest = Counting { filter: GapFilter::new(&self.geometries, ray), calls: 0 };
        let raw = self.scene.intersect(&raw_ray(ray), &mut nearest);
        let hit = raw.map(|raw| self.hit(ray, &raw, &nearest.filter));
        let mut shadow = Counting { filter: ShadowFilter::new(&self.geometries, ray, crossings), calls: 0 };
        let passed = if self.scene.occluded(&raw_ray(ray), &mut shadow) { 0.0 } else { shadow.filter.passed() };
        (hit, passed, [nearest.calls, shadow.calls])
    }

    /// The share of light that comes through along a ray: 0 or the product of what each yarn lets pass.
    #[inline]
    pub fn transmittance(&self, ray: &Ray, crossings: &mut Crossings) -> f32 {
        if !ray.is_finite() {
            return 0.0;
        }
        let mut filter = ShadowFilter::new(&self.geometries, ray, crossings);
        if self.scene.occluded(&raw_ray(ray), &mut filter) { 0.0 } else { filter.passed() }
    }

    /// The tightest place of each yarn of a fabric that bends more tightly than its radius allows, and where it is in the
    /// scene's own space, millimetres.
    pub fn tight_bends(&self, fabric: usize) -> Vec<(&TightBend, DVec3)> {
        let strands = self.geometries.iter().filter_map(|geometry| match geometry {
            CurveGeometry::Yarns(yarns) if yarns.fabric == fabric => Some(&yarns.strands),
            _ => None,
        });
        strands.flat_map(|of| of.tight_bends().iter().map(move |bend| (bend, of.place_of(bend)))).collect()
    }

    /// What is known of the bends of a fabric that are too tight, if there are any.
    pub fn folds(&self, fabric: usize) -> Option<Folds> {
        self.geometries.iter().find_map(|geometry| match geometry {
            CurveGeometry::Yarns(yarns) if yarns.fabric == fabric => yarns.strands.folds(),
            _ => None,
        })
    }
}

/// The ray as Embree takes it.
#[inline]
fn raw_ray(ray: &Ray) -> RawRay {
    let &Ray { origin, direction, t_near, t_far, time, .. } = ray;
    RawRay { origin, direction, t_near, t_far, time }
}

/// The section at a candidate hit: what filter and shading both look at.
#[inline]
fn section_at<'a>(yarns: &'a YarnGeometry, ray: &Ray, raw: &RawHit) -> Section<'a> {
    let walker = Walker::new(&yarns.strands, raw.segment, raw.u, ray.time);
    let section = Section::at_hit(walker, ray.origin, ray.direction, raw.t, yarns.occluders.own().shape().tilted);
    Section { looked_at: ray.looks, ..section }
}

impl FiberGeometry {
    /// Material index of a segment: which of the fabric's variants it is made of, if there are any.
    #[inline]
    pub fn material_index(&self, segment: u32) -> Option<u16> {
        self.material_indices.of(segment)
    }

    /// The material index at `u` (0 to 1) of a segment: see [`MaterialIndices::at`].
    #[inline]
    pub fn material_index_at(&self, segment: u32, u: f32) -> Option<u16> {
        let same = |next: &u32| self.tubes.tube_of(*next) == self.tubes.tube_of(segment);
        let next = |forward: bool| if forward { segment.checked_add(1) } else { segment.checked_sub(1) };
        let known = |next: &u32| (*next as usize) < self.material_indices.len();
        self.material_indices.at(segment, u, |forward| next(forward).filter(known).filter(same))
    }

    /// The yarn that a segment's fibre belongs to, or the fibre itself where there are no yarns.
    pub fn yarn_of(&self, segment: u32) -> usize {
        let tube = self.tubes.tube_of(segment);
        if self.first_tubes.is_empty() { tube } else { self.first_tubes.partition_point(|&f| f as usize <= tube) - 1 }
    }
}

impl CurveGeometry {
    /// The fabric of the scene that they belong to.
    pub fn fabric(&self) -> usize {
        match self {
            Self::Yarns(w) => w.fabric,
            Self::Fibers(f) => f.fabric,
        }
    }

    /// Basis, control points with radii, and the first of the four points of each segment.
    pub fn curves(&self) -> (Basis, &Arc<Vec<Vec4>>, &Arc<Vec<u32>>) {
        match self {
            Self::Yarns(w) => (w.strands.basis(), w.strands.points(), w.strands.segments()),
            Self::Fibers(f) => (f.tubes.basis(), f.tubes.points(), f.tubes.segments()),
        }
    }

    /// Control points at all times: once for what stands still.
    fn points_in_time(&self) -> Vec<Arc<Vec<Vec4>>> {
        match self {
            Self::Yarns(w) => w.strands.points_in_time(),
            Self::Fibers(f) => vec![Arc::clone(f.tubes.points())],
        }
    }

    /// Number of yarns or fibres.
    pub fn count(&self) -> usize {
        match self {
            Self::Yarns(w) => w.strands.yarns(),
            Self::Fibers(f) => f.tubes.count(),
        }
    }

    fn bytes(&self) -> u64 {
        match self {
            Self::Yarns(w) => w.strands.bytes(),
            Self::Fibers(f) => f.tubes.bytes() + f.material_indices.bytes() + f.uvs.bytes() as u64,
        }
    }
}

impl YarnGeometry {
    /// The yarn that a segment is of.
    #[inline]
    pub fn occluder_at(&self, segment: u32) -> &Occluder {
        if self.occluders.variants().is_empty() {
            return self.occluders.own();
        }
        self.occluders.at(self.strands.material_index(segment))
    }
}
