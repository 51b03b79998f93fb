//! From the keys of a garment to its yarns: meshes read, tiles relaxed, poses laid.

use std::{collections::BTreeMap, path::Path};

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::{
    super::{
        Context,
        cloth::Detail,
        color::{ColorPlan, FabricCoordinates},
        poses::{Frames, Moment, Pose, between},
        sequence::check_moves,
        yarns::Library,
    },
    GarmentPlan, Pattern, Rule,
};
use crate::{
    files::mesh_file,
    garment::{Cloth, Garment, GarmentError, GarmentMesh, Laid, LaidYarn, Options, Stranded},
    geometry::{curve::Curve, mesh::Mesh},
    math::words::counted,
    pattern::knit::too_many_strands,
    scene::{FabricMotion, GarmentFacts, PanelFacts, Taken, Yarn},
};

/// For each rule its colours where each is a yarn of its own, and the yarns in the library that they are.
type StrandedRules = (Vec<Option<Stranded>>, Vec<Vec<usize>>);

/// What a rule has become: curves of one kind of yarn.
pub(in crate::scene::load) struct MadePanels {
    pub(in crate::scene::load) origin: String,
    /// What mattes call it, if not as the fabric.
    pub(in crate::scene::load) name: Option<String>,
    /// The yarn's name, if it is not the fabric's.
    pub(in crate::scene::load) yarn: Option<String>,
    pub(in crate::scene::load) color: Option<ColorPlan>,
    pub(in crate::scene::load) curves: Vec<(Curve, Vec<f64>)>,
    /// What is known of curves that a survey leaves out.
    pub(in crate::scene::load) taken: Taken,
    /// From which of the curves on they lie on the panel of a name.
    pub(in crate::scene::load) panels: Vec<(usize, String)>,
    pub(in crate::scene::load) coordinates: FabricCoordinates,
    pub(in crate::scene::load) motion: FabricMotion,
}

impl Rule {
    /// Tex of its yarn, or of the garment's `yarn` where it names none.
    fn tex(&self, yarn: &str, library: &Library) -> Option<f64> {
        library.yarns.get(self.yarn.as_deref().unwrap_or(yarn))?.tex
    }

    /// Radius of its yarn, or this one where it names none; mm.
    fn radius(&self, own: f64, library: &Library) -> f64 {
        self.yarn.as_ref().and_then(|name| library.yarns.get(name)).map_or(own, |yarn| yarn.radius)
    }

    /// What messages call it.
    fn origin(&self, mesh: &Path) -> String {
        let panels = self.panels.as_ref().map_or(String::new(), |chosen| format!(", {chosen}"));
        format!("{}{panels}, {}", mesh.display(), self.cloth.name)
    }
}

impl GarmentPlan {
    /// Reads the mesh and lays the yarns, unless only facts are wanted.
    pub(in crate::scene::load) fn make(
        self,
        (yarn, radius): (&str, f64),
        color: &ColorPlan,
        context: &Context<'_>,
        library: &Library,
        detail: &Detail,
        warnings: &mut Vec<String>,
    ) -> Option<(Vec<MadePanels>, GarmentFacts)> {
        let cloths = self.cloths((library.yarns.get(yarn), radius), context, library, warnings);
        let frames = Frames::find(&self.path, detail);
        let (read, own_unit) = self.read(&frames, context)?;
        let unit = context.unit_of((&self.path, self.span), own_unit, self.unit).unwrap_or(context.unit) * self.scale;
        let rest = &read[&frames.rest];
        let cloths = cloths?;
        let sizes: Vec<DVec2> = cloths.iter().map(|c| c.tile.stitch()).collect();
        let overlap = cloths.iter().filter_map(|c| c.tile.overlap()).max_by(|a, b| a.share.total_cmp(&b.share));
        let options = Options {
            unit_mm: unit,
            uv_mm: self.uv_unit,
            cloths,
            seam: self.seam,
            tension: color.tension(),
            coordinates: color.needs_places() || detail.uv || self.rules.iter().any(|r| r.color.is_some()),
            pressed: self.body.is_some(),
            near: self.near,
        };
        let of_file = |error: GarmentError| if error.of_mesh { error.of(&frames.rest.path) } else { error };
        let garment = Garment::new(rest, options).map_err(|error| self.tell(of_file(error), context)).ok()?;
        let mut notes = garment.report().notes.clone();
        let tex: Vec<Option<f64>> = self.rules.iter().map(|rule| rule.tex(yarn, library)).collect();
        let (stranded, own) = self.stranded((yarn, color), (&garment, &sizes), context, library, warnings)?;
        let amounts = amounts(&garment, &stranded);
        let mut facts = GarmentFacts { overlap, ..self.facts(&garment, &amounts, &tex) };
        let meshes = self.posed(&frames, &read, context)?;
        let kept = kept(&meshes, frames.shown);
        let shown = kept.iter().filter(|i| **i < frames.shown).count();
        check_moves(&kept[1..shown], &kept[shown..], self.span, detail, context)?;
        if detail.survey {
            self.bodies(&kept, unit, false, detail, (context, warnings))?;
            facts.repairs.clone_from(&notes);
            let radii: Vec<f64> = self.rules.iter().map(|rule| rule.radius(radius, library)).collect();
            return Some((self.not_laid(&garment, &sizes, (&amounts, &radii), shown), facts));
        }
        let mut meshes: Vec<GarmentMesh> =
            meshes.into_iter().enumerate().filter(|(i, _)| kept.contains(i)).map(|(_, mesh)| mesh).collect();
        // Plies wind by lengths in the first frame, so that they keep their places from frame to frame.
        let with_rest = frames.animated && (meshes.len() > 1 || meshes[0].points != rest.points);
        let times = meshes.len();
        if with_rest {
            meshes.push(rest.clone());
        }
        let bodies = self.bodies(&kept, unit, with_rest, detail, (context, warnings))?;
        let all: Vec<&GarmentMesh> = meshes.iter().collect();
        let body: Vec<&Mesh> = bodies.iter().collect();
        let mut laid = match garment.lay(rest, &all, &body, &stranded, &mut notes) {
            Ok(laid) => laid,
            Err((_, problem)) => {
                context.error(self.span, problem, None);
                return None;
            }
        };
        let names: Vec<String> = garment.report().panels.iter().map(|p| p.group.clone()).collect();
        let extents: Vec<[f32; 2]> = (0..self.rules.len()).map(|i| extent(&garment, i)).collect();
        drop(garment);
        let at_rest = if with_rest { laid.pop() } else { None };
        debug_assert_eq!(laid.len(), times);
        let mut later = laid.split_off(1);
        let flow = later.split_off(shown - 1);
        let first = laid.pop()?;
        let lengths: Vec<f64> = first.iter().map(|yarns| length(yarns)).collect();
        facts.yarn_length = lengths.iter().sum();
        facts.weight = weight(&lengths, &tex);
        facts.repairs = notes;
        Some((self.made(first, [later, flow], at_rest, (&sizes, &extents, &names), own), facts))
    }

    /// The relaxed tile of each rule, of the garment's yarn of a radius where the rule names none.
    fn cloths(
        &self,
        own: (Option<&Yarn>, f64),
        context: &Context<'_>,
        library: &Library,
        warnings: &mut Vec<String>,
    ) -> Option<Vec<Cloth>> {
        let made = self.rules.iter().map(|rule| {
            let yarn = rule.yarn.as_ref().and_then(|name| library.yarns.get(name));
            let tile =
                rule.cloth.tile(rule.stitch, yarn.map_or(own, |yarn| (Some(yarn), yarn.radius)), context, warnings)?;
            let (panels, points) = (rule.panels.clone(), rule.cloth.points);
            let Rule { grain, seam, hem, hems_itself, .. } = *rule;
            Some(Cloth { panels, tile, grain, points, seam, hem, hems_itself })
        });
        made.collect()
    }

    /// The meshes of all moments, and the unit that their file has, mm.
    fn read(&self, frames: &Frames, context: &Context<'_>) -> Option<(BTreeMap<Moment, GarmentMesh>, Option<f64>)> {
        let mut read = BTreeMap::new();
        let mut own_unit = None;
        for moment in frames.moments() {
            let found = moment.garment(&self.choices[0], self.z_up, (context, self.span));
            let (mesh, unit) = found.map_err(|error| self.tell(error, context)).ok()?;
            own_unit = unit;
            read.insert(moment.clone(), mesh);
        }
        Some((read, own_unit))
    }

    fn tell(&self, error: GarmentError, context: &Context<'_>) {
        let hint = Some(error.hint.clone()).filter(|h| !h.is_empty());
        let rule = error.cloth.and_then(|i| self.rules.get(i));
        context.error(rule.map_or(self.span, |rule| rule.span), error.to_string(), hint);
    }

    /// For each rule whose colours are yarns of their own where they are, and the yarns in the library; `None` and nothing
    /// for others. The garment's own `yarn` and colours are those of rules that say none.
    fn stranded(
        &self,
        (yarn, color): (&str, &ColorPlan),
        (garment, sizes): (&Garment, &[DVec2]),
        context: &Context<'_>,
        library: &Library,
        warnings: &mut Vec<String>,
    ) -> Option<StrandedRules> {
        let mut all = Vec::new();
        let mut own = Vec::new();
        for (i, rule) in self.rules.iter().enumerate() {
            let plan = rule.color.as_ref().unwrap_or(color);
            let name = rule.yarn.as_deref().unwrap_or(yarn);
            let base = library.yarns.keys().position(|n| n == name);
            let (Pattern::Knit { stranding: Some(work), .. }, Some(base), false) =
                (&rule.cloth.pattern, base, plan.is_plain())
            else {
                all.push(None);
                own.push(Vec::new());
                continue;
            };
            let stitch = sizes[i].as_vec2().to_array();
            let (color, yarns) = plan.laid(extent(garment, i), stitch, base, context, library)?;
            let stranded = Stranded { color, catch: work.catch, carry: work.carry };
            let most = garment.floats(i, &stranded).0.most;
            let row = format!("{}: a row", rule.origin(&self.path));
            warnings.extend(too_many_strands(&row, most, "`color_work = \"printed\"`"));
            all.push(Some(stranded));
            own.push(yarns);
        }
        Some((all, own))
    }

    /// What is known before yarns are laid; of their overlap nothing.
    fn facts(&self, garment: &Garment, amounts: &[(f64, u64)], tex: &[Option<f64>]) -> GarmentFacts {
        let report = garment.report();
        let (lengths, points): (Vec<f64>, Vec<u64>) = amounts.iter().copied().unzip();
        let panel = |i: usize| PanelFacts {
            name: report.panels[i].group.clone(),
            cloth: self.rules[report.cloth[i]].cloth.name.clone(),
            stitches: report.stitches[i],
        };
        GarmentFacts {
            path: self.path.display().to_string(),
            cloth: self.rules[0].cloth.name.clone(),
            panels: (0..report.panels.len()).map(panel).collect(),
            stitches: report.all_stitches(),
            near: self.near,
            yarn_length: lengths.iter().sum(),
            weight: weight(&lengths, tex),
            overlap: None,
            control_points: points.iter().sum(),
            uv_ratio: [report.ratio.p5, report.ratio.p50, report.ratio.p95],
            stretched: report.stretched,
            compressed: report.compressed,
            uv_mm: report.uv_mm,
            sewn: report.sewn,
            free: report.free,
            bounds: report.bounds,
            repairs: Vec::new(),
        }
    }

    /// The garment's mesh in every pose; all must have the faces of the one at rest.
    fn posed(
        &self,
        frames: &Frames,
        read: &BTreeMap<Moment, GarmentMesh>,
        context: &Context<'_>,
    ) -> Option<Vec<GarmentMesh>> {
        let mut meshes = Vec::new();
        for pose in &frames.poses {
            let (a, b) = (&read[&pose.before], &read[&pose.after]);
            for (mesh, moment) in [(a, &pose.before), (b, &pose.after)] {
                if let Err(problem) = read[&frames.rest].same_topology(mesh) {
                    let message = format!("{}: {problem}", moment.path.display());
                    context.error(self.span, message, Some("all frames have the same faces".to_owned()));
                    return None;
                }
            }
            meshes.push(between(a, b, pose.share));
        }
        Some(meshes)
    }

    /// What a survey tells of each rule that has panels: all but its yarns, which are not laid.
    fn not_laid(
        self,
        garment: &Garment,
        sizes: &[DVec2],
        (amounts, radii): (&[(f64, u64)], &[f64]),
        shown: usize,
    ) -> Vec<MadePanels> {
        let mut out = Vec::new();
        for (i, rule) in self.rules.into_iter().enumerate() {
            if garment.counts(i).is_none() {
                continue;
            }
            let (extent, stitch) = (extent(garment, i), sizes[i].as_vec2().to_array());
            out.push(MadePanels {
                origin: rule.origin(&self.path),
                name: rule.name,
                yarn: rule.yarn,
                color: rule.color,
                curves: Vec::new(),
                taken: Taken::not_made(amounts[i].1, amounts[i].0 / radii[i], garment.is_pressed(i)),
                panels: Vec::new(),
                coordinates: FabricCoordinates::laid(Vec::new(), garment.kinds(i), extent, stitch),
                motion: FabricMotion { later: vec![Vec::new(); shown - 1], ..FabricMotion::default() },
            });
        }
        out
    }

    /// Yarns as curves, for each rule that has any; `sizes` are those of its stitches, mm, `extents` its columns and rows,
    /// `own` the yarns of its colours where each is one, and `names` those of all panels.
    fn made(
        self,
        first: Laid,
        [mut later, mut flow]: [Vec<Laid>; 2],
        mut rest: Option<Laid>,
        (sizes, extents, names): (&[DVec2], &[[f32; 2]], &[String]),
        own: Vec<Vec<usize>>,
    ) -> Vec<MadePanels> {
        let points = |laid: &mut Laid, rule: usize| -> Vec<Vec<DVec3>> {
            std::mem::take(&mut laid[rule]).into_iter().map(|yarn| yarn.points).collect()
        };
        let mut out = Vec::new();
        for (i, ((yarns, rule), own)) in first.into_iter().zip(self.rules).zip(own).enumerate() {
            if yarns.is_empty() {
                continue;
            }
            let motion = FabricMotion {
                later: later.iter_mut().map(|laid| points(laid, i)).collect(),
                rest: rest.as_mut().map(|laid| points(laid, i)),
                flow: flow.iter_mut().map(|laid| points(laid, i)).collect(),
            };
            let mut panels: Vec<(usize, String)> = Vec::new();
            for (k, yarn) in yarns.iter().enumerate() {
                let name = &names[yarn.panel as usize];
                if panels.last().is_none_or(|(_, before)| before != name) {
                    panels.push((k, name.clone()));
                }
            }
            let own: Vec<usize> =
                if own.is_empty() { own } else { yarns.iter().map(|y| own[usize::from(y.color)]).collect() };
            let kinds = yarns.iter().map(|yarn| yarn.kind).collect();
            let (places, curves) = yarns
                .into_par_iter()
                .map(|mut yarn| (std::mem::take(&mut yarn.coordinates), yarn.into_curve()))
                .unzip();
            out.push(MadePanels {
                origin: rule.origin(&self.path),
                name: rule.name,
                yarn: rule.yarn,
                color: rule.color,
                curves,
                taken: Taken::default(),
                panels,
                coordinates: FabricCoordinates::laid(places, kinds, extents[i], sizes[i].as_vec2().to_array())
                    .with_yarns(own),
                motion,
            });
        }
        out
    }

    /// The body in each pose that is kept; one that is open is told.
    fn bodies(
        &self,
        kept: &[usize],
        unit: f64,
        with_rest: bool,
        detail: &Detail,
        (context, warnings): (&Context<'_>, &mut Vec<String>),
    ) -> Option<Vec<Mesh>> {
        let Some((path, span)) = &self.body else { return Some(Vec::new()) };
        let own = Frames::find(path, detail);
        let mut read: BTreeMap<Moment, Mesh> = BTreeMap::new();
        for moment in own.moments() {
            match moment.body(&self.choices[1], self.z_up, (context, *span)) {
                Ok((mut mesh, own_unit)) => {
                    // A body without a unit of its own has the garment's.
                    let own = context.unit_of((path, *span), own_unit, self.unit);
                    let scale = own.map_or(unit, |mm| mm * self.scale);
                    mesh.transform(&glam::DAffine3::from_scale(DVec3::splat(scale)));
                    read.insert(moment.clone(), mesh);
                }
                Err(problem) => {
                    context.error(*span, problem, None);
                    return None;
                }
            }
        }
        let posed = |pose: &Pose| {
            let (a, b) = (&read[&pose.before], &read[&pose.after]);
            let mut mesh = a.clone();
            if a.points.len() == b.points.len() {
                mesh.points = a.points.iter().zip(&b.points).map(|(a, b)| a.lerp(*b, pose.share)).collect();
            }
            mesh
        };
        let (_, open) = mesh_file::border(&read[&own.rest]);
        if open > 0 {
            let path = own.rest.path.display();
            warnings.push(format!(
                "{path}: the body is open: {} with a face on one side only, where yarns may get into it",
                counted(open as u64, "edge")
            ));
        }
        let last = own.poses.len() - 1;
        let mut out: Vec<Mesh> = kept.iter().map(|&i| posed(&own.poses[i.min(last)])).collect();
        if with_rest {
            out.push(read[&own.rest].clone());
        }
        Some(out)
    }
}

/// Length of the yarns of each rule, mm, and about as many control points, with what floats.
fn amounts(garment: &Garment, stranded: &[Option<Stranded>]) -> Vec<(f64, u64)> {
    let report = garment.report();
    let bare = report.yarn_length.iter().copied().zip(report.control_points.iter().copied());
    let with_floats = |(i, (length, points))| match stranded.get(i).and_then(Option::as_ref) {
        Some(stranded) => {
            let (_, floating, more) = garment.floats(i, stranded);
            (length + floating, points + more)
        }
        None => (length, points),
    };
    bare.enumerate().map(with_floats).collect()
}

/// Columns and rows of the largest panel of a rule.
fn extent(garment: &Garment, rule: usize) -> [f32; 2] {
    garment.counts(rule).unwrap_or([1, 1]).map(|n| n as f32)
}

/// Which poses are laid: one where nothing moves while the shutter is open, and those behind `shown` if anything moves
/// from one of them to the next.
fn kept(meshes: &[GarmentMesh], shown: usize) -> Vec<usize> {
    let moves = |poses: &[GarmentMesh]| poses.windows(2).any(|pair| pair[0].points != pair[1].points);
    let mut kept: Vec<usize> = if moves(&meshes[..shown]) { (0..shown).collect() } else { vec![0] };
    if moves(&meshes[shown..]) {
        kept.extend(shown..meshes.len());
    }
    kept
}

/// Length of yarns, mm: between the places where segments of their B-splines join.
fn length(yarns: &[LaidYarn]) -> f64 {
    let of = |yarn: &LaidYarn| {
        let knot = |w: &[DVec3]| (w[0] + 4.0 * w[1] + w[2]) / 6.0;
        yarn.points.windows(4).map(|w| knot(&w[..3]).distance(knot(&w[1..]))).sum::<f64>()
    };
    // Chords are a little shorter than what they span: by two percent for loops of twelve points.
    let each: Vec<f64> = yarns.par_iter().map(of).collect();
    each.iter().sum()
}

/// Grams of yarns of such lengths, mm, by their tex (grams in a kilometre); `None` where that of one is not known.
fn weight(lengths: &[f64], tex: &[Option<f64>]) -> Option<f64> {
    let all = lengths.iter().zip(tex).filter(|(length, _)| **length > 0.0);
    all.map(|(length, tex)| Some(length * 1e-6 * (*tex)?)).sum()
}
