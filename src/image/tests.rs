//! Round trips, damaged files, and outputs that cannot be.

use std::{fs, path::Path};

use super::{
    Attribute, Image, ImageError,
    exr::{ChannelSpec, ExrLayout, Line, Sample},
    output::{self, Format},
    png::{self, Display, ToneMap, linear_to_srgb, srgb_to_linear},
    read, whole_file,
};

/// Splitmix64: the same damage in every run.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, end: usize) -> usize {
        (self.next() % end as u64) as usize
    }
}

/// A crop of 37 x 35 pixels (three blocks, the last one cut) with every kind of sample.
fn layout() -> ExrLayout {
    let channels = [
        ("R", Sample::F32),
        ("G", Sample::F32),
        ("B", Sample::F32),
        ("A", Sample::F16),
        ("Z", Sample::F32),
        ("albedo.R", Sample::F16),
        ("yarn", Sample::U32),
        ("N.X", Sample::F32),
    ];
    let channels = channels.map(|(name, sample)| ChannelSpec::new(name, sample)).to_vec();
    ExrLayout {
        origin: [11, 7],
        display_size: [64, 50],
        attributes: vec![
            ("yarnray:scene".into(), Attribute::Text("Schärpe, 2/2 twill".into())),
            ("yarnray:seconds".into(), Attribute::Float(12.5)),
            ("yarnray:samples".into(), Attribute::Whole(256)),
            ("yarnray:reference".into(), Attribute::Double(1.0 / 3.0)),
        ],
        ..ExrLayout::new(37, 35, channels)
    }
}

/// A value that tells channel and pixel, exact in 16 bits.
fn value(channel: usize, x: usize, y: usize) -> f32 {
    (channel * 100 + x) as f32 + y as f32 / 64.0 * if channel == 6 { 0.0 } else { 1.0 }
}

fn fill(y: usize, lines: &mut [Line<'_>]) {
    for (channel, line) in lines.iter_mut().enumerate() {
        match line {
            Line::Float(line) => line.iter_mut().enumerate().for_each(|(x, to)| *to = value(channel, x, y)),
            Line::Whole(line) => line.iter_mut().enumerate().for_each(|(x, to)| *to = value(channel, x, y) as u32),
        }
    }
}

fn write_sample_exr(path: &Path) {
    super::exr::write(path, &layout(), fill).expect("a writable EXR");
}

fn entries(directory: &Path) -> Vec<String> {
    let mut names: Vec<_> = fs::read_dir(directory)
        .expect("a directory")
        .map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

#[test]
fn exr_round_trip_of_a_crop() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("new/picture.exr");
    write_sample_exr(&path);
    let image = read(&path).expect("a readable EXR");
    assert_eq!((image.width, image.height), (37, 35), "data window");
    assert_eq!((image.origin, image.display_size), ([11, 7], [64, 50]), "crop");
    for (channel, spec) in layout().channels.iter().enumerate() {
        let samples = image.channel(&spec.name).expect("every channel");
        for (index, sample) in samples.iter().enumerate() {
            let expected = value(channel, index % 37, index / 37);
            // 16 bits keep eleven of a number up to 2048.
            let expected = if spec.sample == Sample::F16 { super::exr::half(expected).to_f32() } else { expected };
            assert_eq!(*sample, expected, "{} at {index}", spec.name);
        }
    }
    for (name, expected) in layout().attributes {
        assert_eq!(image.attribute(&name), Some(&expected), "{name}");
    }
    assert_eq!(image.attribute("software"), Some(&Attribute::Text(super::exr::SOFTWARE.into())), "software");
    assert_eq!(entries(&directory.path().join("new")), ["picture.exr"], "no temporary file is left");
}

#[test]
fn equal_pictures_are_equal_files() {
    let directory = tempfile::tempdir().expect("a directory");
    let write = |name: &str, threads| {
        let path = directory.path().join(name);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| write_sample_exr(&path));
        fs::read(path).expect("the file")
    };
    let first = write("a.exr", 1);
    for threads in [1, 3, 4] {
        assert!(write("b.exr", threads) == first, "the file differs with {threads} threads");
    }
}

#[test]
fn not_a_number_and_infinity_survive_in_exr() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("odd.exr");
    let channels = vec![ChannelSpec::new("full", Sample::F32), ChannelSpec::new("half", Sample::F16)];
    let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30, -1e30, 0.0];
    super::exr::write(&path, &ExrLayout::new(odd.len(), 1, channels), |_, lines| {
        for line in lines {
            if let Line::Float(line) = line {
                line.copy_from_slice(&odd);
            }
        }
    })
    .expect("a writable EXR");
    let image = read(&path).expect("a readable EXR");
    let full = image.channel("full").expect("channel");
    let half = image.channel("half").expect("channel");
    assert!(full[0].is_nan() && half[0].is_nan(), "NaN: {full:?} {half:?}");
    assert_eq!(full[1..], odd[1..], "32 bits");
    assert_eq!(half[1..], [f32::INFINITY, f32::NEG_INFINITY, 65504.0, -65504.0, 0.0], "16 bits");
}

#[test]
fn layouts_that_make_no_exr_are_refused() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("x.exr");
    let channel = |name: &str| ChannelSpec::new(name, Sample::F32);
    let mut with_attribute = ExrLayout::new(1, 1, vec![channel("Y")]);
    with_attribute.attributes.push(("dataWindow".into(), Attribute::Whole(1)));
    for (layout, expected) in [
        (ExrLayout::new(0, 4, vec![channel("Y")]), "at least one pixel"),
        (ExrLayout::new(4, 4, vec![]), "one channel"),
        (ExrLayout::new(4, 4, vec![channel("Y"), channel("Y")]), "two channels are called `Y`"),
        (ExrLayout::new(4, 4, vec![channel("")]), "cannot be called"),
        (with_attribute, "`dataWindow` is there already"),
    ] {
        let error = super::exr::write(&path, &layout, |_, _| {}).expect_err(expected).to_string();
        assert!(error.contains(expected), "{error}");
    }
    assert!(entries(directory.path()).is_empty(), "nothing is left behind");
}

#[test]
fn srgb_has_its_exact_points() {
    for (linear, byte) in [(0.0, 0), (1.0, 255), (0.214_041_14, 128), (0.5, 188), (0.18, 118), (0.003_130_8, 10)] {
        let display = Display::default();
        assert_eq!(display.encode([linear; 4]), [byte, byte, byte, 255], "{linear}");
    }
    for byte in 0..=255_u8 {
        let value = f32::from(byte) / 255.0;
        let back = linear_to_srgb(srgb_to_linear(value));
        assert!((back - value).abs() < 1e-6, "{byte}: {value} became {back}");
        let linear = srgb_to_linear(value);
        assert_eq!(Display::default().encode([linear, linear, linear, 1.0])[0], byte, "every byte returns");
    }
}

#[test]
fn tone_maps_take_any_number() {
    for tone_map in [ToneMap::Srgb, ToneMap::Filmic] {
        let display = Display { tone_map, ..Display::default() };
        assert_eq!(display.encode([f32::NAN, f32::NEG_INFINITY, -1.0, f32::NAN]), [0, 0, 0, 255], "{tone_map:?}");
        assert_eq!(display.encode([f32::INFINITY, f32::MAX, 1e5, 0.0]), [255, 255, 255, 255], "{tone_map:?}");
        let alpha = Display { alpha: true, ..display };
        assert_eq!(alpha.encode([1.0, 1.0, 1.0, f32::NAN])[3], 0, "{tone_map:?}");
        assert_eq!(alpha.encode([0.0; 4]), [0; 4], "{tone_map:?}");
        let steps: Vec<u8> = (0..1000).map(|step| display.encode([step as f32 * 0.01; 4])[0]).collect();
        assert!(steps.is_sorted(), "{tone_map:?} never falls");
    }
    let filmic = Display { tone_map: ToneMap::Filmic, ..Display::default() };
    // 2.54 / 3.16 = 0.8038, encoded 0.9083.
    assert_eq!(filmic.encode([1.0; 4])[0], 232, "white of the curve");
    let brighter = Display { exposure: 1.0, ..Display::default() };
    assert_eq!(brighter.encode([0.25; 4]), Display::default().encode([0.5; 4]), "one stop doubles");
}

#[test]
fn png_round_trip() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("picture.png");
    let color = |x: usize, y: usize| {
        let alpha = x as f32 / 18.0;
        [0.1 * alpha, y as f32 / 12.0 * alpha, alpha, alpha]
    };
    for alpha in [false, true] {
        let display = Display { alpha, ..Display::default() };
        png::write(&path, 19, 13, &display, |y, row| row.iter_mut().enumerate().for_each(|(x, to)| *to = color(x, y)))
            .expect("a writable PNG");
        let image = read(&path).expect("a readable PNG");
        assert_eq!((image.width, image.height, image.channels.len()), (19, 13, if alpha { 4 } else { 3 }), "shape");
        let rgb = image.rgb().expect("colours");
        for (index, red) in rgb[0].iter().enumerate() {
            let expected = color(index % 19, index / 19);
            let got = [*red, rgb[1][index], rgb[2][index]];
            for channel in 0..3 {
                // Half a step of eight bits is at most 0.0045 in linear light.
                let difference = (got[channel] - expected[channel]).abs();
                assert!(difference < 0.007, "{index}: got {got:?}, wanted {expected:?}, alpha {alpha}");
            }
        }
    }
    png::write(&path, 1, 1, &Display::default(), |_, row| row[0] = [f32::NAN; 4]).expect("a writable PNG");
    assert_eq!(read(&path).expect("a readable PNG").rgb().expect("colours"), [&[0.0]; 3], "NaN is black");
}

#[test]
fn png_of_other_kinds() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("other.png");
    let encode = |color: ::png::ColorType, depth: ::png::BitDepth, bytes: &[u8]| {
        let mut encoder = ::png::Encoder::new(fs::File::create(&path).expect("a file"), 2, 1);
        encoder.set_color(color);
        encoder.set_depth(depth);
        if color == ::png::ColorType::Indexed {
            encoder.set_palette(vec![255, 0, 0, 0, 255, 255]);
        }
        encoder.write_header().expect("a header").write_image_data(bytes).expect("data");
        read(&path).expect("a readable PNG")
    };
    let grey = encode(::png::ColorType::Grayscale, ::png::BitDepth::One, &[0b0100_0000]);
    assert_eq!(grey.rgb().expect("grey"), [&[0.0, 1.0]; 3], "one bit");
    let palette = encode(::png::ColorType::Indexed, ::png::BitDepth::Eight, &[0, 1]);
    assert_eq!(palette.rgb().expect("colours"), [&[1.0, 0.0], &[0.0, 1.0], &[0.0, 1.0]], "palette");
    let wide =
        encode(::png::ColorType::GrayscaleAlpha, ::png::BitDepth::Sixteen, &[255, 255, 128, 0, 128, 0, 255, 255]);
    let half = 32768.0 / 65535.0;
    assert_eq!(wide.channel("Y").expect("grey"), [half, srgb_to_linear(half)], "16 bits, associated");
}

#[test]
fn colors_in_an_image() {
    let channel = |name: &str, sample| super::Channel { name: name.into(), samples: vec![sample] };
    let mut image = Image::new(1, 1);
    assert_eq!(image.rgb(), None, "nothing");
    image.channels = vec![channel("Z", 4.0)];
    assert_eq!(image.rgb(), Some([&[4.0_f32][..]; 3]), "an only channel is grey");
    image.channels.extend([channel("beauty.B", 3.0), channel("beauty.G", 2.0), channel("beauty.R", 1.0)]);
    assert_eq!(image.rgb(), Some([&[1.0_f32][..], &[2.0], &[3.0]]), "a layer");
    image.channels.extend([channel("B", 7.0), channel("G", 6.0), channel("R", 5.0)]);
    assert_eq!(image.rgb(), Some([&[5.0_f32][..], &[6.0], &[7.0]]), "the picture itself");
}

#[test]
fn unreadable_files_say_why() {
    let directory = tempfile::tempdir().expect("a directory");
    let at = |name: &str| directory.path().join(name);
    fs::write(at("empty.exr"), b"").expect("a file");
    fs::write(at("short.exr"), b"\x76\x2f\x31\x01").expect("a file");
    for (name, expected) in [
        ("nowhere.exr", "no such file"),
        ("empty.exr", "the file is empty"),
        ("short.exr", "damaged EXR"),
        (".", "it is a directory"),
    ] {
        let error = read(&at(name)).expect_err(expected);
        let message = error.to_string();
        assert!(message.starts_with("cannot read ") && message.ends_with(&error.reason()), "{message}");
        assert!(message.contains(expected) && message.contains(name) && !message.contains('\n'), "{message}");
    }
}

#[test]
fn a_giant_is_refused_before_it_is_allocated() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("giant.png");
    png::write(&path, 1, 1, &Display::default(), |_, _| {}).expect("a writable PNG");
    let mut bytes = fs::read(&path).expect("the file");
    bytes[16..20].copy_from_slice(&60000_u32.to_be_bytes());
    bytes[20..24].copy_from_slice(&60000_u32.to_be_bytes());
    // The checksum of the header: IHDR and its 13 bytes.
    let crc = bytes[12..29].iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| (crc >> 1) ^ if crc & 1 == 1 { 0xedb8_8320 } else { 0 })
    });
    bytes[29..33].copy_from_slice(&(!crc).to_be_bytes());
    fs::write(&path, bytes).expect("a file");
    let error = read(&path).expect_err("too large");
    assert!(matches!(error, ImageError::TooLarge { width: 60000, .. }), "{error}");

    let path = directory.path().join("giant.exr");
    write_sample_exr(&path);
    let mut bytes = fs::read(&path).expect("the file");
    let place = bytes.windows(10).position(|window| window == b"dataWindow").expect("the attribute") + 11 + 6 + 4 + 8;
    // The last column; the number of blocks depends on the rows alone.
    bytes[place..place + 4].copy_from_slice(&[0, 0, 0, 1]);
    fs::write(&path, bytes).expect("a file");
    let error = read(&path).expect_err("too large");
    assert!(matches!(error, ImageError::TooLarge { .. }), "{error}");
}

/// Reads `count` damaged versions of a file: bytes changed, or the end cut off.
fn read_damaged(path: &Path, count: usize) {
    let whole = fs::read(path).expect("the file");
    let damaged = path.with_file_name(format!("damaged.{}", path.extension().unwrap_or_default().to_string_lossy()));
    let mut random = Random(7);
    for round in 0..count {
        let mut bytes = whole.clone();
        // Mostly headers, where a change does most; the magic number stays.
        let end = if round % 3 == 0 { bytes.len() } else { bytes.len().min(700) };
        for _ in 0..=random.below(3) {
            let place = 8 + random.below(end - 8);
            bytes[place] = random.next() as u8;
        }
        if round % 5 == 0 {
            bytes.truncate(8 + random.below(bytes.len() - 8));
        }
        fs::write(&damaged, bytes).expect("a file");
        // Pixels that have changed are no error; a panic is.
        if let Err(error) = read(&damaged) {
            assert!(!error.to_string().contains('\n'), "{error}");
        }
    }
}

#[test]
fn damaged_files_never_panic() {
    let directory = tempfile::tempdir().expect("a directory");
    let exr = directory.path().join("whole.exr");
    write_sample_exr(&exr);
    read_damaged(&exr, 400);
    let png = directory.path().join("whole.png");
    let row = |y: usize, row: &mut [[f32; 4]]| {
        row.iter_mut().enumerate().for_each(|(x, to)| *to = [(x * y) as f32 / 300.0; 4])
    };
    png::write(&png, 21, 17, &Display::default(), row).expect("a writable PNG");
    read_damaged(&png, 400);
}

#[test]
fn outputs_that_cannot_be_leave_nothing() {
    let directory = tempfile::tempdir().expect("a directory");
    let at = |name: &str| directory.path().join(name);
    fs::write(at("file"), b"text").expect("a file");
    fs::create_dir(at("folder.png")).expect("a directory");
    for (name, expected) in [
        ("picture.gift", "unknown extension `gift`; known are exr, png, "),
        ("picture", "it has no extension; known are exr, png, "),
        ("folder.png", "it is a directory"),
        ("file/picture.exr", "and it cannot be created: a file is in its place"),
        ("file/deeper/picture.exr", "and it cannot be created: a file is in its place"),
    ] {
        let before = entries(directory.path());
        let error = output::check_writable(&at(name)).expect_err(expected).to_string();
        assert!(error.starts_with("cannot write ") && error.contains(expected), "{error}");
        output::write_colors(&at(name), 2, 2, &Display::default(), |_, _| {}).expect_err(expected);
        assert_eq!(entries(directory.path()), before, "{name}");
    }
    let mut permissions = fs::metadata(at("file")).expect("the file").permissions();
    permissions.set_readonly(true);
    fs::set_permissions(at("file"), permissions).expect("the file");
    let error = whole_file::write(&at("file"), |_| Ok(())).expect_err("read-only").to_string();
    assert!(error.ends_with("file: the file exists and is read-only"), "{error}");
}

#[test]
fn a_failed_write_keeps_the_older_file() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("results.csv");
    whole_file::write(&path, |file| std::io::Write::write_all(file, b"old")).expect("a file");
    whole_file::write(&path, |file| {
        std::io::Write::write_all(file, b"new and unfinished")?;
        Err(std::io::ErrorKind::StorageFull.into())
    })
    .expect_err("the disk is full");
    assert_eq!(fs::read(&path).expect("the file"), b"old", "content");
    assert_eq!(entries(directory.path()), ["results.csv"], "nothing else");
}

#[cfg(unix)]
#[test]
fn permissions_links_and_devices_are_respected() {
    use std::os::unix::fs::{FileTypeExt as _, PermissionsExt as _, symlink};
    let directory = tempfile::tempdir().expect("a directory");
    let at = |name: &str| directory.path().join(name);
    fs::write(at("ordinary"), b"").expect("a file");
    symlink(at("linked.txt"), at("link.txt")).expect("a link");
    fs::write(at("linked.txt"), b"").expect("a file");
    let hello = |path: &Path| whole_file::write(path, |file| std::io::Write::write_all(file, b"hello"));
    hello(&at("new.txt")).expect("a file");
    let mode = |name: &str| fs::metadata(at(name)).expect("the file").permissions().mode();
    assert_eq!(mode("new.txt"), mode("ordinary"), "the umask decides, not the temporary file");
    hello(&at("link.txt")).expect("a file");
    assert!(fs::symlink_metadata(at("link.txt")).expect("the link").is_symlink(), "the link stays");
    assert_eq!(fs::read(at("linked.txt")).expect("the file"), b"hello", "its target is written");
    hello(Path::new("/dev/null")).expect("the device takes everything");
    let null = fs::metadata("/dev/null").expect("the device").file_type();
    assert!(null.is_char_device(), "the device is still one");
}

#[test]
fn writable_means_writable() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("a/b/picture.exr");
    assert_eq!(output::check_writable(&path), Ok(Format::Exr), "format");
    assert!(entries(&directory.path().join("a/b")).is_empty(), "only the directories are made");
    let row = |y: usize, row: &mut [[f32; 4]]| row.fill([1.0, 2.0, y as f32, 0.5]);
    output::write_colors(&path, 3, 2, &Display { alpha: true, ..Display::default() }, row).expect("an EXR");
    let image = read(&path).expect("a readable EXR");
    assert_eq!(image.channel("B"), Some(&[0.0, 0.0, 0.0, 1.0, 1.0, 1.0][..]), "B");
    assert_eq!(image.channel("A"), Some(&[0.5; 6][..]), "A");
}

/// A small picture with a compression that the crate decodes too trustfully.
fn write_trustful_exr(path: &Path, compression: ::exr::prelude::Compression) {
    use ::exr::prelude::*;
    let pixels = SpecificChannels::rgb(|at: Vec2<usize>| (at.x() as f32, 2.0_f32, at.y() as f32));
    let encoding = Encoding { compression, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
    let layer = Layer::new((37, 35), LayerAttributes::default(), encoding, pixels);
    ::exr::image::Image::from_layer(layer).write().to_file(path).expect("a writable EXR");
}

#[cfg(not(feature = "oiio"))]
#[test]
fn lossy_exr_says_what_it_needs() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("lossy.exr");
    write_trustful_exr(&path, ::exr::prelude::Compression::DWAA(None));
    let error = read(&path).expect_err("unsupported").to_string();
    assert!(error.contains("EXR with dwaa compression") && error.contains("build with the feature `oiio`"), "{error}");
}

#[cfg(not(feature = "oiio"))]
#[test]
fn without_openimageio_the_error_says_how_to_get_it() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("light.hdr");
    fs::write(&path, b"#?RADIANCE\n").expect("a file");
    for error in [read(&path).expect_err("no reader"), output::check_writable(&path).expect_err("no writer")] {
        assert!(error.to_string().contains("build with the feature `oiio`"), "{error}");
    }
}

#[cfg(feature = "oiio")]
mod with_openimageio {
    use super::*;
    use crate::{ffi::oiio, image::oiio as facade};

    #[test]
    fn linear_formats_round_trip() {
        let directory = tempfile::tempdir().expect("a directory");
        let color = |x: usize, y: usize| [0.25 + x as f32, 3.0 * y as f32, 1000.0, 1.0];
        for (name, tolerance) in [("picture.tif", 0.0), ("picture.hdr", 1.0 / 128.0)] {
            let path = directory.path().join(name);
            assert_eq!(output::check_writable(&path), Ok(Format::Linear), "{name}");
            output::write_colors(&path, 9, 5, &Display::default(), |y, row| {
                row.iter_mut().enumerate().for_each(|(x, to)| *to = color(x, y));
            })
            .expect(name);
            let image = read(&path).expect(name);
            assert_eq!((image.width, image.height), (9, 5), "{name}");
            let rgb = image.rgb().expect(name);
            for (channel, samples) in rgb.iter().enumerate() {
                for (index, sample) in samples.iter().enumerate() {
                    // Radiance shares one exponent: the error is measured by the largest channel.
                    let difference = (sample - color(index % 9, index / 9)[channel]).abs();
                    assert!(difference <= tolerance * 1000.0, "{name} {channel} {index}: {difference}");
                }
            }
        }
        assert_eq!(entries(directory.path()), ["picture.hdr", "picture.tif"], "nothing else");
    }

    /// Where a format has no alpha, the picture stands over black, as without it.
    #[test]
    fn formats_hold_what_they_have_room_for() {
        let directory = tempfile::tempdir().expect("a directory");
        let alpha = Display { alpha: true, ..Display::default() };
        for name in ["a.jpg", "a.ppm", "a.webp", "a.tga", "a.bmp"] {
            let path = directory.path().join(name);
            let of = |display: &Display| {
                output::write_colors(&path, 16, 8, display, |_, row| row.fill([0.1, 0.25, 0.05, 0.5])).expect(name);
                read(&path).expect(name)
            };
            let (with, without) = (of(&alpha), of(&Display::default()));
            let has_alpha = with.channels.len() == 4;
            assert_eq!(has_alpha, !["a.jpg", "a.ppm"].contains(&name), "{name}");
            if !has_alpha {
                assert_eq!(with.rgb().expect(name), without.rgb().expect(name), "{name}");
            }
        }
        for (name, size) in [("w.jpg", 65_501), ("w.JPEG", 65_501), ("w.webp", 16_384), ("w.tga", 65_536)] {
            let path = directory.path().join(name);
            let told = [output::check_size(&path, 1, size), output::write_colors(&path, size, 1, &alpha, |_, _| {})];
            for told in told.map(|told| told.expect_err(name).to_string()) {
                assert!(told.contains(&format!("has room for {}", size - 1)), "{told}");
            }
            assert_eq!(output::check_size(&path, size - 1, 1), Ok(()), "{name}");
        }
        assert_eq!(output::check_size(Path::new("w.exr"), 1 << 20, 1), Ok(()));
    }

    #[test]
    fn formats_for_a_screen_carry_the_srgb_curve() {
        let directory = tempfile::tempdir().expect("a directory");
        for (name, tolerance) in [("picture.bmp", 0.003), ("picture.jpg", 0.02)] {
            let path = directory.path().join(name);
            assert_eq!(output::check_writable(&path), Ok(Format::Screen), "{name}");
            output::write_colors(&path, 16, 8, &Display::default(), |_, row| row.fill([0.18, 0.5, 0.02, 1.0]))
                .expect(name);
            let image = read(&path).expect(name);
            let rgb = image.rgb().expect(name);
            for (channel, expected) in [0.18, 0.5, 0.02].into_iter().enumerate() {
                let got = rgb[channel][20];
                assert!((got - expected).abs() < tolerance, "{name}: {got}, wanted {expected}");
            }
        }
    }

    #[test]
    fn our_exr_reads_the_same_through_openimageio() {
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join("picture.exr");
        for (name, compression) in super::super::Compression::NAMES {
            super::super::exr::write(&path, &ExrLayout { compression, ..layout() }, fill).expect("a writable EXR");
            let (ours, theirs) = (read(&path).expect("ours"), facade::read(&path).expect("theirs"));
            assert_eq!((ours.width, ours.height, ours.origin), (theirs.width, theirs.height, theirs.origin), "{name}");
            assert_eq!(
                (ours.display_size, ours.channels.len()),
                (theirs.display_size, theirs.channels.len()),
                "{name}"
            );
            for channel in &ours.channels {
                // OpenImageIO turns whole numbers into fractions of the largest one.
                if channel.name != "yarn" {
                    let theirs = theirs.channel(&channel.name);
                    assert_eq!(Some(channel.samples.as_slice()), theirs, "{name} {}", channel.name);
                }
            }
        }
    }

    #[test]
    fn lossy_exr_is_left_to_openimageio() {
        use ::exr::prelude::Compression;
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join("lossy.exr");
        for compression in [Compression::DWAA(None), Compression::DWAB(None), Compression::B44, Compression::B44A] {
            write_trustful_exr(&path, compression);
            let image = read(&path).expect("a readable EXR");
            assert_eq!((image.width, image.height), (37, 35), "{compression:?}");
            let red = image.channel("R").expect("red")[20 * 37 + 30];
            assert!((red - 30.0).abs() < 3.0, "{compression:?}: {red}");
            read_damaged(&path, 60);
        }
    }

    #[test]
    fn what_is_no_picture_says_so_in_one_line() {
        let directory = tempfile::tempdir().expect("a directory");
        for name in ["notes.txt", "notes.hdr", "notes.jpg", "notes.tif", "notes"] {
            let path = directory.path().join(name);
            fs::write(&path, b"This is no picture, whatever it is called.\n").expect("a file");
            let error = read(&path).expect_err(name);
            let message = error.to_string();
            assert!(matches!(error, ImageError::Read { .. }) && !message.contains('\n'), "{message}");
            assert!(!error.reason().is_empty(), "{message}");
        }
    }

    #[test]
    fn damaged_radiance_never_panics() {
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join("whole.hdr");
        let row = |y: usize, row: &mut [[f32; 4]]| row.fill([y as f32, 1.0, 0.5, 1.0]);
        output::write_colors(&path, 21, 17, &Display::default(), row).expect("a writable file");
        read_damaged(&path, 100);
    }

    #[test]
    fn its_version_is_told() {
        let version = oiio::version().expect("OpenImageIO");
        let parts: Vec<u32> = version.split('.').map(|part| part.parse().expect("a number")).collect();
        assert!(parts.len() == 3 && parts >= vec![2, 4, 0], "{version}");
        assert!(oiio::is_loaded(), "asking loads it");
    }

    /// Tests share a process, so this one runs itself again, alone.
    #[cfg(target_os = "linux")]
    #[test]
    fn it_is_loaded_only_when_needed() {
        const ALONE: &str = "YARNRAY_TEST_ALONE";
        if std::env::var_os(ALONE).is_none() {
            let output = std::process::Command::new(std::env::current_exe().expect("this program"))
                .args(["--exact", "image::tests::with_openimageio::it_is_loaded_only_when_needed"])
                .env(ALONE, "1")
                .output()
                .expect("a process");
            let text = String::from_utf8_lossy(&output.stdout);
            assert!(output.status.success() && text.contains("1 passed"), "{text}");
            return;
        }
        let mapped = || fs::read_to_string("/proc/self/maps").expect("maps").contains("libOpenImageIO");
        let directory = tempfile::tempdir().expect("a directory");
        let exr = directory.path().join("picture.exr");
        write_sample_exr(&exr);
        read(&exr).expect("an EXR");
        assert!(!mapped() && !oiio::is_loaded(), "EXR does not need it");
        output::check_writable(&directory.path().join("picture.tif")).expect("TIFF");
        assert!(mapped() && oiio::is_loaded(), "TIFF does");
    }
}

/// Neither a picture nor a film takes the place of a pipe, or of a link, whether its target is there or not.
#[test]
#[cfg(unix)]
fn pipes_and_links_stay_what_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    assert!(std::process::Command::new("mkfifo").arg(at("pipe")).status().unwrap().success());
    std::os::unix::fs::symlink("target", at("link")).unwrap();
    let content = |file: &mut fs::File| std::io::Write::write_all(file, b"all of it");
    // Open both ways, so that nobody waits for the other end.
    let mut pipe = fs::File::options().read(true).write(true).open(at("pipe")).unwrap();
    for durable in [false, true] {
        let write = |path: &Path| match durable {
            true => whole_file::write_durable(path, content),
            false => whole_file::write(path, content),
        };
        write(&at("pipe")).unwrap();
        assert!(!at("pipe").is_file(), "a file took the place of the pipe");
        let mut read = [0; 9];
        std::io::Read::read_exact(&mut pipe, &mut read).unwrap();
        assert_eq!(&read, b"all of it");
        for _ in 0..2 {
            write(&at("link")).unwrap();
            assert!(at("link").is_symlink() && fs::read(at("target")).unwrap() == b"all of it");
        }
        fs::remove_file(at("target")).unwrap();
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
    }
}
