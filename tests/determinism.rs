//! The same picture to the bit.

use crate::support::{Picture, SWATCH, directory, render, write, yarnray};

fn bits(picture: &Picture) -> Vec<(String, Vec<u32>)> {
    picture.image.channels.iter().map(|c| (c.name.clone(), c.samples.iter().map(|s| s.to_bits()).collect())).collect()
}

#[test]
fn any_number_of_threads_and_every_run_make_the_same_picture() {
    let args = |threads| ["--set", "output.layers=all", "--threads", threads];
    let one = bits(&render(SWATCH, &args("1")));
    assert_eq!(one.len(), 4 + 1 + 3 + 3 + 3 + 1 + 3 + 2 + 2 + 13 * 3 + 3 * 12, "all layers");
    for threads in ["1", "2", "3"] {
        assert!(one == bits(&render(SWATCH, &args(threads))), "{threads} threads");
    }
}

#[test]
fn png_files_are_the_same_byte_for_byte() {
    let directory = directory();
    write(directory.path(), "s.toml", SWATCH);
    for (threads, out) in [("1", "1.png"), ("2", "2.png")] {
        yarnray(directory.path(), &["render", "s.toml", "-q", "-j", threads, "-o", out]).good();
    }
    let [one, two] = ["1.png", "2.png"].map(|n| std::fs::read(directory.path().join(n)).unwrap());
    assert!(one == two);
}

#[test]
fn another_seed_makes_another_picture_of_the_same_brightness() {
    let args = ["--spp", "32", "--set", "fabric.0.phase=0"];
    let a = render(SWATCH, &[&args[..], &["--seed", "1"]].concat());
    let b = render(SWATCH, &[&args[..], &["--seed", "2"]].concat());
    assert!(bits(&a) != bits(&b));
    for (a, b) in a.mean().into_iter().zip(b.mean()) {
        assert!((a / b - 1.0).abs() < 0.02, "{a} and {b}");
    }
}

#[test]
fn a_crop_is_a_part_of_the_whole() {
    let whole = render(SWATCH, &["--set", "output.layers=all"]);
    // Not along tiles, and across several of them.
    let [x0, y0, x1, y1] = [7, 3, 41, 22];
    let crop = render(SWATCH, &["--set", "output.layers=all", "--crop", "7,3,41,22"]);
    assert_eq!([crop.image.width, crop.image.height], [x1 - x0, y1 - y0]);
    assert_eq!(crop.image.origin, [x0 as i32, y0 as i32]);
    assert_eq!(crop.image.display_size, [48, 36]);
    for channel in &crop.image.channels {
        let all = whole.channel(&channel.name);
        for y in y0..y1 {
            for x in x0..x1 {
                let part = channel.samples[(y - y0) * (x1 - x0) + x - x0];
                assert_eq!(part.to_bits(), all[y * 48 + x].to_bits(), "{} at {x}, {y}", channel.name);
            }
        }
    }
}
