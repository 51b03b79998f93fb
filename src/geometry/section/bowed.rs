//! A straight way through a bent yarn, as it looks in the section of one place.

use glam::Vec2;

use super::neighbourhood::Unbent;

/// Angle, in radians, up to which a bend bows light that leaves from inside as a third-order curve.
const MOST_BENT: f32 = 0.6;

/// A straight way from a point in the section of a place, as the bend there bows it.
pub(super) struct Bowed {
    pub(super) at: Vec2,
    pub(super) slope: Vec2,
    pub(super) advance: f32,
    pub(super) straightness: f32,
    pub(super) bend: Vec2,
}

impl Bowed {
    /// How fast the bow begins.
    #[inline]
    pub(super) fn bow(&self) -> Vec2 {
        -(self.advance * self.advance * self.straightness) * self.bend
    }

    /// How far it is to the yarn's surface: as if it were straight, then as it bows.
    #[inline]
    pub(super) fn to_surface(&self) -> f32 {
        let depth = to_surface(self.at, self.slope);
        if self.bend == Vec2::ZERO {
            return depth;
        }
        let slope = self.slope + depth * self.bow();
        depth + to_surface(self.at + (0.5 * depth) * (self.slope + slope), slope)
    }

    /// The way so much deeper: to third order, were the yarn a circle. `None` if the yarn bends more on it.
    #[inline]
    pub(super) fn ahead(&self, depth: f32) -> Option<Unbent> {
        let bent = depth * self.advance;
        if bent * bent * self.bend.length_squared() > MOST_BENT * MOST_BENT {
            return None;
        }
        // r'' = L^2 / r^3 and the angle's change L / r^2, for the distance r from the centre of the circle.
        let nearer = self.bend.dot(self.slope) / self.straightness;
        let bow = self.bow();
        let more = 3.0 * nearer * bow;
        Some(Unbent {
            at: self.at + depth * (self.slope + depth * (0.5 * bow + depth / 6.0 * more)),
            slope: self.slope + depth * (bow + 0.5 * depth * more),
            travel: bent * (1.0 + depth * nearer),
            advance: self.advance * (1.0 + 2.0 * depth * nearer),
            straightness: self.straightness * (1.0 - depth * nearer),
            lean: 0.0,
            cos: 1.0,
        })
    }
}

/// How far it is from a point of the section along a slope to the unit circle: negative from outside.
#[inline]
fn to_surface(at: Vec2, slope: Vec2) -> f32 {
    let (speed, outward) = (slope.length_squared().max(1e-12), at.dot(slope));
    let square = outward * outward + speed * (1.0 - at.length_squared());
    (square.max(0.0).sqrt() - outward) / speed
}
