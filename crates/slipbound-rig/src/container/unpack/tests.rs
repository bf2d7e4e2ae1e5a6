use super::*;
use lz4_flex::block::{compress, get_maximum_output_size};
use proptest::prelude::*;
use ruzstd::encoding::{CompressionLevel, compress_to_vec};

/// Unpacks like the reader: `step` more bytes at a time, and at most `room` bytes of output; returns all output.
fn unpack<F: Format>(packed: &[u8], step: usize, room: usize) -> Result<Vec<u8>, String> {
    let (mut decoder, mut out, mut buffer) = (Unpack::<F>::default(), Vec::new(), vec![0; room]);
    let (mut at, mut end) = (0, 0);
    loop {
        let done = decoder.step(&packed[at..end], &mut buffer)?;
        at += done.used;
        out.extend_from_slice(&buffer[..done.wrote]);
        assert!(decoder.out.capacity() <= 9 << 20, "{} bytes are held", decoder.out.capacity());
        if done.used + done.wrote == 0 {
            if end == packed.len() {
                return Ok(out);
            }
            end = (end + step).min(packed.len());
        }
    }
}

/// A frame of LZ4 over blocks that do not refer to each other, every third one stored.
fn lz4_frame(data: &[u8]) -> Vec<u8> {
    let mut frame = vec![0x04, 0x22, 0x4D, 0x18, 0x60, 0x40, 0x82];
    for (n, block) in data.chunks(64 << 10).enumerate() {
        let packed = if n % 3 == 2 { block.to_vec() } else { compress(block) };
        assert!(packed.len() <= get_maximum_output_size(block.len()));
        frame.extend_from_slice(&(packed.len() as u32 | if n % 3 == 2 { STORED } else { 0 }).to_le_bytes());
        frame.extend_from_slice(&packed);
    }
    frame.extend_from_slice(&[0; 4]);
    frame
}

const STORED: u32 = 1 << 31;

fn zstd_frame(data: &[u8]) -> Vec<u8> {
    compress_to_vec(data, CompressionLevel::Fastest)
}

fn data(count: usize) -> Vec<u8> {
    (0..count).map(|i| ((i * i) >> 9) as u8 ^ (i / 700) as u8).collect()
}

#[test]
fn whatever_the_steps_what_was_packed_comes_out() {
    let data = data(300_000);
    let skipped = [&[0x5A, 0x2A, 0x4D, 0x18, 3, 0, 0, 0, 1, 2, 3][..], &zstd_frame(&data)].concat();
    for (step, room) in [(1 << 20, 1 << 20), (7, 1 << 20), (40_000, 999), (1, 65_536)] {
        assert!(unpack::<Lz4>(&lz4_frame(&data), step, room).as_deref() == Ok(&data[..]), "lz4 {step} {room}");
        assert!(unpack::<Zstd>(&zstd_frame(&data), step, room).as_deref() == Ok(&data[..]), "zstd {step} {room}");
        assert!(unpack::<Zstd>(&skipped, step, room).as_deref() == Ok(&data[..]), "zstd after skipped {step} {room}");
    }
    let twice = [lz4_frame(&data[..1000]), lz4_frame(&data[1000..])].concat();
    assert!(unpack::<Lz4>(&twice, 50, 5000).as_deref() == Ok(&data[..]), "two frames");
}

#[test]
fn a_block_may_refer_to_those_before_it() {
    // The second block is a copy of 40 bytes from 40 before it, then one literal.
    let mut frame = vec![0x04, 0x22, 0x4D, 0x18, 0x40, 0x40, 0];
    let first: Vec<u8> = (0..40).collect();
    frame.extend_from_slice(&(40 | STORED).to_le_bytes());
    frame.extend_from_slice(&first);
    let second = [0x0F, 40, 0, 40 - 19, 0x10, 99];
    frame.extend_from_slice(&(second.len() as u32).to_le_bytes());
    frame.extend_from_slice(&second);
    frame.extend_from_slice(&[0; 4]);
    let out = unpack::<Lz4>(&frame, 3, 1000).expect("unpacks");
    assert_eq!((&out[..40], &out[40..80], out[80]), (&first[..], &first[..], 99));
}

#[test]
fn a_bomb_takes_no_memory() {
    // Blocks of 128 kB of one byte each, 4 bytes long.
    let mut bomb = vec![0x28, 0xB5, 0x2F, 0xFD, 0x00, 0x38];
    let head = (128u32 << 10) << 3 | 2;
    (0..1000).for_each(|_| bomb.extend_from_slice(&[head as u8, (head >> 8) as u8, (head >> 16) as u8, 7]));
    let (mut decoder, mut buffer) = (Unpack::<Zstd>::default(), vec![0; 1 << 20]);
    let (mut at, mut total) = (0, 0);
    while at < bomb.len() {
        let done = decoder.step(&bomb[at..], &mut buffer).expect("unpacks");
        (at, total) = (at + done.used, total + done.wrote);
        assert!(decoder.out.capacity() <= 1 << 20);
    }
    assert!(total > 120 << 20, "{total}");
}

#[test]
fn what_is_no_frame_is_refused_by_its_chunk() {
    let refused = unpack::<Zstd>(b"no frame of anything", 100, 100).expect_err("refused");
    assert!(refused.contains("expected a frame of zstd, got one that begins with [6e,"), "{refused}");
    let refused = unpack::<Lz4>(b"no frame of anything", 100, 100).expect_err("refused");
    assert!(refused.contains("expected a frame of lz4, got one that begins with [6e,"), "{refused}");
}

proptest! {
    #[test]
    fn damage_never_makes_it_panic_or_grow(
        damage in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        cut in any::<prop::sample::Index>(),
    ) {
        let data = data(20_000);
        for (is_zstd, mut packed) in [(true, zstd_frame(&data)), (false, lz4_frame(&data))] {
            damage.iter().for_each(|(at, value)| *at.get_mut(&mut packed) = *value);
            packed.truncate(cut.index(packed.len() * 2).max(1).min(packed.len()));
            let _ = if is_zstd { unpack::<Zstd>(&packed, 500, 3000) } else { unpack::<Lz4>(&packed, 500, 3000) };
        }
    }
}
