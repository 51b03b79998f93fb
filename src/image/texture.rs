//! Pictures that are looked up place by place, filtered: through OpenImageIO's texture system.

use std::path::Path;

use super::ImageError;

/// A texture of linear colours. (0, 0) is the lower left corner of the picture, which repeats beyond 0 to 1; what is
/// transparent is white.
#[derive(Debug)]
pub struct Texture {
    #[cfg(feature = "oiio")]
    file: crate::ffi::oiio::TextureFile,
    /// Of the file's bytes.
    #[cfg(feature = "oiio")]
    hash: u128,
    /// Holds the copy that OpenImageIO reads, until this is dropped.
    #[cfg(feature = "oiio")]
    _folder: tempfile::TempDir,
    #[cfg(not(feature = "oiio"))]
    never: std::convert::Infallible,
}

impl Texture {
    /// Opens any picture that OpenImageIO reads; integer samples are made linear.
    ///
    /// # Errors
    /// [`ImageError`]: the file cannot be read, or there is no OpenImageIO.
    #[cfg(feature = "oiio")]
    pub fn open(path: &Path) -> Result<Self, ImageError> {
        use crate::ffi::oiio::{OiioError, TextureFile};
        // What is no file at all is told in the words of every other picture.
        let bytes = std::fs::read(path).map_err(|e| unreadable(path, &e))?;
        let hash = twox_hash::XxHash3_128::oneshot(&bytes);
        drop(bytes);
        let failed = |reason: String| ImageError::Read { path: path.into(), reason };
        let folder = tempfile::Builder::new()
            .prefix("yarnray-texture-")
            .tempdir()
            .map_err(|e| failed(format!("no place for a copy with smaller levels: {e}")))?;
        let file =
            TextureFile::open(path, &folder.path().join("texture.exr"), super::SAMPLE_LIMIT).map_err(|error| {
                match error {
                    OiioError::Missing(_) => ImageError::Unsupported { path: path.into(), reason: error.to_string() },
                    _ => failed(error.to_string()),
                }
            })?;
        Ok(Self { file, hash, _folder: folder })
    }

    /// Without the feature: an error that says how to get it.
    ///
    /// # Errors
    /// Always.
    #[cfg(not(feature = "oiio"))]
    pub fn open(path: &Path) -> Result<Self, ImageError> {
        let reason = "textures need OpenImageIO: build with the feature `oiio`".to_owned();
        Err(ImageError::Unsupported { path: path.into(), reason })
    }

    /// Width and height in pixels.
    pub fn size(&self) -> [usize; 2] {
        #[cfg(feature = "oiio")]
        return self.file.size();
        #[cfg(not(feature = "oiio"))]
        match self.never {}
    }

    /// A hash of the file that it was opened from.
    pub fn hash(&self) -> u128 {
        #[cfg(feature = "oiio")]
        return self.hash;
        #[cfg(not(feature = "oiio"))]
        match self.never {}
    }

    /// Bytes of all its levels, three half floats a pixel: what the texture cache may come to hold of it.
    pub fn bytes(&self) -> u64 {
        let [width, height] = self.size().map(|n| n as u64);
        width * height * 6 * 4 / 3
    }

    /// The colour at (u, v), filtered over a square of this width.
    #[inline]
    pub fn sample(&self, u: f32, v: f32, width: f32) -> [f32; 3] {
        #[cfg(feature = "oiio")]
        return self.file.sample(u, v, width);
        #[cfg(not(feature = "oiio"))]
        {
            let _ = (u, v, width);
            match self.never {}
        }
    }
}

/// Why a picture cannot be read; of a set of tiles, that one of them is meant.
#[cfg(feature = "oiio")]
fn unreadable(path: &Path, error: &std::io::Error) -> ImageError {
    const TILES: [&str; 3] = ["<UDIM>", "<UVTILE>", "%(UDIM)d"];
    let name = path.to_string_lossy();
    match TILES.iter().find(|mark| name.contains(**mark)) {
        Some(mark) => {
            let reason =
                format!("a set of tiles is not read; name one of them, such as {}", name.replace(mark, "1001"));
            ImageError::Unsupported { path: path.into(), reason }
        }
        None => ImageError::unreadable(path, error),
    }
}

/// Most bytes of all textures together that are kept in memory, as `ffi/oiio.cpp` sets it.
pub(crate) const CACHE_BYTES: u64 = 1024 << 20;

/// Bytes that textures take in memory now.
pub(crate) fn bytes() -> u64 {
    #[cfg(feature = "oiio")]
    return crate::ffi::oiio::texture_bytes();
    #[cfg(not(feature = "oiio"))]
    0
}

#[cfg(all(test, feature = "oiio"))]
mod tests {
    use super::*;
    use crate::testing::write_png;

    /// A PNG of 8-bit RGB rows, the top one first.
    fn picture(width: usize, rows: &[&[[u8; 3]]]) -> (tempfile::TempDir, std::path::PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("p.png");
        let bytes: Vec<u8> = rows.iter().flat_map(|r| r.iter().flatten().copied()).collect();
        write_png(&path, width, png::ColorType::Rgb, &bytes);
        (folder, path)
    }

    #[test]
    fn a_texture_stands_upright_and_is_linear() {
        let (red, green, blue, grey) = ([255, 0, 0], [0, 255, 0], [0, 0, 255], [188, 188, 188]);
        let (_folder, path) = picture(2, &[&[red, green], &[blue, grey]]);
        let texture = Texture::open(&path).unwrap();
        assert_eq!(texture.size(), [2, 2]);
        let close = |at: [f32; 2], want: [f32; 3]| {
            let got = texture.sample(at[0], at[1], 0.0);
            assert!(got.iter().zip(want).all(|(g, w)| (g - w).abs() < 3e-3), "{at:?}: {got:?}, not {want:?}");
        };
        close([0.25, 0.75], [1.0, 0.0, 0.0]);
        close([0.75, 0.75], [0.0, 1.0, 0.0]);
        close([0.25, 0.25], [0.0, 0.0, 1.0]);
        // 188 is half the light, and the picture goes on beyond its edges.
        close([1.75, -0.75], [0.503, 0.503, 0.503]);
    }

    /// A texture multiplies: where a picture is transparent it leaves what is there.
    #[test]
    fn what_is_transparent_is_white() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("p.png");
        write_png(&path, 3, png::ColorType::Rgba, &[255, 0, 0, 255, 0, 0, 0, 0, 188, 0, 0, 128]);
        let texture = Texture::open(&path).unwrap();
        for (u, want) in [(1.0 / 6.0, [1.0, 0.0, 0.0]), (0.5, [1.0; 3]), (5.0 / 6.0, [0.750, 0.498, 0.498])] {
            let got = texture.sample(u, 0.5, 0.0);
            assert!(got.iter().zip(want).all(|(g, w)| (g - w).abs() < 3e-3), "{u}: {got:?}, not {want:?}");
        }
    }

    #[test]
    fn wide_lookups_are_means_of_light() {
        let row: Vec<[u8; 3]> = (0..64).map(|x| if x % 2 == 0 { [255; 3] } else { [0; 3] }).collect();
        let rows: Vec<&[[u8; 3]]> = (0..64).map(|_| row.as_slice()).collect();
        let (_folder, path) = picture(64, &rows);
        let texture = Texture::open(&path).unwrap();
        for i in 0..40 {
            let got = texture.sample(0.013 * i as f32, 0.017 * i as f32, 0.25);
            assert!(got.iter().all(|c| (c - 0.5).abs() < 0.02), "{got:?}");
        }
        assert!(bytes() > 0);
    }

    #[test]
    fn what_is_no_picture_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("noise.png");
        std::fs::write(&path, b"not a picture at all").unwrap();
        assert!(Texture::open(&path).is_err());
        assert!(Texture::open(&folder.path().join("absent.png")).unwrap_err().to_string().contains("no such file"));
        let tiles = Texture::open(Path::new("skin.<UDIM>.exr")).unwrap_err().to_string();
        assert!(tiles.contains("skin.1001.exr"), "{tiles}");
    }
}
