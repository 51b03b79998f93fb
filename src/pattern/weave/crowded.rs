//! What is told of a weave whose yarns run into each other.

use super::{Cloth, PatternStrand, StrandKind};
use crate::pattern::crowded::{Measured, crowding, in_words};

impl Cloth<'_> {
    /// That its yarns run into each other, if they do, and why, for people. `strands` are its own.
    pub(crate) fn crowded(&self, strands: &[PatternStrand]) -> Option<String> {
        let weave = self.weave;
        let (radii, half_widths) = (weave.yarn_radii(), weave.half_width);
        let side = |strand: &PatternStrand| usize::from(strand.kind == StrandKind::Weft);
        let own = |strand: &PatternStrand| {
            let even = || vec![radii[side(strand)]; strand.curve.points.len()];
            strand.curve.radii.clone().unwrap_or_else(even)
        };
        // Strands are crowded in their tuft as fibres are.
        let ground: Vec<&PatternStrand> = strands.iter().filter(|strand| !strand.is_of_tuft()).collect();
        let own: Vec<Vec<f64>> = ground.iter().map(|strand| own(strand)).collect();
        let measured: Vec<Measured<'_>> =
            ground.iter().zip(&own).map(|(s, radii)| (&s.curve, radii.as_slice(), half_widths[side(s)])).collect();
        let found = crowding(&measured)?;
        let is_set = weave.cover.or(weave.warp_spacing).or(weave.weft_spacing).is_some();
        let why = if is_set {
            "its yarns are set more closely than they find room; without a setting they are as close as they go"
        } else if weave.draft.pile().is_some() {
            "its pile finds no room; more room between its yarns, or thinner ones"
        } else {
            "yarns of so different thickness or ways find no room beside each other; a wider setting"
        };
        Some(in_words(&found, why))
    }
}
