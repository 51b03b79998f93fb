//! The unit and the axes in which pictures tell of places.

use glam::{DMat3, DMat4, DVec3};

/// How an EXR writes places, directions and matrices. A scene itself has millimetres and y up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axes {
    /// Length of one unit, millimetres.
    pub unit: f64,
    /// Whether z points up and y away; else y points up.
    pub z_up: bool,
}

impl Default for Axes {
    fn default() -> Self {
        Self { unit: 1.0, z_up: false }
    }
}

impl Axes {
    fn turn(&self) -> DMat3 {
        if self.z_up { DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y) } else { DMat3::IDENTITY }
    }

    /// A direction of the scene in these axes.
    pub fn direction(&self, v: DVec3) -> DVec3 {
        self.turn() * v
    }

    /// A place of the scene, millimetres, in these axes and this unit.
    pub fn place(&self, at: DVec3) -> DVec3 {
        self.turn() * at / self.unit
    }

    /// From places in these axes to those of the scene, millimetres.
    pub fn to_scene(&self) -> DMat4 {
        DMat4::from_mat3(self.turn().transpose() * self.unit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_come_back() {
        let at = DVec3::new(20.0, 300.0, -4.0);
        for (axes, wanted) in [
            (Axes::default(), at),
            (Axes { unit: 10.0, z_up: false }, DVec3::new(2.0, 30.0, -0.4)),
            // Up is up, and what is to the right stays there.
            (Axes { unit: 1000.0, z_up: true }, DVec3::new(0.02, 0.004, 0.3)),
        ] {
            assert!(axes.place(at).abs_diff_eq(wanted, 1e-12), "{axes:?}");
            assert!(axes.to_scene().transform_point3(axes.place(at)).abs_diff_eq(at, 1e-9));
            assert_eq!(axes.direction(DVec3::Y), if axes.z_up { DVec3::Z } else { DVec3::Y });
        }
    }
}
