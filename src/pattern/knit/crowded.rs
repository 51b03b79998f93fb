//! What is told of a knit whose yarns run into each other.

use super::{Form, Knit, Thickness};
use crate::{
    geometry::curve::Curve,
    pattern::crowded::{Measured, crowding, in_words},
};

/// So many stitches change places without running into each other.
const EASY_CABLE: u32 = 10;

impl Knit {
    /// That its yarns run into each other, if they do, and why, for people. The knit is as it was made, `curves` are its yarns with
    /// their radii, `spelled` is how an option is named.
    pub(crate) fn crowded(
        &self,
        yarn: &Thickness,
        curves: &[(&Curve, &[f64])],
        spelled: impl Fn(&str) -> String,
    ) -> Option<String> {
        let measured: Vec<Measured<'_>> =
            curves.iter().map(|&(curve, radii)| (curve, radii, yarn.half_width)).collect();
        let found = crowding(&measured)?;
        let sized = self.stitch_width.or(self.row_height).or(self.yarn_per_stitch).is_some();
        let why = match self.chart.widest_cable() {
            Some(wide) if wide > EASY_CABLE => format!(
                "{wide} stitches change places in a row, and more than {EASY_CABLE} press through each other; cables of up to \
                 {EASY_CABLE} stitches cross freely"
            ),
            _ if sized || matches!(self.form, Form::Revolution(_)) => {
                let [across, up] = Self { stitch_width: None, row_height: None, ..self.clone() }.gauge();
                let [own_across, own_up] = [across, up].map(|s| 100.0 / (s * yarn.pressed()));
                format!(
                    "too many stitches or rows for its size; this yarn knits to {own_across:.1} x {own_up:.1} in 10 cm by itself"
                )
            }
            _ => format!(
                "the stitches of the chart find no room beside each other; more plain rows between, or more yarn in a stitch by {}",
                spelled("yarn_per_stitch")
            ),
        };
        Some(in_words(&found, &why))
    }
}
