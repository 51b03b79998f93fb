//! Cloth that is pressed together in its own plane, by a drape or by the body that it is moved out of, let out again.
//!
//! Real cloth does not take it: long before its stitches are half as wide it slides to where there is room. So edges that
//! are much shorter than in the flat panels push their ends apart, round by round (a strain limit, as in Provot,
//! "Deformation Constraints in a Mass-Spring Model to Describe Rigid Cloth Behavior", 1995), and what they move takes its
//! neighbours along. Points move by no more than edges are too short, and nothing else moves: as a drape comes to press
//! cloth from frame to frame it is let out by as much, without a jump.

use glam::DVec3;
use rayon::prelude::*;

use super::subdivide::Topology;

/// Edges are let out that are shorter than so many times their length on the flat panel.
const LEAST: f64 = 0.85;
/// Nor do others become longer for it than so many times their length, if they are not already.
const MOST: f64 = 1.15;
/// Rounds in which cloth settles, and after how many of them it is moved out of the body again.
const ROUNDS: usize = 64;
const BODY_EVERY: usize = 4;
/// How many edges away from what is pressed points may move.
const RINGS: usize = 16;
/// Which share of its neighbours' way a point goes in each round.
const ALONG: f64 = 0.05;
/// Which share of what an edge lacks each of its ends goes: half would do for one alone, and its neighbours hold it back.
const STEP: f64 = 0.9;

/// A neighbour of a point that may move: which point, and between which lengths the edge to it is kept.
struct Link {
    to: u32,
    least: f64,
    most: f64,
}

/// Lets out the edges of a mesh that are pressed together; `rest` is the length of each that is not. `keep_off` says where a point
/// goes that comes too near to a body. Gives the number of edges.
pub(super) fn settle(
    mesh: &Topology,
    rest: &[f64],
    points: &mut [DVec3],
    keep_off: &(impl Fn(usize, DVec3) -> DVec3 + Sync),
) -> usize {
    let long = |[a, b]: [u32; 2]| points[a as usize].distance(points[b as usize]);
    let is_pressed = |(ends, rest): &([u32; 2], &f64)| long(*ends) < LEAST * **rest;
    let pressed: Vec<[u32; 2]> =
        mesh.edge_ends().zip(rest).with_min_len(1024).filter(is_pressed).map(|(ends, _)| ends).collect();
    if pressed.is_empty() {
        return 0;
    }
    let (movable, place) = around(mesh, &pressed, points.len());
    let mut links: Vec<Vec<Link>> = movable.iter().map(|_| Vec::new()).collect();
    let near: Vec<([u32; 2], f64)> = mesh
        .edge_ends()
        .zip(rest)
        .with_min_len(1024)
        .filter(|([a, b], _)| place[*a as usize] != FIXED || place[*b as usize] != FIXED)
        .map(|(ends, rest)| (ends, *rest))
        .collect();
    for (ends, rest) in near {
        let (least, most) = (LEAST * rest, long(ends).max(MOST * rest));
        for [from, to] in [ends, [ends[1], ends[0]]] {
            if let Some(own) = links.get_mut(place[from as usize] as usize) {
                own.push(Link { to, least, most });
            }
        }
    }
    let start: Vec<DVec3> = movable.iter().map(|&v| points[v as usize]).collect();
    let mut moved = vec![DVec3::ZERO; movable.len()];
    for round in 1..=ROUNDS {
        let apart = |(i, own): (usize, &DVec3)| *own + push(points[movable[i] as usize], &links[i], points);
        let pushed: Vec<DVec3> = moved.par_iter().enumerate().with_min_len(64).map(apart).collect();
        let along = |i: usize| {
            let of = |link: &Link| pushed.get(place[link.to as usize] as usize).copied().unwrap_or_default();
            let mean = links[i].iter().map(of).sum::<DVec3>() / links[i].len().max(1) as f64;
            let to = start[i] + pushed[i].lerp(mean, ALONG);
            let to = if round % BODY_EVERY == 0 { keep_off(movable[i] as usize, to) } else { to };
            to - start[i]
        };
        moved = (0..movable.len()).into_par_iter().with_min_len(64).map(along).collect();
        for ((&v, start), moved) in movable.iter().zip(&start).zip(&moved) {
            points[v as usize] = *start + *moved;
        }
    }
    pressed.len()
}

/// In place of the number of a point that does not move.
const FIXED: u32 = u32::MAX;

/// The points at edges and around them, in rising order of their rings; and the place of each point of the mesh among them.
fn around(mesh: &Topology, edges: &[[u32; 2]], points: usize) -> (Vec<u32>, Vec<u32>) {
    let mut place = vec![FIXED; points];
    let mut found: Vec<u32> = Vec::new();
    let mut add = |v: u32, found: &mut Vec<u32>| {
        if place[v as usize] == FIXED {
            place[v as usize] = found.len() as u32;
            found.push(v);
        }
    };
    edges.iter().flatten().for_each(|&v| add(v, &mut found));
    let mut done = 0;
    for _ in 0..RINGS {
        let ring = done..found.len();
        done = ring.end;
        for i in ring {
            mesh.around_of(found[i] as usize).iter().for_each(|&v| add(v, &mut found));
        }
    }
    (found, place)
}

/// Where a point is pushed by the edges at it that are too short or too long: the mean over them.
fn push(at: DVec3, links: &[Link], points: &[DVec3]) -> DVec3 {
    let (mut sum, mut count) = (DVec3::ZERO, 0);
    for link in links {
        let from = at - points[link.to as usize];
        let length = from.length();
        let wanted = length.clamp(link.least, link.most);
        if wanted != length {
            sum += from.normalize_or_zero() * (STEP * (wanted - length));
            count += 1;
        }
    }
    sum / f64::from(count.max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: f64 = 5.0;
    const COLUMNS: usize = 48;
    const ROWS: usize = 12;

    /// A strip whose middle is pressed to a share of its width, with the flat lengths of its edges.
    fn pressed(share: f64) -> (Topology, Vec<f64>, Vec<DVec3>) {
        let flat = |i: usize, j: usize| DVec3::new(i as f64 * SIZE, j as f64 * SIZE, 0.0);
        let x = |i: usize| {
            // Four columns of it.
            let within = (i as f64 - 22.0).clamp(0.0, 4.0);
            (i as f64 - within * (1.0 - share)) * SIZE
        };
        let all = || (0..=ROWS).flat_map(|j| (0..=COLUMNS).map(move |i| (i, j)));
        let points: Vec<DVec3> = all().map(|(i, j)| DVec3::new(x(i), j as f64 * SIZE, 0.0)).collect();
        let corner = |i: usize, j: usize| (j * (COLUMNS + 1) + i) as u32;
        let faces: Vec<[u32; 3]> = (0..ROWS)
            .flat_map(|j| (0..COLUMNS).map(move |i| (i, j)))
            .flat_map(|(i, j)| {
                let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
                [[a, b, c], [a, c, d]]
            })
            .collect();
        let mesh = Topology::new(faces, points.len());
        let flat: Vec<DVec3> = all().map(|(i, j)| flat(i, j)).collect();
        let rest = mesh.edge_lengths(|face, k| {
            let f = mesh.faces[face];
            flat[f[k] as usize].distance(flat[f[(k + 1) % 3] as usize])
        });
        (mesh, rest, points)
    }

    /// The least length of an edge over its flat one.
    fn shortest(mesh: &Topology, rest: &[f64], points: &[DVec3]) -> f64 {
        let ratio = |([a, b], rest): ([u32; 2], &f64)| points[a as usize].distance(points[b as usize]) / rest;
        mesh.edge_ends().zip(rest).map(ratio).min_by(f64::total_cmp).unwrap()
    }

    fn stays(_: usize, at: DVec3) -> DVec3 {
        at
    }

    #[test]
    fn pressed_cloth_slides_to_where_there_is_room() {
        let (mesh, rest, before) = pressed(0.4);
        let mut points = before.clone();
        assert!(settle(&mesh, &rest, &mut points, &stays) > 40);
        let (worst, least) = (shortest(&mesh, &rest, &before), shortest(&mesh, &rest, &points));
        assert!(worst < 0.41 && least > 0.75, "{worst} {least}");
        // Far away nothing moves, and what moves stays in the plane.
        for (p, q) in points.iter().zip(&before).filter(|(_, q)| (q.x - 117.0).abs() > 100.0) {
            assert_eq!(p, q);
        }
        assert!(points.iter().all(|p| p.z == 0.0));
    }

    /// From frame to frame cloth is let out by as much as it is pressed, and not at all before.
    #[test]
    fn letting_out_sets_in_without_a_jump() {
        let settled = |share: f64| {
            let (mesh, rest, before) = pressed(share);
            let mut points = before.clone();
            let edges = settle(&mesh, &rest, &mut points, &stays);
            let most = points.iter().zip(&before).map(|(p, q)| p.distance(*q)).fold(0.0, f64::max);
            (edges, most, points)
        };
        assert_eq!((settled(0.851).0, settled(0.851).1), (0, 0.0));
        let (edges, most, _) = settled(0.849);
        assert!(edges > 0 && most < 0.02 * SIZE, "{edges} {most}");
        let [a, b] = [0.5, 0.501].map(|share| settled(share).2);
        let most = a.iter().zip(&b).map(|(p, q)| p.distance(*q)).fold(0.0, f64::max);
        assert!(most < 0.02 * SIZE, "{most}");
    }

    #[test]
    fn what_is_let_out_keeps_off_a_body() {
        let (mesh, rest, mut points) = pressed(0.4);
        // A ball that touches the strip from below.
        let middle = DVec3::new(117.0, 30.0, -20.0);
        let keep_off = |_: usize, at: DVec3| match (at - middle).length() {
            far if far >= 22.0 => at,
            near => middle + (at - middle) / near * 22.0,
        };
        points.iter_mut().for_each(|p| *p = keep_off(0, *p));
        settle(&mesh, &rest, &mut points, &keep_off);
        assert!(points.iter().all(|p| p.distance(middle) > 21.9999));
        assert!(shortest(&mesh, &rest, &points) > 0.7);
    }
}
