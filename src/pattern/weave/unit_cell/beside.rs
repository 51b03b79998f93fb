//! A window of a large repeat in the whole of it.

/// How many neighbours go aside together.
pub(super) const NEIGHBOURS: usize = 16;

/// How the yarns of a window lie in the whole.
pub(super) struct Beside {
    /// Warps and wefts of the whole.
    pub(super) whole: [usize; 2],
    /// For each yarn of a side and each crossing of it: how far it was aside.
    pub(super) aside: [Vec<f64>; 2],
    /// For each group of neighbours of a side and each crossing: how far it was out of line.
    pub(super) line: [Vec<f64>; 2],
}

impl Beside {
    /// Neighbours that go aside together.
    pub(super) fn many(&self, side: usize) -> usize {
        self.whole[side].min(NEIGHBOURS)
    }
}
