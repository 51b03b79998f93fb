//! The ellipsoid that a piece of a yarn is where another crosses it.

use glam::DVec3;

/// A node as crossing yarns meet it.
#[derive(Default)]
pub(super) struct Spheroid {
    /// Squared half axes: wide, high.
    pub(super) wide: f64,
    pub(super) high: f64,
    /// The larger of both.
    pub(super) widest: f64,
    /// The level part of its matrix: xx, xy, yy.
    pub(super) level: [f64; 3],
    /// Level unit vector across the yarn.
    pub(super) across: [f64; 2],
}

impl Spheroid {
    pub(super) fn new(axes: [f64; 2], tangent: DVec3) -> Self {
        let flat = tangent.truncate().length().max(1e-3);
        let across = [-tangent.y / flat, tangent.x / flat];
        let [wide, high] = axes.map(|v| v * v);
        let more = wide - high;
        let level =
            [high + more * across[0] * across[0], more * across[0] * across[1], high + more * across[1] * across[1]];
        Self { wide, high, widest: wide.max(high), level, across }
    }

    /// Of w' Q w by the logarithm of the flattening and by the yarn's heading, for the level part of w and its height.
    pub(super) fn gradient(&self, way: [f64; 2], up: f64) -> (f64, f64) {
        let across = way[0] * self.across[0] + way[1] * self.across[1];
        let along = way[0] * self.across[1] - way[1] * self.across[0];
        let by_flattening = 2.0 * (self.wide * across * across - self.high * (along * along + up * up));
        (by_flattening, -2.0 * (self.wide - self.high) * across * along)
    }
}
