//! Curves as a USD layer: which prims they become.

use std::{io, path::Path};

use super::SOME_RADIUS;
use crate::{
    files::{
        extension,
        stage::{self, CurvesOut, Interpolated},
    },
    geometry::curve::{Basis, CurveSet, equal_radii},
};

/// Extensions of layers that are written.
pub(super) const EXTENSIONS: [&str; 3] = ["usda", "usdc", "usd"];

pub(super) fn can_write(path: &Path) -> bool {
    extension(path).is_some_and(|found| EXTENSIONS.contains(&found.as_str()))
}

/// The most prims for curves that are of one width each.
const MOST_WIDTHS: usize = 8;

/// What all curves of a prim have in common.
#[derive(Clone, Copy, PartialEq)]
struct Kind {
    basis: Basis,
    closed: bool,
    radii: Radii,
    colored: bool,
    in_plies: bool,
}

#[derive(Clone, Copy, PartialEq)]
enum Radii {
    None,
    /// The same everywhere on all curves of the prim: the first is this one's.
    Even(f64),
    Varying,
}

impl Kind {
    fn of(set: &CurveSet, i: usize, widths: &mut Vec<f64>) -> Self {
        let curve = &set.curves[i];
        let radii = match (&curve.radii, curve.even_radius()) {
            (None, _) => Radii::None,
            (_, None) => Radii::Varying,
            (_, Some(radius)) => match widths.iter().find(|w| equal_radii(**w, radius)) {
                Some(known) => Radii::Even(*known),
                None if widths.len() < MOST_WIDTHS => {
                    widths.push(radius);
                    Radii::Even(radius)
                }
                None => Radii::Varying,
            },
        };
        Self {
            basis: curve.basis,
            closed: curve.closed,
            radii,
            colored: label(&set.colors, i).is_some(),
            in_plies: label(&set.plies, i).is_some(),
        }
    }

    /// The name of the `number`th prim, which is the first of several or the only one.
    fn name(&self, number: usize) -> String {
        let what = if self.in_plies { "curves" } else { "yarns" };
        if number == 1 {
            return what.to_owned();
        }
        let basis = match self.basis {
            Basis::CatmullRom => "catmull_rom",
            Basis::BSpline => "b_spline",
            Basis::Linear => "linear",
        };
        let ends = if self.closed { "closed" } else { "open" };
        format!("{what}_{basis}_{ends}_{number}")
    }
}

fn label<T: Copy>(list: &[Option<T>], i: usize) -> Option<T> {
    list.get(i).copied().flatten()
}

/// One prim for each basis, kind of ends and width, with the number of each yarn. Curves of one width have a prim of their
/// own, as constant widths are what every program reads alike.
pub(super) fn write(path: &Path, set: &CurveSet, out: &mut impl io::Write) -> io::Result<()> {
    // The file's own numbers, where it has some for all.
    let all_have_ids = !set.ids.is_empty() && set.ids.iter().all(Option::is_some);
    let number = |n: i64, otherwise: usize| i32::try_from(n).unwrap_or(otherwise as i32);
    let (mut kinds, mut widths) = (Vec::new(), Vec::new());
    let mut members: Vec<Vec<usize>> = Vec::new();
    for i in 0..set.curves.len() {
        let kind = Kind::of(set, i, &mut widths);
        match kinds.iter().position(|k| *k == kind) {
            Some(own) => members[own].push(i),
            None => {
                kinds.push(kind);
                members.push(vec![i]);
            }
        }
    }
    let group = |(number_of_prim, (kind, members)): (usize, (&Kind, &Vec<usize>))| {
        let all = || members.iter().copied();
        let yarn = |i: usize| number(if all_have_ids { set.ids[i].unwrap_or(0) } else { i as i64 }, i);
        let mut primvars = vec![("yarnId".to_owned(), Interpolated::Id(all().map(yarn).collect()))];
        if kind.in_plies {
            let plies = all().filter_map(|i| label(&set.plies, i)).map(|ply| number(ply, 0)).collect();
            primvars.push(("plyId".to_owned(), Interpolated::Id(plies)));
        }
        if kind.colored {
            let colors = all().filter_map(|i| label(&set.colors, i)).collect();
            primvars.push(("displayColor".to_owned(), Interpolated::Color(colors)));
        }
        let curves = all().map(|i| &set.curves[i]).collect();
        CurvesOut { name: kind.name(number_of_prim + 1), curves, radius: SOME_RADIUS, primvars }
    };
    let groups: Vec<CurvesOut<'_>> = kinds.iter().zip(&members).enumerate().map(group).collect();
    stage::write(path, set.unit_mm.unwrap_or(1.0), &groups, out)
}
