use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    sync::Arc,
};

use glam::{Vec3A, Vec4};

use super::*;

fn straight_yarn(device: &Arc<Device>) -> CommittedScene {
    let points: Arc<Vec<Vec4>> = Arc::new((0..8).map(|i| Vec4::new(i as f32, 0.0, 0.0, 0.25)).collect());
    let segments: Arc<Vec<u32>> = Arc::new((0..5).collect());
    let mut builder = SceneBuilder::new(device, BvhLayout::Compact).unwrap();
    builder.add_round_curves(CurveBasis::CatmullRom, vec![points], segments).unwrap();
    builder.commit().unwrap()
}

#[test]
fn a_ray_meets_a_moving_curve_where_it_is_at_its_time() {
    let device = Device::new(1).unwrap();
    let at = |y: f32| -> Arc<Vec<Vec4>> { Arc::new((0..8).map(|i| Vec4::new(i as f32, y, 0.0, 0.25)).collect()) };
    let mut builder = SceneBuilder::new(&device, BvhLayout::Compact).unwrap();
    // Up by two, then back by one.
    let segments: Arc<Vec<u32>> = Arc::new((0..5).collect());
    builder.add_round_curves(CurveBasis::CatmullRom, vec![at(0.0), at(2.0), at(1.0)], segments).unwrap();
    let scene = builder.commit().unwrap();
    let mut filter = Counting { guard: 0, calls: 0, accept: true };
    for (time, y) in [(0.0, 0.0), (0.25, 1.0), (0.5, 2.0), (0.75, 1.5), (1.0, 1.0)] {
        let ray = RawRay { time, ..endless(Vec3A::new(3.2, 5.0, 0.0), Vec3A::new(0.01, -1.0, 0.002)) };
        let hit = scene.intersect(&ray, &mut filter).unwrap();
        assert!((hit.t - (4.75 - y)).abs() < 2e-3, "at {time}: {}", hit.t);
    }
}

fn endless(origin: Vec3A, direction: Vec3A) -> RawRay {
    RawRay { origin, direction, t_near: 0.0, t_far: f32::INFINITY, time: 0.0 }
}

/// Embree takes at most 129 times: what it refuses must be neither freed under it nor in the way of what follows.
#[test]
fn a_refused_geometry_keeps_its_buffers_and_harms_nothing() {
    let device = Device::new(1).unwrap();
    let points: Arc<Vec<Vec4>> = Arc::new((0..8).map(|i| Vec4::new(i as f32, 0.0, 0.0, 0.25)).collect());
    let segments: Arc<Vec<u32>> = Arc::new((0..5).collect());
    let mut builder = SceneBuilder::new(&device, BvhLayout::Compact).unwrap();
    let too_many = vec![Arc::clone(&points); 200];
    let error = builder.add_round_curves(CurveBasis::CatmullRom, too_many, Arc::clone(&segments)).unwrap_err();
    assert_eq!(error.during, "adding curves");
    assert_eq!(Arc::strong_count(&points), 201, "the buffers are kept");
    assert_eq!(builder.add_round_curves(CurveBasis::CatmullRom, vec![points], segments), Ok(1));
    let scene = builder.commit().unwrap();
    let mut filter = Counting { guard: 0, calls: 0, accept: true };
    let hit = scene.intersect(&endless(Vec3A::new(3.2, 1.0, 0.0), Vec3A::NEG_Y), &mut filter).unwrap();
    assert_eq!(hit.geometry, 1);
}

/// Counts hits behind a guard value, where a context that Embree thinks larger would be overwritten.
struct Counting {
    guard: u64,
    calls: u64,
    accept: bool,
}

impl HitFilter for Counting {
    fn accept(&mut self, hit: &RawHit) -> Option<f32> {
        self.calls += 1;
        self.accept.then_some(hit.t)
    }
}

#[test]
fn fields_behind_the_context_survive_a_million_hits() {
    let device = Device::new(1).unwrap();
    let scene = straight_yarn(&device);
    let mut filter = Counting { guard: 0x0123_4567_89ab_cdef, calls: 0, accept: true };
    let mut hits = 0;
    while filter.calls < 1_000_000 {
        let x = 2.0 + (hits % 1000) as f32 * 3e-3;
        let ray = endless(Vec3A::new(x, 1.0, 0.1), Vec3A::new(0.03, -1.0, 0.01));
        assert!(scene.intersect(&ray, &mut filter).is_some(), "ray {hits} misses the yarn");
        hits += 1;
    }
    assert_eq!(filter.guard, 0x0123_4567_89ab_cdef, "Embree wrote behind its context");
}

#[test]
fn a_rejected_hit_lets_the_ray_pass() {
    let device = Device::new(1).unwrap();
    let scene = straight_yarn(&device);
    let ray = endless(Vec3A::new(3.2, 1.0, 0.0), Vec3A::new(0.01, -1.0, 0.02));
    let mut reject = Counting { guard: 0, calls: 0, accept: false };
    assert!(scene.intersect(&ray, &mut reject).is_none());
    assert!(reject.calls >= 2, "entry and exit are both offered");
    assert!(!scene.occluded(&ray, &mut reject));
    let mut accept = Counting { guard: 0, calls: 0, accept: true };
    let hit = scene.intersect(&ray, &mut accept).unwrap();
    assert!((hit.t - 0.75).abs() < 1e-3, "hit at {}", hit.t);
    assert!(hit.normal.y > 0.0, "the normal points outward");
    assert!(scene.occluded(&ray, &mut accept));
}

/// A hit of the geometry 0 stands farther away than it is.
struct Deferring(f32);

impl HitFilter for Deferring {
    fn accept(&mut self, hit: &RawHit) -> Option<f32> {
        Some(hit.t + if hit.geometry == 0 { self.0 } else { 0.0 })
    }
}

#[test]
fn a_hit_that_stands_farther_away_leaves_room_for_nearer_ones() {
    let device = Device::new(1).unwrap();
    let mut builder = SceneBuilder::new(&device, BvhLayout::Compact).unwrap();
    for z in [0.0, -1.0, -2.0] {
        let points: Arc<[Vec3A]> = [Vec3A::ZERO, Vec3A::X, Vec3A::Y].map(|p| p + z * Vec3A::Z).into();
        builder.add_triangles(points, [[0, 1, 2]].into()).unwrap();
    }
    let scene = builder.commit().unwrap();
    let ray = endless(Vec3A::new(0.25, 0.5, 5.0), Vec3A::NEG_Z);
    for (by, geometry, t) in [(0.0, 0, 5.0), (0.5, 0, 5.5), (1.5, 1, 6.0)] {
        let hit = scene.intersect(&ray, &mut Deferring(by)).unwrap();
        assert!(hit.geometry == geometry && (hit.t - t).abs() < 1e-5, "by {by}: {hit:?}");
    }
    // No farther than the ray goes.
    let short = RawRay { t_far: 5.2, ..ray };
    let hit = scene.intersect(&short, &mut Deferring(0.5)).unwrap();
    assert!(hit.geometry == 0 && hit.t == 5.2, "{hit:?}");
}

#[test]
fn triangles_are_met_from_both_sides() {
    let device = Device::new(1).unwrap();
    let points: Arc<[Vec3A]> = [Vec3A::ZERO, Vec3A::X, Vec3A::Y].into();
    let mut builder = SceneBuilder::new(&device, BvhLayout::Compact).unwrap();
    assert_eq!(builder.add_triangles(points, [[0, 1, 2]].into()), Ok(0));
    let scene = builder.commit().unwrap();
    let mut filter = Counting { guard: 0, calls: 0, accept: true };
    for (from, towards) in [(5.0, Vec3A::NEG_Z), (-5.0, Vec3A::Z)] {
        let hit = scene.intersect(&endless(Vec3A::new(0.25, 0.5, from), towards), &mut filter).unwrap();
        assert!((hit.t - 5.0).abs() < 1e-5 && (hit.u - 0.25).abs() < 1e-5 && (hit.v - 0.5).abs() < 1e-5);
        assert!(hit.normal.z > 0.0, "counter-clockwise is outside");
    }
    assert_eq!(filter.calls, 2);
    assert!(scene.intersect(&endless(Vec3A::new(0.7, 0.7, 5.0), Vec3A::NEG_Z), &mut filter).is_none());
}

#[test]
fn a_panic_in_a_filter_comes_back_to_rust() {
    struct Panicking;
    impl HitFilter for Panicking {
        fn accept(&mut self, _: &RawHit) -> Option<f32> {
            panic!("parked")
        }
    }
    let device = Device::new(1).unwrap();
    let scene = straight_yarn(&device);
    let ray = endless(Vec3A::new(3.2, 1.0, 0.0), Vec3A::new(0.01, -1.0, 0.02));
    let caught = catch_unwind(AssertUnwindSafe(|| scene.intersect(&ray, &mut Panicking)));
    assert_eq!(caught.unwrap_err().downcast_ref::<&str>(), Some(&"parked"));
}

#[test]
fn memory_is_counted_and_given_back() {
    let device = Device::new(1).unwrap();
    let before = device.memory().bytes();
    let scene = straight_yarn(&device);
    assert!(device.memory().bytes() > before);
    drop(scene);
    assert!(device.memory().bytes() <= before, "{} > {before}", device.memory().bytes());
    assert!(device.version().starts_with("4."));
}
