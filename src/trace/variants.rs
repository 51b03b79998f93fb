//! What differs between the variants of a fabric, and material indices that choose one.

/// One thing for all of a geometry, or one for each variant that its segments may be of.
#[derive(Clone, Debug)]
pub struct PerVariant<T> {
    own: T,
    variants: Vec<T>,
}

impl<T> PerVariant<T> {
    /// `own` where segments have no material index; `variants` by it, or none where all are as `own`.
    pub fn new(own: T, variants: Vec<T>) -> Self {
        Self { own, variants }
    }

    /// The same for all.
    pub fn same(own: T) -> Self {
        Self { own, variants: Vec::new() }
    }

    /// That of segments without a material index.
    #[inline]
    pub fn own(&self) -> &T {
        &self.own
    }

    /// Those of material indices, in order; empty where all are as [`Self::own`].
    #[inline]
    pub fn variants(&self) -> &[T] {
        &self.variants
    }

    /// That of a material index.
    ///
    /// # Panics
    /// If there are variants, but not so many.
    #[inline]
    pub fn at(&self, index: Option<u16>) -> &T {
        match index {
            Some(index) if !self.variants.is_empty() => &self.variants[usize::from(index)],
            _ => &self.own,
        }
    }
}
