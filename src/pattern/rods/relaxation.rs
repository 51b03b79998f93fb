//! A relaxation under way: step by step until forces are small.

use glam::{DVec2, DVec3};

#[cfg(test)]
use super::passing;
use super::{APART, CONTACT, Fire, MANY, MARGIN, Rods, Run, STEP, Step, TIME, Work, sums};

impl Rods {
    /// Relaxes; gives the steps it took and the largest force that is left.
    pub(in super::super) fn relax(&mut self, run: &Run) -> (usize, f64) {
        if self.points.is_empty() {
            return (0, 0.0);
        }
        let mut relaxation = Relaxation::new(self, run);
        for step in 0..run.steps {
            if relaxation.step(self, step) {
                return (step, relaxation.largest);
            }
        }
        (run.steps, relaxation.largest)
    }
}

struct Relaxation<'a> {
    run: &'a Run,
    /// Whether a segment begins at a point.
    has: Vec<bool>,
    work: Work,
    speeds: Vec<DVec3>,
    /// A cell's size moves as if it weighed as much as what is in it.
    weight: f64,
    cell_speed: DVec2,
    fire: Fire,
    /// Where points were when what is near each of them was looked for, and whether any has gone too far since then.
    before: Vec<DVec3>,
    gone: bool,
    /// How far the cell's rim has moved since that was done for all.
    strained: f64,
    /// The largest force of the last step.
    largest: f64,
}

impl<'a> Relaxation<'a> {
    fn new(rods: &Rods, run: &'a Run) -> Self {
        let n = rods.points.len();
        Self {
            run,
            has: rods.has_segment(),
            work: Work { on_strands: rods.on_strands(), ..Work::default() },
            speeds: vec![DVec3::ZERO; n],
            weight: (n as f64).sqrt(),
            cell_speed: DVec2::ZERO,
            fire: Fire::new(TIME / run.firm.max(1.0).sqrt()),
            before: Vec::new(),
            gone: n > 0,
            strained: 0.0,
            largest: 0.0,
        }
    }

    /// One step; tells whether all is calm, in place of moving.
    fn step(&mut self, rods: &mut Rods, step: usize) -> bool {
        let Run { growing, thin, calm, .. } = *self.run;
        let grown = if growing > 0 { (step as f64 / growing as f64).min(1.0) } else { 1.0 };
        self.look(rods);
        let cell_force = self.forces(rods, APART * (thin + (1.0 - thin) * grown));
        let [power, force2, speed2, max2] = sums(&self.work.forces, &self.speeds);
        let power = power + cell_force.dot(self.cell_speed);
        let force = (force2 + cell_force.length_squared()).sqrt();
        let speed = (speed2 + self.cell_speed.length_squared()).sqrt();
        self.largest = max2.sqrt();
        let still = self.largest < calm && cell_force.length() < calm * self.weight * 0.02;
        if grown >= 1.0 && step > growing && still {
            return true;
        }
        let (keep, turn) = self.fire.adapt(power, force, speed);
        self.go(rods, cell_force, keep, turn);
        false
    }

    /// Looks for neighbours again where points have gone far.
    fn look(&mut self, rods: &Rods) {
        if self.gone {
            // Those too that will soon have gone too far.
            let far = (0.25 * MARGIN - self.strained).max(0.0).powi(2);
            let places = rods.points.iter().zip(&self.before);
            let moved: Vec<bool> = places.map(|(p, before)| p.distance_squared(*before) > far).collect();
            let count = moved.iter().filter(|moved| **moved).count();
            if self.before.is_empty() || count > moved.len() / MANY {
                rods.search(&self.has, &mut self.work);
                self.before.clone_from(&rods.points);
                self.strained = 0.0;
            } else {
                rods.search_again(&self.has, &rods.segments_of(&moved), &mut self.work);
                let places = self.before.iter_mut().zip(&rods.points).zip(moved);
                places.filter(|(_, moved)| *moved).for_each(|((before, p), _)| *before = *p);
            }
        }
    }

    /// Forces on points, for yarns that keep so far `apart`; gives that on the cell's width and height.
    fn forces(&mut self, rods: &Rods, apart: f64) -> DVec2 {
        let Run { firm, press, load, free, .. } = *self.run;
        let virial = rods.forces(&self.has, apart, CONTACT * firm, &mut self.work);
        if press > 0.0 {
            rods.press(press, &mut self.work.forces);
        }
        if !rods.fixed.is_empty() {
            for (force, fixed) in self.work.forces.iter_mut().zip(&rods.fixed) {
                if *fixed {
                    *force = DVec3::ZERO;
                }
            }
        }
        rods.period.map_or(DVec2::ZERO, |period| {
            let pull = load * period.x * period.y - virial;
            pull * DVec2::from(free.map(|free| f64::from(u8::from(free)))) / self.weight
        })
    }

    /// Moves points and the cell's rim.
    fn go(&mut self, rods: &mut Rods, cell_force: DVec2, keep: f64, turn: f64) {
        let dt = self.fire.dt;
        let push = turn + dt;
        #[cfg(test)]
        let last = passing::before(rods);
        let far = (0.5 * MARGIN - self.strained).max(0.0).powi(2);
        let step = Step { keep, push, dt, far };
        self.gone = rods.advance(&mut self.speeds, &mut self.work, &self.before, step);
        let mut strained = 0.0;
        if let Some(period) = rods.period {
            self.cell_speed = self.cell_speed * keep + cell_force * push;
            // In a step the cell's rim moves no farther than a point may.
            let by = self.cell_speed * dt / self.weight;
            let by = by.clamp(DVec2::splat(-STEP) / period, DVec2::splat(STEP) / period);
            // Its images move with it.
            strained = (by * period).abs().max_element();
            self.strained += strained;
            rods.scale(DVec2::ONE + by);
            self.before.iter_mut().for_each(|p| *p *= (DVec2::ONE + by).extend(1.0));
        }
        rods.travel(strained, &mut self.work);
        #[cfg(test)]
        if let Some(last) = last {
            passing::watch(&last, rods, &self.has, &self.work);
        }
    }
}
