//! Names that were probably meant, and lists of names, in messages.

/// The candidate that `name` was probably meant to be: at most two slips of the finger away
/// (one for names of up to three letters; upper and lower case are the same), or else
/// the one that goes on where `name` stops, or stops before it.
pub(crate) fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    const LONGEST: usize = 64; // nobody types more by hand, and the distance costs the product of the lengths
    const SHORTEST_PREFIX: usize = 3;
    let wanted: Vec<char> = name.chars().take(LONGEST + 1).map(|character| character.to_ascii_lowercase()).collect();
    if wanted.is_empty() || wanted.len() > LONGEST {
        return None;
    }
    let allowed = if wanted.len() <= 3 { 1 } else { 2 };
    let mut best: Option<(usize, &str)> = None;
    for candidate in candidates {
        let letters: Vec<char> =
            candidate.chars().take(LONGEST + 1).map(|character| character.to_ascii_lowercase()).collect();
        if letters.is_empty() || letters.len() > LONGEST {
            continue;
        }
        let distance = edit_distance(&wanted, &letters);
        let shares_prefix = wanted.len().min(letters.len()) >= SHORTEST_PREFIX
            && (wanted.starts_with(&letters) || letters.starts_with(&wanted));
        let score = match distance {
            // Replacing every letter is no slip.
            distance if distance <= allowed && distance < wanted.len().max(letters.len()) => distance,
            distance if shares_prefix => allowed + distance,
            _ => continue,
        };
        if best.is_none_or(|(least, _)| score < least) {
            best = Some((score, candidate));
        }
    }
    best.map(|(_, candidate)| candidate)
}

/// Damerau-Levenshtein distance in its restricted form: insert, delete, replace, swap two neighbours.
pub(super) fn edit_distance(first: &[char], second: &[char]) -> usize {
    let mut two_above: Vec<usize> = Vec::new();
    let mut above: Vec<usize> = (0..=second.len()).collect();
    for row in 1..=first.len() {
        let mut current = vec![row];
        for column in 1..=second.len() {
            let replace = above[column - 1] + usize::from(first[row - 1] != second[column - 1]);
            let mut least = replace.min(above[column] + 1).min(current[column - 1] + 1);
            let swapped =
                row > 1 && column > 1 && first[row - 1] == second[column - 2] && first[row - 2] == second[column - 1];
            if swapped {
                least = least.min(two_above[column - 2] + 1);
            }
            current.push(least);
        }
        two_above = std::mem::replace(&mut above, current);
    }
    above[second.len()]
}

/// Message and hint for a name that is not among `candidates`:
/// `unknown fiber "slk"` and `did you mean "silk"?`, or else a list of what there is.
pub(crate) fn unknown_name<'a>(
    what: &str,
    name: &str,
    candidates: impl IntoIterator<Item = &'a str> + Clone,
) -> (String, String) {
    let message = format!("unknown {what} \"{}\"", shortened(name));
    let hint = match nearest(name, candidates.clone()) {
        Some(candidate) => format!("did you mean \"{candidate}\"?"),
        None => match listed(candidates.into_iter().map(|candidate| format!("\"{candidate}\"")), "and") {
            list if list.is_empty() => format!("there is no {what}"),
            list => format!("there is {list}"),
        },
    };
    (message, hint)
}

/// `a, b or c`; long lists end in `...`.
pub(crate) fn listed(words: impl IntoIterator<Item = String>, last: &str) -> String {
    const MOST: usize = 30;
    let mut words: Vec<String> = words.into_iter().collect();
    if words.len() > MOST {
        words.truncate(MOST);
        return words.join(", ") + ", ...";
    }
    let Some(end) = words.pop() else { return String::new() };
    if words.is_empty() { end } else { format!("{} {last} {end}", words.join(", ")) }
}

/// So many letters of the user's own text, as they stand between quotes: on one line.
pub(crate) fn excerpt(text: &str, most: usize) -> String {
    text.chars().take(most).collect::<String>().escape_debug().to_string()
}

/// The user's own text, cut to a length that fits into a message.
pub(crate) fn shortened(text: &str) -> String {
    const MOST: usize = 60;
    match text.char_indices().nth(MOST) {
        Some((byte, _)) => format!("{}…", &text[..byte]),
        None => text.to_owned(),
    }
}
