//! Random numbers as a function of (seed, pixel, sample, dimension): never of a thread or an order of work.

/// A 32-bit mix with good avalanche (the lowbias32 finaliser of C. Wellons' hash prospector).
#[inline]
pub fn hash(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// A hash of two words.
#[inline]
pub fn hash2(a: u32, b: u32) -> u32 {
    hash(a ^ hash(b).wrapping_add(0x9e37_79b9))
}

/// A float in [0, 1) from the upper bits of a word.
#[inline]
pub fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// How many sets of four dimensions come from the Sobol sequence; later ones, deep in a path, are plain random.
const SOBOL_SETS: u32 = 24;
/// What keeps them apart from the streams of [`Sampler::position`].
const BEYOND_SOBOL: u32 = 0x5eed_0000;
/// The crate's sequence has 2^16 points; longer renders go on with another scrambling.
const SOBOL_LENGTH: u32 = 1 << 16;

/// The even numbers of a stream.
const EVEN: usize = 8;

/// The numbers of one sample of one pixel: Owen-scrambled Sobol points in sets of four dimensions.
///
/// ```
/// use yarnray::math::sampler::Sampler;
///
/// // The first 16 samples of a pixel put one number into each sixteenth of the first dimension.
/// let mut taken = [false; 16];
/// for index in 0..16 {
///     let [x, ..] = Sampler::new(1, 40, 30, index).next4();
///     taken[(16.0 * x) as usize] = true;
/// }
/// assert!(taken.iter().all(|&t| t));
/// ```
#[derive(Clone, Debug)]
pub struct Sampler {
    pixel: u32,
    index: u32,
    set: u32,
}

impl Sampler {
    /// The sample `index` of the pixel `(x, y)` of the image, for a scene's `seed`.
    pub fn new(seed: u32, x: u32, y: u32, index: u32) -> Self {
        let pixel = hash2(hash2(seed, x), y);
        let block = index / SOBOL_LENGTH;
        let pixel = if block == 0 { pixel } else { hash2(pixel, block) };
        Self { pixel, index: index % SOBOL_LENGTH, set: 0 }
    }

    /// The next four numbers in [0, 1).
    #[inline]
    pub fn next4(&mut self) -> [f32; 4] {
        let set = self.set;
        self.set += 1;
        if set < SOBOL_SETS {
            sobol_burley::sample_4d(self.index, set, self.pixel)
        } else {
            let mut stream = self.stream(set ^ BEYOND_SOBOL);
            std::array::from_fn(|_| stream.next())
        }
    }

    /// Plain random numbers without end for this sample, one stream for each `key`: for rejection sampling.
    #[inline]
    pub fn stream(&self, key: u32) -> Stream {
        let state = hash2(self.pixel ^ key.wrapping_mul(0x85eb_ca6b), self.index);
        Stream { state, weyl: 0, even: [0.0; EVEN], used: EVEN }
    }

    /// A stream of which the first eight numbers are two of [`Self::next4`], for what must be even over a pixel's samples.
    #[inline]
    pub fn even_stream(&mut self) -> Stream {
        let [a, b, c, d] = self.next4();
        let [e, f, g, h] = self.next4();
        Stream { even: [a, b, c, d, e, f, g, h], used: 0, ..self.stream(self.position()) }
    }

    /// Which set of four numbers comes next: a key for [`Self::stream`] that differs at each vertex of a path.
    pub fn position(&self) -> u32 {
        self.set
    }
}

/// One of several things, drawn by their weights as they come, by one number.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OneOf<T> {
    /// The one drawn of those so far; `None` before any has weight.
    pub(crate) drawn: Option<T>,
    /// The weights so far.
    pub(crate) total: f32,
    u: f32,
}

impl<T> OneOf<T> {
    /// Of none so far; `u` in [0, 1).
    #[inline]
    pub(crate) fn new(u: f32) -> Self {
        Self { drawn: None, total: 0.0, u }
    }

    /// One more; never drawn unless its weight is above 0.
    #[inline]
    pub(crate) fn offer(&mut self, weight: f32, one: T) {
        if weight <= 0.0 {
            return;
        }
        self.total += weight;
        // Of all so far each is held by its share, for which one number serves: what is left of it is even again.
        let share = weight / self.total;
        if self.u < share {
            self.drawn = Some(one);
            self.u /= share;
        } else {
            self.u = (self.u - share) / (1.0 - share);
        }
        self.u = self.u.clamp(0.0, 0.999_999_94);
    }
}

/// Random numbers without end: plain ones by a counter and a hash, behind those of [`Sampler::even_stream`], if any.
#[derive(Clone, Debug)]
pub struct Stream {
    state: u32,
    weyl: u32,
    even: [f32; EVEN],
    /// How many of `even` are gone.
    used: usize,
}

impl Stream {
    /// A stream of its own for a number.
    pub fn new(key: u32) -> Self {
        Self { state: hash(key ^ 0xa511_e9b3), weyl: 0, even: [0.0; EVEN], used: EVEN }
    }

    /// The next number in [0, 1).
    #[inline]
    #[allow(clippy::should_implement_trait, reason = "a number source without an end is not an iterator here")]
    pub fn next(&mut self) -> f32 {
        if let Some(&number) = self.even.get(self.used) {
            self.used += 1;
            return number;
        }
        self.weyl = self.weyl.wrapping_add(0x9e37_79b9);
        unit(hash(self.state ^ self.weyl))
    }

    /// A stream of its own that begins with the next four even numbers of this one, as far as it has them: what takes an unknown
    /// number of them leaves the rest to others.
    #[inline]
    pub fn branch(&mut self) -> Self {
        let used = self.used;
        self.used = (used + 4).min(EVEN);
        let mut branch = Self { used: EVEN, even: [0.0; EVEN], ..self.fork() };
        for number in (used..self.used).rev() {
            branch.used -= 1;
            branch.even[branch.used] = self.even[number];
        }
        branch
    }

    /// A stream of its own, plain random and independent of what this one still gives.
    #[inline]
    pub fn fork(&mut self) -> Self {
        self.weyl = self.weyl.wrapping_add(0x9e37_79b9);
        Self::new(hash(self.state ^ self.weyl))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_lie_in_the_unit_interval_and_are_even() {
        for set_skip in [0, SOBOL_SETS + 3] {
            let mut mean = [0.0f64; 4];
            let n = 4096;
            for i in 0..n {
                let mut sampler = Sampler::new(3, 17, 5, i);
                sampler.set = set_skip;
                for (m, x) in mean.iter_mut().zip(sampler.next4()) {
                    assert!((0.0..1.0).contains(&x));
                    *m += f64::from(x) / f64::from(n);
                }
            }
            let bound = if set_skip == 0 { 2e-4 } else { 0.02 };
            assert!(mean.iter().all(|m| (m - 0.5).abs() < bound), "{mean:?}");
        }
    }

    #[test]
    fn an_even_stream_spreads_its_first_numbers_over_the_samples() {
        let n = 64;
        // Six numbers of a branch that begins behind the first one, and then those that are left.
        let mut taken = [[0; 64]; 11];
        for i in 0..n {
            let mut sampler = Sampler::new(3, 17, 5, i);
            sampler.set = 9;
            let mut stream = sampler.even_stream();
            let first = stream.next();
            let mut branch = stream.branch();
            let later = (0..10).map(|k| if k < 6 { branch.next() } else { stream.next() });
            for (strata, number) in taken.iter_mut().zip(std::iter::once(first).chain(later)) {
                strata[(number * n as f32) as usize] += 1;
            }
            assert_eq!(sampler.position(), 11, "the same numbers are not drawn again");
        }
        for (number, strata) in taken.iter().enumerate() {
            let even = (0..5).contains(&number) || (7..10).contains(&number);
            assert_eq!(strata.iter().all(|&count| count == 1), even, "number {number}: {strata:?}");
        }
    }

    #[test]
    fn numbers_depend_on_every_part_of_the_key() {
        let first = |seed, x, y, i| Sampler::new(seed, x, y, i).next4();
        let base = first(1, 2, 3, 4);
        assert_eq!(base, first(1, 2, 3, 4));
        for other in [
            first(2, 2, 3, 4),
            first(1, 3, 3, 4),
            first(1, 2, 4, 4),
            first(1, 2, 3, 5),
            first(1, 2, 3, 4 + SOBOL_LENGTH),
        ] {
            assert_ne!(base, other);
        }
        let mut a = Sampler::new(1, 2, 3, 4).stream(1);
        let mut b = Sampler::new(1, 2, 3, 4).stream(2);
        assert_ne!(a.next(), b.next());
    }
}
