//! Which layers an EXR has beside the picture.

use super::LightGroups;

/// Layers of an EXR beside the picture and its alpha.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layers {
    /// The light by where it came from: R, TT, D, F and B of its first scattering at cloth, direct and indirect; lights;
    /// other surfaces.
    pub lobes: bool,
    /// Distance to the first yarn or ground along the view.
    pub depth: bool,
    /// Normal of the first ply.
    pub normal: bool,
    /// Albedo of what is seen first.
    pub albedo: bool,
    /// Variance of each pixel's mean.
    pub variance: bool,
    /// Number of samples.
    pub samples: bool,
    /// Which fabric, yarn and ply cover each pixel, as Cryptomatte.
    pub cryptomatte: bool,
    /// Where what is seen first lies in the world.
    pub position: bool,
    /// By how many pixels it moves until the next frame.
    pub motion: bool,
    /// Its texture coordinates.
    pub uv: bool,
    /// The light of so many groups of lights, each by itself.
    pub light_groups: u8,
}

impl Default for Layers {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// A layer's name, and where it is switched.
pub type LayerName = (&'static str, fn(&mut Layers) -> &mut bool);

impl Layers {
    /// The name of the layers of [`Self::light_groups`] in scene files.
    pub const LIGHT_GROUPS: &str = "light_groups";
    /// Every other layer with its name there.
    pub const NAMES: [LayerName; 10] = [
        ("lobes", |l| &mut l.lobes),
        ("depth", |l| &mut l.depth),
        ("normal", |l| &mut l.normal),
        ("albedo", |l| &mut l.albedo),
        ("variance", |l| &mut l.variance),
        ("samples", |l| &mut l.samples),
        ("cryptomatte", |l| &mut l.cryptomatte),
        ("position", |l| &mut l.position),
        ("motion", |l| &mut l.motion),
        ("uv", |l| &mut l.uv),
    ];
    /// None of them.
    pub const NONE: Self = Self {
        lobes: false,
        depth: false,
        normal: false,
        albedo: false,
        variance: false,
        samples: false,
        cryptomatte: false,
        position: false,
        motion: false,
        uv: false,
        light_groups: 0,
    };
    /// Those of a scene that names none. The light by where it came from is not among them, whose sums would take two
    /// thirds of the film, nor Cryptomatte, whose channels are many, nor what only some compositors want.
    pub const DEFAULT: Self =
        Self { depth: true, normal: true, albedo: true, variance: true, samples: true, ..Self::NONE };
    /// All of them, and as many groups of lights as there may be.
    pub const ALL: Self = Self {
        lobes: true,
        cryptomatte: true,
        position: true,
        motion: true,
        uv: true,
        light_groups: LightGroups::MOST as u8,
        ..Self::DEFAULT
    };

    /// All names in scene files, but `all`.
    pub fn names() -> impl Iterator<Item = &'static str> {
        Self::NAMES.into_iter().map(|(name, _)| name).chain([Self::LIGHT_GROUPS])
    }
}
