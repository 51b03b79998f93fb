//! Lines of Wavefront OBJ files, the same for every reader of them.

use std::io::{self, BufRead};

use super::curve_file::quoted;

/// All first words of lines that the format has, superseded ones among them.
const WORDS: [&str; 45] = [
    "v",
    "vt",
    "vn",
    "vp",
    "f",
    "fo",
    "l",
    "p",
    "g",
    "o",
    "s",
    "mg",
    "usemtl",
    "mtllib",
    "usemap",
    "maplib",
    "cstype",
    "deg",
    "bmat",
    "step",
    "curv",
    "curv2",
    "surf",
    "parm",
    "trim",
    "hole",
    "scrv",
    "sp",
    "end",
    "con",
    "bevel",
    "c_interp",
    "d_interp",
    "lod",
    "shadow_obj",
    "trace_obj",
    "ctech",
    "stech",
    "call",
    "csh",
    "res",
    "bsp",
    "bzp",
    "cdc",
    "cdp",
];

/// A line, with those that a backslash at its end joins to it.
#[derive(Debug)]
pub(crate) struct ObjLine {
    /// Of its first line in the file, counted from 1.
    pub(crate) number: usize,
    /// Without its end.
    pub(crate) text: String,
}

impl ObjLine {
    /// What is wrong with a line that holds numbers behind no word of the format: it may be a damaged corner or face.
    pub(crate) fn damage(&self) -> Option<String> {
        let mut words = self.text.split_whitespace();
        let first = words.next().filter(|word| !word.starts_with('#') && !WORDS.contains(word))?;
        let is_number = |word: &str| word.split('/').next().is_some_and(|number| number.parse::<f64>().is_ok());
        (is_number(first) || words.next().is_some_and(is_number))
            .then(|| format!("expected v, vt, f or another word of OBJ before numbers, found {}", quoted(first)))
    }
}

/// The lines of a file, which end in LF, CR LF or CR. A byte-order mark is left out, what is not UTF-8 replaced.
pub(crate) struct ObjLines<R> {
    reader: R,
    /// Lines that have been read.
    count: usize,
    /// Whether the last line ended in CR: a LF belongs to it.
    after_cr: bool,
}

impl<R: BufRead> ObjLines<R> {
    pub(crate) fn new(reader: R) -> Self {
        Self { reader, count: 0, after_cr: false }
    }

    /// One line as it is in the file.
    fn physical(&mut self) -> io::Result<Option<Vec<u8>>> {
        let mut line = Vec::new();
        let mut begun = false;
        loop {
            let have = self.reader.fill_buf()?;
            if have.is_empty() {
                self.count += usize::from(begun);
                return Ok(begun.then_some(line));
            }
            let behind = usize::from(std::mem::take(&mut self.after_cr) && have[0] == b'\n');
            let end = have[behind..].iter().position(|b| matches!(b, b'\n' | b'\r')).map(|i| behind + i);
            line.extend_from_slice(&have[behind..end.unwrap_or(have.len())]);
            begun |= have.len() > behind;
            let taken = end.map_or(have.len(), |end| end + 1);
            self.after_cr = end.is_some_and(|end| have[end] == b'\r');
            self.reader.consume(taken);
            if end.is_some() {
                self.count += 1;
                return Ok(Some(line));
            }
        }
    }

    fn line(&mut self) -> io::Result<Option<ObjLine>> {
        let Some(mut bytes) = self.physical()? else { return Ok(None) };
        let number = self.count;
        if number == 1 && bytes.starts_with("\u{feff}".as_bytes()) {
            bytes.drain(..3);
        }
        // A comment may end in the name of a folder.
        while !bytes.trim_ascii_start().starts_with(b"#") && bytes.trim_ascii_end().ends_with(b"\\") {
            bytes.truncate(bytes.trim_ascii_end().len() - 1);
            let Some(more) = self.physical()? else { break };
            bytes.push(b' ');
            bytes.extend(more);
        }
        Ok(Some(ObjLine { number, text: String::from_utf8_lossy(&bytes).into_owned() }))
    }
}

impl<R: BufRead> Iterator for ObjLines<R> {
    type Item = io::Result<ObjLine>;

    fn next(&mut self) -> Option<Self::Item> {
        self.line().transpose()
    }
}

#[cfg(test)]
mod tests {
    use std::io::BufReader;

    use super::*;

    fn read(text: &str) -> Vec<(usize, String)> {
        let of = |buffer: usize| {
            let lines = ObjLines::new(BufReader::with_capacity(buffer, text.as_bytes()));
            lines.map(|line| line.unwrap()).map(|line| (line.number, line.text)).collect::<Vec<_>>()
        };
        assert_eq!(of(1), of(4096));
        of(3)
    }

    #[test]
    fn lines_end_as_they_do_in_files() {
        let lines = |of: &[&str]| of.iter().zip(1..).map(|(text, n)| (n, (*text).to_owned())).collect::<Vec<_>>();
        for end in ["\n", "\r\n", "\r"] {
            assert_eq!(read(&["v 1", "", "f 2", ""].join(end)), lines(&["v 1", "", "f 2"]), "{end:?}");
        }
        assert_eq!(read("\u{feff}v 1\nv 2"), lines(&["v 1", "v 2"]));
        assert!(read("").is_empty());
    }

    #[test]
    fn a_backslash_goes_on() {
        let lines = read("f 1 \\\n2 \\ \r\n3\n# C:\\meshes\\\nv 4\\");
        assert_eq!(lines.iter().map(|l| l.0).collect::<Vec<_>>(), [1, 4, 5]);
        assert_eq!(lines[0].1.split_whitespace().collect::<Vec<_>>(), ["f", "1", "2", "3"]);
        assert_eq!(lines[2].1, "v 4");
    }

    #[test]
    fn damaged_words_are_told() {
        let damage = |text: &str| ObjLine { number: 1, text: text.into() }.damage();
        for sound in ["v 0 0 0", "  f 1/2 3/4", "", "# 1 2", "s 1", "curv2 1 2", "vendor_note of an exporter"] {
            assert_eq!(damage(sound), None, "{sound}");
        }
        for damaged in ["vv 0 0 0", "0 0 0", "\u{feff}v 1 2 3", "F 1/1 2/2 3/3"] {
            assert!(damage(damaged).is_some(), "{damaged}");
        }
    }
}
