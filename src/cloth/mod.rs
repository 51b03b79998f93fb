//! A scene's cloth made ready for light: curves by the scene's mode, scatterers by its model, and the one place that
//! joins a hit of [`trace`](crate::trace) to what scatters there.

mod curves;
mod estimate;
mod material;
mod outgoing;

use std::{
    borrow::Cow,
    time::{Duration, Instant},
};

use crate::{
    geometry::{section::Section, strand::Folds, tube::TubePlace},
    scattering::{fiber::FiberBcsdf, yarn::YarnScatterer},
    scene::Scene,
    trace::{CurveGeometry, FiberGeometry, Hit, HitPlace, SurfacePlace, TriangleMesh, World, YarnGeometry},
};
use curves::{Given, Piece, Preparation};
pub use estimate::{BuildError, Estimate};
pub use material::{Scatterers, pressed_scatterer, scatterer};
pub use outgoing::curves;

/// The cloth and meshes of a scene, ready for rays, with what their light needs.
#[derive(Debug)]
pub struct Cloth {
    world: World,
    /// One entry for each of the world's geometries.
    scatterers: Vec<Scatterers>,
}

/// What making [`Cloth`] took.
#[derive(Clone, Copy, Debug, Default)]
pub struct BuildTimes {
    /// Resampling, frames and phases.
    pub generate: Duration,
    /// Embree's BVH.
    pub build: Duration,
}

/// What a ray met, and how it scatters.
#[derive(Clone, Copy, Debug)]
pub enum Met<'a> {
    /// A yarn, or a ply as a yarn of its own.
    Yarn {
        /// Its cross-section as the ray sees it.
        section: &'a Section<'a>,
        /// The yarns that it is one of.
        yarns: &'a YarnGeometry,
        /// Its model.
        scatterer: &'a YarnScatterer,
    },
    /// A fibre.
    Fiber {
        /// The place on it.
        place: &'a TubePlace,
        /// The fibres that it is one of.
        fibers: &'a FiberGeometry,
        /// How it scatters.
        scatterer: &'a FiberBcsdf,
    },
    /// A mesh, whose material the scene holds.
    Surface(&'a SurfacePlace),
}

impl Cloth {
    /// Prepares the scene's curves and builds Embree's BVH with `threads` threads.
    ///
    /// # Errors
    /// What Embree says, mostly that memory is short; or that the scene would take more than it may.
    pub fn new(scene: &Scene, threads: usize) -> Result<(Self, BuildTimes), BuildError> {
        Self::with_curves(scene, borrowed(scene), threads, scene.render.max_memory, 0)
    }

    /// As [`Self::new`], within a `limit` of bytes of which some are taken `beside`: by a film, by textures. Frees the
    /// scene's curves on the way: it has none afterwards.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn consuming(
        scene: &mut Scene,
        threads: usize,
        limit: Option<u64>,
        beside: u64,
    ) -> Result<(Self, BuildTimes), BuildError> {
        let curves = scene.fabrics.iter_mut().map(|fabric| Cow::Owned(fabric.take_curves())).collect();
        Self::with_curves(scene, curves, threads, limit, beside)
    }

    fn with_curves(
        scene: &Scene,
        curves: Vec<Given<'_>>,
        threads: usize,
        limit: Option<u64>,
        beside: u64,
    ) -> Result<(Self, BuildTimes), BuildError> {
        let started = Instant::now();
        let pieces = Preparation::checked(scene, curves, limit, beside)?.pieces();
        let (geometries, scatterers) =
            pieces.into_iter().map(|Piece { curves, scatterers }| (curves, scatterers)).unzip();
        let meshes =
            scene.objects.iter().map(|object| TriangleMesh::new(&object.mesh, &object.next, object.material)).collect();
        let generate = started.elapsed();
        let started = Instant::now();
        let world = World::new(geometries, meshes, scene.render.compact_bvh, threads)?;
        Ok((Self { world, scatterers }, BuildTimes { generate, build: started.elapsed() }))
    }

    /// What rays meet.
    #[inline]
    pub fn world(&self) -> &World {
        &self.world
    }

    /// What rays meet, without how it scatters.
    pub fn into_world(self) -> World {
        self.world
    }

    /// What scatters at a hit of a ray with [`Self::world`].
    ///
    /// # Panics
    /// If the hit is of another world.
    #[inline]
    pub fn at<'a>(&'a self, hit: &'a Hit<'a>) -> Met<'a> {
        if let HitPlace::Surface(place) = &hit.place {
            return Met::Surface(place);
        }
        let index = hit.geometry;
        match (&hit.place, &self.world.geometries()[index], &self.scatterers[index]) {
            (HitPlace::Yarn(section), CurveGeometry::Yarns(yarns), Scatterers::Yarns(all)) => {
                Met::Yarn { section, yarns, scatterer: all.at(yarns.strands.material_index_at(hit.segment, hit.u)) }
            }
            (HitPlace::Fiber(place), CurveGeometry::Fibers(fibers), Scatterers::Fibers(all)) => {
                Met::Fiber { place, fibers, scatterer: all.at(fibers.material_index_at(hit.segment, hit.u)) }
            }
            _ => unreachable!("a hit is of the kind of what it hit"),
        }
    }
}

fn borrowed(scene: &Scene) -> Vec<Given<'_>> {
    scene.fabrics.iter().map(|fabric| Cow::Borrowed(&*fabric.curves)).collect()
}

/// What the curves of each fabric will take, without making them.
pub fn estimates(scene: &Scene) -> Vec<Estimate> {
    surveyed(scene).into_iter().map(|(estimate, _)| estimate).collect()
}

/// The same, with where the yarns of each fabric fold into themselves, if they do.
pub(crate) fn surveyed(scene: &Scene) -> Vec<(Estimate, Option<Folds>)> {
    curves::estimates(scene)
}

#[cfg(test)]
mod tests;
