//! What a WIF file says of cloth, as the loom of [`super::super::weave`] takes it.

use super::{
    super::{
        PatternStrand, StrandKind,
        draft::{Draft, DraftError, Threads},
    },
    Wif,
};
use crate::math::srgb::srgb_to_linear;

/// Threads of this thickness over their spacing are drawn so, not woven: programs write one value in both places.
const DRAWN: f64 = 0.9;

/// Which of a file's measures are used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WifUse {
    /// Spacings of ends and picks; else they are as close as the loom beats them.
    pub spacing: bool,
    /// Thickness of threads; else that of the yarn.
    pub thickness: bool,
    /// Colours of threads.
    pub colors: bool,
}

impl Default for WifUse {
    fn default() -> Self {
        Self { spacing: true, thickness: true, colors: true }
    }
}

/// A draft with all that its file says of the cloth; pairs are warp and weft.
#[derive(Clone, Debug)]
pub struct WovenWif {
    /// Its smallest repeat.
    pub draft: Draft,
    /// How the threads of the repeat differ.
    pub threads: [Threads; 2],
    /// Mean distance of threads, millimetres; `None` also where it says nothing of the cloth.
    pub spacing: [Option<f64>; 2],
    /// Mean radius of threads, millimetres.
    pub radius: [Option<f64>; 2],
    /// Colour of each thread of the file, sRGB from 0 to 1; empty where there are none.
    pub colors: [Vec<[f64; 3]>; 2],
    /// Threads of the whole file.
    pub count: [u32; 2],
    /// What was taken for granted.
    pub notes: Vec<String>,
}

impl WovenWif {
    /// The colour of a strand of this cloth, linear Rec.709: the mean where it is several threads in one.
    pub fn color_of(&self, strand: &PatternStrand) -> Option<[f32; 3]> {
        let side = usize::from(strand.kind == StrandKind::Weft);
        let colors = &self.colors[side];
        let at = strand.coordinates.first().filter(|_| !colors.is_empty())?;
        // A thread is of one colour all along.
        let color = colors[(at[side].floor() as i64).rem_euclid(colors.len() as i64) as usize];
        Some(color.map(|v| srgb_to_linear(v as f32)))
    }
}

impl Wif {
    /// The cloth of the file: its first end on the left, its first pick at the bottom.
    ///
    /// # Errors
    /// A repeat that is too large.
    pub fn woven(&self, take: WifUse) -> Result<WovenWif, DraftError> {
        let mut notes = self.notes.clone();
        let sides = [&self.warp, &self.weft];
        let given = |asked: bool, values: &[f64]| if asked { values.to_vec() } else { Vec::new() };
        let mut threads = sides.map(|side| Threads {
            thickness: given(take.thickness, &side.thickness),
            spacing: given(take.spacing, &side.spacing),
        });
        let mean = |values: &[f64]| (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64);
        let spacing = [0, 1].map(|side| mean(&threads[side].spacing));
        let thickness = [0, 1].map(|side| mean(&threads[side].thickness));
        let drawn = (0..2).any(|s| thickness[s].zip(spacing[s]).is_some_and(|(t, s)| t > DRAWN * s));
        let radius = thickness.map(|t| t.filter(|_| !drawn).map(|t| 0.5 * t));
        // How far apart threads are says how open the cloth is only beside how thick they are.
        let measured = |side: usize| radius[side].is_some() || !take.thickness;
        let setting = [0, 1].map(|side| spacing[side].filter(|_| measured(side)));
        if drawn || setting != spacing {
            let why = if drawn { "as thick as they are apart, which is how they are drawn" } else { "of no thickness" };
            notes.push(format!("threads are {why}: the yarn is woven as close as it goes"));
        }
        for (threads, setting) in threads.iter_mut().zip(setting) {
            // Yarn as close as it goes has no room to give: none lies nearer to its neighbour than others.
            if setting.is_none() {
                threads.spacing.clear();
            }
        }
        let draft = Draft::repeat_of(&self.warp_over, &mut threads)?;
        let colors = sides.map(|side| if take.colors { side.colors.clone() } else { Vec::new() });
        let count = sides.map(|side| side.count as u32);
        Ok(WovenWif { draft, threads, spacing: setting, radius, colors, count, notes })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "[WIF]\nVersion=1.1\n[WEAVING]\nShafts=2\n[WARP]\nThreads=4\nSpacing=1\nThickness=0.6\nUnits=mm\n\
        [WEFT]\nThreads=2\nSpacing=2\nThickness=0.5\nUnits=mm\n[THREADING]\n1=1\n2=2\n3=1\n4=2\n[LIFTPLAN]\n1=1\n2=2\n";

    fn woven(text: &str) -> WovenWif {
        super::super::parse(text.as_bytes()).unwrap().woven(WifUse::default()).unwrap()
    }

    #[test]
    fn measures_become_means_and_ratios() {
        let cloth = woven(HEAD);
        assert_eq!((cloth.draft.warps(), cloth.draft.wefts(), cloth.count), (2, 2, [4, 2]));
        assert_eq!((cloth.spacing, cloth.radius), ([Some(1.0), Some(2.0)], [Some(0.3), Some(0.25)]));
        assert_eq!(cloth.threads, <[Threads; 2]>::default());
        let cloth = woven(&format!("{HEAD}[WARP SPACING]\n1=3\n[WARP THICKNESS]\n1=0.9\n2=0.1\n3=0.5\n4=0.5\n"));
        assert_eq!(cloth.spacing[0], Some(1.5));
        assert_eq!(cloth.threads[0].spacing, [2.0, 2.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0]);
        assert_eq!((cloth.threads[0].thickness[0], cloth.radius[0]), (1.8, Some(0.25)));
        assert_eq!(cloth.draft.warps(), 4);
    }

    /// Cloth of them is closed: neither their spacing nor their thickness is measured.
    #[test]
    fn threads_that_are_only_drawn_are_woven_as_close_as_they_go() {
        let cloth = woven(&HEAD.replace("Thickness=0.5", "Thickness=2"));
        assert_eq!((cloth.radius, cloth.spacing), ([None; 2], [None; 2]));
        assert!(cloth.notes[0].contains("as thick as they are apart"), "{:?}", cloth.notes);
        let half = HEAD.replace("Thickness=0.6\n", "");
        let cloth = woven(&half);
        assert_eq!((cloth.radius, cloth.spacing), ([None, Some(0.25)], [None, Some(2.0)]));
        assert!(cloth.notes[0].contains("of no thickness"), "{:?}", cloth.notes);
        let uneven = woven(&format!("{half}[WARP SPACING]\n1=0.25\n[WEFT SPACING]\n1=1\n"));
        assert_eq!(uneven.threads.map(|t| t.spacing), [vec![], vec![2.0 / 3.0, 4.0 / 3.0]]);
        // Who leaves the thickness aside takes the spacing for the yarn's own.
        let file = super::super::parse(half.as_bytes()).unwrap();
        let cloth = file.woven(WifUse { thickness: false, ..WifUse::default() }).unwrap();
        assert_eq!((cloth.spacing, cloth.notes.len()), ([Some(1.0), Some(2.0)], 0));
    }

    /// Files of another project, good and bad.
    #[test]
    fn real_files_are_read_or_refused_with_the_reason() {
        let bad = [
            ("default warp color too big", "line 79: [WARP] names colour 11, the [COLOR TABLE] has 1 to 10"),
            ("default warp color too small", "line 77: [WARP] names colour 0, the [COLOR TABLE] has 1 to 10"),
            ("default weft color too big", "line 85: [WEFT] names colour 11, the [COLOR TABLE] has 1 to 10"),
            ("default weft color too small", "line 83: [WEFT] names colour 0, the [COLOR TABLE] has 1 to 10"),
            ("missing liftplan", "there is no section [LIFTPLAN] and no section [TREADLING]"),
            ("missing tieup", "there is a treadling, but no section [TIEUP]"),
            ("missing treadling", "there is no section [LIFTPLAN] and no section [TREADLING]"),
            ("too many treadles in treadline", "line 44: [TREADLING] names treadle 7, the file says that there are 6"),
            ("warp_color too big", "line 39: [WEFT COLORS] names colour 11, the [COLOR TABLE] has 1 to 10"),
            ("warp_color too small", "line 30: [WARP COLORS] names colour 0, the [COLOR TABLE] has 1 to 10"),
            ("weft_color too big", "line 35: [WEFT COLORS] names colour 11, the [COLOR TABLE] has 1 to 10"),
            ("weft_color too small", "line 32: [WARP COLORS] names colour 0, the [COLOR TABLE] has 1 to 10"),
        ];
        let notes = [
            ("default warp color missing", "8 threads of the warp without a colour: the first of the table"),
            ("default warp spacing missing", "9 threads of the warp without a spacing: the mean of the others"),
            ("default warp thickness missing", "9 threads of the warp without a thickness: the mean of the others"),
            (
                "missing_color_table_warp",
                "colours of the warp are numbers without a [COLOR TABLE]: they are left aside",
            ),
        ];
        let folder = crate::testing::shared_path("data/wif");
        let Ok(entries) = std::fs::read_dir(&folder) else {
            crate::testing::skipped("data/wif is not beside the project");
            return;
        };
        let (mut read, mut refused) = (0, 0);
        for path in entries.map(|e| e.unwrap().path()).filter(|p| p.extension().is_some_and(|e| e == "wif")) {
            let name = path.file_stem().unwrap().to_string_lossy().into_owned();
            let expected = bad.iter().find(|(n, _)| *n == name).map(|(_, message)| *message);
            match super::super::parse(&std::fs::read(&path).unwrap()) {
                Err(error) => {
                    assert_eq!(Some(error.without_hint().as_str()), expected, "{name}");
                    refused += 1;
                }
                Ok(wif) => {
                    assert_eq!(expected, None, "{name} was read");
                    let cloth = wif.woven(WifUse::default()).unwrap();
                    assert_eq!(cloth.count, [wif.warp.count as u32, wif.weft.count as u32], "{name}");
                    if let Some((_, note)) = notes.iter().find(|(n, _)| *n == name) {
                        assert!(cloth.notes.iter().any(|n| n == note), "{name}: {:?}", cloth.notes);
                    }
                    if name.starts_with("multi-byte") {
                        // A point twill of 17 shafts, both ways.
                        assert_eq!((cloth.count, cloth.draft.warps(), cloth.draft.wefts()), ([641; 2], 32, 32));
                    }
                    read += 1;
                }
            }
        }
        assert_eq!((read, refused), (21, 12));
    }
}
