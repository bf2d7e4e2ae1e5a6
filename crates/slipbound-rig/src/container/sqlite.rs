//! Tables of an SQLite file, row by row, read only: what a ROS 2 bag needs, in the order of the row numbers.
//!
//! ```text
//!   header 100 | page 1: the schema | pages: interior (children), leaf (rows), overflow (the rest of a long row)
//! ```
//!
//! The format is public (sqlite.org/fileformat2.html). A write-ahead log beside the file is not read: it is refused.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

/// Longest row, bytes; a damaged length asks for more.
const LONGEST_ROW_BYTES: usize = 256 << 20;
/// Deepest tree; a page holds dozens of children, so no file is deeper.
const MOST_LEVELS_COUNT: usize = 16;
/// Length of the file's header, bytes.
const HEADER_BYTES: usize = 100;

/// A value of a row.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// NULL, or a floating-point number, which no bag has.
    Other,
    /// A whole number.
    Whole(i64),
    /// A text, or bytes.
    Bytes(Vec<u8>),
}

impl Value {
    /// A text.
    pub fn text(&self) -> Option<&str> {
        match self {
            Value::Bytes(bytes) => std::str::from_utf8(bytes).ok(),
            _ => None,
        }
    }

    /// A whole number.
    pub fn whole(&self) -> Option<i64> {
        match self {
            Value::Whole(number) => Some(*number),
            _ => None,
        }
    }
}

/// A row: its number and its values.
pub type Row = (i64, Vec<Value>);

/// An open file.
pub struct Sqlite {
    file: File,
    page_bytes: usize,
    /// Of a page, without the part that other programs have reserved.
    usable_bytes: usize,
    pages_count: u64,
}

/// Where the reading of a table is.
pub struct Cursor {
    /// A page and its next cell, from the root down.
    stack: Vec<(Vec<u8>, usize, u32)>,
    /// Pages that may still be read: more than the file has means a cycle.
    pages_left: u64,
}

impl Sqlite {
    /// Opens a file. The error states what was expected and got.
    pub fn open(path: &Path) -> Result<Self, String> {
        let words = |e: std::io::Error| e.to_string();
        let mut file = File::open(path).map_err(words)?;
        let length = file.metadata().map_err(words)?.len();
        let mut head = [0; HEADER_BYTES];
        let is_sqlite = file.read_exact(&mut head).is_ok() && head.starts_with(b"SQLite format 3\0");
        if !is_sqlite {
            return Err("expected a file of SQLite 3, got none".into());
        }
        let mut log = path.as_os_str().to_owned();
        log.push("-wal");
        if std::fs::metadata(&log).is_ok_and(|log| log.len() > 0) {
            return Err("expected a bag that was closed, got one with a write-ahead log beside it: open and close it with sqlite3".into());
        }
        let page_bytes = match u16::from_be_bytes([head[16], head[17]]) {
            1 => 1 << 16,
            count => usize::from(count),
        };
        let usable_bytes = page_bytes.saturating_sub(usize::from(head[20]));
        if !page_bytes.is_power_of_two() || usable_bytes < 480 {
            return Err(format!("expected pages of 512 to 65536 bytes, got {page_bytes}"));
        }
        if head[56..60] != [0, 0, 0, 1] {
            return Err("expected texts in UTF-8, got another encoding".into());
        }
        let pages_count = length / page_bytes as u64;
        Ok(Sqlite { file, page_bytes, usable_bytes, pages_count })
    }

    /// A cursor at the first row of a table.
    pub fn table(&mut self, name: &str) -> Result<Cursor, String> {
        let mut schema = self.cursor(1)?;
        while let Some((_, row)) = self.next(&mut schema)? {
            let [kind, _, of, root, ..] = row.as_slice() else { continue };
            if kind.text() == Some("table") && of.text() == Some(name) {
                let root = root.whole().and_then(|root| u32::try_from(root).ok());
                return self.cursor(root.ok_or_else(|| format!("table {name}: expected a page, got none"))?);
            }
        }
        Err(format!("expected a table `{name}`, got none"))
    }

    fn cursor(&mut self, root: u32) -> Result<Cursor, String> {
        let page = self.page(root)?;
        Ok(Cursor { stack: vec![(page, 0, root)], pages_left: self.pages_count })
    }

    /// The next row; None at the end.
    pub fn next(&mut self, cursor: &mut Cursor) -> Result<Option<Row>, String> {
        loop {
            let level = cursor.stack.len();
            let Some((page, cell, number)) = cursor.stack.last_mut() else { return Ok(None) };
            let head = if *number == 1 { HEADER_BYTES } else { 0 };
            let cut = || "expected a page of a table, got one that is cut".to_owned();
            let count = usize::from(be_u16(page, head + 3).ok_or_else(cut)?);
            let (kind, at) = (page[head], *cell);
            *cell += 1;
            let cells_from = head + if kind == 5 { 12 } else { 8 };
            let place = |page: &[u8]| be_u16(page, cells_from + 2 * at).map(usize::from).ok_or_else(cut);
            match kind {
                13 if at < count => {
                    let from = place(page)?;
                    let (payload_bytes, key, body) = leaf_cell(page.get(from..).unwrap_or(&[])).ok_or_else(cut)?;
                    let body_at = page.len() - body.len();
                    let page = std::mem::take(page);
                    let row = self.row(payload_bytes, &page[body_at..]);
                    if let Some(top) = cursor.stack.last_mut() {
                        top.0 = page;
                    }
                    return Ok(Some((key, row?)));
                }
                5 if at <= count => {
                    let from = if at == count { head + 8 } else { place(page)? };
                    let child = be_u32(page, from).ok_or_else(cut)?;
                    if level >= MOST_LEVELS_COUNT || cursor.pages_left == 0 {
                        return Err("expected a tree of pages, got a circle".into());
                    }
                    cursor.pages_left -= 1;
                    let page = self.page(child)?;
                    cursor.stack.push((page, 0, child));
                }
                5 | 13 => drop(cursor.stack.pop()),
                other => return Err(format!("expected a page of a table (5 or 13), got {other}")),
            }
        }
    }

    /// A row of this many bytes, which begins here and may continue in other pages.
    fn row(&mut self, payload_bytes: u64, local: &[u8]) -> Result<Vec<Value>, String> {
        let total = usize::try_from(payload_bytes).unwrap_or(usize::MAX);
        if total > LONGEST_ROW_BYTES || payload_bytes > self.pages_count * self.page_bytes as u64 {
            return Err(format!("expected a row of at most {LONGEST_ROW_BYTES} bytes, got {payload_bytes}"));
        }
        let cut = || "expected a whole row, got one that is cut".to_owned();
        let (most, usable) = (self.usable_bytes - 35, self.usable_bytes);
        if total <= most {
            return values(local.get(..total).ok_or_else(cut)?).ok_or_else(cut);
        }
        let least = (usable - 12) * 32 / 255 - 23;
        let wanted = least + (total - least) % (usable - 4);
        let here = if wanted <= most { wanted } else { least };
        let mut bytes = local.get(..here).ok_or_else(cut)?.to_vec();
        let mut next = be_u32(local, here).ok_or_else(cut)?;
        // Every page adds to a known total, so a cycle of pages ends.
        while bytes.len() < total {
            let page = self.page(next)?;
            let count = (usable - 4).min(total - bytes.len());
            bytes.extend_from_slice(page.get(4..4 + count).ok_or_else(cut)?);
            next = be_u32(&page, 0).ok_or_else(cut)?;
        }
        values(&bytes).ok_or_else(cut)
    }

    fn page(&mut self, number: u32) -> Result<Vec<u8>, String> {
        if number == 0 || u64::from(number) > self.pages_count {
            return Err(format!(
                "expected a page from 1 to {}, got {number}: the file is cut off or damaged",
                self.pages_count
            ));
        }
        let mut page = vec![0; self.page_bytes];
        let at = u64::from(number - 1) * self.page_bytes as u64;
        let read = self.file.seek(SeekFrom::Start(at)).and_then(|_| self.file.read_exact(&mut page));
        read.map(|()| page).map_err(|e| e.to_string())
    }
}

fn be_u16(bytes: &[u8], at: usize) -> Option<u16> {
    bytes.get(at..)?.first_chunk().map(|found| u16::from_be_bytes(*found))
}

fn be_u32(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..)?.first_chunk().map(|found| u32::from_be_bytes(*found))
}

/// A number of up to nine bytes, seven bits each except the last.
fn varint(from: &mut &[u8]) -> Option<u64> {
    let mut value = 0u64;
    for place in 0..9 {
        let (&byte, rest) = from.split_first()?;
        *from = rest;
        if place == 8 {
            return Some(value << 8 | u64::from(byte));
        }
        value = value << 7 | u64::from(byte & 0x7F);
        if byte < 0x80 {
            return Some(value);
        }
    }
    None
}

/// Length of the row, its number, and the part of it in this page.
fn leaf_cell(mut cell: &[u8]) -> Option<(u64, i64, &[u8])> {
    let payload_bytes = varint(&mut cell)?;
    let key = varint(&mut cell)? as i64;
    Some((payload_bytes, key, cell))
}

/// The values of a row.
fn values(row: &[u8]) -> Option<Vec<Value>> {
    let mut rest = row;
    let head_bytes = usize::try_from(varint(&mut rest)?).ok()?;
    let mut body = row.get(head_bytes..)?;
    let mut kinds = row.get(row.len() - rest.len()..head_bytes)?;
    let mut values = Vec::new();
    while !kinds.is_empty() {
        let kind = varint(&mut kinds)?;
        let bytes = match kind {
            0 | 8 | 9 => 0,
            1..=4 => kind as usize,
            5 => 6,
            6 | 7 => 8,
            10 | 11 => return None,
            _ => usize::try_from((kind - 12) / 2).ok()?,
        };
        let (value, after) = body.split_at_checked(bytes)?;
        body = after;
        values.push(match kind {
            0 | 7 => Value::Other,
            8 | 9 => Value::Whole(kind as i64 - 8),
            1..=6 => {
                let sign = if value[0] & 0x80 == 0 { 0 } else { -1 };
                Value::Whole(value.iter().fold(sign, |number, byte| number << 8 | i64::from(*byte)))
            }
            _ => Value::Bytes(value.to_vec()),
        });
    }
    Some(values)
}
