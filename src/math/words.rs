//! Numbers as people read them.

/// A number of things with its noun, in the plural where needed: "1 ply", "2 plies", "3 stitches".
pub(crate) fn counted(count: impl TryInto<u64>, noun: &str) -> String {
    let count = count.try_into().unwrap_or(u64::MAX);
    format!("{count} {}", if count == 1 { noun.to_owned() } else { plural(noun) })
}

/// The plural of a noun, or of the last of some words.
pub(crate) fn plural(noun: &str) -> String {
    let before_y = noun.strip_suffix('y').filter(|stem| !stem.ends_with(['a', 'e', 'o', 'u']));
    match before_y {
        Some(stem) => format!("{stem}ies"),
        None if noun.ends_with("ch") => format!("{noun}es"),
        None => format!("{noun}s"),
    }
}

/// What lies between two texts, or the one where they are the same: "13 to 122", "13".
pub(crate) fn from_to([least, most]: [String; 2]) -> String {
    if least == most { least } else { format!("{least} to {most}") }
}

/// A number of bytes in the unit in which it has some digits before the point.
pub(crate) fn bytes_in_words(bytes: u64) -> String {
    let b = bytes as f64;
    match bytes {
        0..1_000 => format!("{bytes} B"),
        1_000..1_000_000 => format!("{:.1} kB", b / 1e3),
        1_000_000..1_000_000_000 => format!("{:.1} MB", b / 1e6),
        _ => format!("{:.2} GB", b / 1e9),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_of_one_number_is_that_number() {
        assert_eq!(from_to([13, 122].map(|n| n.to_string())), "13 to 122");
        assert_eq!(from_to([13, 13].map(|n| n.to_string())), "13");
    }

    #[test]
    fn one_of_a_thing_is_told_from_many() {
        assert_eq!(counted(1_usize, "yarn"), "1 yarn");
        assert_eq!(counted(0_u32, "yarn"), "0 yarns");
        let many = ["ply", "stitch", "tray", "control point"].map(|noun| counted(2_u64, noun));
        assert_eq!(many, ["2 plies", "2 stitches", "2 trays", "2 control points"]);
    }

    #[test]
    fn bytes_have_their_own_unit() {
        let shown = [12, 1_500, 2_340_000, 20_000_000_000].map(bytes_in_words);
        assert_eq!(shown, ["12 B", "1.5 kB", "2.3 MB", "20.00 GB"]);
    }
}
