//! Stranded colours: which yarn is where, and what floats behind.

use super::*;

/// Colours of a cloth by column and row, with floats of at most `catch` stitches.
fn stranded(color: fn(usize, usize) -> u16, catch: Option<u32>) -> Stranded {
    Stranded { color: Box::new(color), catch, carry: 2 }
}

fn laid_stranded(mesh: &GarmentMesh, options: Options, stranded: Stranded) -> Vec<LaidYarn> {
    let garment = Garment::new(mesh, options).unwrap();
    let yarns = garment.lay(mesh, &[mesh], &[], &[Some(stranded)], &mut Vec::new()).unwrap();
    yarns.into_iter().flatten().flatten().filter(|y| !(y.closed && y.color == 0)).collect()
}

/// Three stitches of the one colour and two of the other, a stitch further in each row.
fn slanting(x: usize, y: usize) -> u16 {
    u16::from((x + y) % 5 > 2)
}

/// Fields of twelve stitches.
fn wide(x: usize, y: usize) -> u16 {
    u16::from((x / 12 + y / 6) % 2 == 1)
}

fn three(x: usize, y: usize) -> u16 {
    ((x / 2 + y) % 3) as u16
}

fn one(_: usize, _: usize) -> u16 {
    0
}

fn middle(p: DVec3) -> bool {
    (p.truncate() - DVec2::splat(50.0)).abs().max_element() < 36.0
}

#[test]
fn each_colour_is_a_yarn_that_knits_its_stitches_and_floats_behind_the_others() {
    let tile = stockinette();
    let d = tile.diameter();
    let yarns = laid_stranded(&square(), options(tile), stranded(slanting, None));
    assert_eq!(yarns.iter().map(|y| y.color).collect::<Vec<_>>(), [0, 1]);
    let mut loops = 0;
    for yarn in &yarns {
        for (p, [x, y]) in yarn.points.iter().zip(&yarn.coordinates).filter(|(p, _)| middle(**p)) {
            let share = x.fract();
            let own = slanting(*x as usize, *y as usize) == yarn.color;
            // Legs of loops are in front; what passes in the middle of a stitch of another colour is behind all loops.
            match own {
                true if p.z > 0.3 * d => loops += 1,
                false if (0.3..0.7).contains(&share) => assert!(p.z < -1.3 * d, "{p} {x} {y}"),
                false => assert!(p.z < 0.3 * d, "{p} {x} {y}"),
                true => {}
            }
        }
    }
    assert!(loops > 1000, "{loops}");
}

#[test]
fn floats_lie_behind_the_cloth_and_cross_where_colours_change() {
    let plain = within(&laid_stranded(&square(), options(stockinette()), stranded(one, None)), &middle);
    let rest = run_into_each_other(&plain);
    eprintln!("plain {rest:?}");
    let mut wrong = Vec::new();
    // Measured: 0.11 (0.26), 0.016 (0.26), 0.082 (0.31), 0.16 (0.71) of the yarn, and the deepest in diameters. Each change of
    // colour is a crossing, each catch two.
    for (name, color, catch, most) in [
        ("two colours", slanting as fn(usize, usize) -> u16, None, [0.12, 0.3]),
        ("wide fields", wide, None, [0.02, 0.3]),
        ("caught", wide, Some(5), [0.09, 0.35]),
        ("three colours", three, None, [0.19, 0.8]),
    ] {
        let yarns = within(&laid_stranded(&square(), options(stockinette()), stranded(color, catch)), &middle);
        let found = run_into_each_other(&yarns);
        eprintln!("{name}: {found:?}");
        if found.share > most[0] || found.deepest > most[1] {
            wrong.push(format!("{name}: {found:?}"));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn long_floats_are_caught_by_the_yarn_that_knits() {
    let tile = stockinette();
    let d = tile.diameter();
    let free = laid_stranded(&square(), options(tile.clone()), stranded(wide, None));
    let caught = laid_stranded(&square(), options(tile), stranded(wide, Some(5)));
    // The yarn that knits goes behind the float, which lies behind the cloth.
    let hooks = |yarns: &[LaidYarn]| {
        let places = yarns.iter().flat_map(|y| y.points.iter().zip(&y.coordinates).map(|(p, at)| (y.color, *p, *at)));
        let behind = |(color, p, [x, y]): &(u16, DVec3, [f32; 2])| {
            middle(*p) && wide(*x as usize, *y as usize) == *color && p.z < -2.1 * d
        };
        places.filter(behind).count()
    };
    assert_eq!(hooks(&free), 0);
    // Twelve stitches are caught twice, in some 24 rows of 18 stitches.
    let found = hooks(&caught);
    assert!((40..300).contains(&found), "{found}");
}

#[test]
fn a_colour_is_carried_over_a_few_rows_and_cut_over_more() {
    fn every(n: usize) -> fn(usize, usize) -> u16 {
        match n {
            3 => |x, y| u16::from(y % 3 == 0 && x % 4 == 0),
            _ => |x, y| u16::from(y % 6 == 0 && x % 4 == 0),
        }
    }
    let count = |n: usize| {
        let yarns = laid_stranded(&square(), options(stockinette()), stranded(every(n), Some(7)));
        [0, 1].map(|color| yarns.iter().filter(|y| y.color == color).count())
    };
    assert_eq!(count(3), [1, 1]);
    let [ground, cut] = count(6);
    assert!(ground == 1 && cut > 4, "{ground} {cut}");
}

#[test]
fn a_part_has_the_floats_of_the_whole() {
    let whole = laid_stranded(&square(), options(stockinette()), stranded(wide, Some(5)));
    let near = Some((DVec3::new(50.0, 50.0, 0.0), 24.0));
    let part = laid_stranded(&square(), Options { near, ..options(stockinette()) }, stranded(wide, Some(5)));
    let middle = |yarns: &[LaidYarn]| -> Vec<DVec3> {
        let points = yarns.iter().flat_map(|y| y.points.clone());
        points.filter(|p| p.truncate().distance(DVec2::splat(50.0)) < 14.0).collect()
    };
    let (one, other) = (middle(&whole), middle(&part));
    assert!(one.len() == other.len() && one.len() > 500, "{} {}", one.len(), other.len());
    assert!(other.iter().all(|p| one.contains(p)));
}

#[test]
fn floats_are_counted_before_they_are_laid() {
    let garment = Garment::new(&square(), options(stockinette())).unwrap();
    let (floats, length, points) = garment.floats(0, &stranded(three, None));
    let count = |yarns: &[LaidYarn]| yarns.iter().map(|y| y.points.len()).sum::<usize>();
    let [plain, colored] = [one as fn(usize, usize) -> u16, three]
        .map(|color| count(&laid_stranded(&square(), options(stockinette()), stranded(color, None))));
    // Each stitch has two floats; turns and ends of their own are few.
    assert!(floats.most == 3 && floats.stitches == 2 * garment.report().all_stitches());
    assert!((points as f64 / (colored - plain) as f64 - 1.0).abs() < 0.05, "{points} {colored} {plain}");
    assert!((length / (floats.stitches as f64 * 4.0) - 1.0).abs() < 0.05);
}

#[test]
fn floats_follow_the_cloth_from_frame_to_frame() {
    // Rolled about the wales, face inside or outside, without being stretched.
    const RADIUS: f64 = 40.0;
    let roll = |p: DVec3, inside: f64| {
        let (sin, cos) = ((p.x - 50.0) / RADIUS).sin_cos();
        let r = RADIUS - inside * p.z;
        DVec3::new(50.0 + r * sin, p.y, inside * (RADIUS - r * cos))
    };
    let unroll = |p: DVec3, inside: f64| {
        let (x, z) = (p.x - 50.0, RADIUS - inside * p.z);
        DVec3::new(50.0 + RADIUS * x.atan2(z), p.y, inside * (RADIUS - x.hypot(z)))
    };
    let still = square();
    let frames = [1.0, -1.0].map(|inside| {
        let mut frame = still.clone();
        frame.points.iter_mut().for_each(|p| *p = roll(*p, inside));
        frame
    });
    let tile = stockinette();
    let d = tile.diameter();
    let garment = Garment::new(&still, options(tile)).unwrap();
    let all = [&still, &frames[0], &frames[1]];
    let laid = garment.lay(&still, &all, &[], &[Some(stranded(wide, Some(5)))], &mut Vec::new()).unwrap();
    let [at_rest, rolled @ ..] = laid.as_slice() else { panic!("three frames") };
    let share = |yarns: &[LaidYarn]| run_into_each_other(yarns).share;
    let rest = share(&within(&at_rest.concat(), &middle));
    for (frame, inside) in rolled.iter().zip([1.0, -1.0]) {
        let mut furthest: f64 = 0.0;
        let mut unrolled = frame.concat();
        for (yarn, own) in unrolled.iter_mut().zip(at_rest.concat()) {
            assert_eq!((yarn.color, yarn.closed, yarn.points.len()), (own.color, own.closed, own.points.len()));
            assert_eq!(yarn.coordinates, own.coordinates);
            for (p, q) in yarn.points.iter_mut().zip(&own.points) {
                *p = unroll(*p, inside);
                if middle(*q) {
                    furthest = furthest.max(p.distance(*q));
                }
            }
        }
        let found = share(&within(&unrolled, &middle));
        eprintln!("{inside}: {:.3} diameters, {found:.3} of {rest:.3} overlap", furthest / d);
        assert!(furthest < 0.1 * d && found < rest + 0.01, "{inside}: {furthest} {found} {rest}");
    }
}

/// The tightest bend of the ends of yarns, by its radius in radii of the yarn.
fn tightest_end(yarns: &[LaidYarn]) -> f64 {
    const END: usize = 11;
    let bend = |w: &[DVec3]| {
        let [a, b, c] = [w[1] - w[0], w[2] - w[1], w[2] - w[0]];
        a.length() * b.length() * c.length() / (2.0 * a.cross(b).length()).max(1e-12)
    };
    let of_end = |yarn: &LaidYarn, points: &[DVec3]| {
        let end = LaidYarn { points: points.to_vec(), sections: Vec::new(), ..yarn.clone() };
        let places = seams::along(&[end]);
        places.windows(3).map(bend).fold(f64::MAX, f64::min) / yarn.radius
    };
    let widest = yarns.iter().map(|y| y.radius).fold(0.0, f64::max);
    let of_cloth = |y: &&LaidYarn| !y.closed && y.radius == widest && y.points.len() > 2 * END;
    let open = yarns.iter().filter(of_cloth);
    let ends = open.flat_map(|y| [of_end(y, &y.points[..END]), of_end(y, &y.points[y.points.len() - END..])]);
    ends.fold(f64::MAX, f64::min)
}

/// Ends of yarns go to the wrong side without a fold, of plain cloth and of floats: they bend about no less than a yarn.
#[test]
fn ends_turn_to_the_wrong_side_without_folds() {
    for color in [one as fn(usize, usize) -> u16, wide, three] {
        let yarns = laid_stranded(&square(), options(stockinette()), stranded(color, None));
        let tightest = tightest_end(&yarns);
        eprintln!("{tightest:.2}");
        // Measured: 1.15 radii; ends that turned at a point and floats' ends that came up again first had 0.33 to 0.84.
        assert!(tightest > 0.95, "{tightest}");
    }
}
