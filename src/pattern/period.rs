//! After how much a list goes on as it began.

/// The least distance at which all that follows is the same again; a repeat is seen twice at least. By the failure function
/// of Knuth, Morris and Pratt ("Fast Pattern Matching in Strings", 1977), which compares at most `2 * count` times.
pub(super) fn period(count: usize, same: impl Fn(usize, usize) -> bool) -> usize {
    // For each place: how many of the first are the last up to there.
    let mut again = vec![0; count];
    for i in 1..count {
        let mut length: usize = again[i - 1];
        while length > 0 && !same(length, i) {
            length = again[length - 1];
        }
        again[i] = length + usize::from(same(length, i));
    }
    let period = count - again[count - 1];
    if 2 * period <= count { period } else { count }
}

/// The counts next to one that hold a repeat of so many a whole number of times, for people: what to ask for where it does not.
pub(crate) fn counts_that_hold(wide: u32, count: u32) -> String {
    match count / wide * wide {
        0 => wide.to_string(),
        fewer => format!("{fewer} or {}", fewer + wide),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn periods_are_the_least_that_are_seen_twice() {
        for (text, want) in [("aaaa", 1), ("abcabca", 3), ("abcab", 5), ("aabaab", 3), ("aabaaab", 7), ("a", 1)] {
            let text = text.as_bytes();
            assert_eq!(period(text.len(), |i, j| text[i] == text[j]), want);
        }
    }

    #[test]
    fn counts_hold_whole_repeats() {
        assert_eq!(
            [(2, 1), (2, 13), (4, 30), (12, 5)].map(|(w, n)| counts_that_hold(w, n)),
            ["2", "12 or 14", "28 or 32", "12"]
        );
    }
}
