//! Brioche: stitches that are slipped with a yarn over, and worked together with it in the next row.

use super::{Steps, parser::Parser};

/// Steps of brioche that work a stitch together with its yarn over, and the steps of charts that they are: the yarn over goes
/// with its stitch there.
const STEPS: [(&str, &str); 8] = [
    ("brk", "k"),
    ("brp", "p"),
    ("brk2tog", "k2tog"),
    ("brssk", "ssk"),
    ("brp2tog", "p2tog"),
    ("brssp", "ssp"),
    ("brk3tog", "k3tog"),
    ("brsssk", "sssk"),
];

fn found(name: &str) -> Option<&'static str> {
    STEPS.iter().find_map(|(brioche, chart)| (*brioche == name).then_some(*chart))
}

/// Whether a step works stitches with their yarn overs.
pub(super) fn takes_over(name: &str) -> bool {
    found(name).is_some()
}

/// The step of a chart that a step is.
pub(super) fn charted(steps: &Steps) -> Steps {
    Steps { name: found(&steps.name).unwrap_or(&steps.name).to_owned(), ..steps.clone() }
}

/// "yf, sl 1 purlwise, yo", "sl1 wyif, yo": a stitch that is slipped with a yarn over.
pub(super) fn slipped(words: &mut Parser<'_>) -> bool {
    const FRONT: [&[&str]; 8] = [
        &["bring", "yarn", "to", "front"],
        &["yarn", "to", "front"],
        &["with", "yarn", "in", "front"],
        &["yfwd"],
        &["yft"],
        &["ytf"],
        &["wyif"],
        &["yf"],
    ];
    const SLIP: [&[&str]; 5] = [&["sl1"], &["s1"], &["sl", "1"], &["slip", "1"], &["slip", "next"]];
    const OVER: [&[&str]; 3] = [&["yo"], &["yarn", "over"], &["yon"]];
    let from = words.at;
    let mut front = words.take_any(&FRONT);
    if front {
        words.take(&[","]);
    }
    // "yf sl1yo"
    if front && words.take_any(&[&["sl1yo"], &["sl1yof"]]) {
        return true;
    }
    if words.take_any(&SLIP) {
        words.stitches();
        words.take_any(&[&["pwise"], &["purlwise"], &["as", "if", "to", "purl"]]);
        front |= words.take_any(&FRONT);
        words.take_any(&[&["pwise"], &["purlwise"]]);
        words.take(&[","]);
        if front && words.take_any(&OVER) {
            return true;
        }
    }
    words.at = from;
    false
}

/// A step of brioche by one word: its name, and the stitches that it takes and makes.
pub(super) fn named(word: &str) -> Option<(&'static str, u32, u32)> {
    Some(match word {
        "brk" | "brk1" | "bk" | "bk1" => ("brk", 1, 1),
        "brp" | "brp1" | "bp" | "bp1" => ("brp", 1, 1),
        "brk2tog" => ("brk2tog", 2, 1),
        "brssk" | "brskp" => ("brssk", 2, 1),
        "brp2tog" => ("brp2tog", 2, 1),
        "brssp" => ("brssp", 2, 1),
        // Three stitches, the rightmost on top leaning left, or the leftmost one.
        "brlsldec" | "brlsl" | "brsssk" | "brsk2p" => ("brsssk", 3, 1),
        "brrsldec" | "brrsl" | "brk3tog" => ("brk3tog", 3, 1),
        "sl1yof" | "sl1yob" | "yfsl1yo" | "yfsl1yof" | "ybsl1yo" => ("tuck", 1, 1),
        _ => return None,
    })
}
