//! ROS 2 bags in SQLite: rows in many pages, long ones over several, and anything in a damaged file.
#![cfg(feature = "mcap")]

use proptest::prelude::*;
use slipbound::port::{Clock, FrameBuffer, FrameSource as _, Next};
use slipbound_rig::source;
use std::fs;

const PAGE_BYTES: usize = 512;
/// Longest row that fits in one page, bytes.
const MOST_LOCAL_BYTES: usize = PAGE_BYTES - 35;
/// Children of a page.
const CHILDREN_COUNT: usize = 12;

enum Value<'a> {
    Null,
    Whole(i64),
    Text(&'a str),
    Bytes(&'a [u8]),
}

fn varint(mut value: u64) -> Vec<u8> {
    let mut out = vec![value as u8 & 0x7F];
    while value >= 0x80 {
        value >>= 7;
        out.insert(0, value as u8 | 0x80);
    }
    out
}

fn row(values: &[Value<'_>]) -> Vec<u8> {
    let (mut kinds, mut body) = (Vec::new(), Vec::new());
    for value in values {
        match value {
            Value::Null => kinds.extend(varint(0)),
            Value::Whole(number @ 0..=1) => kinds.extend(varint(8 + *number as u64)),
            Value::Whole(number) => {
                kinds.extend(varint(6));
                body.extend_from_slice(&number.to_be_bytes());
            }
            Value::Text(text) => {
                kinds.extend(varint(13 + 2 * text.len() as u64));
                body.extend_from_slice(text.as_bytes());
            }
            Value::Bytes(bytes) => {
                kinds.extend(varint(12 + 2 * bytes.len() as u64));
                body.extend_from_slice(bytes);
            }
        }
    }
    [varint(kinds.len() as u64 + 1), kinds, body].concat()
}

/// A row as stored in a leaf; what does not fit goes into pages of its own.
fn cell(key: u64, row: &[u8], pages: &mut Vec<Vec<u8>>) -> Vec<u8> {
    let head = [varint(row.len() as u64), varint(key)].concat();
    if row.len() <= MOST_LOCAL_BYTES {
        return [&head[..], row].concat();
    }
    let least = (PAGE_BYTES - 12) * 32 / 255 - 23;
    let wanted = least + (row.len() - least) % (PAGE_BYTES - 4);
    let here = if wanted <= MOST_LOCAL_BYTES { wanted } else { least };
    let first = pages.len() as u32 + 1;
    let parts: Vec<&[u8]> = row[here..].chunks(PAGE_BYTES - 4).collect();
    for (n, part) in parts.iter().enumerate() {
        let next = if n + 1 < parts.len() { pages.len() as u32 + 2 } else { 0 };
        let mut page = [&next.to_be_bytes()[..], part].concat();
        page.resize(PAGE_BYTES, 0);
        pages.push(page);
    }
    [&head[..], &row[..here], &first.to_be_bytes()].concat()
}

fn page(kind: u8, head_bytes: usize, right: Option<u32>, cells: &[Vec<u8>]) -> Vec<u8> {
    let mut page = vec![0; PAGE_BYTES];
    page[head_bytes] = kind;
    page[head_bytes + 3..head_bytes + 5].copy_from_slice(&(cells.len() as u16).to_be_bytes());
    let mut pointers_at = head_bytes + 8;
    if let Some(right) = right {
        page[pointers_at..pointers_at + 4].copy_from_slice(&right.to_be_bytes());
        pointers_at += 4;
    }
    let mut end = PAGE_BYTES;
    for (n, cell) in cells.iter().enumerate() {
        end -= cell.len();
        page[end..end + cell.len()].copy_from_slice(cell);
        let at = pointers_at + 2 * n;
        page[at..at + 2].copy_from_slice(&(end as u16).to_be_bytes());
        assert!(at + 2 <= end, "a page is too full");
    }
    page
}

/// One leaf per row, and pages over them in as many levels as needed; returns the number of the topmost page.
fn table(rows: &[Vec<u8>], pages: &mut Vec<Vec<u8>>) -> u32 {
    let mut children = Vec::new();
    for (row, key) in rows.iter().zip(1..) {
        let cell = cell(key, row, pages);
        pages.push(page(13, 0, None, &[cell]));
        children.push((pages.len() as u32, key));
    }
    loop {
        let mut over = Vec::new();
        for below in children.chunks(CHILDREN_COUNT) {
            let (last, others) = below.split_last().expect("rows");
            let cells = others.iter().map(|(child, key)| [&child.to_be_bytes()[..], &varint(*key)].concat());
            pages.push(page(5, 0, Some(last.0), &cells.collect::<Vec<_>>()));
            over.push((pages.len() as u32, last.1));
        }
        if let [(top, _)] = over[..] {
            return top;
        }
        children = over;
    }
}

/// `sensor_msgs/msg/Image` of grey pixels in CDR.
fn image(seconds: u32, grey: u8) -> Vec<u8> {
    let mut out = vec![0, 1, 0, 0];
    for number in [seconds, 5, 3] {
        out.extend_from_slice(&number.to_le_bytes());
    }
    out.extend_from_slice(b"ab\0\0");
    for number in [24u32, 32, 6] {
        out.extend_from_slice(&number.to_le_bytes());
    }
    out.extend_from_slice(b"mono8\0\0\0");
    for number in [32u32, 24 * 32] {
        out.extend_from_slice(&number.to_le_bytes());
    }
    out.resize(out.len() + 24 * 32, grey);
    out
}

/// A bag of this many images on each of these topics, in turns.
fn bag(topics: &[&str], count: u32) -> Vec<u8> {
    let mut pages = vec![Vec::new()];
    let named = |name: &&str| {
        let kind = if *name == "/words" { "std_msgs/msg/String" } else { "sensor_msgs/msg/Image" };
        row(&[Value::Null, Value::Text(name), Value::Text(kind), Value::Text("cdr"), Value::Text("")])
    };
    let topics_page = table(&topics.iter().map(named).collect::<Vec<_>>(), &mut pages);
    let message = |at: u32, topic: usize| {
        let data = image(100 + at, (at as u8) << 2 | topic as u8);
        row(&[Value::Null, Value::Whole(topic as i64 + 1), Value::Whole(7_000_000_000), Value::Bytes(&data)])
    };
    let rows: Vec<Vec<u8>> = (0..count).flat_map(|at| (0..topics.len()).map(move |topic| message(at, topic))).collect();
    let messages_page = table(&rows, &mut pages);
    let schema = |name: &str, root: u32| {
        row(&[Value::Text("table"), Value::Text(name), Value::Text(name), Value::Whole(root.into()), Value::Text("")])
    };
    let cells = [("topics", topics_page), ("messages", messages_page)].map(|(name, root)| {
        let row = schema(name, root);
        [varint(row.len() as u64), varint(1), row].concat()
    });
    pages[0] = page(13, 100, None, &cells);
    pages[0][..16].copy_from_slice(b"SQLite format 3\0");
    pages[0][16..18].copy_from_slice(&(PAGE_BYTES as u16).to_be_bytes());
    pages[0][59] = 1;
    pages.concat()
}

/// A frame's number, time and first byte.
type Drained = (u64, Option<u64>, u8);

/// Number, time and first pixel of every frame, and why others are torn.
fn drain(uri: &str) -> (Vec<Drained>, Vec<String>) {
    let mut source = source::open(uri).expect("opens");
    let (mut frame, mut frames, mut torn) = (FrameBuffer::default(), Vec::new(), Vec::new());
    loop {
        match source.next(&mut frame).expect("goes on") {
            Next::End => return (frames, torn),
            Next::Torn { reason } => torn.push(reason),
            _ => frames.push((frame.seq, frame.time_ns, frame.pixels[0])),
        }
        assert_eq!(frame.clock, Clock::Container);
    }
}

#[test]
fn pictures_come_in_their_order_with_their_times() {
    let scratch = tempfile::tempdir().expect("a folder");
    let path = scratch.path().join("bag.db3");
    let shown = path.to_str().expect("UTF-8").to_owned();
    fs::write(&path, bag(&["/left", "/words", "/right"], 25)).expect("writes");
    let refused = source::open(&shown).err().expect("two").to_string();
    assert!(refused.contains("expected FILE.db3#TOPIC with one of /left, /right"), "{refused}");
    let (frames, torn) = drain(&format!("{shown}#/right"));
    let expected = (0..25).map(|at| (at, Some((100 + at) * 1_000_000_000 + 5), (at as u8) << 2 | 2));
    assert_eq!(frames, expected.collect::<Vec<_>>());
    assert!(torn.is_empty(), "{torn:?}");
    let refused = source::open(&format!("{shown}#/words")).err().expect("no pictures").to_string();
    assert!(refused.contains("bag.db3: expected a topic /words with sensor_msgs/msg/CompressedImage"), "{refused}");
    fs::write(scratch.path().join("bag.db3-wal"), "log").expect("writes");
    let refused = source::open(&shown).err().expect("open").to_string();
    assert!(refused.contains("write-ahead log"), "{refused}");
    fs::write(&path, "no database").expect("writes");
    let refused = source::open(&shown).err().expect("none").to_string();
    assert!(refused.contains("expected a file of SQLite 3, got none"), "{refused}");
}

#[test]
fn a_bag_that_is_cut_gives_what_came_before_and_says_so() {
    let scratch = tempfile::tempdir().expect("a folder");
    let path = scratch.path().join("bag.db3");
    let shown = path.to_str().expect("UTF-8");
    let whole = bag(&["/left"], 10);
    fs::write(&path, &whole).expect("writes");
    let (all, _) = drain(shown);
    // A page over the rows points to one beyond the end.
    let mut cut = whole.clone();
    let root = whole.len() - PAGE_BYTES;
    cut[root + 8..root + 12].copy_from_slice(&9999u32.to_be_bytes());
    fs::write(&path, &cut).expect("writes");
    let (frames, torn) = drain(shown);
    assert_eq!(frames, all[..9]);
    assert!(torn[0].contains("got 9999: the file is cut off or damaged; what came before was read"), "{torn:?}");
}

/// `PROPTEST_CASES`, or 300: each writes a file.
fn cases_count() -> u32 {
    std::env::var("PROPTEST_CASES").ok().and_then(|count| count.parse().ok()).unwrap_or(300)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(cases_count()))]

    #[test]
    fn damage_never_makes_it_panic_or_run_on(
        damage in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..20),
        cut in any::<prop::sample::Index>(),
    ) {
        let scratch = tempfile::tempdir().expect("a folder");
        let path = scratch.path().join("bag.db3");
        let mut bytes = bag(&["/left"], 6);
        damage.iter().for_each(|(at, value)| *at.get_mut(&mut bytes) = *value);
        bytes.truncate(cut.index(3 * bytes.len()).max(200));
        fs::write(&path, &bytes).expect("writes");
        if let Ok(mut source) = source::open(path.to_str().expect("UTF-8")) {
            let (mut frame, mut steps_count) = (FrameBuffer::default(), 0);
            while !matches!(source.next(&mut frame), Ok(Next::End) | Err(_)) {
                steps_count += 1;
                prop_assert!(steps_count < 10_000);
            }
        }
    }
}
