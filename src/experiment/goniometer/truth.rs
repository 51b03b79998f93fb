//! The truth that models are held against: paths through explicit fibres of one straight yarn.
//!
//! Fibres are placed at random for each of several packings, turned into curves, and traced with Embree. A path
//! scatters at each fibre it meets by that fibre's BCSDF and goes on from where it leaves the fibre (the BCSDF has
//! dealt with the way through). Standard errors are those of the mean over packings, whose spread is most of the error.

use std::f64::consts::TAU;

use glam::{DVec3, Vec3, Vec3A};
use rayon::prelude::*;

use super::{Effort, Measurement, Outcome, Tally, View};
use crate::{
    cloth::BuildError,
    geometry::ray::Ray,
    geometry::{
        curve::{Basis, Curve},
        fiber::Plies,
        material_indices::MaterialIndices,
        segment_uvs::SegmentUvs,
        strand::{StrandOptions, Strands},
    },
    math::{
        Rgb,
        sampler::{Stream, hash2},
    },
    scattering::{LobeValues, fiber::FiberBcsdf, lobe::LobeFrame},
    scene::Yarn,
    trace::{CurveGeometry, FiberGeometry, HitPlace, World},
};

/// Packings that a truth is averaged over.
const PACKINGS: u64 = 24;
/// Half the length of the yarn, in its radii: light that gets as far has left.
const HALF_LENGTH: f64 = 80.0;
/// Rays meet the yarn within this distance of its middle.
const HALF_START: f64 = 6.0;
/// Parts of a packing's paths, each with its own random numbers: what threads share.
const CHUNKS: u64 = 32;
/// Scattering events before paths may end by chance.
const ROULETTE_AFTER: u32 = 16;
/// Most scattering events: a guard only.
const MOST_EVENTS: u32 = 100_000;

/// One packing: fibres in Embree, and the yarn they are wound around.
struct Sample<'a> {
    world: &'a World,
    /// How the fibres of each of its geometries scatter.
    fibers: Vec<FiberBcsdf>,
    strands: &'a Strands,
    view: &'a View,
    seed: u32,
}

/// Measures a yarn of explicit fibres, placed as the yarn says and without fly-aways, with `effort.paths` paths in all, in the calling thread's rayon pool; the same
/// result for any number of threads.
///
/// # Errors
/// What Embree says, mostly that memory is short.
pub fn truth(yarn: &Yarn, view: &View, effort: Effort) -> Result<Measurement, BuildError> {
    let (shape, in_tube) = (yarn.shape(), yarn.plies_in_tube());
    let points = 2 * (HALF_LENGTH / 2.0) as usize;
    let at = |i: usize| DVec3::new(0.0, 0.0, HALF_LENGTH * (2.0 * i as f64 / points as f64 - 1.0));
    let curve = Curve {
        basis: Basis::CatmullRom,
        closed: false,
        points: (0..=points).map(at).collect(),
        radii: None,
        flattening: (view.flatten > 1.0).then(|| vec![Vec3::new(view.flatten.recip() as f32, 0.0, 0.0); points + 1]),
    };
    let radii = vec![1.0; curve.points.len()];
    let options = StrandOptions {
        basis: Basis::CatmullRom,
        tolerance: 0.0,
        longest_segment: 3.0,
        ply_rate: f64::from(shape.ply_rate),
        symmetry: shape.symmetry,
        phases: Vec::new(),
        distances: false,
        unevenness: None,
        tube: 1.0,
    };
    let curves = [(curve, radii)];
    let mut tallies = Vec::new();
    for packing in 0..PACKINGS.min(effort.paths) {
        let seed = hash2(effort.seed ^ 0x7275_7468, packing as u32);
        // A round yarn is looked at from all sides; one that is pressed from one side, at plies that lie anyhow.
        let phase = if view.flatten > 1.0 { TAU * f64::from(Stream::new(seed).next()) } else { 0.0 };
        let strands = Strands::new(&curves, &StrandOptions { phases: vec![phase], ..options.clone() });
        let plies = Plies::new(&strands, &in_tube, &shape, seed);
        let (geometries, fibers) = (0..yarn.plies.len())
            .filter(|&ply| yarn.plies[ply].fibers > 0)
            .map(|ply| {
                let (tubes, first_tubes) = plies.fibers(ply, yarn.placement);
                let curves = FiberGeometry {
                    fabric: 0,
                    ply,
                    first_tubes,
                    tubes,
                    material_indices: MaterialIndices::default(),
                    uvs: SegmentUvs::default(),
                };
                (CurveGeometry::Fibers(curves), FiberBcsdf::new(&yarn.fibers[ply].1))
            })
            .unzip();
        let world = World::new(geometries, Vec::new(), true, rayon::current_num_threads())?;
        let sample = Sample { world: &world, fibers, strands: &strands, view, seed };
        let count = effort.paths / PACKINGS + u64::from(packing < effort.paths % PACKINGS);
        let parts: Vec<Tally> = (0..CHUNKS).into_par_iter().map(|chunk| sample.run(chunk, count)).collect();
        let mut tally = Tally::new();
        parts.iter().for_each(|part| tally.merge(part));
        tallies.push(tally);
    }
    Ok(Tally::measure(&tallies, false))
}

impl Sample<'_> {
    /// The paths of one chunk of all `count` of a packing.
    fn run(&self, chunk: u64, count: u64) -> Tally {
        let mut tally = Tally::new();
        let mine = count / CHUNKS + u64::from(chunk < count % CHUNKS);
        let mut stream = Stream::new(hash2(self.seed, chunk as u32));
        for i in 0..mine {
            // Offsets are stratified: most of the difference between rays is between offsets.
            let across = (i as f32 + stream.next()) / mine as f32;
            tally.add(self.path(across, &mut stream));
        }
        tally
    }

    fn path(&self, across: f32, stream: &mut Stream) -> Outcome {
        let h = self.view.offset.map_or(2.0 * f64::from(across) - 1.0, |h| h);
        let z = HALF_START * (2.0 * f64::from(stream.next()) - 1.0);
        let turn = f64::from(stream.next());
        let azimuth = match self.view.phase {
            // Along the short axis.
            None if self.view.flatten > 1.0 => 0.0,
            None => TAU * turn,
            Some(phase) => self.azimuth_of_plies(z) - phase,
        };
        let (sin, cos) = azimuth.sin_cos();
        let (x, y) = (DVec3::new(cos, sin, 0.0), DVec3::new(-sin, cos, 0.0));
        // A ray exactly across straight fibres costs Embree hundreds of repeated hits.
        let theta = self.view.theta + 1e-6;
        let towards = theta.cos() * x + theta.sin() * DVec3::Z;
        let entry = (1.0 - h * h).max(0.0).sqrt() * x + h * y + z * DVec3::Z;
        let mut ray = Ray::new((entry + towards).as_vec3a(), (-towards).as_vec3a());
        let (mut throughput, mut events) = (Rgb::ONE, 0);
        while let Some(hit) = self.world.intersect(&ray) {
            let HitPlace::Fiber(place) = &hit.place else { break };
            events += 1;
            let frame = LobeFrame::new(place.tangent, -ray.direction);
            let u = [0; 4].map(|_| stream.next());
            let Some(next) = self.fibers[hit.geometry].sample(frame.sin, frame.cos, throughput, u, stream) else {
                return Outcome { unscattered: 0.0, scattered: None };
            };
            throughput *= next.weight;
            if events > ROULETTE_AFTER {
                let keep = throughput.max_channel().clamp(0.0, 1.0);
                if events > MOST_EVENTS || stream.next() >= keep {
                    return Outcome { unscattered: 0.0, scattered: None };
                }
                throughput /= keep;
            }
            let direction = frame.to_world(next.wi);
            ray = Ray::new(place.leave(hit.normal, direction), direction);
        }
        if events == 0 {
            return Outcome { unscattered: 1.0, scattered: None };
        }
        let d = ray.direction.as_dvec3();
        let local = Vec3A::new(d.dot(x) as f32, d.dot(y) as f32, d.z as f32);
        Outcome { unscattered: 0.0, scattered: Some((local, LobeValues { r: throughput, ..LobeValues::default() })) }
    }

    /// Azimuth of the plies' phase at a place along the yarn.
    fn azimuth_of_plies(&self, z: f64) -> f64 {
        let segments = self.strands.segments().len() as f64;
        let along = (z + HALF_LENGTH) / (2.0 * HALF_LENGTH) * segments;
        let segment = along.clamp(0.0, segments - 1.0).floor();
        let place = self.strands.frame(segment as u32, (along - segment) as f32);
        f64::from(place.normal.y.atan2(place.normal.x)) + f64::from(place.phase)
    }
}
