//! `[fiber.NAME]` and `[yarn.NAME]`: what cloth is made of.

use std::{collections::BTreeMap, f64::consts::TAU};

use super::{
    super::{Yarn, defaults},
    Context, Range, Reader, TWIST, radians,
};
use crate::{
    geometry::{
        density::KnownPacking,
        fiber::{
            Distribution, Placement,
            flyaway::{Flyaways, Spread},
        },
        ply::PlyParameters,
        yarn::{MAX_PLIES, touching_plies},
    },
    input::diagnostic::Sources,
    scattering::fiber::FiberMaterial,
};

/// The fibres that a yarn may name.
#[derive(Clone, Copy)]
struct Fibers<'a> {
    described: &'a BTreeMap<String, FiberMaterial>,
    /// Asked for one that is not described.
    built_in: fn(&str) -> Option<FiberMaterial>,
}

/// Reads every fibre and yarn, also those that the scene does not use: a mistake in a library is a mistake. `built_in` is asked
/// for fibres that nothing describes.
pub(super) fn read(
    root: &Reader<'_>,
    context: &Context<'_>,
    tilted: bool,
    built_in: fn(&str) -> Option<FiberMaterial>,
) -> Library {
    let fibers: BTreeMap<String, FiberMaterial> = root
        .named_tables("fiber")
        .into_iter()
        .filter_map(|(name, table)| Some((name.to_owned(), fiber(table)?)))
        .collect();
    let known = Fibers { described: &fibers, built_in };
    let yarns = root
        .named_tables("yarn")
        .into_iter()
        .filter_map(|(name, table)| Some((name.to_owned(), yarn(name, table, context, known, tilted)?)))
        .collect();
    let names = |key| root.named_tables(key).into_iter().map(|(name, _)| name.to_owned()).collect();
    Library { yarns, fibers, yarn_names: names("yarn"), fiber_names: names("fiber") }
}

/// Every yarn and fibre that a scene may name.
pub(super) struct Library {
    /// Yarns without mistakes.
    pub(super) yarns: BTreeMap<String, Yarn>,
    /// Fibres without mistakes.
    pub(super) fibers: BTreeMap<String, FiberMaterial>,
    /// Names of all yarns, also of those with mistakes, which are told already.
    pub(super) yarn_names: Vec<String>,
    /// Names of all fibres, also of those with mistakes, which are told already.
    pub(super) fiber_names: Vec<String>,
}

fn fiber(table: Reader<'_>) -> Option<FiberMaterial> {
    // Half a turn and more is as wide as anything can be; zero would be a mirror no light finds.
    let width = Range::above(0.0).and_at_most(360.0);
    let [r, tt, d] = ["r", "tt", "d"].map(|key| table.rgb_or(key, [0.0; 3], Range::UNIT));
    let beta_r = table.f64_or("beta_r", defaults::BETA_R, width);
    let beta_tt = table.f64_or("beta_tt", defaults::BETA_TT, width);
    let beta_n = table.f64_or("beta_n", defaults::BETA_N, width);
    for c in 0..3 {
        let sum = r[c] + tt[c] + d[c];
        if sum > 1.0 + 1e-9 {
            let channel = ["red", "green", "blue"][c];
            let key = ["d", "tt", "r"].into_iter().find(|k| table.has(k)).unwrap_or("d");
            let message = format!("r + tt + d is {sum:.4} in {channel}: the fibre would make light");
            table.error_at(key, message, Some("the three albedos of a channel sum to at most 1"));
            break;
        }
    }
    table.finish();
    Some(FiberMaterial { r, tt, d, beta_r: radians(beta_r), beta_tt: radians(beta_tt), beta_n: radians(beta_n) })
}

/// The keys of one ply, each with the yarn's own value behind it.
struct PlyKeys {
    radius: Option<f64>,
    aspect: f64,
    fiber: Option<String>,
    fibers: Option<u64>,
    fiber_radius: Option<f64>,
    density: Option<f64>,
    fiber_twist: f64,
    angle: Option<f64>,
}

impl PlyKeys {
    fn read(table: &Reader<'_>, behind: Option<&PlyKeys>, sources: &Sources) -> Self {
        let mut fiber_radius = table.f64("fiber_radius", Range::POSITIVE);
        let mut density = table.f64("density", Range::above(0.0).and_at_most(1.0));
        // An option of one takes the place of the other in a file.
        let option = |key| table.span(key).is_some_and(|s| sources.is_option(s.source()));
        match (option("fiber_radius"), option("density")) {
            (true, false) => density = None,
            (false, true) => fiber_radius = None,
            _ => {}
        }
        if fiber_radius.is_some() && density.is_some() {
            table.error_at(
                "density",
                "give `fiber_radius` or `density`, not both",
                Some("density = fibers * (fiber_radius / ply_radius)^2"),
            );
        }
        let own = fiber_radius.is_some() || density.is_some();
        Self {
            radius: table.f64("ply_radius", Range::POSITIVE).or(behind.and_then(|b| b.radius)),
            aspect: table.f64_or(
                "ply_aspect",
                behind.map_or(defaults::PLY_ASPECT, |b| b.aspect),
                Range::above(0.0).and_at_most(1.0),
            ),
            fiber: table.string("fiber").map(str::to_owned).or_else(|| behind.and_then(|b| b.fiber.clone())),
            fibers: table.u64("fibers", 1..=1_000_000).or(behind.and_then(|b| b.fibers)),
            fiber_radius: fiber_radius.or(if own { None } else { behind.and_then(|b| b.fiber_radius) }),
            density: density.or(if own { None } else { behind.and_then(|b| b.density) }),
            fiber_twist: table.f64_or("fiber_twist", behind.map_or(0.0, |b| b.fiber_twist), TWIST),
            angle: table.f64("ply_angle", Range::FINITE).map(radians),
        }
    }
}

/// `[yarn.NAME.packing]`: where explicit fibres lie, and how they lie where that is stated.
fn packing(table: Reader<'_>) -> (Placement, KnownPacking) {
    let measured = table.one_of_or("type", false, &[("regular", false), ("measured", true)]);
    let distribution = Distribution {
        epsilon: table.f64_or("epsilon", 0.0, Range::between(0.0, 0.5)),
        beta: table.f64_or("beta", 0.0, Range::between(0.0, 100.0)),
        migration: match table.numbers("migration", Range::UNIT).as_deref() {
            None => [1.0, 1.0],
            Some(&[least, most]) if least <= most => [least, most],
            Some(_) => {
                let hint = "migration = [0.85, 1.0]: the least and the most of a fibre's distance from the ply's axis";
                table.error_at("migration", "expected two numbers, the smaller first", Some(hint));
                [1.0, 1.0]
            }
        },
        migration_rate: table.f64_or("migration_rate", 1.0, Range::between(0.0, 100.0)),
        jitter: table.f64_or("jitter", 0.0, Range::between(0.0, 10.0)),
    };
    if !measured {
        for key in ["epsilon", "beta", "migration", "migration_rate", "jitter"] {
            if table.has(key) {
                table.error_at(key, format!("`{key}` is for `type = \"measured\"`"), None);
                break;
            }
        }
    }
    let known = KnownPacking {
        crowding: table.f64("crowding", Range::between(-1.0, 1.0)),
        regularity: table.f64("regularity", Range::between(0.0, 3.0)),
    };
    table.finish();
    (if measured { Placement::Measured(distribution) } else { Placement::Regular }, known)
}

/// `[yarn.NAME.flyaways]`: lengths in the scene's unit, as the yarn's radius; counts for each ply and unit of length.
fn flyaways(table: Reader<'_>, radius: f64) -> Flyaways {
    let spread = |key: &str, unit: f64, range: Range| -> Spread {
        match table.numbers(key, range).as_deref() {
            None => [0.0; 2],
            Some(&[mean]) => [mean / unit, 0.0],
            Some(&[mean, deviation]) if deviation >= 0.0 => [mean / unit, deviation / unit],
            Some(_) => {
                let message = "expected a mean and a standard deviation";
                table.error_at(key, message, Some("hair_length = [0.2, 0.05], or one number for all"));
                [0.0; 2]
            }
        }
    };
    let density = Range::between(0.0, 1e6);
    let flyaways = Flyaways {
        hair_density: table.f64_or("hair_density", 0.0, density) * radius,
        hair_start: spread("hair_start", radius, Range::at_least(0.0)),
        hair_rise: spread("hair_rise", radius, Range::FINITE),
        hair_length: spread("hair_length", radius, Range::FINITE),
        hair_turn: spread("hair_turn", 1f64.to_degrees(), Range::FINITE),
        loop_density: table.f64_or("loop_density", 0.0, density) * radius,
        loop_height: spread("loop_height", radius, Range::at_least(0.0)),
        loop_turns: table.f64_or("loop_turns", 1.0, Range::above(0.0).and_at_most(100.0)),
    };
    table.finish();
    flyaways
}

/// How many plies a yarn has: as many as it has tables of them, or as `plies` says; `None` if that is too many.
fn ply_count(table: &Reader<'_>, tables: usize, name: &str) -> Option<u64> {
    let count = table.u64("plies", 1..=MAX_PLIES as u64);
    match (count, tables) {
        (Some(n), m) if m > 0 && n != m as u64 => {
            table.error_at(
                "plies",
                format!("plies = {n}, but there are {m} [[yarn.{name}.ply]] tables"),
                Some("leave `plies` out"),
            );
            Some(m as u64)
        }
        (_, m) if m > MAX_PLIES => {
            table.error_at("ply", format!("{m} plies; at most {MAX_PLIES} are possible"), None);
            None
        }
        (_, m) if m > 0 => Some(m as u64),
        (n, _) => Some(n.unwrap_or(1)),
    }
}

/// What the plies of a yarn have in common: lengths in the scene's unit but `touching`, which is in yarn radii.
struct PlyMaker<'a> {
    context: &'a Context<'a>,
    radius: f64,
    count: u64,
    /// Of each ply's centre from the yarn's axis, if it is given.
    distance: Option<f64>,
    /// Radius of plies that touch each other.
    touching: f64,
    fibers: Fibers<'a>,
}

impl PlyMaker<'_> {
    /// A ply with its fibre; what is wrong with its keys is told at `place`.
    fn make(
        &self,
        keys: &PlyKeys,
        place: &Reader<'_>,
        index: usize,
    ) -> Option<(PlyParameters, (String, FiberMaterial))> {
        let ply_radius = keys.radius.map_or(self.touching, |r| r / self.radius);
        if ply_radius > 1.0 + 1e-9 {
            place.error_at("ply_radius", "a ply cannot be thicker than its yarn", Some("ply_radius <= radius"));
        }
        let short = ply_radius * keys.aspect.sqrt();
        let in_the_middle = if self.count == 1 { 0.0 } else { (1.0 - short).max(0.0) };
        let distance = self.distance.map_or(in_the_middle, |d| d / self.radius);
        if distance + short > 1.0 + 1e-6 {
            place.error_at(
                "ply_distance",
                "the ply reaches beyond the yarn's radius",
                Some("ply_distance + ply_radius <= radius"),
            );
        }
        let Some(n) = keys.fibers else {
            if !place.has("fibers") {
                let message = format!("missing key `fibers` in {}", place.title());
                place.error(message, Some("the number of fibres in a ply"));
            }
            return None;
        };
        let fiber_radius = self.fiber_radius(keys, place, ply_radius, n)?;
        let (name, material) = self.fiber(keys, place)?;
        let ply = PlyParameters {
            radius: ply_radius.min(1.0),
            aspect: keys.aspect,
            distance,
            angle: keys.angle.unwrap_or(TAU * index as f64 / self.count as f64),
            fibers: n as u32,
            fiber_radius,
            fiber_twist: radians(keys.fiber_twist),
        };
        Some((ply, (name.to_owned(), material)))
    }

    /// Radius of each of `n` fibres, in yarn radii.
    fn fiber_radius(&self, keys: &PlyKeys, place: &Reader<'_>, ply_radius: f64, n: u64) -> Option<f64> {
        let fiber_radius = match (keys.fiber_radius, keys.density) {
            (Some(r), _) => r / self.radius,
            (None, Some(d)) => ply_radius * (d / n.max(1) as f64).sqrt(),
            (None, None) => {
                if !place.has("fiber_radius") && !place.has("density") {
                    let message = format!("missing key `fiber_radius` in {}", place.title());
                    place.error(message, Some("or give `density`, the share of the ply's section that fibres fill"));
                }
                return None;
            }
        };
        if fiber_radius >= ply_radius {
            let key = if keys.fiber_radius.is_some() { "fiber_radius" } else { "density" };
            place.error_at(
                key,
                format!(
                    "fibres of radius {:.4} do not fit a ply of radius {:.4}",
                    fiber_radius * self.radius,
                    ply_radius * self.radius
                ),
                None,
            );
        }
        Some(fiber_radius)
    }

    /// Name and material of the ply's fibre.
    fn fiber<'k>(&self, keys: &'k PlyKeys, place: &Reader<'_>) -> Option<(&'k str, FiberMaterial)> {
        let Some(name) = keys.fiber.as_deref() else {
            if !place.has("fiber") {
                let message = format!("missing key `fiber` in {}", place.title());
                place.error(message, Some("the name of a [fiber.NAME] table"));
            }
            return None;
        };
        let material = self.fibers.described.get(name).cloned().or_else(|| (self.fibers.built_in)(name));
        if material.is_none() {
            let span = place.span("fiber").unwrap_or(place.header());
            let names: Vec<String> = self.fibers.described.keys().cloned().collect();
            self.context.unknown_thread(span, "fiber", name, &names);
        }
        Some((name, material?))
    }
}

/// One `[yarn.NAME]`.
fn yarn(name: &str, table: Reader<'_>, context: &Context<'_>, fibers: Fibers<'_>, tilted: bool) -> Option<Yarn> {
    let tex = table.f64("tex", Range::POSITIVE);
    let radius = table.f64("radius", Range::POSITIVE);
    let ply_twist = table.f64_or("ply_twist", 0.0, TWIST);
    let unevenness = table.f64_or("unevenness", 0.0, Range::between(0.0, 0.3));
    let distance = table.f64("ply_distance", Range::at_least(0.0));
    let shared = PlyKeys::read(&table, None, context.sources);
    let ply_tables = table.tables("ply");
    let count = ply_count(&table, ply_tables.len(), name)?;
    let (placement, known_packing) =
        table.table("packing").map_or((Placement::Regular, KnownPacking::default()), packing);
    let flyaways = table.table("flyaways").map(|t| flyaways(t, radius.unwrap_or(1.0)));
    let Some(radius) = radius else {
        if !table.has("radius") {
            table.error(
                format!("missing key `radius` in {}", table.title()),
                Some("outer radius of the yarn; the radii of a curve file win over it"),
            );
        }
        table.finish();
        return None;
    };
    let (touching, _) = touching_plies(count as u32);

    let maker = PlyMaker { context, radius, count, distance, touching, fibers };
    let made: Vec<_> = if ply_tables.is_empty() {
        (0..count as usize).filter_map(|index| maker.make(&shared, &table, index)).collect()
    } else {
        let own = |(index, ply): (usize, Reader<'_>)| {
            let keys = PlyKeys::read(&ply, Some(&shared), context.sources);
            let made = maker.make(&keys, &ply, index);
            ply.finish();
            made
        };
        ply_tables.into_iter().enumerate().filter_map(own).collect()
    };
    let (plies, materials): (Vec<_>, Vec<_>) = made.into_iter().unzip();
    table.finish();
    (plies.len() == count as usize).then(|| Yarn {
        name: name.to_owned(),
        radius: radius * context.unit,
        plies,
        ply_twist: radians(ply_twist),
        fibers: materials,
        placement,
        known_packing,
        flyaways,
        unevenness,
        tex,
        tilted,
    })
}
