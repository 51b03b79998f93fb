//! From where light leaves the yarn.

use super::{tests::build, *};
use crate::{
    geometry::fiber::{packing::hard_discs, slopes::Twist},
    math::sampler::Stream,
    scattering::testing::{SILK, material, packed_ply, section},
};

#[test]
fn light_that_wandered_leaves_from_the_outline_where_that_faces_its_way() {
    let (yarn, section) = build((1, 40, 0.2, 0.0, -0.33, 0.2, 0.5, 0.4), None, &material(SILK, [0.3, 0.25, 0.5]));
    let mut crossings = Crossings::new();
    section.crossings(yarn.occluder().shape(), &mut crossings);
    let t0 = yarn.occluder().transparency(&crossings);
    let w = Vec3A::new(-0.8, 0.6, 0.0);
    let (mut sum, mut places) = (Vec3A::ZERO, Vec3A::ZERO);
    for seed in 0..400 {
        let mut stream = Stream::new(seed);
        let u = std::array::from_fn(|_| stream.next());
        let vertex = Vertex::new(&yarn, &section, &crossings, t0, Rgb::ONE, u, &mut stream);
        let Some(node) = vertex.node.get(&vertex.view) else { continue };
        let start = vertex.backward.of(&vertex.view, node).start(&vertex.view, &node.spot, w);
        let axis = node.spot.inside.axis_of(yarn.occluder().shape(), 0);
        let out = start - axis;
        assert!((out.truncate().length() - 1.0).abs() < 1e-4 && out.dot(w) > -1e-4, "{out}");
        sum += out;
        places += node.spot.inside.point - axis;
    }
    // The places lie to one side of the axis as seen from there, and so does what leaves.
    let side = Vec3A::new(w.y, -w.x, 0.0);
    assert!(places.dot(side) * sum.dot(side) > 0.0 && sum.dot(side).abs() > 40.0, "{places} {sum}");
}

/// Light leaves from the surface of the fibre that it met, not from its middle: as high on the ply, as the camera sees it, as lines through
/// packings of discs first meet one.
#[test]
fn light_leaves_as_high_as_fibers_are_met() {
    const FIBERS: u32 = 150;
    const DENSITY: f64 = 0.5;
    let fiber = (DENSITY / f64::from(FIBERS)).sqrt();
    let core = 1.0 - fiber;
    let yarn = AggregatedYarn::new(
        packed_ply(FIBERS, DENSITY),
        &[&material(([0.0; 3], [0.0; 3], [0.5; 3]), [0.15, 0.12, 0.35])],
    );
    let packings: Vec<_> =
        (0..100).map(|seed| hard_discs(FIBERS, fiber / core, Twist::NONE, &mut Stream::new(seed))).collect();
    // By three parts of the ply's width.
    for (from, to) in [(0.0, 0.5), (0.5, 0.8), (0.8, 0.97)] {
        let (mut want, mut lines, mut found, mut drawn) = (0.0f64, 0u32, 0.0f64, 0.0f64);
        let mut stream = Stream::new(11);
        for discs in &packings {
            for _ in 0..60 {
                let h = f64::from(from + (to - from) * stream.next());
                let first = discs.iter().filter_map(|disc| {
                    let off = core * disc.y - h;
                    (off.abs() < fiber).then(|| core * disc.x + (fiber * fiber - off * off).sqrt())
                });
                if let Some(first) = first.max_by(f64::total_cmp) {
                    want += first;
                    lines += 1;
                }
                let section = section(0.0, h as f32, 0.0);
                let mut crossings = Crossings::new();
                section.crossings(yarn.occluder().shape(), &mut crossings);
                let t0 = yarn.occluder().transparency(&crossings);
                let u = std::array::from_fn(|_| stream.next());
                let vertex = Vertex::new(&yarn, &section, &crossings, t0, Rgb::ONE, u, &mut stream);
                let Some(node) = vertex.node.get(&vertex.view) else { continue };
                // Sideways, so that how far it got does not count.
                let start = node.spot.leaves_from(&vertex.view, node.way_in.back, Vec3A::Y);
                found += f64::from((1.0 - t0) * start.x);
                drawn += f64::from(1.0 - t0);
            }
        }
        let (want, found) = (want / f64::from(lines), found / drawn);
        assert!((found - want).abs() < 0.2 * fiber, "{from} to {to}: {found} {want}");
    }
}
