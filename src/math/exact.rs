//! Sums that do not depend on the order of their terms.
//!
//! Floating-point addition is not associative: a render in two halves would differ from one in a piece in its last
//! bits. Here each term is first brought to a fixed step, which depends on the term alone; whole numbers of steps then
//! add up the same in any order and any grouping. That is what lets threads, checkpoints and machines share a picture
//! to the bit.

/// What can be summed up exactly, and kept in a file.
pub(crate) trait Exact: Copy + Default {
    /// Bytes in a file, little-endian.
    const BYTES: usize;
    /// Adds another sum.
    fn merge(&mut self, other: &Self);
    /// Appends the sum to a file's bytes.
    fn save(&self, out: &mut Vec<u8>);
    /// Reads back what [`Self::save`] wrote: exactly [`Self::BYTES`] bytes.
    fn load(bytes: &[u8]) -> Self;
}

macro_rules! exact {
    ($name:ty, $bytes:expr, $merge:expr, $save:expr, $load:expr) => {
        impl Exact for $name {
            const BYTES: usize = $bytes;
            #[inline]
            fn merge(&mut self, other: &Self) {
                *self = $merge(*self, *other);
            }
            fn save(&self, out: &mut Vec<u8>) {
                out.extend($save(*self));
            }
            fn load(bytes: &[u8]) -> Self {
                $load(bytes.try_into().expect("the caller cuts to size"))
            }
        }
    };
}

/// A whole number of 96 bits, the lowest word first: in twelve bytes what `i128` would need sixteen for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Whole96([u32; 3]);

impl Whole96 {
    const BYTES: usize = 12;

    /// The lower 96 bits.
    #[inline]
    fn new(value: i128) -> Self {
        Self([value as u32, (value >> 32) as u32, (value >> 64) as u32])
    }

    #[inline]
    fn signed(self) -> i128 {
        let [a, b, c] = self.0;
        i128::from(c as i32) << 64 | i128::from(u64::from(b) << 32 | u64::from(a))
    }

    #[inline]
    fn unsigned(self) -> u128 {
        let [a, b, c] = self.0;
        u128::from(c) << 64 | u128::from(u64::from(b) << 32 | u64::from(a))
    }

    fn to_le_bytes(self) -> [u8; Self::BYTES] {
        std::array::from_fn(|i| self.0[i / 4].to_le_bytes()[i % 4])
    }

    fn from_le_bytes(bytes: [u8; Self::BYTES]) -> Self {
        Self(std::array::from_fn(|i| u32::from_le_bytes(std::array::from_fn(|k| bytes[4 * i + k]))))
    }
}

/// Terms of either sign: steps of 2^-40, sums below 2^55; larger ones stay at the limit. A term of 2^-16 or more, in
/// size, keeps all of its bits; one of a millionth keeps 20 of 24.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Sum(Whole96);

/// Squares: steps of 2^-48, sums below 2^48; larger ones stay at the limit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct SquareSum(Whole96);

/// Terms of layers beside the picture, in half the memory: steps of 2^-28, sums below 2^35; larger ones stay at the
/// limit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct NarrowSum(i64);

exact!(
    Sum,
    Whole96::BYTES,
    |a: Sum, b: Sum| Sum::clamped(a.0.signed() + b.0.signed()),
    |s: Sum| s.0.to_le_bytes(),
    |bytes| Sum(Whole96::from_le_bytes(bytes))
);
exact!(
    SquareSum,
    Whole96::BYTES,
    |a: SquareSum, b: SquareSum| SquareSum::clamped(a.0.unsigned() + b.0.unsigned()),
    |s: SquareSum| s.0.to_le_bytes(),
    |bytes| SquareSum(Whole96::from_le_bytes(bytes))
);
exact!(
    NarrowSum,
    8,
    |a: NarrowSum, b: NarrowSum| NarrowSum(a.0.saturating_add(b.0)),
    |s: NarrowSum| s.0.to_le_bytes(),
    |bytes| NarrowSum(i64::from_le_bytes(bytes))
);
exact!(u32, 4, u32::saturating_add, u32::to_le_bytes, u32::from_le_bytes);

impl<T: Exact, const N: usize> Exact for [T; N]
where
    [T; N]: Default,
{
    const BYTES: usize = N * T::BYTES;
    fn merge(&mut self, other: &Self) {
        self.iter_mut().zip(other).for_each(|(a, b)| a.merge(b));
    }
    fn save(&self, out: &mut Vec<u8>) {
        self.iter().for_each(|v| v.save(out));
    }
    fn load(bytes: &[u8]) -> Self {
        std::array::from_fn(|i| T::load(&bytes[i * T::BYTES..(i + 1) * T::BYTES]))
    }
}

impl Sum {
    /// Terms must be smaller than this: then 2^16 of them fit.
    pub(crate) const LIMIT: f32 = (1u64 << 39) as f32;
    const STEPS: f64 = (1u64 << 40) as f64;
    const MOST: i128 = (1 << 95) - 1;

    /// Terms of one sign may be clamped in any order: whoever reaches the limit stays there.
    #[inline]
    fn clamped(steps: i128) -> Self {
        Self(Whole96::new(steps.clamp(-Self::MOST, Self::MOST)))
    }

    /// Adds a term; one beyond [`Self::LIMIT`] counts as the limit, NaN as nothing.
    #[inline]
    pub(crate) fn add(&mut self, value: f32) {
        // A power of two: exact. Ordinary values take the short way through a register.
        let steps = f64::from(value.clamp(-Self::LIMIT, Self::LIMIT)) * Self::STEPS;
        let steps = if steps.abs() < 9.2e18 { i128::from(steps as i64) } else { steps as i128 };
        *self = Self::clamped(self.0.signed() + steps);
    }

    /// The sum.
    #[inline]
    pub(crate) fn value(self) -> f64 {
        self.0.signed() as f64 / Self::STEPS
    }
}

impl SquareSum {
    const STEPS: f64 = (1u64 << 48) as f64;
    const MOST: u128 = (1 << 96) - 1;

    #[inline]
    fn clamped(steps: u128) -> Self {
        Self(Whole96::new(steps.min(Self::MOST) as i128))
    }

    /// Adds the square of a value.
    #[inline]
    pub(crate) fn add_square_of(&mut self, value: f32) {
        let value = f64::from(value);
        let steps = value * value * Self::STEPS;
        let steps = if steps < 9.2e18 { (steps as i64) as u128 } else { (steps as u128).min(Self::MOST) };
        *self = Self::clamped(self.0.unsigned() + steps);
    }

    /// The sum.
    #[inline]
    pub(crate) fn value(self) -> f64 {
        self.0.unsigned() as f64 / Self::STEPS
    }
}

impl NarrowSum {
    const STEPS: f64 = (1u64 << 28) as f64;

    /// Adds a term.
    #[inline]
    pub(crate) fn add(&mut self, value: f32) {
        self.0 = self.0.saturating_add((f64::from(value) * Self::STEPS) as i64);
    }

    /// The sum.
    #[inline]
    pub(crate) fn value(self) -> f64 {
        self.0 as f64 / Self::STEPS
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::Stream;

    /// Values over many orders of magnitude, some of them negative.
    fn values(count: usize) -> Vec<f32> {
        let mut random = Stream::new(5);
        (0..count)
            .map(|_| {
                let size = 10f32.powf(30.0 * random.next() - 20.0);
                if random.next() < 0.3 { -size } else { size }
            })
            .collect()
    }

    #[test]
    fn sums_do_not_depend_on_order_or_grouping() {
        let values = values(10_000);
        let add = |values: &mut dyn Iterator<Item = &f32>| {
            let mut sums = (Sum::default(), SquareSum::default(), NarrowSum::default());
            for &v in values {
                sums.0.add(v);
                sums.1.add_square_of(v);
                // Where the narrow sum stays at its limit, it does so for terms of one sign only.
                sums.2.add(v.abs());
            }
            sums
        };
        let forward = add(&mut values.iter());
        assert_eq!(forward, add(&mut values.iter().rev()));
        for cut in [1, 77, 5000, 9999] {
            let (mut a, b) = (add(&mut values[..cut].iter()), add(&mut values[cut..].iter()));
            a.0.merge(&b.0);
            a.1.merge(&b.1);
            a.2.merge(&b.2);
            assert_eq!(a, forward, "cut at {cut}");
        }
        // Sums of floats do depend on it: what this is all for.
        let float = |i: &mut dyn Iterator<Item = &f32>| i.fold(0.0, |s, &v| s + f64::from(v));
        assert_ne!(float(&mut values.iter()), float(&mut values.iter().rev()));
    }

    #[test]
    fn sums_are_as_good_as_those_of_floats() {
        let values: Vec<f32> = values(10_000).into_iter().map(|v| v.clamp(-1e4, 1e4)).collect();
        let (mut sum, mut square, mut narrow) = (Sum::default(), SquareSum::default(), NarrowSum::default());
        let (mut want, mut want_square) = (0.0, 0.0);
        for &v in &values {
            sum.add(v);
            square.add_square_of(v);
            narrow.add(v);
            want += f64::from(v);
            want_square += f64::from(v) * f64::from(v);
        }
        assert!((sum.value() / want - 1.0).abs() < 1e-9, "{} {want}", sum.value());
        assert!((square.value() / want_square - 1.0).abs() < 1e-9, "{} {want_square}", square.value());
        assert!((narrow.value() / want - 1.0).abs() < 1e-7, "{} {want}", narrow.value());
    }

    #[test]
    fn extremes_stay_in_range() {
        let mut sum = Sum::default();
        for v in [f32::NAN, 0.0, f32::from_bits(1), 1e-30] {
            sum.add(v);
        }
        assert_eq!(sum.value(), 0.0);
        sum.add(f32::INFINITY);
        assert_eq!(sum.value(), f64::from(Sum::LIMIT));
        let mut square = SquareSum::default();
        square.add_square_of(f32::MAX);
        square.add_square_of(f32::MAX);
        assert_eq!(square, SquareSum(Whole96([u32::MAX; 3])));
        // At its limit a sum stays, whatever comes first.
        let mut many = Sum::default();
        (0..70_000).for_each(|_| many.add(Sum::LIMIT));
        assert_eq!(many, Sum::clamped(i128::MAX));
        many.add(1.0);
        many.merge(&sum);
        assert_eq!(many, Sum::clamped(i128::MAX));
        let mut negative = Sum::default();
        negative.add(-1.5);
        assert_eq!(negative.value(), -1.5);
        let mut narrow = NarrowSum::default();
        narrow.add(f32::MAX);
        narrow.add(1.0);
        assert_eq!(narrow, NarrowSum(i64::MAX));
    }

    #[test]
    fn sums_come_back_from_their_bytes() {
        let mut sums = [[Sum::default(); 3]; 2];
        sums[1][2].add(-1.5e-3);
        sums[0][0].add(7e9);
        let mut bytes = Vec::new();
        sums.save(&mut bytes);
        assert_eq!(bytes.len(), <[[Sum; 3]; 2] as Exact>::BYTES);
        assert_eq!(<[[Sum; 3]; 2] as Exact>::load(&bytes), sums);
    }
}
