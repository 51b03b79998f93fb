//! Converged pictures: two halves of independent seeds, kept on disk under a hash of everything that changes them.

use std::{
    path::{Path, PathBuf},
    time::UNIX_EPOCH,
};

use super::LOBES;
use crate::{
    image::{
        self, Attribute, Image, ImageError,
        exr::{self, ChannelSpec, ExrLayout, Line, Sample},
        interleaved,
        metric::Halves,
    },
    render::picture::PART_NAMES,
    scene::identity::hashed,
};

/// A converged picture.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Converged {
    /// Both halves.
    pub halves: Halves,
    /// Samples per pixel of both together.
    pub spp: f64,
    /// Seconds that a sample per pixel took, for choosing sample counts.
    pub sample_seconds: f64,
    /// Direct and indirect light by the lobe of its first scattering at cloth, in the order of [`LOBES`], where
    /// it was asked for; of the first half.
    pub lobes: Option<[Vec<[f32; 3]>; 5]>,
}

/// One of the halves, as a render gives it.
#[derive(Clone, Debug)]
pub(crate) struct Half {
    /// R, G, B, A, and the parts of light if wanted.
    pub image: Image,
    /// Samples per pixel.
    pub spp: f64,
    /// Seconds of rendering.
    pub seconds: f64,
}

impl Converged {
    /// Puts two halves together; `None` if a picture lacks colours.
    pub(crate) fn new(first: &Half, second: &Half) -> Option<Self> {
        let colors = |image: &Image| image.rgb().map(interleaved);
        let alpha =
            |image: &Image| image.channel("A").map_or_else(|| vec![1.0; image.width * image.height], <[f32]>::to_vec);
        let (a, b) = (alpha(&first.image), alpha(&second.image));
        let halves = Halves {
            width: first.image.width,
            colors: [colors(&first.image)?, colors(&second.image)?],
            alpha: a.iter().zip(b).map(|(a, b)| 0.5 * (a + b)).collect(),
        };
        let spp = first.spp + second.spp;
        let sample_seconds = (first.seconds + second.seconds) / spp;
        Some(Self { halves, spp, sample_seconds, lobes: lobes(&first.image) })
    }

    /// Reads what [`Self::store`] has written; `None` if there is no such file, or another program has written it.
    pub(crate) fn load(path: &Path) -> Option<Self> {
        let image = image::read(path).ok()?;
        let plane = |layer: &str| image.layer_rgb(layer).map(interleaved);
        let number = |name: &str| match image.attribute(name)? {
            Attribute::Double(value) => Some(*value),
            _ => None,
        };
        let lobes: Vec<_> = LOBES.iter().filter_map(|name| plane(name)).collect();
        let colors = [plane("first")?, plane("second")?];
        // A file that was cut or damaged in a way that EXR does not notice must not become the truth.
        if colors.iter().flatten().flatten().any(|v| !v.is_finite()) {
            return None;
        }
        Some(Self {
            halves: Halves { width: image.width, colors, alpha: image.channel("A")?.to_vec() },
            spp: number("yarnray.spp")?,
            sample_seconds: number("yarnray.sample_seconds")?,
            lobes: lobes.try_into().ok(),
        })
    }

    /// Writes an EXR: the picture as R, G, B, A, the variance of its pixels from the difference of the halves, the layers
    /// `first` and `second` with the halves, and the lobes.
    ///
    /// # Errors
    /// What writing a file can say.
    pub(crate) fn store(&self, path: &Path) -> Result<(), ImageError> {
        let (mean, variance) = (self.halves.mean(), self.halves.variance());
        let mut layers: Vec<(String, &[[f32; 3]])> = vec![
            (String::new(), &mean),
            ("variance.".to_owned(), &variance),
            ("first.".to_owned(), &self.halves.colors[0]),
            ("second.".to_owned(), &self.halves.colors[1]),
        ];
        for (name, colors) in LOBES.iter().zip(self.lobes.iter().flatten()) {
            layers.push((format!("{name}."), colors));
        }
        let names = layers.iter().flat_map(|(layer, _)| ["R", "G", "B"].map(|c| format!("{layer}{c}")));
        let channels = names.chain(["A".to_owned()]).map(|name| ChannelSpec::new(name, Sample::F32)).collect();
        let width = self.halves.width;
        let mut layout = ExrLayout::new(width, mean.len() / width.max(1), channels);
        layout.attributes = vec![
            ("yarnray.spp".to_owned(), Attribute::Double(self.spp)),
            ("yarnray.sample_seconds".to_owned(), Attribute::Double(self.sample_seconds)),
        ];
        exr::write(path, &layout, |y, lines| {
            let row = y * width..(y + 1) * width;
            let planes = layers.iter().flat_map(|(_, colors)| (0..3).map(move |k| (k, *colors)));
            for (line, plane) in lines.iter_mut().zip(planes.map(Some).chain([None])) {
                let Line::Float(line) = line else { continue };
                match plane {
                    Some((k, colors)) => line.iter_mut().zip(&colors[row.clone()]).for_each(|(out, c)| *out = c[k]),
                    None => line.copy_from_slice(&self.halves.alpha[row.clone()]),
                }
            }
        })
    }
}

/// Direct and indirect light of each lobe together, if the picture has such layers.
fn lobes(image: &Image) -> Option<[Vec<[f32; 3]>; 5]> {
    let sums: Option<Vec<Vec<[f32; 3]>>> = LOBES
        .iter()
        .map(|lobe| {
            let mut sum = vec![[0.0; 3]; image.width * image.height];
            let parts = PART_NAMES.iter().filter(|part| part.split('_').next() == Some(lobe));
            for part in parts {
                let [r, g, b] = image.layer_rgb(part)?;
                for (i, sum) in sum.iter_mut().enumerate() {
                    *sum = [sum[0] + r[i], sum[1] + g[i], sum[2] + b[i]];
                }
            }
            Some(sum)
        })
        .collect();
    sums?.try_into().ok()
}

/// The file of a converged picture that everything in `parts` decides, together with the program itself.
pub(crate) fn path(cache: &Path, parts: &[&str]) -> PathBuf {
    cache.join(format!("{}.exr", key(parts)))
}

/// A name for everything in `parts` and for this program.
pub(crate) fn key(parts: &[&str]) -> String {
    let mut bytes = Vec::new();
    // With its length before each, so that no two lists are one text.
    for part in parts.iter().chain([&exr::SOFTWARE]) {
        bytes.extend((part.len() as u64).to_le_bytes());
        bytes.extend(part.as_bytes());
    }
    // A commit names the program only if nothing was changed since.
    if (exr::SOFTWARE.contains("dirty") || exr::SOFTWARE.contains("unknown"))
        && let Ok(file) = std::env::current_exe().and_then(std::fs::metadata)
    {
        let changed = file.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok());
        bytes.extend(file.len().to_le_bytes());
        bytes.extend(changed.map_or(0, |time| time.as_nanos()).to_le_bytes());
    }
    hashed(&bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Channel;

    fn half(level: f32) -> Half {
        let mut image = Image::new(5, 4);
        let parts = PART_NAMES.iter().flat_map(|p| ["R", "G", "B"].map(|c| format!("{p}.{c}")));
        for (i, name) in ["R", "G", "B", "A"].map(str::to_owned).into_iter().chain(parts).enumerate() {
            let samples = (0..20).map(|p| level + p as f32 + 0.1 * i as f32).collect();
            image.channels.push(Channel { name, samples });
        }
        Half { image, spp: 32.0, seconds: 8.0 }
    }

    #[test]
    fn what_is_stored_is_found_again() {
        let directory = tempfile::tempdir().unwrap();
        let path = path(directory.path(), &["a", "b"]);
        assert_eq!(Converged::load(&path), None);
        let converged = Converged::new(&half(1.0), &half(2.0)).unwrap();
        assert_eq!((converged.spp, converged.sample_seconds), (64.0, 0.25));
        converged.store(&path).unwrap();
        assert_eq!(Converged::load(&path), Some(converged.clone()));
        let image = image::read(&path).unwrap();
        assert_eq!(image.channel("R").unwrap()[3], 1.5 + 3.0);
        assert!((image.channel("variance.G").unwrap()[0] - 0.25).abs() < 1e-6);
        let lobe = converged.lobes.unwrap()[0][0][0];
        assert!(lobe > 2.0, "direct and indirect: {lobe}");
        std::fs::write(&path, b"not a picture").unwrap();
        assert_eq!(Converged::load(&path), None);
    }

    #[test]
    fn every_part_changes_the_name() {
        let all = [key(&["a", "b"]), key(&["a", "c"]), key(&["ab"]), key(&["a", "b", ""]), key(&[])];
        for (i, a) in all.iter().enumerate() {
            assert!(all[..i].iter().all(|b| a != b));
        }
        assert_eq!(key(&["a"]), key(&["a"]));
    }
}
