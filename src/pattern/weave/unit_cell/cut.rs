//! The section of a yarn in a plane across the cloth.

/// A sloping yarn cut by a plane across the cloth. It is higher there whichever way it slopes, so that twined yarns keep apart, and
/// wider where it goes aside.
#[derive(Default)]
pub(super) struct Cut {
    /// Half width and half height, over those of its section.
    pub(super) longer: [f64; 2],
    /// Derivatives of both by the tangent's components along and aside.
    pub(super) slopes: [[f64; 2]; 2],
}

impl Cut {
    /// Of a unit tangent along, aside and up.
    pub(super) fn of([along, aside, _]: [f64; 3]) -> Self {
        const STEEPEST: f64 = 0.2;
        let along = along.max(STEEPEST);
        let level = along.hypot(aside);
        let square = level * along * along;
        Self {
            longer: [level / along, 1.0 / along],
            slopes: [[-aside * aside / square, aside / (level * along)], [-1.0 / (along * along), 0.0]],
        }
    }
}
