//! Compressed chunks.

use crate::{drain, record};
use slipbound::port::{FrameBuffer, Next};
use slipbound_rig::source;
use std::fs;

/// The same file with its chunks packed; everything from the summary on is dropped, as in a file that was cut off
/// there.
fn packed(whole: &[u8], name: &str, mut pack: impl FnMut(&[u8]) -> Vec<u8>) -> Vec<u8> {
    let (magic, mut rest) = whole.split_at(8);
    let mut out = magic.to_vec();
    while let Some((head, after)) = rest.split_at_checked(9) {
        let count = u64::from_le_bytes(head[1..].try_into().expect("8 bytes")) as usize;
        let (body, after) = after.split_at(count);
        let record = match head[0] {
            0x0F => break, // the end of the data
            0x06 => {
                let records = pack(&body[40..]);
                let (sizes, name_bytes) = (&body[..28], name.as_bytes());
                let name_count = (name_bytes.len() as u32).to_le_bytes();
                [sizes, &name_count, name_bytes, &(records.len() as u64).to_le_bytes(), &records].concat()
            }
            _ => body.to_vec(),
        };
        out.push(head[0]);
        out.extend_from_slice(&(record.len() as u64).to_le_bytes());
        out.extend_from_slice(&record);
        rest = after;
    }
    out
}

/// A frame of LZ4 of one block, of up to 4 MB.
fn lz4(data: &[u8]) -> Vec<u8> {
    let block = lz4_flex::block::compress(data);
    let size = (block.len() as u32).to_le_bytes();
    [&[0x04, 0x22, 0x4D, 0x18, 0x60, 0x70, 0x73][..], &size, &block, &[0; 4]].concat()
}

fn zstd(data: &[u8]) -> Vec<u8> {
    ruzstd::encoding::compress_to_vec(data, ruzstd::encoding::CompressionLevel::Fastest)
}

#[test]
fn compressed_chunks_hold_the_same_and_damage_in_one_is_told() {
    let scratch = tempfile::tempdir().expect("a folder");
    let path = scratch.path().join("run.mcap");
    let judged = record(&path, 300, |_| true);
    let whole = fs::read(&path).expect("reads");
    let part = scratch.path().join("packed.mcap");
    let shown = part.to_str().expect("UTF-8");
    type Pack = fn(&[u8]) -> Vec<u8>;
    for (name, pack) in [("zstd", zstd as Pack), ("lz4", lz4)] {
        let packed = packed(&whole, name, pack);
        fs::write(&part, &packed).expect("writes");
        let (seen, cut) = drain(shown);
        assert!(seen == judged && cut.is_some(), "{name}: {} of {}, {cut:?}", seen.len(), judged.len());
        // An image in the first chunk gets another byte: the chunk is reported, and those after it are read.
        let mut is_first = true;
        let damaged = self::packed(&whole, name, |data| {
            let mut data = data.to_vec();
            // A slow machine may have closed a chunk without an image.
            if let Some(at) = data.windows(2).position(|pair| pair == [0xFF, 0xD9]) {
                data[at] ^= u8::from(std::mem::take(&mut is_first));
            }
            pack(&data)
        });
        fs::write(&part, &damaged).expect("writes");
        let mut source = source::open(shown).expect("opens");
        let (mut frame, mut told, mut last_seq) = (FrameBuffer::default(), Vec::new(), 0);
        loop {
            match source.next(&mut frame).expect("goes on") {
                Next::End => break,
                Next::Torn { reason } if reason.contains("checksum") => told.push((frame.seq, reason)),
                Next::Frame => last_seq = frame.seq,
                _ => {}
            }
        }
        let [(seq, reason)] = told.as_slice() else { panic!("{name}: {told:?}") };
        assert!(
            (1..=300).contains(seq)
                && reason.contains("packed.mcap: chunk ")
                && reason.contains(", just before this, is damaged"),
            "{seq} {reason}"
        );
        assert_eq!(last_seq, 299);
    }
    fs::write(&part, self::packed(&whole, "zstd", |data| data.to_vec())).expect("writes");
    let refused = source::open(shown).err().expect("no zstd").to_string();
    assert!(refused.contains("packed.mcap") && refused.contains("chunk 0: expected a frame of zstd"), "{refused}");
    fs::write(&part, self::packed(&whole, "br", |data| data.to_vec())).expect("writes");
    let refused = source::open(shown).err().expect("no such").to_string();
    assert!(refused.contains("chunk 0: expected zstd, lz4 or no compression, got `br`"), "{refused}");
    // The claims of a head are checked: more than is possible, and more than is present.
    for (claimed, expected) in
        [(u64::MAX, "chunk 0: expected at most 1073741824 bytes unpacked"), (1 << 29, "got its end")]
    {
        let mut claims = self::packed(&whole, "zstd", zstd);
        let chunk = claims.windows(4).position(|name| name == b"zstd").expect("a chunk");
        claims[chunk - 16..chunk - 8].copy_from_slice(&claimed.to_le_bytes());
        fs::write(&part, &claims).expect("writes");
        let told = source::open(shown).err().map_or_else(|| drain(shown).1.unwrap_or_default(), |e| e.to_string());
        assert!(told.contains(expected), "{told}");
    }
}
