//! The yarns that a source of cloth may name, and how thick they are.

use super::{super::Yarn, yarns::Library};
use crate::pattern::knit::Thickness;

/// How thick yarn of a radius is where it is pressed to a width over height of `flatten`; fibres, which are no yarn, stay round.
pub(super) fn thickness(yarn: Option<&Yarn>, radius: f64, flatten: f64) -> Thickness {
    match yarn {
        Some(yarn) => Thickness { radius, half_width: yarn.half_width(), flatten },
        None => Thickness::round(radius),
    }
}

/// The yarns that a source may name.
pub(super) struct KnownYarns<'a> {
    pub(super) library: &'a Library,
    /// The fabric's own, by name and, where it is sound, as it is.
    pub(super) own: (&'a str, Option<&'a Yarn>),
    /// What the fabric says in place of its yarn's radius.
    pub(super) radius: Option<f64>,
    /// That of fibres, or something to go on with where the yarn has mistakes.
    pub(super) fallback: f64,
}

impl KnownYarns<'_> {
    /// Radius of the fabric's yarns or fibres, millimetres.
    pub(super) fn radius(&self) -> f64 {
        self.radius.or(self.own.1.map(|y| y.radius)).unwrap_or(self.fallback)
    }

    /// Mean half width of the fabric's yarns over their radius, see [`Yarn::half_width`]; 1 of fibres.
    pub(super) fn half_width(&self) -> f64 {
        self.own.1.map_or(1.0, Yarn::half_width)
    }

    /// How thick they are where stitches press them to a width over height of `flatten`; fibres stay round.
    pub(super) fn thickness(&self, flatten: f64) -> Thickness {
        thickness(self.own.1, self.radius(), flatten)
    }

    /// Whether the fabric itself says it.
    pub(super) fn has_radius(&self) -> bool {
        self.radius.is_some()
    }

    /// Name of the fabric's yarn.
    pub(super) fn name(&self) -> &str {
        self.own.0
    }
}
