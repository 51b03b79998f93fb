//! What `info` tells of a file of curves.

use std::{borrow::Cow, collections::BTreeSet, path::Path};

use glam::DVec3;
use serde_json::{Map, Value, json};

use super::{Figure, list, overlap_json, overlap_line, unit_in_words};
use crate::{
    geometry::{
        curve::{Basis, Curve, CurveSet},
        length::length,
        overlap::{Overlap, overlap},
        proposal::{self, Proposal},
    },
    math::words::counted,
};

/// What is told of a file of curves.
pub(super) struct CurveFacts<'a> {
    path: &'a Path,
    set: &'a CurveSet,
    points: usize,
    closed: usize,
    length: f64,
    bounds: [DVec3; 2],
    basis: &'static str,
    /// Whether the file has radii.
    radii: bool,
    /// Curves that have a colour, and how many colours these are.
    colored: usize,
    colors: usize,
    ids: BTreeSet<i64>,
    plies: BTreeSet<i64>,
    /// How far curves run into each other, and by which radius.
    overlap: Option<Overlap>,
    by: &'static str,
    /// What the file does not say, and nobody has.
    proposal: Option<Proposal>,
    /// The size in centimetres by the unit that the file may be in.
    sizes: Vec<(&'static str, DVec3)>,
}

impl<'a> CurveFacts<'a> {
    /// Of a file; `radius` is asked for in place of its own.
    pub(super) fn new(path: &'a Path, set: &'a CurveSet, radius: Option<f64>) -> Self {
        let own = |curve: &'a Curve| -> Option<Cow<'a, [f64]>> {
            radius.map(|r| Cow::Owned(vec![r; curve.points.len()])).or(curve.radii.as_deref().map(Cow::Borrowed))
        };
        let with_radii = set.curves.iter().map(|c| Some((c, own(c)?))).collect::<Option<Vec<_>>>();
        let all = || set.curves.iter().flat_map(|c| &c.points).copied();
        let radii = set.curves.iter().any(|c| c.radii.is_some());
        let colors: BTreeSet<[u32; 3]> = set.colors.iter().flatten().map(|c| c.map(f32::to_bits)).collect();
        Self {
            path,
            set,
            points: set.curves.iter().map(|c| c.points.len()).sum(),
            closed: set.curves.iter().filter(|c| c.closed).count(),
            // A sum of nothing is -0.
            length: set.curves.iter().map(length).fold(0.0, |a, b| a + b),
            bounds: [all().reduce(DVec3::min), all().reduce(DVec3::max)].map(Option::unwrap_or_default),
            basis: match set.curves.first().map(|c| c.basis) {
                Some(Basis::CatmullRom) => "catmull-rom",
                Some(Basis::BSpline) => "b-spline",
                Some(Basis::Linear) => "linear",
                None => "none",
            },
            radii,
            colored: set.colors.iter().flatten().count(),
            colors: colors.len(),
            ids: set.ids.iter().flatten().copied().collect(),
            plies: set.plies.iter().flatten().copied().collect(),
            overlap: with_radii.and_then(|list| overlap(list.iter().map(|(c, r)| (*c, &**r)))),
            // Of its yarn a file knows no more.
            by: if radius.is_some() { "radius asked for" } else { "radius in the file" },
            proposal: if radii || radius.is_some() { None } else { Proposal::new(set) },
            sizes: proposal::sizes(set).to_vec(),
        }
    }

    pub(super) fn json(&self) -> Value {
        let Self { set, points, closed, length, basis, radii, colored, colors, by, .. } = self;
        let proposal = self.proposal.as_ref().map(|p| {
            json!({
                "radius": p.radius, "unit": p.unit.0, "overlap": overlap_json(Some(p.overlap), "radius proposed"),
                "bend_radius": {"p1": p.bends[0], "p50": p.bends[1]},
            })
        });
        let sizes: Map<String, Value> =
            self.sizes.iter().map(|(unit, size)| ((*unit).to_owned(), list(*size))).collect();
        json!({
            "file": self.path.display().to_string(), "proposal": proposal, "size_cm": sizes,
            "curves": set.curves.len(), "closed": closed, "open": set.curves.len() - closed,
            "points": points, "basis": basis, "radii": radii,
            "up": set.up_axis.map(|a| ["x", "y", "z"][usize::from(a.min(2))]),
            "unit_mm": set.unit_mm, "length": length, "overlap": overlap_json(self.overlap, by),
            "bounds": self.bounds.map(list), "notes": set.notes,
            "colored": colored, "colors": colors, "ids": self.ids.len(), "plies": self.plies.len(),
        })
    }

    pub(super) fn text(&self) -> String {
        let Self { set, points, closed, length, basis, colored, colors, ids, plies, by, .. } = self;
        let [low, high] = self.bounds;
        let mut text = format!(
            "{}\n  curves    {} ({closed} closed, {} open), {basis}\n  points    {points}\n  length    {length:.6}\n  \
             bounds    {low:.4} to {high:.4}\n  radii     {}\n  unit      {}\n",
            self.path.display(),
            set.curves.len(),
            set.curves.len() - closed,
            if self.radii { "in the file" } else { "none: the scene's yarn gives them" },
            unit_in_words(set.unit_mm),
        );
        if *colored > 0 {
            let how = "`colors = true` in a scene's source dyes the yarns";
            text += &format!("  colours   {colors} on {}; {how}\n", counted(*colored, "curve"));
        }
        if let (Some(first), Some(last)) = (ids.first(), ids.last()) {
            text += &format!("  ids       {} from {first} to {last}\n", ids.len());
        }
        if !plies.is_empty() {
            text += &format!("  plies     {}: curves are plies or fibres of yarns\n", plies.len());
        }
        let may_nestle = *by == "radius asked for" || plies.is_empty();
        let nestle = if may_nestle { ": plied yarns that nestle count as overlapping" } else { "" };
        text += &overlap_line(self.overlap, &format!("by the {by}{nestle}"), false);
        text += &self.proposal_lines();
        for note in &set.notes {
            text += &format!("  note      {note}\n");
        }
        text
    }

    /// What may be meant where the file does not say it.
    fn proposal_lines(&self) -> String {
        let mut text = String::new();
        if let Some(p) = &self.proposal {
            text += &format!(
                "  proposal  radius {:.3}: at it {:.1} % of the length overlaps; one bend in a hundred is tighter than {:.3}, \
                 half are tighter than {:.3}\n            unit \"{}\": the yarn would be {:.2} mm thick\n",
                Figure(p.radius),
                100.0 * p.overlap.share,
                Figure(p.bends[0]),
                Figure(p.bends[1]),
                p.unit.0,
                2.0 * p.radius * p.unit.1
            );
        }
        if self.set.unit_mm.is_none() {
            let size = |(unit, v): &(&str, DVec3)| {
                format!("{unit}: {:.3} x {:.3} x {:.3} cm", Figure(v.x), Figure(v.y), Figure(v.z))
            };
            let sizes: Vec<String> = self.sizes.iter().map(size).collect();
            text += &format!("  size      if it is in {}\n", sizes.join("; in "));
        }
        text
    }
}
