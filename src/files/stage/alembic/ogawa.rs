//! The Ogawa container: groups of groups and data, found by their offsets, all bounded by the bytes that are there.

use crate::files::stage::Problem;

/// Letters that begin a file.
pub(in crate::files::stage) const MAGIC: &[u8] = b"Ogawa";
/// Those of the older container, which is not read.
pub(in crate::files::stage) const HDF5_MAGIC: &[u8] = b"\x89HDF";

const IS_DATA: u64 = 1 << 63;

/// Numbers of a file by their offsets.
#[derive(Clone, Copy)]
pub(super) struct Bytes<'a>(pub(super) &'a [u8]);

impl<'a> Bytes<'a> {
    pub(super) fn slice(self, at: u64, length: u64) -> Result<&'a [u8], Problem> {
        let end = at.checked_add(length).filter(|&end| end <= self.0.len() as u64);
        match end {
            Some(end) => Ok(&self.0[at as usize..end as usize]),
            None => Err(Problem::new(format!("byte {at}: {length} bytes are expected, the file ends before"))),
        }
    }

    fn u64(self, at: u64) -> Result<u64, Problem> {
        let bytes = self.slice(at, 8)?;
        Ok(u64::from_le_bytes(bytes.try_into().expect("eight bytes")))
    }

    /// The group at the root.
    pub(super) fn root(self) -> Result<Group<'a>, Problem> {
        if self.0.get(5) != Some(&0xff) {
            return Err(Problem::new("was not closed by the program that wrote it"));
        }
        Group::at(self, self.u64(8)?)
    }
}

/// A list of children.
#[derive(Clone, Copy)]
pub(super) struct Group<'a> {
    bytes: Bytes<'a>,
    /// Where the offsets of the children begin.
    first: u64,
    count: u64,
}

impl<'a> Group<'a> {
    fn at(bytes: Bytes<'a>, at: u64) -> Result<Self, Problem> {
        // An empty group has no place.
        if at == 0 {
            return Ok(Self { bytes, first: 0, count: 0 });
        }
        let count = bytes.u64(at)?;
        let size = count.checked_mul(8).ok_or_else(|| Problem::new(format!("byte {at}: {count} children")))?;
        bytes.slice(at + 8, size)?;
        Ok(Self { bytes, first: at + 8, count })
    }

    pub(super) fn len(&self) -> usize {
        self.count as usize
    }

    fn child(&self, i: usize) -> Result<u64, Problem> {
        if i as u64 >= self.count {
            return Err(Problem::new(format!("byte {}: a group lacks its child {i}", self.first)));
        }
        self.bytes.u64(self.first + 8 * i as u64)
    }

    pub(super) fn is_group(&self, i: usize) -> bool {
        self.child(i).is_ok_and(|child| child & IS_DATA == 0)
    }

    pub(super) fn group(&self, i: usize) -> Result<Self, Problem> {
        let child = self.child(i)?;
        if child & IS_DATA != 0 {
            return Err(Problem::new(format!("byte {}: child {i} should be a group", self.first)));
        }
        // Children stand before their group in the file: no ring can be made of them.
        if child >= self.first {
            return Err(Problem::new(format!("byte {}: child {i} does not stand before its group", self.first)));
        }
        Self::at(self.bytes, child)
    }

    pub(super) fn data(&self, i: usize) -> Result<&'a [u8], Problem> {
        let child = self.child(i)?;
        if child & IS_DATA == 0 {
            return Err(Problem::new(format!("byte {}: child {i} should be data", self.first)));
        }
        match child & !IS_DATA {
            0 => Ok(&[]),
            at => {
                let size = self.bytes.u64(at)?;
                self.bytes.slice(at + 8, size)
            }
        }
    }
}

/// Reads small numbers one after the other.
pub(super) struct Cursor<'a> {
    bytes: &'a [u8],
}

impl<'a> Cursor<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    pub(super) fn take(&mut self, count: usize) -> Result<&'a [u8], Problem> {
        if count > self.bytes.len() {
            return Err(Problem::new(format!("{count} bytes of a header are expected, {} are left", self.bytes.len())));
        }
        let (taken, rest) = self.bytes.split_at(count);
        self.bytes = rest;
        Ok(taken)
    }

    pub(super) fn u8(&mut self) -> Result<u8, Problem> {
        Ok(self.take(1)?[0])
    }

    pub(super) fn u32(&mut self) -> Result<u32, Problem> {
        Ok(u32::from_le_bytes(self.take(4)?.try_into().expect("four bytes")))
    }

    pub(super) fn f64(&mut self) -> Result<f64, Problem> {
        Ok(f64::from_le_bytes(self.take(8)?.try_into().expect("eight bytes")))
    }

    /// A number of one, two or four bytes, as a hint says.
    pub(super) fn sized(&mut self, hint: u32) -> Result<u32, Problem> {
        match hint {
            0 => Ok(self.u8()?.into()),
            1 => Ok(u16::from_le_bytes(self.take(2)?.try_into().expect("two bytes")).into()),
            2 => self.u32(),
            _ => Err(Problem::new(format!("a header has a size hint of {hint}, expected 0 to 2"))),
        }
    }

    pub(super) fn text(&mut self, length: u32) -> Result<String, Problem> {
        Ok(String::from_utf8_lossy(self.take(length as usize)?).into_owned())
    }
}
