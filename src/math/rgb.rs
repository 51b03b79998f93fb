//! The three-channel value: radiance, albedo, attenuation, optical depth.

use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub};

use wide::f32x4;

/// Red, green and blue, linear Rec.709, in one SIMD register. The fourth lane repeats blue, so that no
/// operation can make a NaN that the three channels do not have.
#[derive(Clone, Copy, PartialEq)]
#[repr(transparent)]
pub struct Rgb(f32x4);

impl Rgb {
    /// Nothing.
    pub const ZERO: Self = Self(f32x4::ZERO);
    /// One in each channel.
    pub const ONE: Self = Self(f32x4::ONE);

    /// The channels, in order.
    #[inline]
    pub fn new(r: f32, g: f32, b: f32) -> Self {
        Self(f32x4::new([r, g, b, b]))
    }

    /// The same value in each channel.
    #[inline]
    pub fn splat(value: f32) -> Self {
        Self(f32x4::splat(value))
    }

    /// The three channels as an array.
    #[inline]
    pub fn to_array(self) -> [f32; 3] {
        let [r, g, b, _] = self.0.to_array();
        [r, g, b]
    }

    /// The mean of the channels.
    #[inline]
    pub fn mean(self) -> f32 {
        let [r, g, b] = self.to_array();
        (r + g + b) * (1.0 / 3.0)
    }

    /// The largest channel.
    #[inline]
    pub fn max_channel(self) -> f32 {
        let [r, g, b] = self.to_array();
        r.max(g).max(b)
    }

    /// The smallest channel.
    #[inline]
    pub fn min_channel(self) -> f32 {
        let [r, g, b] = self.to_array();
        r.min(g).min(b)
    }

    /// The mean of the channels weighted by those of `weight`: (w_r r + w_g g + w_b b) / 3.
    #[inline]
    pub fn weighted_mean(self, weight: Self) -> f32 {
        (self * weight).mean()
    }

    /// e to the power of each channel; relative error below 1e-6.
    #[inline]
    pub fn exp(self) -> Self {
        Self(self.0.exp())
    }

    /// 1 - e^-x of each channel, exact near 0; for x >= 0.
    #[inline]
    pub fn one_minus_exp_neg(self) -> Self {
        let x = self.0;
        let series =
            x * (f32x4::ONE - x * (f32x4::HALF - x * (f32x4::splat(1.0 / 6.0) - x * f32x4::splat(1.0 / 24.0))));
        let direct = f32x4::ONE - (-x).exp();
        Self(x.simd_lt(f32x4::splat(0.03)).select(series, direct))
    }

    /// The square root of each channel.
    #[inline]
    pub fn sqrt(self) -> Self {
        Self(self.0.sqrt())
    }

    /// The larger of each pair of channels.
    #[inline]
    pub fn max(self, other: Self) -> Self {
        Self(self.0.fast_max(other.0))
    }

    /// The smaller of each pair of channels.
    #[inline]
    pub fn min(self, other: Self) -> Self {
        Self(self.0.fast_min(other.0))
    }

    /// Each channel of `yes` where this channel is below that of `bound`, else of `no`.
    #[inline]
    pub fn select_below(self, bound: f32, yes: Self, no: Self) -> Self {
        Self(self.0.simd_lt(f32x4::splat(bound)).select(yes.0, no.0))
    }

    /// Whether every channel is neither infinite nor NaN.
    #[inline]
    pub fn is_finite(self) -> bool {
        self.to_array().iter().all(|c| c.is_finite())
    }

    /// Whether every channel is exactly zero.
    #[inline]
    pub fn is_zero(self) -> bool {
        self.to_array() == [0.0; 3]
    }
}

impl std::fmt::Debug for Rgb {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [r, g, b] = self.to_array();
        write!(f, "Rgb({r}, {g}, {b})")
    }
}

impl Default for Rgb {
    fn default() -> Self {
        Self::ZERO
    }
}

impl From<[f32; 3]> for Rgb {
    fn from([r, g, b]: [f32; 3]) -> Self {
        Self::new(r, g, b)
    }
}

impl From<[f64; 3]> for Rgb {
    fn from(c: [f64; 3]) -> Self {
        Self::new(c[0] as f32, c[1] as f32, c[2] as f32)
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident, $op:tt) => {
        impl $trait for Rgb {
            type Output = Self;
            #[inline]
            fn $method(self, other: Self) -> Self {
                Self(self.0 $op other.0)
            }
        }
        impl $trait<f32> for Rgb {
            type Output = Self;
            #[inline]
            fn $method(self, other: f32) -> Self {
                Self(self.0 $op f32x4::splat(other))
            }
        }
    };
}
operator!(Add, add, +);
operator!(Sub, sub, -);
operator!(Mul, mul, *);
operator!(Div, div, /);

impl Neg for Rgb {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl AddAssign for Rgb {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl MulAssign for Rgb {
    #[inline]
    fn mul_assign(&mut self, other: Self) {
        *self = *self * other;
    }
}

impl MulAssign<f32> for Rgb {
    #[inline]
    fn mul_assign(&mut self, other: f32) {
        *self = *self * other;
    }
}

impl DivAssign<f32> for Rgb {
    #[inline]
    fn div_assign(&mut self, other: f32) {
        *self = *self / other;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponentials_keep_their_digits() {
        for i in -2000..200 {
            let x = i as f32 * 0.01;
            let got = Rgb::splat(x).exp().to_array()[0];
            assert!((got / x.exp() - 1.0).abs() < 1e-6, "exp({x}) = {got}");
        }
        for i in 0..400 {
            let x = 10f64.powf(-9.0 + i as f64 * 0.025);
            let got = f64::from(Rgb::splat(x as f32).one_minus_exp_neg().to_array()[1]);
            let want = -(-f64::from(x as f32)).exp_m1();
            assert!((got / want - 1.0).abs() < 4e-6, "1 - exp(-{x}) = {got}, not {want}");
        }
        assert_eq!(Rgb::splat(200.0).one_minus_exp_neg(), Rgb::ONE);
        assert_eq!(Rgb::splat(-200.0).exp().to_array()[2], 0.0);
    }

    #[test]
    fn the_fourth_lane_stays_out_of_sight() {
        let c = Rgb::new(1.0, 2.0, 4.0) / Rgb::new(1.0, 0.5, 2.0);
        assert_eq!(c.to_array(), [1.0, 4.0, 2.0]);
        assert_eq!(c.max_channel(), 4.0);
        assert!((c.mean() - 7.0 / 3.0).abs() < 1e-6);
        assert!(!(c / Rgb::new(0.0, 1.0, 1.0)).is_finite());
    }
}
