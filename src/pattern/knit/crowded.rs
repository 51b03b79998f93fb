//! What is told of a knit whose yarns run into each other.

use super::{Form, Knit, Thickness};
use crate::geometry::{
    curve::Curve,
    overlap::{Overlap, sampled_overlap},
};

/// So many stitches change places without running into each other.
const EASY_CABLE: u32 = 10;

/// More overlap is told.
const MOST: f64 = 0.05;
/// Fewer places are not seen, where strands are as deep in each other as this.
const FEW: f64 = 0.002;
const DEEP: f64 = 0.5;
/// The first rows of one large piece are as the others: so many points are enough.
const ENOUGH: usize = 400_000;

impl Knit {
    /// That its yarns run into each other, if they do, and why, for people. The knit is as it was made, `curves` are its yarns with
    /// their radii, `spelled` is how an option is named.
    pub(crate) fn crowded(
        &self,
        yarn: &Thickness,
        curves: &[(&Curve, &[f64])],
        spelled: impl Fn(&str) -> String,
    ) -> Option<String> {
        let found = overlap_of(curves, yarn.half_width)?;
        if found.share <= MOST && (found.share <= FEW || found.deepest <= DEEP) {
            return None;
        }
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
        let [share, deepest] = [found.share, found.deepest].map(|part| 100.0 * part);
        Some(format!("{share:.1} % of the yarn overlaps, by up to {deepest:.0} % of its diameter: {why}"))
    }
}

fn overlap_of(curves: &[(&Curve, &[f64])], half_width: f64) -> Option<Overlap> {
    match curves {
        [(curve, radii)] if radii.len() > ENOUGH => {
            let first = Curve {
                basis: curve.basis,
                closed: false,
                points: curve.points[..ENOUGH].to_vec(),
                radii: None,
                flattening: curve.flattening.as_ref().map(|axes| axes[..ENOUGH].to_vec()),
            };
            sampled_overlap(std::iter::once((&first, &radii[..ENOUGH], half_width)))
        }
        _ => sampled_overlap(curves.iter().map(|&(curve, radii)| (curve, radii, half_width))),
    }
}
