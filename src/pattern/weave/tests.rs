use std::{
    collections::HashMap,
    hash::Hash,
    sync::{LazyLock, Mutex, OnceLock},
};

use glam::DVec2;

use super::{
    super::{
        bend::{excess, folded, folds},
        draft::NAMES,
    },
    *,
};
use crate::geometry::{
    curve::Curve,
    overlap::{Overlap, overlap},
};

fn weave(draft: &str) -> Weave {
    let (warps, wefts) = (Extent::Yarns(12), Extent::Yarns(10));
    Weave { warps, wefts, ..Weave::of(Draft::named(draft).unwrap(), 1.0) }
}

/// How far yarns whose sections are known lie in each other.
pub(super) fn overlap_of(strands: &[PatternStrand]) -> Overlap {
    overlap(strands.iter().map(|s| (&s.curve, s.curve.radii.as_deref().unwrap()))).unwrap()
}

/// What several tests look at, made once by the first that asks for it.
struct Made<K, T: 'static>(LazyLock<Mutex<HashMap<K, &'static OnceLock<T>>>>);

impl<K: Eq + Hash, T> Made<K, T> {
    const fn new() -> Self {
        Self(LazyLock::new(Mutex::default))
    }

    fn get(&self, key: K, make: impl FnOnce() -> T) -> &'static T {
        let made = *self.0.lock().unwrap().entry(key).or_insert_with(|| Box::leak(Box::default()));
        made.get_or_init(make)
    }
}

/// The cloth of a draft as [`weave`] has it.
fn relaxed(draft: &'static str) -> &'static Cloth<'static> {
    static MADE: Made<&str, Cloth> = Made::new();
    MADE.get(draft, || Box::leak(Box::new(weave(draft))).relax().unwrap())
}

/// Whether the warp is above the weft where both cross, seen from above: at the nearest pair of their points in plan.
fn warp_is_above(strands: &[PatternStrand], place: [f32; 2]) -> bool {
    let near = |kind: StrandKind, index: f32| {
        let strand = strands.iter().find(|s| s.kind == kind && s.index == index as u32).unwrap();
        let points = strand.curve.points.iter().zip(&strand.coordinates);
        points.filter(|(_, c)| (c[0] - place[0]).hypot(c[1] - place[1]) < 0.8).map(|(p, _)| *p).collect::<Vec<_>>()
    };
    let (warp, weft) = (near(StrandKind::Warp, place[0]), near(StrandKind::Weft, place[1]));
    let pairs = warp.iter().flat_map(|p| weft.iter().map(move |q| (p, q)));
    let (p, q) = pairs
        .min_by(|a, b| {
            let apart = |(p, q): (&DVec3, &DVec3)| p.truncate().distance(q.truncate());
            apart(*a).total_cmp(&apart(*b))
        })
        .unwrap();
    p.z > q.z
}

#[test]
fn the_draft_says_what_lies_on_top() {
    for name in NAMES {
        let strands = relaxed(name).ground();
        let draft = Draft::named(name).unwrap();
        for (i, j) in (0..10_u32).flat_map(|i| (0..12_u32).map(move |j| (i, j))) {
            let above = warp_is_above(&strands, [j as f32 + 0.5, i as f32 + 0.5]);
            assert_eq!(above, draft.warp_over(i as usize, j as usize), "{name}: weft {i}, warp {j}");
        }
    }
}

#[test]
fn yarns_touch_and_hardly_run_into_each_other() {
    for name in NAMES {
        let cloth = relaxed(name);
        let [deepest, share] = cloth.cell.overlap(weave(name).options().unit());
        // Twined warps, the ridges of a honeycomb and wefts that are held in the same places press hardest.
        let (most, depth) = match *name {
            "honeycomb" | "honeycomb 10" | "corduroy" => (MOST_OVERLAP, 0.6),
            _ => (MOST_OVERLAP, 0.35),
        };
        assert!(share < most && deepest < depth, "{name}: {deepest} of a diameter, {share} of the surface");
        // The table of docs/cloth.md.
        let Measures { spacing: [p, q], crimp: [c, d], see_through, .. } = cloth.measures();
        let percent = [c, d, see_through, share].map(|x| format!("{:.1}", 100.0 * x));
        let [c, d, see_through, share] = percent;
        eprintln!("| {name} | {:.2} x {:.2} | {c}, {d} | {see_through} | {share}, {deepest:.2} |", p / 2.0, q / 2.0);
    }
}

#[test]
fn sections_keep_their_area_and_are_not_upright() {
    let weave = Weave { half_rooms: [weave("satin 5").half_rooms[0], 0.6], ..weave("satin 5") };
    for strand in weave.strands().unwrap() {
        let radius = if strand.kind == StrandKind::Warp { 1.0 } else { 0.6_f64 };
        let (radii, flattening) = (strand.curve.radii.unwrap(), strand.curve.flattening.unwrap());
        for (half, short) in radii.iter().zip(&flattening) {
            let ratio = f64::from(short.length());
            assert!(ratio <= 1.000_001 && ratio > 0.2, "{ratio}");
            assert!((half * half * ratio / (radius * radius) - 1.0).abs() < 1e-6);
        }
    }
}

#[test]
fn round_plain_weave_jams_where_peirce_says() {
    // He has 1.73 diameters and a cover of 0.82; ours is pressed a little closer, and yarns do not give way.
    let weave = Weave { flatten: 1.0, crimp: Some(0.5), ..weave("plain") };
    let Measures { spacing, see_through, .. } = weave.relax().unwrap().measures();
    for spacing in spacing {
        assert!((1.62..1.8).contains(&(spacing / 2.0)), "{spacing}");
    }
    assert!((0.8..0.88).contains(&(1.0 - see_through)), "{see_through}");
}

#[test]
fn crimps_share_the_sum_of_both_heights() {
    let heights = |crimp: f64| {
        let weave = Weave { flatten: 1.0, crimp: Some(crimp), ..weave("plain") };
        let cell = weave.relax().unwrap().cell;
        [0, 1].map(|side| cell.yarns[side].iter().flatten().fold(0.0f64, |h, n| h.max(n.height)))
    };
    let [even, stiff_weft, stiff_warp] = [0.5, 0.9, 0.1].map(heights);
    for [warp, weft] in [even, stiff_weft, stiff_warp] {
        assert!((warp + weft - 2.0).abs() < 0.12, "{warp} {weft}");
    }
    assert!((even[0] - even[1]).abs() < 0.02);
    assert!(stiff_weft[0] > 1.3 && stiff_warp[1] > 1.3, "{stiff_weft:?} {stiff_warp:?}");
}

#[test]
fn closed_weaves_are_closed() {
    for (name, most) in
        [("plain", 0.08), ("twill 2/2", 0.08), ("satin 5", 0.01), ("satin 8", 0.01), ("double cloth", 0.01)]
    {
        let see_through = relaxed(name).measures().see_through;
        assert!(see_through < most, "{name}: {see_through}");
    }
}

/// Share of a repeat on which a warp is on top, seen from above.
fn warp_face(cell: &UnitCell) -> f64 {
    const FINE: usize = 12;
    let count = [0, 1].map(|side| cell.yarns[side].len());
    let top = |side: usize, place: [f64; 2]| {
        let own = (-1..=count[side] as i64).map(|index| {
            let yarn = &cell.yarns[side][index.rem_euclid(count[side] as i64) as usize];
            let node = &yarn[(place[1 - side] * cell.nodes as f64).round() as usize % yarn.len()];
            let off = ((place[side] - index as f64) * cell.spacing[side] - node.aside) / node.axes[0];
            if off.abs() < 1.0 { node.height + node.axes[1] * (1.0 - off * off).sqrt() } else { f64::MIN }
        });
        own.fold(f64::MIN, f64::max)
    };
    let places = (0..count[0] * FINE).flat_map(|x| (0..count[1] * FINE).map(move |y| [x, y]));
    let warps = places.filter(|at| {
        let place = at.map(|v| (v as f64 + 0.5) / FINE as f64);
        top(0, place) > top(1, place)
    });
    warps.count() as f64 / (count[0] * count[1] * FINE * FINE) as f64
}

/// Floats of a satin close over the places where its ends dip and hide the picks. Measured: 0.93 and 0.97.
#[test]
fn floats_of_a_satin_hide_what_crosses_them() {
    for (name, least) in [("satin 5", 0.9), ("satin 8/3", 0.95)] {
        let face = warp_face(&relaxed(name).cell);
        eprintln!("{name}: {face:.3}");
        assert!(face > least, "{name}: {face}");
    }
}

/// Between its turns a herringbone is a twill. Left to themselves its yarns gave way by turns, each another way, and its picks
/// followed the zigzag, 3.8 radii up and down.
#[test]
fn a_herringbone_is_as_even_as_its_twill() {
    // Half the way that the yarn which goes farthest aside goes from side to side, in its radii, for warps and wefts.
    let aside = |name: &'static str| {
        [0, 1].map(|side| {
            let way = |yarn: &Vec<unit_cell::Node>| {
                let ends = |(least, most): (f64, f64), n: &unit_cell::Node| (least.min(n.aside), most.max(n.aside));
                let (least, most) = yarn.iter().fold((f64::MAX, f64::MIN), ends);
                0.5 * (most - least)
            };
            relaxed(name).cell.yarns[side].iter().map(way).fold(0.0, f64::max)
        })
    };
    let twill = aside("twill 2/2");
    for name in ["herringbone 2/2 8", "herringbone"] {
        let [warp, weft] = aside(name);
        assert!(warp < 1.1 * twill[0], "{name}: {warp} {twill:?}");
        // Beside a turn floats of two neighbours meet, and push a pick twice as far.
        assert!(weft < 2.1 * twill[1], "{name}: {weft} {twill:?}");
        let cell = &relaxed(name).cell;
        // The same float is alike from warp to warp where the next turn is farther than it reaches.
        let at = |warp: usize, pick: usize| cell.yarns[1][pick % 4][(warp * cell.nodes) % cell.yarns[1][0].len()];
        for pick in 0..4 {
            let along: Vec<_> = (2..6).map(|warp| at(warp, pick + warp)).collect();
            let against: Vec<_> = (2..6).map(|warp| at(warp, pick + 4 * warp - warp)).collect();
            assert!(along.iter().all(|n| *n == along[0]) || against.iter().all(|n| *n == against[0]), "{along:?}");
        }
    }
}

#[test]
fn warps_of_a_basket_draw_together() {
    let cell = &relaxed("basket 2").cell;
    let mean =
        |yarn: usize| cell.yarns[0][yarn].iter().map(|n| n.aside).sum::<f64>() / cell.yarns[0][yarn].len() as f64;
    let within = cell.spacing[0] + mean(1) - mean(0);
    let between = cell.spacing[0] + mean(2) - mean(1);
    assert!(between > 1.2 * within, "{within} {between}");
}

#[test]
fn spacings_and_cover_are_kept() {
    let given = Weave { warp_spacing: Some(4.0), weft_spacing: Some(5.0), ..weave("plain") };
    assert_eq!(given.relax().unwrap().measures().spacing, [4.0, 5.0]);
    for cover in [0.3, 0.45, 0.5, 0.55, 0.7, 0.9] {
        let weave = Weave { cover: Some(cover), ..weave("plain") };
        let see_through = weave.relax().unwrap().measures().see_through;
        assert!((1.0 - see_through - cover).abs() < 0.005, "{cover} {see_through}");
    }
    // Round yarns that hardly bend leave rectangles between them.
    for spacing in [6.0, 6.7, 7.3] {
        let far = Weave { warp_spacing: Some(spacing), weft_spacing: Some(spacing), flatten: 1.0, ..weave("plain") };
        let see_through = far.relax().unwrap().measures().see_through;
        assert!((see_through - (1.0 - 2.0 / spacing).powi(2)).abs() < 0.01, "{spacing} {see_through}");
    }
    let sparse = Weave { cover: Some(1.0), ..weave("plain") };
    assert!(matches!(sparse.relax(), Err(Impossible::TooMuchCover { most }) if most > 0.9), "{:?}", sparse.relax());
}

#[test]
fn too_little_cover_is_refused() {
    let beside = Weave { warp_spacing: Some(5.0), cover: Some(0.3), ..weave("plain") };
    let Err(Impossible::TooLittleCover { least }) = beside.relax() else { panic!("accepted") };
    assert!((0.35..0.6).contains(&least), "{least}");
    assert!(Weave { cover: Some(least + 0.1), ..beside }.relax().is_ok());
    let alone = Weave { cover: Some(0.01), ..weave("plain") };
    assert!(matches!(alone.relax(), Err(Impossible::TooLittleCover { least }) if (0.01..0.05).contains(&least)));
}

#[test]
fn few_warps_hold_the_turns_of_wefts_or_are_refused() {
    for (name, least) in [("plain", 2), ("twill 2/1", 2), ("satin 5", 2), ("terry", 2), ("double cloth", 4)] {
        for warps in 1..=least {
            let few =
                Weave { warps: Extent::Yarns(warps), wefts: Extent::Yarns(5), edges: Edges::Selvedge, ..weave(name) };
            match few.strands() {
                Ok(strands) => assert!(warps == least && !strands.is_empty(), "{name} {warps}"),
                Err(why) => assert!(warps < least && why == Impossible::TooFewWarps { least }, "{name} {warps}"),
            }
        }
    }
}

#[test]
fn too_little_room_is_refused() {
    let tight = Weave { warp_spacing: Some(2.2), weft_spacing: Some(2.2), ..weave("plain") };
    let Err(Impossible::TooTight { warp: true, least }) = tight.relax() else { panic!("accepted") };
    assert!((3.2..3.7).contains(&least), "{least}");
}

#[test]
fn cloth_is_as_large_as_it_is_asked_to_be() {
    let weave = Weave { warps: Extent::Length(50.0), wefts: Extent::Length(30.0), ..weave("twill 2/1") };
    let cloth = weave.relax().unwrap();
    let measures = cloth.measures();
    assert!(
        (measures.size[0] - 50.0).abs() < measures.spacing[0] && (measures.size[1] - 30.0).abs() < measures.spacing[1]
    );
    let strands = cloth.strands();
    assert_eq!(strands.len() as u32, cloth.count()[0] + cloth.count()[1]);
    // Yarns end at the edges of the cloth and nowhere else, and are as long as is said.
    let mut length = [0.0; 2];
    for strand in &strands {
        let side = usize::from(strand.kind == StrandKind::Weft);
        length[side] += strand.curve.polygon_length();
        let half = 0.5 * measures.size[1 - side];
        let along = |p: &DVec3| if side == 0 { p.y } else { p.x };
        let (first, last) = (&strand.curve.points[0], strand.curve.points.last().unwrap());
        assert!((along(first) + half).abs() < 1e-9 && (along(last) - half).abs() < 1e-9);
        assert_eq!(strand.coordinates.len(), strand.curve.points.len());
    }
    for side in 0..2 {
        assert!((length[side] / measures.length[side] - 1.0).abs() < 0.02, "{length:?} {measures:?}");
    }
    let many = Weave { warps: Extent::Yarns(1_000_000), wefts: Extent::Yarns(1_000_000), ..weave };
    assert!(matches!(many.relax(), Err(Impossible::TooLarge)));
}

#[test]
fn a_leno_has_whole_pairs() {
    let of = |warps| Weave { warps, ..weave("leno") };
    let odd = of(Extent::Yarns(13));
    assert!(matches!(odd.relax(), Err(Impossible::Unpaired { warps: 13 })));
    assert_eq!([1, 13].map(|warps| crate::pattern::period::counts_that_hold(2, warps)), ["2", "12 or 14"]);
    // What fills a width does.
    for width in [9.0, 11.0, 13.0, 15.0] {
        let filled = of(Extent::Length(width));
        assert!(filled.relax().unwrap().count()[0].is_multiple_of(2), "{width}");
    }
}

#[test]
fn pairs_of_a_leno_are_twined() {
    let leno = weave("leno");
    let strands = leno.strands().unwrap();
    let (crossing, straight) = (&strands[4], &strands[5]);
    let aside = |k: usize| crossing.curve.points[k].x - straight.curve.points[k].x;
    // Over one weft on one side of its neighbour, over the next on the other, below it between them.
    let nodes = leno.nodes() as usize;
    let weft = |i: usize| nodes / 2 + i * nodes;
    for i in 2..7 {
        assert!(aside(weft(i)) * aside(weft(i + 1)) < 0.0, "{} {}", aside(weft(i)), aside(weft(i + 1)));
        let between = weft(i) + nodes / 2;
        assert!(crossing.curve.points[between].z < straight.curve.points[between].z);
    }
}

/// Orders of yarns in the weft: one, one or two picks of each, and an odd number of one.
const ORDERS: [&[u32]; 5] = [&[], &[0, 1], &[0, 0, 1, 1], &[0, 0, 0, 1], &[0, 0, 1, 1, 1, 1]];

/// Drafts whose wefts turn, with one yarn; and one of each kind of selvedge with several.
fn turning() -> impl Iterator<Item = (&'static str, &'static [u32])> {
    let several = ["plain", "twill 2/2", "satin 5", "double cloth", "terry", "leno"];
    let one = NAMES.iter().filter(|name| **name != "corduroy").map(|name| (*name, ORDERS[0]));
    one.chain(several.into_iter().flat_map(|name| ORDERS[1..].iter().map(move |order| (name, *order))))
}

/// The strands of such a piece: ten picks, and wide enough for warps that float at both sides of two layers.
fn turned(draft: &'static str, order: &'static [u32]) -> &'static [PatternStrand] {
    static MADE: Made<(&str, &[u32]), Vec<PatternStrand>> = Made::new();
    let warps = Extent::Yarns(16);
    let piece = || Weave { edges: Edges::Selvedge, shuttles: order.to_vec(), warps, ..weave(draft) };
    MADE.get((draft, order), || piece().strands().unwrap())
}

#[test]
fn selvedges_make_one_strand_of_each_shuttle() {
    for (name, order) in turning() {
        let strands = turned(name, order);
        let wefts: Vec<_> = strands.iter().filter(|s| s.kind == StrandKind::Weft).collect();
        let layers = Draft::named(name).unwrap().layers();
        let yarns: std::collections::BTreeSet<_> =
            (0..10).map(|i| (i % layers, order.get(i % order.len().max(1)))).collect();
        assert_eq!(wefts.len(), yarns.len(), "{name} {order:?}");
        let mean_x = |s: &PatternStrand| s.curve.points.iter().map(|p| p.x).sum::<f64>() / s.curve.points.len() as f64;
        // Tufts are not as long as the cloth.
        let span = |s: &PatternStrand| s.curve.points[s.curve.points.len() - 1].y - s.curve.points[0].y;
        let warps = || strands.iter().filter(|s| s.kind == StrandKind::Warp);
        let height = warps().map(span).fold(0.0, f64::max);
        let mut beyond = [0, 0];
        for weft in wefts {
            let way = &weft.curve.points;
            let layer = |s: &&PatternStrand| (s.index as usize) % layers == (weft.index as usize) % layers;
            for (side, out) in [-1.0, 1.0].into_iter().enumerate() {
                let whole = warps().filter(|s| span(s) > 0.7 * height).filter(layer);
                let outermost = whole.max_by(|a, b| (out * mean_x(a)).total_cmp(&(out * mean_x(b)))).unwrap();
                let edge = out * mean_x(outermost);
                // A turn is what lies beyond the middle of the outermost warp, but for the ends of the weft.
                let outside: Vec<usize> = (3..way.len() - 3).filter(|&i| out * way[i].x > edge + 0.02).collect();
                let turns = outside.chunk_by(|a, b| a + 1 == *b).filter(|turn| turn.len() > 4);
                for turn in turns {
                    let near = |y: f64| {
                        let points = outermost.curve.points.iter();
                        points.min_by(|p, q| (p.y - y).abs().total_cmp(&(q.y - y).abs())).unwrap()
                    };
                    let above = [turn[0] - 1, turn[turn.len() - 1] + 1].map(|i| way[i].z > near(way[i].y).z);
                    assert_ne!(above[0], above[1], "{name} {order:?}: a turn that no warp holds");
                    let middle = way[turn[turn.len() / 2]];
                    let warp = near(middle.y);
                    let away = (middle.x - warp.x).hypot(middle.z - warp.z);
                    // Radii are 1: snug, and not into the warp; farther out around yarns that are carried.
                    let most = if order.is_empty() { 2.75 } else { 2.75 + 2.2 * 2.0 };
                    assert!((1.8..most).contains(&away), "{name} {order:?}: {away}");
                    beyond[side] += 1;
                }
            }
            let steps = way.windows(2).map(|w| w[0].distance(w[1])).fold(0.0, f64::max);
            assert!(steps < 2.0, "{name} {order:?}: a jump of {steps}");
        }
        assert_eq!(
            beyond[0] + beyond[1],
            10 - yarns.len(),
            "{name} {order:?}: each yarn turns after each pick but its last"
        );
        if layers == 1 && order.is_empty() {
            assert_eq!(beyond, [4, 5], "{name}: turns on the left and on the right of ten picks");
        }
    }
}

/// Overshot: a pattern weft and a ground weft by turns, which are carried past each other at the sides.
#[test]
fn wefts_that_are_carried_have_no_two_points_in_one_place() {
    let tie_up = [[1, 2], [2, 3], [3, 4], [4, 1], [1, 3], [2, 4]].map(Vec::from);
    let draft = Draft::from_loom(&[1, 2, 3, 4], &tie_up, &[1, 5, 1, 6, 2, 5, 2, 6]).unwrap();
    let (warps, wefts) = (Extent::Yarns(24), Extent::Yarns(24));
    for edges in [Edges::Selvedge, Edges::Fringe(20.0), Edges::Finished] {
        let weave = Weave { edges, shuttles: vec![0, 1], warps, wefts, draft: draft.clone(), ..weave("plain") };
        for strand in weave.strands().unwrap() {
            let least = strand.curve.points.windows(2).map(|w| w[0].distance(w[1])).fold(f64::MAX, f64::min);
            assert!(least > 1e-3, "{edges:?}, {:?} {}: {least}", strand.kind, strand.index);
            let curve = strand.smooth().curve;
            assert!(curve.flattening.is_none_or(|axes| axes.len() == curve.points.len()));
        }
    }
}

#[test]
fn no_more_points_are_promised_than_the_longest_yarn_has() {
    for name in ["plain", "double cloth", "terry", "velvet", "corduroy"] {
        for (edges, order) in [Edges::Live, Edges::Selvedge, Edges::Finished].into_iter().zip(ORDERS) {
            let weave = Weave { edges, shuttles: order.to_vec(), warps: Extent::Yarns(24), ..weave(name) };
            let cloth = weave.relax().unwrap();
            let longest = cloth.strands().iter().map(|s| s.curve.points.len()).max().unwrap() as u64;
            assert!((1..=longest).contains(&weave.least_points()), "{name}: {} {longest}", weave.least_points());
            assert_eq!(cloth.least_points(), weave.least_points());
        }
    }
}

/// The warp that floats at a side is relaxed with those beside it, and wefts lie flat on it where they turn; those that are
/// carried lie beside it.
#[test]
fn yarns_have_room_at_selvedges() {
    let several =
        ["plain", "twill 2/2", "double cloth"].into_iter().flat_map(|n| ORDERS[1..].iter().map(move |o| (n, *o)));
    let one =
        ["plain", "twill 2/1", "twill 2/2", "satin 5", "basket 2", "huck", "double cloth"].map(|n| (n, ORDERS[0]));
    for (name, order) in one.into_iter().chain(several) {
        let (warps, wefts) = (Extent::Yarns(20), Extent::Yarns(24));
        let weave = Weave { edges: Edges::Selvedge, shuttles: order.to_vec(), warps, wefts, ..weave(name) };
        let measured = overlap_of(&weave.strands().unwrap());
        let (share, deepest) = match (name, order) {
            ("double cloth", []) => (0.05, 0.3),
            ("double cloth", _) => (0.09, 1.0),
            (_, []) => (0.01, 0.08),
            _ => (0.045, 0.6),
        };
        assert!(measured.share < share && measured.deepest < deepest, "{name} {order:?}: {measured:?}");
    }
}

#[test]
fn wefts_turn_without_folding_into_themselves() {
    for (name, order) in turning() {
        for weft in turned(name, order).iter().filter(|s| s.kind == StrandKind::Weft) {
            // Beyond the outermost crossings.
            let fold = weft.curve.points.windows(3).zip(&weft.coordinates).scan(0.0, |fold: &mut f64, (w, at)| {
                *fold = if (0.51..15.49).contains(&at[0]) { 0.0 } else { folded(*fold, excess(w, 1.0)) };
                Some(*fold)
            });
            let deepest = fold.fold(0.0, f64::max);
            // Under the loops of terry wefts go up and down as steeply all along.
            let most = if name == "terry" { 0.8 } else { 0.5 };
            assert!(deepest < most, "{name} {order:?}: {deepest}");
        }
    }
}

/// The wefts of terry, which go far up and down, come into its selvedge without a fold.
#[test]
fn wefts_come_from_pile_into_a_selvedge_without_folding() {
    let (warps, wefts) = (Extent::Yarns(48), Extent::Yarns(24));
    let weave = Weave { edges: Edges::Selvedge, warps, wefts, ..weave("terry") };
    let made = weave.strands().unwrap();
    for weft in made.iter().filter(|s| s.kind == StrandKind::Weft) {
        let deepest = folds(&weft.curve.points, weave.half_rooms[1]).fold(0.0, f64::max);
        eprintln!("{deepest:.2}");
        assert!(deepest < 0.7, "{deepest}");
    }
}

#[test]
fn hems_hide_the_ends_of_warps() {
    let weave = Weave { edges: Edges::Finished, wefts: Extent::Yarns(20), ..weave("plain") };
    let cloth = weave.relax().unwrap();
    let Measures { thickness, size, .. } = cloth.measures();
    let strands = cloth.strands();
    for warp in strands.iter().filter(|s| s.kind == StrandKind::Warp) {
        let points = &warp.curve.points;
        for end in [points[0], points[points.len() - 1]] {
            assert!(end.y.abs() < 0.5 * size[1] && end.z < 0.0 && end.z > -2.6 * thickness, "{end}");
        }
        let outermost = points.iter().map(|p| p.y.abs()).fold(0.0, f64::max);
        // The cloth is as high as it was asked to be, with its folds.
        assert!((outermost - 0.5 * size[1] + 0.25 * thickness).abs() < 0.3 * thickness, "{outermost} {size:?}");
        let lengths = points.windows(2).map(|w| w[0].distance(w[1]));
        assert!(lengths.fold(0.0, f64::max) < 2.0, "points stay together");
    }
}

#[test]
fn fringes_are_as_long_as_they_are_asked_to_be() {
    let weave = Weave { edges: Edges::Fringe(20.0), ..weave("plain") };
    let cloth = weave.relax().unwrap();
    let half = 0.5 * cloth.measures().size[1];
    for warp in cloth.strands().iter().filter(|s| s.kind == StrandKind::Warp).take(12) {
        let (first, last) = (warp.curve.points[0].y, warp.curve.points.last().unwrap().y);
        for end in [-first, last] {
            assert!((end - half - 20.0).abs() < 2.0, "{end}");
        }
    }
}

/// The warps of a corduroy are all of the ground: they alone are drawn out, and its pile stays as it is.
/// Warps that lie above or beside each other where the cloth ends have less room there than they are thick.
#[test]
fn yarns_of_a_fringe_keep_apart() {
    for name in ["plain", "twill 2/2", "satin 5", "huck", "basket 2", "double cloth"] {
        let of = |edges| overlap_of(&Weave { edges, flatten: 1.5, ..weave(name) }.strands().unwrap());
        let (cut, fringed) = (of(Edges::Selvedge), of(Edges::Fringe(20.0)));
        assert!(
            fringed.share < cut.share + 0.05 && fringed.nearest > cut.nearest - 0.12,
            "{name}: {cut:?} {fringed:?}"
        );
    }
}

#[test]
fn a_corduroy_has_a_fringe_of_its_warps() {
    let [cut, drawn] = [Edges::Live, Edges::Fringe(20.0)].map(|edges| Weave { edges, ..weave("corduroy") });
    let live = cut.relax().unwrap();
    let half = 0.5 * live.measures().size[1];
    let fringed = drawn.relax().unwrap().strands();
    let (bare, mut warps) = (live.strands(), 0);
    assert_eq!(bare.len(), fringed.len());
    for (before, after) in bare.iter().zip(&fringed) {
        if after.kind == StrandKind::Warp {
            let (first, last) = (after.curve.points[0].y, after.curve.points.last().unwrap().y);
            assert!((-first - half - 20.0).abs() < 2.0 && (last - half - 20.0).abs() < 2.0, "{first} {last} {half}");
            warps += 1;
        } else {
            assert_eq!(before.curve.points, after.curve.points);
        }
    }
    assert!(warps > 0);
}

#[test]
fn pile_is_made_in_pieces_of_any_size() {
    for (name, sizes) in [("terry", 1..9), ("velvet", 1..5), ("corduroy", 1..7)] {
        for n in sizes {
            let weave = Weave { warps: Extent::Yarns(n), wefts: Extent::Yarns(9 - n), ..weave(name) };
            let strands = weave.relax().unwrap().strands();
            assert!(strands.iter().all(|s| s.curve.points.iter().all(|p| p.is_finite())), "{name} {n}");
        }
    }
}

/// Once its floats are cut, what is left of a corduroy must cover what they did.
#[test]
fn corduroy_has_more_picks_than_ends() {
    let Measures { spacing: [p, q], see_through, .. } = relaxed("corduroy").measures();
    // Radii are 1: picks lie closer than side by side.
    assert!(p > 1.9 * q && q < 2.0 && see_through < 0.01, "{p} {q} {see_through}");
}

#[test]
fn pile_stands_as_high_as_it_is_asked_to() {
    for (name, kind, cut) in
        [("terry", StrandKind::Warp, false), ("velvet", StrandKind::Warp, true), ("corduroy", StrandKind::Weft, true)]
    {
        let weave = weave(name);
        let cloth = weave.relax().unwrap();
        let ground = cloth.measures().thickness;
        let strands = cloth.strands();
        let top = |s: &PatternStrand| s.curve.points.iter().map(|p| p.z).fold(f64::MIN, f64::max);
        let highest = strands.iter().map(top).fold(f64::MIN, f64::max);
        assert_eq!(weave.pile_height, if cut { 8.0 } else { 24.0 }, "{name}: radii of its yarn");
        assert!((highest - weave.pile_height).abs() < 0.5 * ground + 2.0, "{name}: {highest}");
        // Tufts are held in the cloth and end above it; loops are one yarn.
        let standing: Vec<_> = strands.iter().filter(|s| s.kind == kind && top(s) > 5.0).collect();
        assert!(standing.len() > if cut { 10 } else { 2 }, "{name}: {}", standing.len());
        for strand in standing {
            let points = &strand.curve.points;
            let lowest = points.iter().map(|p| p.z).fold(f64::MAX, f64::min);
            assert!(lowest < 1.5, "{name}: held at {lowest}");
            let (first, last) = (points[0].z, points[points.len() - 1].z);
            assert_eq!(cut, first > 3.0 && last > 3.0, "{name}: ends at {first} and {last}");
            let longest = points.windows(2).map(|w| w[0].distance(w[1])).fold(0.0, f64::max);
            assert!(longest < 3.5, "{name}: a jump of {longest}");
        }
    }
}

/// Strands of neighbouring tufts share the room between them: no crack shows where one tuft ends and the next begins.
#[test]
fn cut_pile_is_closed() {
    let weave = Weave { warps: Extent::Yarns(24), wefts: Extent::Yarns(24), ..weave("velvet") };
    let cloth = weave.relax().unwrap();
    let [p, q] = cloth.measures().size.map(|size| 0.5 * size - 3.0);
    let is_tuft = |s: &PatternStrand| s.curve.points.iter().any(|p| p.z > 5.0);
    let tips: Vec<DVec2> = (cloth.strands().iter().filter(|s| is_tuft(s)))
        .flat_map(|s| [s.curve.points[0], s.curve.points[s.curve.points.len() - 1]].map(DVec3::truncate))
        .collect();
    let inside = tips.iter().filter(|at| at.x.abs() < p && at.y.abs() < q).count();
    let apart = (2.0 / 3f64.sqrt() * 4.0 * p * q / inside as f64).sqrt();
    // The place furthest from all tips, in distances of tips that stand evenly: in triangles that is 0.58.
    let widest = (0..400).fold(0.0, |widest: f64, i| {
        let at = DVec2::new(p * (f64::from(i % 20) / 9.5 - 1.0), q * (f64::from(i / 20) / 9.5 - 1.0));
        widest.max(tips.iter().map(|tip| tip.distance(at)).fold(f64::MAX, f64::min))
    });
    eprintln!("{} tips, {:.3}", tips.len(), widest / apart);
    assert!(widest < 0.85 * apart, "{widest} of {apart}");
}

/// Every fourth warp is twice as thick and has more room.
#[test]
fn threads_of_several_kinds_have_their_own_thickness_and_room() {
    let thickness = vec![0.8, 0.8, 1.6, 0.8];
    let spacing = vec![0.8, 1.0, 1.4, 0.8];
    let threads = [Threads { thickness, spacing }, Threads::default()];
    let warps = Extent::Yarns(8);
    let piece = Weave { threads, warps, warp_spacing: Some(4.0), ..Weave::of(Draft::named("twill 2/2").unwrap(), 1.0) };
    let cloth = piece.relax().unwrap();
    let strands = cloth.strands();
    let warps: Vec<&PatternStrand> = strands.iter().filter(|s| s.kind == StrandKind::Warp).collect();
    let mean_x = |s: &PatternStrand| s.curve.points.iter().map(|p| p.x).sum::<f64>() / s.curve.points.len() as f64;
    let gaps: Vec<f64> = warps.windows(2).map(|pair| mean_x(pair[1]) - mean_x(pair[0])).collect();
    // Neighbours slide aside, repeats do not.
    assert!((gaps[..4].iter().sum::<f64>() - 16.0).abs() < 1e-6 && (gaps[0] - gaps[4]).abs() < 1e-6, "{gaps:?}");
    // Beside the thick one there is more room, as the reed has it.
    assert!(gaps[1].min(gaps[2]) > 1.2 * gaps[0].max(gaps[3]), "{gaps:?}");
    // Equal area: half the width times half the height.
    for (warp, want) in warps.iter().zip([0.8, 0.8, 1.6, 0.8]) {
        let (wide, axes) = (warp.curve.radii.as_ref().unwrap(), warp.curve.flattening.as_ref().unwrap());
        let round = (wide[9] * wide[9] * f64::from(axes[9].length())).sqrt();
        assert!((round - want).abs() < 0.01, "{round} for {want}");
    }
    assert!((cloth.measures().size[0] - 32.0).abs() < 1e-9);
    let overlap = cloth.cell.overlap(piece.options().unit());
    assert!(overlap[1] < 0.03, "{overlap:?}");
}

/// Where yarns of one side lean aside together they have less room than their distance says.
#[test]
fn yarns_that_go_aside_keep_apart() {
    // Measured: 0.0, 0.026 and 0.0 of the length.
    for (name, most) in [("herringbone 2/2 8", 0.01), ("honeycomb", 0.045), ("leno", 0.01)] {
        let weave = Weave { edges: Edges::Live, flatten: 1.5, ..weave(name) };
        let strands = weave.strands().unwrap();
        let radius = |s: &PatternStrand| s.curve.radii.clone().unwrap_or_else(|| vec![0.5; s.curve.points.len()]);
        let curves: Vec<(Curve, Vec<f64>)> =
            strands.into_iter().map(|s| (radius(&s), s)).map(|(r, s)| (s.curve, r)).collect();
        let found = overlap(curves.iter().map(|(c, r)| (c, r.as_slice()))).unwrap();
        eprintln!("{name}: {found:?}");
        assert!(found.share < most && found.nearest > 0.85, "{name}: {found:?}");
    }
}

/// Yarns do not lie in each other in the folds of a hem, and cloth that is lower than two hems has none.
#[test]
fn hems_have_room_or_are_left_out() {
    let made = |draft: &str, wefts: u32| {
        let sides = [Extent::Yarns(12), Extent::Yarns(wefts)];
        let weave = Weave { edges: Edges::Finished, warps: sides[0], wefts: sides[1], flatten: 1.5, ..weave(draft) };
        let strands = weave.relax().unwrap().strands();
        let low = strands.iter().flat_map(|s| &s.curve.points).map(|p| p.z).fold(0.0, f64::min);
        (overlap_of(&strands), low)
    };
    for draft in ["plain", "twill 2/2", "satin 5", "basket 2", "herringbone 2/2 8", "huck"] {
        let (found, folded) = made(draft, 40);
        assert!(found.share < 0.02 && found.nearest > 0.7 && folded < -5.0, "{draft}: {found:?}, {folded}");
    }
    let (small, flat) = made("plain", 5);
    assert!(small.nearest > 0.9 && flat > -3.0, "{small:?}, {flat}");
    // The lowest cloth that has hems: one at the bottom and one at the top do not meet.
    for draft in ["plain", "twill 2/2", "satin 5", "basket 2"] {
        let flat = Weave { flatten: 1.5, ..weave(draft) };
        let measures = flat.relax().unwrap().measures();
        let fewest = (measures.least_hemmed() / measures.spacing[1]).ceil() as u32;
        let ((found, folded), (_, unfolded)) = (made(draft, fewest), made(draft, fewest - 1));
        assert!(found.share < 0.02 && found.nearest > 0.7, "{draft}, {fewest}: {found:?}");
        assert!(folded < -5.0 && unfolded > -5.0, "{draft}, {fewest}: {folded} {unfolded}");
    }
}

/// A distance given in another unit would have each yarn meet thousands of others.
#[test]
fn hopeless_spacings_are_refused_before_anything_is_relaxed() {
    for (given, cover) in [([Some(2e-3), None], None), ([None, Some(1e-12)], Some(0.7)), ([Some(0.3), Some(3.0)], None)]
    {
        let [warp_spacing, weft_spacing] = given;
        let cloth = Weave { warp_spacing, weft_spacing, cover, ..weave("satin 8") };
        match cloth.relax() {
            Err(Impossible::TooTight { warp, least }) => assert!(warp == given[0].is_some() && least > 1.0, "{least}"),
            other => panic!("{given:?}: {:?}", other.map(|c| c.measures())),
        }
    }
}
