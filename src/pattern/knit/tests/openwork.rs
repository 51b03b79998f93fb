//! Openwork and cables: what decreases, yarn-overs and crossings do to the rows and wales around them.

use super::*;
use crate::pattern::rods::passing::passed;

fn cell(rows: &[&str], wide: u32) -> Cell {
    let chart = Chart::parse(rows).unwrap();
    Cell::relaxed(&chart, wide, YARN_PER_STITCH, POINTS, [None; 2])
}

fn named(pattern: &str, wide: u32) -> Cell {
    Cell::relaxed(&Chart::named(pattern).unwrap(), wide, YARN_PER_STITCH, POINTS, [None; 2])
}

/// The mean of points.
fn mean(points: &[DVec3]) -> DVec3 {
    points.iter().sum::<DVec3>() / points.len() as f64
}

/// Feet and head of a loop of a cell.
fn feet_and_head(cell: &Cell, row: usize, k: usize) -> [DVec3; 2] {
    let points: Vec<DVec3> = cell.visit(row, k).map(|(p, _)| p).collect();
    let n = points.len();
    let feet = [&points[..n / 6], &points[n - n / 6..]].concat();
    [mean(&feet), mean(&points[n * 2 / 5..n - n * 2 / 5])]
}

/// Share of a cell that no yarn of diameter 1 covers, seen from the front.
fn see_through(cell: &Cell) -> f64 {
    // In diameters.
    const PIXEL: f64 = 0.1;
    let [across, up] = (cell.period / PIXEL).round().to_array().map(|n| n as usize);
    let size = cell.period / DVec2::new(across as f64, up as f64);
    let mut covered = vec![false; across * up];
    for row in 0..cell.high as usize {
        let points: Vec<DVec3> = (0..cell.visits[row].len()).flat_map(|k| cell.visit(row, k)).map(|(p, _)| p).collect();
        for w in points.windows(2) {
            for t in 0..4 {
                let p = w[0].lerp(w[1], f64::from(t) / 4.0).truncate();
                let reach = (DVec2::splat(0.5) / size).ceil();
                let middle = (p / size).floor();
                for y in -(reach.y as i64)..=reach.y as i64 {
                    for x in -(reach.x as i64)..=reach.x as i64 {
                        let pixel = middle + DVec2::new(x as f64, y as f64);
                        if ((pixel + 0.5) * size).distance(p) < 0.5 {
                            let x = (pixel.x as i64).rem_euclid(across as i64) as usize;
                            covered[(pixel.y as i64).rem_euclid(up as i64) as usize * across + x] = true;
                        }
                    }
                }
            }
        }
    }
    covered.iter().filter(|c| !**c).count() as f64 / covered.len() as f64
}

/// From the front to the back of the yarn.
fn thickness(cell: &Cell) -> f64 {
    let z = || cell.rods.points.iter().map(|p| p.z);
    1.0 + z().fold(f64::MIN, f64::max) - z().fold(f64::MAX, f64::min)
}

#[test]
fn rows_of_feather_and_fan_wave_to_both_edges() {
    let knit = knit("feather-and-fan", 36, 12);
    let made = knit.knitted(1.0).unwrap();
    let height = made.gauge[1];
    let points = || made.strands[0].curve.points.iter().zip(&made.strands[0].coordinates);
    // Mean height of a row in some columns of both repeats.
    let level = |row: f32, columns: std::ops::Range<f32>| {
        let is_there = |c: &[f32; 2]| (row..row + 1.0).contains(&c[1]) && columns.contains(&(c[0] % 18.0));
        let y: Vec<f64> = points().filter(|(_, c)| is_there(c)).map(|(p, _)| p.y).collect();
        y.iter().sum::<f64>() / y.len() as f64
    };
    for row in [-1.0, 2.0, 4.0, 5.0, 7.0, 11.0] {
        let fan = level(row, 8.0..10.0);
        let drawn = 0.5 * (level(row, 0.0..1.0) + level(row, 17.0..18.0));
        let wave = (fan - drawn) / height;
        eprintln!("row {row}: {wave:.2} rows");
        assert!((2.0..6.0).contains(&wave), "row {row}: {wave}");
    }
}

#[test]
fn decreases_lean_and_the_upper_loop_covers_the_other() {
    // What is worked together in row 1: its columns in row 0, the one on top first; the side to which that leans, and by how
    // many stitches at least: beside its hole it goes straight on.
    for (row, columns, side, least) in [
        ("k yo k2tog k3", [1, 2], 1.0, 0.3),
        ("k3 ssk yo k", [4, 3], -1.0, 0.3),
        ("k k2tog yo k3", [1, 2], 1.0, -0.1),
        ("k3 yo ssk k", [4, 3], -1.0, -0.1),
    ] {
        let cell = cell(&["k", row, "2: k"], 6);
        let width = cell.gauge()[0];
        let [top, other] = columns.map(|k| feet_and_head(&cell, 0, k));
        let [lean, back] = [top, other].map(|[feet, head]| side * (head.x - feet.x) / width);
        eprintln!("{row}: leans {lean:.2} over {back:.2}, {:.2} in front", top[1].z - other[1].z);
        assert!(lean > least && back < lean - 0.3, "{row}: {lean} {back}");
        assert!(top[1].z > other[1].z + 0.3, "{row}: {} {}", top[1].z, other[1].z);
    }
    let cell = cell(&["k", "k yo cdd yo k2", "2: k"], 6);
    let [left, middle, right] = [1, 2, 3].map(|k| feet_and_head(&cell, 0, k));
    assert!((middle[1].x - middle[0].x).abs() < 0.2 * cell.gauge()[0], "{middle:?}");
    assert!(middle[1].z > left[1].z.max(right[1].z) + 0.3, "{left:?} {middle:?} {right:?}");
}

#[test]
fn openwork_is_open_and_flat() {
    let plain = named("stockinette", 6);
    let [holes, thick] = [see_through(&plain), thickness(&plain)];
    eprintln!("stockinette: {holes:.3} open, {thick:.2} thick");
    // How much more open than plain knit, and how thick at most.
    for (pattern, wide, more, most) in
        [("eyelet", 6, 0.01, 3.9), ("lace", 7, 0.06, 4.6), ("feather-and-fan", 18, 0.05, 4.8)]
    {
        let cell = named(pattern, wide);
        let [open, deep] = [see_through(&cell), thickness(&cell)];
        eprintln!("{pattern}: {open:.3} open, {deep:.2} thick");
        assert!(open > holes + more, "{pattern}: {open}, plain {holes}");
        assert!(deep < most, "{pattern}: {deep}");
    }
}

#[test]
fn patterns_in_the_round_keep_their_yarns_apart() {
    for (pattern, stitches, most) in [
        ("lace", 42, 0.001),
        ("feather-and-fan", 36, 0.003),
        ("cable", 24, 0.003),
        ("honeycomb", 40, 0.003),
        ("garter", 24, 0.002),
        ("slip-stitch", 24, 0.006),
    ] {
        let knit = Knit { form: Form::Tube, ..knit(pattern, stitches, 12) };
        let mut found = None;
        let passes = passed(|| found = Some(measured(&knit.strands(1.0).unwrap())));
        let found = found.unwrap();
        eprintln!("{pattern}: {found:?}, {passes} passes");
        assert!(found.share <= most && found.nearest > 0.9 && passes == 0, "{pattern}: {found:?}, {passes} passes");
    }
}

#[test]
fn mesh_keeps_its_sides() {
    // Each row begins or ends with a yarn-over at the right side. Rows that lean would draw these out more and more.
    let chart = Chart::parse(&["k2tog yo"]).unwrap();
    let knit = Knit { chart, ..knit("stockinette", 12, 12) };
    let made = knit.knitted(1.0).unwrap();
    let [width, height] = made.gauge;
    let right = |row: f64| {
        let of_row = |p: &&DVec3| (p.y + 6.0 * height - row * height).abs() < height;
        made.strands[0].curve.points.iter().filter(of_row).map(|p| p.x).fold(0.0, f64::max) - 6.0 * width
    };
    let beyond = [2.0, 6.0, 10.0].map(right);
    eprintln!("{beyond:.1?}");
    assert!(beyond.iter().all(|x| *x < 0.8 * width), "{beyond:?}");
}
