//! Properties of objects: typed values, some of which change in time.

use super::{
    TimeSampling,
    ogawa::{Cursor, Group},
};
use crate::files::stage::Problem;

/// What a property holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Compound,
    Scalar,
    Array,
}

/// Kinds of numbers by their code in the format.
const POD_SIZES: [usize; 12] = [1, 1, 1, 2, 2, 4, 4, 8, 8, 2, 4, 8];

/// A property's header.
#[derive(Clone, Debug)]
struct Header {
    name: String,
    metadata: String,
    kind: Kind,
    pod: usize,
    /// Numbers of one value: 3 of a vector.
    extent: usize,
    /// Samples as seen from outside, and the first and last that differ from their neighbours.
    samples: u32,
    first_changed: u32,
    last_changed: u32,
    time_sampling: usize,
}

/// The properties of an object, or of a property.
pub(super) struct Compound<'a> {
    group: Group<'a>,
    headers: Vec<Header>,
}

/// A typed value at one time.
pub(super) struct Sample<'a> {
    pod: usize,
    bytes: &'a [u8],
}

/// Two samples around a time, and how far it is from the first to the second.
pub(super) struct Around<'a> {
    pub(super) before: Sample<'a>,
    pub(super) after: Option<(Sample<'a>, f64)>,
}

impl<'a> Compound<'a> {
    pub(super) fn new(group: Group<'a>, metadata: &[String]) -> Result<Self, Problem> {
        let headers = match group.len() {
            0 => Vec::new(),
            n => headers(group.data(n - 1)?, metadata)?,
        };
        if headers.len() >= group.len().max(1) {
            return Err(Problem::new(format!("{} properties are named, {} are there", headers.len(), group.len())));
        }
        Ok(Self { group, headers })
    }

    fn find(&self, name: &str) -> Option<(usize, &Header)> {
        self.headers.iter().enumerate().find(|(_, h)| h.name == name)
    }

    /// The compound of this name.
    pub(super) fn compound(&self, name: &str, metadata: &[String]) -> Result<Option<Self>, Problem> {
        match self.find(name) {
            Some((i, header)) if header.kind == Kind::Compound => Ok(Some(Self::new(self.group.group(i)?, metadata)?)),
            _ => Ok(None),
        }
    }

    /// What a property says of itself, such as how its values are spread.
    pub(super) fn metadata(&self, name: &str) -> &str {
        self.find(name).map_or("", |(_, header)| &header.metadata)
    }

    /// The names of all properties.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.headers.iter().map(|header| header.name.as_str())
    }

    /// How many numbers one value of a property has.
    pub(super) fn extent(&self, name: &str) -> Option<usize> {
        self.find(name).filter(|(_, h)| h.kind != Kind::Compound).map(|(_, header)| header.extent)
    }

    /// The times of a property's samples.
    pub(super) fn times<'t>(&self, name: &str, samplings: &'t [TimeSampling]) -> Option<(&'t TimeSampling, u32)> {
        let (_, header) = self.find(name)?;
        Some((samplings.get(header.time_sampling)?, header.samples))
    }

    /// The values of a property at a time in seconds; `None` without such a property or without samples.
    pub(super) fn at(
        &self,
        name: &str,
        time: Option<f64>,
        samplings: &[TimeSampling],
    ) -> Result<Option<Around<'a>>, Problem> {
        let Some((i, header)) = self.find(name).filter(|(_, h)| h.kind != Kind::Compound && h.samples > 0) else {
            return Ok(None);
        };
        let missing = || Problem::new(format!("`{name}` names times that are not there"));
        let sampling = samplings.get(header.time_sampling).ok_or_else(missing)?;
        let (index, share) = time.map_or((0, 0.0), |time| sampling.around(time, header.samples));
        let group = self.group.group(i)?;
        let sample = |index: u32| {
            let stored = header.stored(index) as usize;
            let at = if header.kind == Kind::Array { 2 * stored } else { stored };
            let data = group.data(at).map_err(|p| Problem::new(format!("`{name}`: {}", p.text)))?;
            // Before the values stands their hash.
            Ok::<_, Problem>(Sample { pod: header.pod, bytes: data.get(16..).unwrap_or_default() })
        };
        let after = if share > 0.0 && header.stored(index) != header.stored(index + 1) {
            Some((sample(index + 1)?, share))
        } else {
            None
        };
        Ok(Some(Around { before: sample(index)?, after }))
    }
}

impl Header {
    /// Samples that do not change are stored once.
    fn stored(&self, index: u32) -> u32 {
        if self.last_changed == 0 || index < self.first_changed {
            0
        } else {
            index.min(self.last_changed) - self.first_changed + 1
        }
    }
}

fn headers(data: &[u8], indexed: &[String]) -> Result<Vec<Header>, Problem> {
    let mut cursor = Cursor::new(data);
    let mut out = Vec::new();
    while !cursor.is_empty() {
        let info = cursor.u32()?;
        let hint = (info >> 2) & 3;
        let kind = match info & 3 {
            0 => Kind::Compound,
            1 => Kind::Scalar,
            _ => Kind::Array,
        };
        let pod = ((info >> 4) & 0xf) as usize;
        let extent = ((info >> 12) & 0xff) as usize;
        let (mut samples, mut first_changed, mut last_changed, mut time_sampling) = (0, 0, 0, 0);
        if kind != Kind::Compound {
            samples = cursor.sized(hint)?;
            if info & 0x200 != 0 {
                (first_changed, last_changed) = (cursor.sized(hint)?, cursor.sized(hint)?);
            } else if info & 0x800 == 0 {
                (first_changed, last_changed) = (1, samples.saturating_sub(1));
            }
            if info & 0x100 != 0 {
                time_sampling = cursor.sized(hint)? as usize;
            }
            if first_changed > last_changed && last_changed != 0 {
                return Err(Problem::new("a property changes last before it changes first"));
            }
        }
        let length = cursor.sized(hint)?;
        let name = cursor.text(length)?;
        let metadata = match (info >> 20) & 0xff {
            0xff => {
                let length = cursor.sized(hint)?;
                cursor.text(length)?
            }
            i => indexed.get(i as usize).cloned().unwrap_or_default(),
        };
        out.push(Header { name, metadata, kind, pod, extent, samples, first_changed, last_changed, time_sampling });
    }
    Ok(out)
}

impl Sample<'_> {
    /// All numbers of the sample.
    pub(super) fn numbers(&self, name: &str) -> Result<Vec<f64>, Problem> {
        let Some(&size) = POD_SIZES.get(self.pod) else {
            return Err(Problem::new(format!("`{name}` should hold numbers, found text")));
        };
        if !self.bytes.len().is_multiple_of(size) {
            let length = self.bytes.len();
            return Err(Problem::new(format!("`{name}` has {length} bytes, which is no multiple of {size}")));
        }
        let number = |b: &[u8]| -> f64 {
            match self.pod {
                0 | 1 => b[0].into(),
                2 => (b[0] as i8).into(),
                3 => u16::from_le_bytes([b[0], b[1]]).into(),
                4 => i16::from_le_bytes([b[0], b[1]]).into(),
                5 => u32::from_le_bytes([b[0], b[1], b[2], b[3]]).into(),
                6 => i32::from_le_bytes([b[0], b[1], b[2], b[3]]).into(),
                7 => u64::from_le_bytes(b.try_into().expect("eight bytes")) as f64,
                8 => i64::from_le_bytes(b.try_into().expect("eight bytes")) as f64,
                9 => half::f16::from_le_bytes([b[0], b[1]]).into(),
                10 => f32::from_le_bytes([b[0], b[1], b[2], b[3]]).into(),
                _ => f64::from_le_bytes(b.try_into().expect("eight bytes")),
            }
        };
        Ok(self.bytes.chunks_exact(size).map(number).collect())
    }

    /// All numbers as whole ones.
    pub(super) fn integers(&self, name: &str) -> Result<Vec<i64>, Problem> {
        Ok(self.numbers(name)?.into_iter().map(|x| x as i64).collect())
    }
}

impl Around<'_> {
    /// Numbers that go evenly from the sample before to the one after; those before where the two differ in count.
    pub(super) fn between(&self, name: &str) -> Result<Vec<f64>, Problem> {
        let mut before = self.before.numbers(name)?;
        if let Some((after, share)) = &self.after {
            let after = after.numbers(name)?;
            if after.len() == before.len() {
                before.iter_mut().zip(after).for_each(|(b, a)| *b += share * (a - *b));
            }
        }
        Ok(before)
    }
}
