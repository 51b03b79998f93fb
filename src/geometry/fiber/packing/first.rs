//! How deep the first fibre on a line lies, counted on packings: [`FirstFiber`] maps the depths by the gaps to those.

use glam::DVec2;

use super::{
    line::Line,
    lines::{Lines, Scales},
};
use crate::{
    geometry::{first_fiber::FirstFiber, gaps::PlyGaps, ply::PlyShape},
    math::sampler::Stream,
};

/// A first fibre: its depth in fibre radii below the end of the chord on which centres lie, and how much its line counts as one by the rim.
struct First {
    depth: f32,
    by_rim: f32,
}

/// Of as many first fibres as the gaps have above each depth of a knot, the deepest: on random lines, or on lines along both axes of a pressed section.
pub(super) fn first(lines: &Lines, sections: &[Vec<DVec2>], ply: &PlyShape) -> FirstFiber {
    const RAYS: usize = 16_000;
    let [long, short] = if lines.stretch == 1.0 {
        [on_lines(lines, sections, ply, RAYS, None); 2]
    } else {
        [DVec2::X, DVec2::Y].map(|axis| on_lines(lines, sections, ply, RAYS / 2, Some(axis)))
    };
    let [inside, rim] = [0, 1].map(|place| std::array::from_fn(|knot| [long[place][knot], short[place][knot]]));
    FirstFiber { inside, rim }
}

/// The same on so many lines, along an axis or in all directions: inside and by the rim.
fn on_lines(
    lines: &Lines,
    sections: &[Vec<DVec2>],
    ply: &PlyShape,
    rays: usize,
    axis: Option<DVec2>,
) -> [[f32; FirstFiber::KNOTS]; 2] {
    /// From this depth on less of the difference counts, and none at the last knot. Light goes on from deep places by the rim alone, where few
    /// are that deep: as the gaps have it, and not as lines that are near to each other have it together.
    const ALL: f32 = 1.5;
    let mut stream = Stream::new(0xf125);
    let (mut counted, mut by_gaps) = (Vec::with_capacity(rays), Vec::with_capacity(rays));
    for ray in 0..rays {
        let line = Line::random(lines, &sections[ray % sections.len()], axis, &mut stream);
        let seen = Seen::new(lines, ply, &line);
        counted.extend(seen.counted(lines, &line));
        by_gaps.extend(seen.by_gaps([stream.next(), stream.next()]));
    }
    [|of: &First| 1.0 - of.by_rim, |of: &First| of.by_rim].map(|weight: fn(&First) -> f32| {
        let [counted, by_gaps] =
            [&counted, &by_gaps].map(|all| Ranks::new(all.iter().map(|of| [of.depth, weight(of)])));
        let last = FirstFiber::of_gaps(FirstFiber::KNOTS - 1);
        std::array::from_fn(|knot| {
            let of_gaps = FirstFiber::of_gaps(knot);
            let differs = counted.at(by_gaps.before(of_gaps)).map_or(0.0, |depth| depth - of_gaps);
            of_gaps + ((last - of_gaps) / (last - ALL)).min(1.0) * differs
        })
    })
}

/// Numbers in order, each with the weight of all up to it.
struct Ranks(Vec<[f32; 2]>);

impl Ranks {
    /// Of numbers and their weights.
    fn new(of: impl Iterator<Item = [f32; 2]>) -> Self {
        let mut all: Vec<_> = of.filter(|[_, weight]| *weight > 0.0).collect();
        all.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
        let mut sum = 0.0;
        for [_, weight] in &mut all {
            sum += *weight;
            *weight = sum;
        }
        Self(all)
    }

    fn all(&self) -> f32 {
        self.0.last().map_or(0.0, |[_, sum]| *sum)
    }

    /// The share of the weight that is below a number.
    fn before(&self, number: f32) -> f32 {
        match self.0.partition_point(|[own, _]| *own < number) {
            0 => 0.0,
            count => self.0[count - 1][1] / self.all(),
        }
    }

    /// The number below which a share of the weight is. `None` of none.
    fn at(&self, share: f32) -> Option<f32> {
        let wanted = share * self.all();
        let index = self.0.partition_point(|[_, sum]| *sum < wanted).min(self.0.len().checked_sub(1)?);
        Some(self.0[index][0])
    }
}

/// A line as the model sees it: in the circle that the section becomes when its axes are made equal.
struct Seen<'a> {
    ply: &'a PlyShape,
    /// How far beside the middle it is.
    offset: f32,
    scales: Scales,
    /// Where the middle of its chord is, from the point nearest to the middle of the section.
    foot: f64,
    /// How many more fibres it meets than untwisted ones.
    squeeze: f32,
}

impl<'a> Seen<'a> {
    fn new(lines: &Lines, ply: &'a PlyShape, line: &Line<'_>) -> Self {
        let across = line.along.perp();
        let scales = lines.scales(across);
        let foot = lines.middle(line.offset * across, line.along);
        let [offset, squeeze] = [line.offset / scales.reach, lines.stretch.sqrt()].map(|v| v as f32);
        Self { ply, offset, scales, foot, squeeze }
    }

    /// One at a depth.
    fn first(&self, depth: f32) -> First {
        First { depth, by_rim: self.ply.first_by_rim(self.offset) }
    }

    /// The one that it meets, if it meets any.
    fn counted(&self, lines: &Lines, line: &Line<'_>) -> Option<First> {
        let hits = line.hits(lines);
        let first = hits.iter().min_by(|a, b| a.enter.total_cmp(&b.enter))?;
        let middle = line.discs[first.fiber].dot(line.along.perp()) as f32 * self.scales.wide;
        let half = self.squeeze * self.ply.half_chord(middle, self.scales.wide) / self.scales.length;
        let depth = half + (first.lies - self.foot) as f32;
        Some(self.first(depth / lines.radius as f32))
    }

    /// One that the gaps draw by two numbers, if they draw any.
    fn by_gaps(&self, u: [f32; 2]) -> Option<First> {
        let chord = self.scales.chord(self.ply, self.offset);
        let gaps = PlyGaps::new(self.ply.dead_zone(&chord, self.offset, self.scales.length));
        let fibers = self.squeeze * chord.total();
        let through = gaps.unscattered(fibers);
        if u[0] < through {
            return None;
        }
        let met = gaps.fibers_passed(1.0 - u[1] * (1.0 - through)).min(fibers);
        let depth = chord.half - chord.place(met / fibers.max(1e-20));
        Some(self.first(depth / (self.scales.thin * self.ply.fiber_radius)))
    }
}

#[cfg(test)]
mod tests {
    use super::{
        super::tests::{measured_ply, other_sections},
        *,
    };
    use crate::geometry::density::KnownPacking;

    #[test]
    fn first_fibers_lie_as_deep_as_in_other_packings() {
        const NEAR: f32 = 1.5;
        for (count, density, stretch) in [(60u32, 0.2f64, 1.0), (60, 0.45, 1.0), (100, 0.55, 1.0), (100, 0.4, 1.5)] {
            let (lines, ply) = measured_ply(count, density, stretch, KnownPacking::default());
            let first = ply.first.unwrap();
            let sections = other_sections(count, density, stretch);
            for (axis, short) in [(DVec2::X, 0.0), (DVec2::Y, 1.0)] {
                let mut stream = Stream::new(9);
                // Inside and by the rim: how deep they are, as far as they are near, and how many; as counted, by the model, by the gaps alone.
                let mut sums = [[[0.0f64; 2]; 3]; 2];
                for ray in 0..60_000 {
                    let line = Line::random(&lines, &sections[ray % sections.len()], Some(axis), &mut stream);
                    let seen = Seen::new(&lines, &ply, &line);
                    let by_gaps = seen.by_gaps([stream.next(), stream.next()]);
                    let mapped = by_gaps.as_ref().map(|of| First {
                        depth: first.depth(of.depth, of.by_rim, if stretch == 1.0 { 0.5 } else { short }),
                        by_rim: of.by_rim,
                    });
                    for (way, met) in [seen.counted(&lines, &line), mapped, by_gaps].iter().enumerate() {
                        let Some(First { depth, by_rim }) = met else { continue };
                        for (sums, weight) in sums.iter_mut().zip([1.0 - by_rim, *by_rim]) {
                            sums[way][0] += f64::from(weight * depth.clamp(0.0, NEAR));
                            sums[way][1] += f64::from(weight);
                        }
                    }
                }
                for (place, sums) in sums.iter().enumerate() {
                    let [counted, mapped, by_gaps] = sums.map(|[depth, all]| depth / all);
                    let case = format!("{count} at {density}, {stretch}, along {axis}, by the rim {place}");
                    assert!((mapped - counted).abs() < 0.1, "{case}: {mapped}, counted {counted}, by gaps {by_gaps}");
                }
            }
        }
    }
}
