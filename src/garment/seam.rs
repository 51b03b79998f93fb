//! The kinds of seams.

/// How panels are sewn together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SeamKind {
    /// Their edges lie beside each other.
    None,
    /// The outermost stitches are turned in, and a yarn goes to and fro between them where it is not seen.
    Mattress,
    /// Both edges are turned in and lie against each other, with a needle's thread through them and two loopers' around.
    Overlock,
}

impl SeamKind {
    /// All of them, in the order of their numbers.
    pub(super) const ALL: [Self; 3] = [Self::None, Self::Mattress, Self::Overlock];
    /// How many kinds there are.
    pub(super) const COUNT: usize = Self::ALL.len();
}
