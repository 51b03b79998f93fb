//! Flat pieces that decreases and increases shape: rows lie square to their wales, and every loop is drawn through what it should be.

use super::{short_rows::undrawn, *};
use crate::pattern::rods::passing::passed;

fn piece(stitches: u32, rows: &[String]) -> Knit {
    let rows: Vec<&str> = rows.iter().map(String::as_str).collect();
    let chart = Chart::parse(&rows).unwrap();
    Knit { rows: chart.rows(), chart, ..knit("stockinette", stitches, 1) }
}

/// Two stitches less in the middle of every other row, or more, beside a stitch that stands.
fn mitre(rows: u32) -> Knit {
    let side = rows / 2 + 4;
    let row = |r: u32| if r % 2 == 1 { format!("k{0} cdd k{0}", side - r / 2 - 1) } else { "k".to_owned() };
    piece(2 * side + 1, &(0..rows).map(row).collect::<Vec<_>>())
}

/// Two stitches more, beside the one in the middle.
fn shawl(rows: u32) -> Knit {
    let row = |r: u32| if r % 2 == 1 { format!("k{0} yo k yo k{0}", 4 + r / 2) } else { "k".to_owned() };
    piece(9, &(0..rows).map(row).collect::<Vec<_>>())
}

/// A stitch less at either side of every other row.
fn raglan(rows: u32) -> Knit {
    let row = |r: u32| if r % 2 == 1 { format!("k2 ssk k{} k2tog k2", rows + 2 - r) } else { "k".to_owned() };
    piece(rows + 9, &(0..rows).map(row).collect::<Vec<_>>())
}

/// A stitch less at one side of every other row, and one more at the other.
fn bias(rows: u32) -> Knit {
    let row = |r: u32| if r % 2 == 1 { "k2tog k15 yo k".to_owned() } else { "k".to_owned() };
    piece(18, &(0..rows).map(row).collect::<Vec<_>>())
}

/// Where a strand is in a row, on the mean, at columns of some range.
fn place(strands: &[PatternStrand], row: i32, columns: std::ops::Range<f32>) -> DVec3 {
    let points = strands.iter().flat_map(|s| s.curve.points.iter().zip(&s.coordinates));
    let own: Vec<DVec3> = points
        .filter(|(_, [wale, course])| course.floor() as i32 == row && columns.contains(wale))
        .map(|(p, _)| *p)
        .collect();
    own.iter().sum::<DVec3>() / own.len() as f64
}

#[test]
fn every_loop_of_shaped_cloth_is_drawn_through() {
    for (name, piece) in [("mitre", mitre(16)), ("shawl", shawl(16)), ("raglan", raglan(16)), ("bias", bias(16))] {
        let mut made = Vec::new();
        let passes = passed(|| made = piece.strands(1.0).unwrap());
        let found = measured(&made);
        assert_eq!((made.len(), passes), (1, 0), "{name}");
        assert_eq!(undrawn(&piece), [], "{name}");
        assert!(found.share <= 0.02, "{name}: {found:?}");
    }
}

/// Each arm of a row loses or gains half of its stitches a row: that says by how much it slants.
#[test]
fn rows_of_a_mitre_turn_a_corner() {
    for (name, piece, row, bend) in [("mitre", mitre(24), 8, -1.0), ("shawl", shawl(24), 18, 1.0)] {
        let made = piece.knitted(1.0).unwrap();
        let count = piece.worked().unwrap()[row as usize].len() as f32;
        let half = (0.5 * count).floor();
        let at = |from: f32| place(&made.strands, row, from..from + 2.0);
        let left = at(half - 3.0) - at(1.0);
        let right = at(count - 3.0) - at(half + 1.0);
        let slant = |arm: DVec3| arm.y.atan2(arm.x);
        let expected = (0.5 * made.gauge[0] / made.gauge[1]).atan();
        let found = 0.5 * bend * (slant(left) - slant(right));
        assert!((found - expected).abs() < 6.0_f64.to_radians(), "{name}: {found} {expected}");
    }
}

/// Beside a raglan's edge stitches are as wide and as high as elsewhere.
#[test]
fn shaped_cloth_keeps_its_gauge() {
    let piece = raglan(24);
    let made = piece.knitted(1.0).unwrap();
    let [width, height] = made.gauge;
    for (row, from) in [(4, 4.0), (4, 14.0), (14, 3.0), (14, 8.0)] {
        let [own, right, above] = [(row, from), (row, from + 4.0), (row + 4, from - 2.0)]
            .map(|(row, from)| place(&made.strands, row, from..from + 2.0));
        let (wide, high) = ((right - own).length() / 4.0, (above.y - own.y) / 4.0);
        assert!((wide / width - 1.0).abs() < 0.06 && (high / height - 1.0).abs() < 0.06, "{row} {from}: {wide} {high}");
    }
}

/// Half a stitch a row to the side; its wales stand upright.
#[test]
fn cloth_on_the_bias_slants() {
    let piece = bias(24);
    let made = piece.knitted(1.0).unwrap();
    let [width, height] = made.gauge;
    let at = |row: i32, from: f32| place(&made.strands, row, from..from + 2.0);
    let up = at(18, 8.0) - at(6, 8.0);
    let (found, expected) = (up.x.atan2(up.y), (0.5 * width / height).atan());
    assert!((found.abs() - expected).abs() < 4.0_f64.to_radians(), "{found} {expected}");
    // Six stitches aside in twelve rows: that of which a stitch is made.
    let wale = at(18, 8.0 - 6.0 * found.signum() as f32) - at(6, 8.0);
    assert!(wale.x.abs() < 0.1 * wale.y, "{wale}");
}

/// Stitches that lace moves within its repeat are laid as its cell has them.
#[test]
fn lace_is_not_on_the_bias() {
    let rows = ["yo k5 ssk", "k"].map(str::to_owned);
    let lace = Knit { rows: 12, ..piece(21, &rows) };
    let worked = lace.worked().unwrap();
    assert!(kinds::slant(&worked) && !lace.slants(&worked));
    let bias = bias(12);
    assert!(bias.slants(&bias.worked().unwrap()));
}

/// A skirt from its hem up, a sleeve from its cuff, and a mitten, whose cuffs are ribs.
fn tubes() -> [(&'static str, Knit); 3] {
    let round = |stitches: u32, top: Closing, rows: &[&str]| {
        let rows: Vec<String> = rows.iter().map(|row| (*row).to_owned()).collect();
        let rims = Rims { top, ..Rims::default() };
        Knit { form: Form::Tube, rims, ..piece(stitches, &rows) }
    };
    let skirt = ["10: k", "k6 k2tog", "6: k", "k5 k2tog", "6: k", "k4 k2tog", "8: k"];
    let sleeve = ["10: k1 p1", "7: k", "k yo k18 yo k", "5: k", "k yo k20 yo k", "5: k", "k yo k22 yo k", "8: k"];
    let mitten = [
        "8: k1 p1",
        "12: k",
        "k ssk k8 k2tog k k ssk k8 k2tog k",
        "k",
        "k ssk k6 k2tog k k ssk k6 k2tog k",
        "k",
        "k ssk k4 k2tog k k ssk k4 k2tog k",
        "k ssk k2 k2tog k k ssk k2 k2tog k",
        "k",
    ];
    [
        ("skirt", round(48, Closing::BoundOff, &skirt)),
        ("sleeve", round(20, Closing::BoundOff, &sleeve)),
        ("mitten", round(28, Closing::Drawn, &mitten)),
    ]
}

#[test]
fn every_loop_of_shaped_tubes_is_drawn_through() {
    for (name, piece) in tubes() {
        let mut made = Vec::new();
        let passes = passed(|| made = piece.strands(1.0).unwrap());
        let found = measured(&made);
        assert_eq!((made.len(), passes), (1, 0), "{name}");
        // What is cast on is measured on plain tubes.
        let wrong: Vec<_> = undrawn(&piece).into_iter().filter(|(row, _)| *row > 0).collect();
        assert_eq!(wrong, [], "{name}");
        assert!(found.share <= 0.02, "{name}: {found:?}");
    }
}

/// Away from where counts and stitches change each round is as wide as its stitches.
#[test]
fn tubes_are_as_wide_as_their_stitches() {
    for (name, piece) in tubes() {
        let made = piece.knitted(1.0).unwrap();
        let counts = piece.widths().unwrap();
        let radius = |row: usize| {
            let points = made.strands.iter().flat_map(|s| s.curve.points.iter().zip(&s.coordinates));
            let own: Vec<f64> =
                points.filter(|(_, at)| at[1].floor() == row as f32).map(|(p, _)| p.x.hypot(p.z)).collect();
            own.iter().sum::<f64>() / own.len() as f64
        };
        let own = |row: usize| f64::from(counts[row]) * made.widths[row] / TAU;
        let even = |row: usize| {
            let near = row.saturating_sub(6)..(row + 7).min(counts.len());
            near.clone().all(|r| counts[r] == counts[row] && (made.widths[r] / made.widths[row] - 1.0).abs() < 0.01)
        };
        for row in (2..counts.len() - 2).filter(|row| even(*row)) {
            let (found, own) = (radius(row), own(row));
            assert!((found / own - 1.0).abs() < 0.02, "{name}, round {row}: {found} for {own}");
        }
        let range = |of: &dyn Fn(usize) -> f64| {
            (2..counts.len() - 2).map(of).fold([f64::MAX, 0.0], |[a, b], r| [a.min(r), b.max(r)])
        };
        let (found, own) = (range(&radius), range(&own));
        println!("{name}: radii of {found:.2?} for {own:.2?}");
        // What is drawn together is narrower.
        let is_drawn = piece.rims.top == Closing::Drawn;
        assert!(is_drawn || (found[0] / own[0] - 1.0).abs() < 0.05, "{name}");
        assert!((found[1] / own[1] - 1.0).abs() < 0.05, "{name}");
    }
}
