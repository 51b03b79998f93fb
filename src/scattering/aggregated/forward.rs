//! Lobe F: light that passes the fibres it meets as TT, each of which bends it, until it is out (docs/model.md, section 5).

use std::f32::consts::{PI, TAU};

use arrayvec::ArrayVec;
use glam::Vec3A;

use super::{
    super::{
        kernel::{normalised_kernel, sample_sine},
        lobe::LobeFrame,
        medium::TtWidth,
    },
    Spot, Turned, View,
    ahead::{FibersAhead, PliesAhead, STRETCHES, Stretch, nearest, plies_ahead},
    way_in::{Place, WayIn},
};
use crate::{
    geometry::{
        after_fiber::AfterTurn,
        gaps::PlyGaps,
        section::{Crossings, PlyCrossing},
    },
    math::{Rgb, sampler::Stream, special::wrapped_normal, warp::normal},
};

/// Density (1/steradian) of F's directions below which the lobe ends. What little it would have there ends its chain
/// instead, and most light that comes from elsewhere pays nothing for F.
const FORWARD_TAIL: f32 = 1e-4;
/// The most fibres to which light is followed, one by one. The last lets all out that it passes on.
const FOLLOWED: usize = 16;
/// Its index.
const LAST: usize = FOLLOWED - 1;
/// Below such a share of what the first fibre passes on, light is followed farther by chance only: where light is sampled at
/// the vertex, which sees all of F, and where it is not. There a path takes one way on whether F ends before or is not chosen.
const LITTLE: [f32; 2] = [0.25, 1.0];

/// Light that the first fibre on the camera's ray passes on, for one such fibre and one way on from it.
#[derive(Clone, Debug)]
pub(super) struct Forward {
    /// The fibres that it meets, one after the other: at least one.
    pub(super) fibers: ArrayVec<Fiber, FOLLOWED>,
    /// Where the first of them is, if that is on the camera's ray.
    first: Option<First>,
    /// About the share of light that leaves from a node where F does not, and the path's weight: they decide between both.
    pub(super) gain: Rgb,
    pub(super) weight: Rgb,
    /// A direction drawn from the lobe.
    pub(super) drawn: Drawn,
}

/// A fibre that the camera's ray meets first, where the gaps between fibres have it.
#[derive(Clone, Copy, Debug)]
struct First {
    crossing: PlyCrossing,
    depth: f32,
    /// How far its middle is beside the ray, in the circle of the ply's radius.
    beside: f32,
}

impl First {
    /// The same where packings have it, from where its own light leaves.
    #[inline]
    fn of_packings(&self, view: &View<'_>, by_gaps: &Spot) -> Spot {
        let Self { crossing, depth, beside } = self;
        let shape = view.yarn.occluder().shape();
        let counted = view.section.first_depth(shape, crossing, &by_gaps.inside, *depth, *beside);
        Spot { deeper: counted - depth, ..view.first_spot(crossing, counted, *beside) }
    }
}

/// A place where light ends its chain.
#[derive(Clone, Copy, Debug)]
pub(super) struct ChainEnd {
    pub(super) spot: Spot,
    /// How the light came there.
    pub(super) way_in: WayIn,
    /// The camera's ray in the ply, or in the first one if it does not meet this.
    pub(super) crossing: PlyCrossing,
    /// The camera's part along the first fibre of its ply that the light met, whose own part along the yarn is 1.
    pub(super) axial: f32,
    /// Its energy there over the chance that it was drawn.
    pub(super) amplitude: Rgb,
}

/// A fibre on the way of F.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fiber {
    pub(super) spot: Spot,
    /// About its tangent; the camera of this frame is where the light came from.
    frame: LobeFrame,
    /// What this fibre and those before it pass on.
    passed: Rgb,
    /// Of what those before it pass on: what ends its chain here.
    ended: Rgb,
    /// The width of its TT.
    width: TtWidth,
    /// Where the light came from, across the fibre.
    pub(super) back: Vec3A,
    /// Whether it came from another fibre of the same ply.
    later: bool,
}

/// A direction of F.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drawn {
    pub(super) direction: Vec3A,
    /// Value over density: at most 1, since the light came this way or ended its chain.
    pub(super) share: Rgb,
    pub(super) pdf: f32,
    /// The chance that a path goes on this way.
    pub(super) chance: f32,
}

impl Drawn {
    const NOTHING: Self = Self { direction: Vec3A::ZERO, share: Rgb::ZERO, pdf: 0.0, chance: 0.0 };

    fn new(direction: Vec3A, part: &Part) -> Self {
        let share = if part.pdf > 0.0 { part.value / part.pdf } else { Rgb::ZERO };
        Self { direction, share, pdf: part.pdf, chance: part.chance }
    }
}

/// A part of what F sends in one direction.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Part {
    /// With the cosine, 1/steradian, over 1 - T0.
    pub(super) value: Rgb,
    /// Density of drawing the direction, 1/steradian.
    pub(super) pdf: f32,
    /// The chance that a path goes on this way, were this the direction drawn.
    pub(super) chance: f32,
}

impl Part {
    /// The density with which a path goes on this way, 1/steradian.
    #[inline]
    pub(super) fn density(&self) -> f32 {
        self.chance * self.pdf
    }
}

/// A ply on a way out.
#[derive(Clone, Copy, Debug)]
struct PlyOnWay {
    fibers: FibersAhead,
    gaps: PlyGaps,
    /// Whether the way begins in it, at a fibre.
    own: bool,
    /// The share of light that meets none of them.
    through: f32,
}

impl Stretch for PlyOnWay {
    fn through(&self) -> f32 {
        self.through
    }

    fn begins(&self) -> f32 {
        self.fibers.distance_past(0.0)
    }

    fn meets(&self, left: f32) -> f32 {
        let Self { fibers, gaps, own, through } = self;
        fibers.distance_past(if *own {
            gaps.fibers_to_next(fibers.expected, (1.0 - left) / (1.0 - through))
        } else {
            gaps.fibers_passed(left)
        })
    }
}

/// A ply on the camera's ray.
#[derive(Clone, Copy)]
struct Crossed<'v>(&'v View<'v>, PlyCrossing);

impl Stretch for Crossed<'_> {
    fn through(&self) -> f32 {
        self.1.gaps.unscattered(self.1.fibers)
    }

    fn begins(&self) -> f32 {
        self.1.enter
    }

    fn meets(&self, left: f32) -> f32 {
        let Self(view, crossing) = self;
        let met = crossing.gaps.fibers_passed(left).min(crossing.fibers);
        view.depth(crossing, crossing.share_before(met))
    }
}

/// A straight way on from a fibre.
#[derive(Clone, Copy, Debug)]
struct Way<'a> {
    w: Vec3A,
    /// From the fibre's place to where the way begins.
    shift: Vec3A,
    /// How far from there on fibres of other plies are.
    free: f32,
    /// What it meets in the own ply.
    after: AfterTurn<'a>,
}

impl Forward {
    /// Draws the first fibre that a ray meets, and a way out from there. `weight` is the path's; two numbers draw the first fibre and on which side of
    /// the ray it is. `None` if there is none.
    #[inline]
    pub(super) fn draw(
        view: &View<'_>,
        crossings: &Crossings,
        unscattered: f32,
        (weight, lit): (Rgb, bool),
        [u_first, u_side]: [f32; 2],
        stream: &mut Stream,
    ) -> Option<Self> {
        let crossed = crossings.iter().map(|crossing| Crossed(view, *crossing));
        let (Crossed(_, crossing), depth) = nearest(crossed, 1.0 - u_first * (1.0 - unscattered), stream)?;
        let beside = view.section.first_beside(view.yarn.occluder().shape(), &crossing, u_side);
        let spot = view.first_spot(&crossing, depth, beside);
        let fiber = Fiber::new(view, spot, (view.camera, false), Rgb::ONE);
        let little = LITTLE[usize::from(!lit)] * (fiber.passed * weight).max_channel();
        let mut forward = Self::new(view, &fiber, weight);
        forward.first = Some(First { crossing, depth, beside });
        forward.follow(view, fiber, little, stream);
        Some(forward)
    }

    /// Light of a path's weight that has not been followed yet, from a fibre.
    #[inline]
    pub(super) fn new(view: &View<'_>, first: &Fiber, weight: Rgb) -> Self {
        let gain = view.yarn.node_gain[first.spot.ply];
        Self { fibers: ArrayVec::new(), first: None, gain, weight, drawn: Drawn::NOTHING }
    }

    /// Follows light from a fibre to the next, and so on, until it is out or ends by chance, which it may where `little` is passed on.
    #[inline]
    pub(super) fn follow(&mut self, view: &View<'_>, first: Fiber, little: f32, stream: &mut Stream) {
        let mut next = Some(first);
        while let Some(mut fiber) = next.take() {
            let passed = (fiber.passed * self.weight).max_channel();
            if passed < little {
                if stream.next() * little >= passed {
                    // It may end here, and goes on no farther.
                    fiber.passed = Rgb::ZERO;
                } else {
                    fiber.passed *= little / passed;
                }
            }
            if fiber.passed.max_channel() <= 0.0 {
                self.fibers.push(fiber);
                break;
            }
            // Of light that goes on so much is left where it meets the next one.
            let left = stream.next();
            let way = fiber.way(view, fiber.direction(stream));
            let mut stretches = ArrayVec::<PlyOnWay, STRETCHES>::new();
            let through = if self.fibers.len() == LAST {
                1.0
            } else {
                fiber.follow_way(view, &way, |stretch| {
                    let _ = stretches.try_push(stretch);
                })
            };
            if left < through {
                self.drawn = Drawn::new(way.w, &self.part(view, &fiber, fiber.lobe(way.w), through));
            } else {
                stretches.sort_unstable_by(|a, b| a.fibers.foot.total_cmp(&b.fibers.foot));
                next = fiber.next(view, &way, (&stretches, left), stream);
            }
            if next.is_none() {
                // What F does not send out.
                fiber.ended = (fiber.ended + fiber.passed - self.drawn.share).max(Rgb::ZERO);
            }
            self.fibers.push(fiber);
        }
    }

    /// A fibre at which light ends its chain, which `u` draws: where, how many fibres passed it on before, and its energy over the chance to
    /// draw it. `None` if no light leaves.
    #[inline]
    pub(super) fn end(&self, view: &View<'_>, crossings: &Crossings, u: f32) -> Option<ChainEnd> {
        let leaves = |fiber: &Fiber| (fiber.ended * view.yarn.node_gain[fiber.spot.ply]).weighted_mean(self.weight);
        let energies: ArrayVec<f32, FOLLOWED> = self.fibers.iter().map(leaves).collect();
        let total: f32 = energies.iter().sum();
        let mut left = u * total;
        let (mut drawn, mut energy) = (None, 0.0);
        for (before, &own) in energies.iter().enumerate().filter(|(_, own)| **own > 0.0) {
            (drawn, energy) = (Some(before), own);
            if left < own {
                break;
            }
            left -= own;
        }
        let before = drawn?;
        let Fiber { spot, back, ended, .. } = self.fibers[before];
        let spot = self.first.filter(|_| before == 0).map_or(spot, |first| first.of_packings(view, &spot));
        let crossing = *crossings.iter().find(|crossing| crossing.ply == spot.ply).or(crossings.first())?;
        let first = &self.fibers[0].spot;
        let axial = if first.ply == spot.ply { first } else { &spot }.axial(view.camera);
        let amplitude = ended * (total / energy);
        let of_ply = self.fibers[..before].iter().rev().take_while(|fiber| fiber.spot.ply == spot.ply);
        let way_in =
            WayIn::new(back, before, of_ply.map(|fiber| Place { at: fiber.spot.inside.point, back: fiber.back }));
        Some(ChainEnd { spot, way_in, crossing, axial, amplitude })
    }

    /// F towards `w`: what leaves from the place of each of the fibres.
    #[inline]
    pub(super) fn toward(&self, view: &View<'_>, w: Vec3A, mut visit: impl FnMut(&Fiber, Part)) {
        for (index, fiber) in self.fibers.iter().enumerate() {
            let lobe = fiber.lobe(w);
            if lobe.0 >= FORWARD_TAIL && fiber.passed != Rgb::ZERO {
                let through = if index == LAST { 1.0 } else { fiber.follow_way(view, &fiber.way(view, w), |_| {}) };
                visit(fiber, self.part(view, fiber, lobe, through));
            }
        }
    }

    /// The density with which a path goes on as F towards `w`, whichever of its parts that belongs to, 1/steradian.
    pub(super) fn density(&self, view: &View<'_>, w: Vec3A) -> f32 {
        let mut density = 0.0;
        self.toward(view, w, |_, part| density += part.density());
        density
    }

    /// What leaves from a fibre by its lobe, of which the share `through` meets no other on the way out.
    #[inline]
    fn part(&self, view: &View<'_>, fiber: &Fiber, (lobe, around): (f32, f32), through: f32) -> Part {
        let pdf = lobe * through;
        if pdf < FORWARD_TAIL {
            return Part::default();
        }
        let share = view.yarn.plies[fiber.spot.ply].chain_share;
        let even = (1.0 - share) / TAU;
        // What is drawn for all channels together holds the lobe of each but for rare directions.
        let share = (fiber.passed * ((1.0 - even / around).max(0.0) / share)).min(Rgb::ONE);
        let passed = share.weighted_mean(self.weight);
        let ended = ((Rgb::ONE - share) * self.gain).weighted_mean(self.weight);
        Part { value: share * pdf, pdf, chance: if passed > 0.0 { passed / (passed + ended) } else { 0.0 } }
    }
}

impl Fiber {
    /// A fibre that light meets on its way against `from`, of which those before it have passed on a share; `later` says whether it came from one of
    /// the same ply.
    #[inline]
    fn new(view: &View<'_>, spot: Spot, (from, later): (Vec3A, bool), passed: Rgb) -> Self {
        let optics = &view.yarn.plies[spot.ply];
        Self {
            spot,
            frame: LobeFrame::new(spot.tangent, from),
            passed: passed * optics.chain,
            ended: passed * (Rgb::ONE - optics.chain),
            width: optics.tt,
            back: spot.across(from).normalize_or_zero(),
            later,
        }
    }

    /// A direction of its lobe.
    #[inline]
    fn direction(&self, stream: &mut Stream) -> Vec3A {
        let u_azimuth = stream.next();
        let u = [stream.next(), stream.next()];
        let sin = sample_sine(self.width.kappa, self.frame.sin, self.frame.cos, u, stream);
        self.frame.direction(sin, PI + self.width.sigma * normal(u_azimuth))
    }

    /// Its lobe of TT with the cosine, 1/steradian, and the part around the fibre, 1/radian.
    #[inline]
    fn lobe(&self, w: Vec3A) -> (f32, f32) {
        let width = &self.width;
        let (at, cos) = self.frame.latitudes(w);
        let [along, ..] = normalised_kernel(Rgb::splat(width.kappa), Rgb::splat(width.factor), at).to_array();
        if along * cos < FORWARD_TAIL * 1e-4 {
            return (0.0, 1.0);
        }
        let off = w.dot(self.frame.y).atan2(w.dot(self.frame.x)) - PI;
        let around = wrapped_normal(off, width.sigma);
        (along * cos * around, around)
    }

    /// The way in the direction `w`.
    #[inline]
    fn way<'a>(&self, view: &View<'a>, w: Vec3A) -> Way<'a> {
        let Turned { cos: turn, shift, free, .. } = self.spot.turned(view, self.back, w);
        let Spot { ply, inside, .. } = &self.spot;
        let short = inside.along_short_axis(view.yarn.occluder().shape(), *ply, w);
        let after = view.yarn.plies[*ply].after.turned(self.later, turn, short);
        Way { w, shift, free, after }
    }

    /// The share of light on a way that meets no other fibre; `visit` is told of the plies there, in no order. The fibre's own chord keeps
    /// others away.
    #[inline]
    fn follow_way(&self, view: &View<'_>, way: &Way<'_>, mut visit: impl FnMut(PlyOnWay)) -> f32 {
        let (yarn, spot) = (view.yarn, &self.spot);
        let shape = yarn.occluder().shape();
        let mut all = 1.0;
        let mut ahead = PliesAhead::new();
        plies_ahead(view, spot, (way.shift, way.w), Some(0.0), way.free, &mut ahead);
        for &fibers in &ahead {
            let gaps = yarn.plies[fibers.ply].gaps;
            let own = fibers.ply == spot.ply;
            let through = if own {
                let by_rim = shape.plies[fibers.ply].by_rim(fibers.offset);
                (-gaps.rate * way.after.met(fibers.expected, by_rim)).exp()
            } else {
                gaps.unscattered(fibers.expected)
            };
            all *= through;
            visit(PlyOnWay { fibers, gaps, own, through });
        }
        all
    }

    /// The fibre that light meets next on a way that these plies lie on, where so much of it is left.
    #[inline]
    fn next(
        &self,
        view: &View<'_>,
        way: &Way<'_>,
        (plies, left): (&[PlyOnWay], f32),
        stream: &mut Stream,
    ) -> Option<Self> {
        let (met, distance) = nearest(plies.iter().copied(), left, stream)?;
        let shape = view.yarn.occluder().shape();
        let inside = view.section.beyond(shape, &self.spot.inside, way.shift, way.w, distance);
        let spot = Spot::new(view, met.fibers.ply, inside);
        let later = spot.ply == self.spot.ply;
        Some(Self::new(view, spot, (-way.w, later), self.passed))
    }
}
