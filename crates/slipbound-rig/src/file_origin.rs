//! Whether a file was written by this software, so that overwriting it destroys nobody else's data.
//!
//! | file | how it is recognised |
//! |---|---|
//! | report | its first line begins with `{"format":"slipbound-report"` |
//! | finger at rest | it begins with `{"format":"slipbound-rest"` |
//! | timings | its first line begins with `{"seq":` and names a time in microseconds |
//! | log of an emulator | its first line begins with `{"unix_ns":` and states whether the block is carried |
//! | table | its first line begins with `finger,frame,seq,time_ns,state,reason,contact_area_px2` |
//! | slips | its first line begins with `{"slip":` |
//! | page | `<meta name="generator" content="slipbound"/>` |
//! | overlay video | `slipbound` in the reserved words of its AVI header |
//! | overlay image | the PNG text `Software: slipbound` |

use crate::avi_writer;
use crate::rest_file;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Bytes at the start that are checked.
const START_BYTES: u64 = 512;

/// Whether this software wrote the file; an empty one counts, because it holds nothing.
pub fn is_own_file(path: &Path) -> io::Result<bool> {
    let mut start = Vec::new();
    File::open(path)?.take(START_BYTES).read_to_end(&mut start)?;
    Ok(start.is_empty() || has_our_start(&start))
}

fn has_our_start(start: &[u8]) -> bool {
    let first_line = start.split(|byte| *byte == b'\n').next().unwrap_or_default();
    let holds = |text: &[u8]| start.windows(text.len()).any(|part| part == text);
    let is_report = start.starts_with(b"{\"format\":\"slipbound-report\"");
    let is_rest = start.starts_with(rest_file::START);
    let is_timings = first_line.starts_with(b"{\"seq\":") && first_line.windows(5).any(|part| part == b"_us\":");
    let tells_carried = || first_line.windows(14).any(|part| part == b",\"is_carried\":");
    let is_block_log = first_line.starts_with(b"{\"unix_ns\":") && first_line.ends_with(b"}") && tells_carried();
    let is_picture = start.starts_with(b"\x89PNG") && holds(b"tEXtSoftware\0slipbound");
    let is_table = start.starts_with(b"finger,frame,seq,time_ns,state,reason,contact_area_px2");
    let is_slips = start.starts_with(b"{\"slip\":");
    let is_page = start.starts_with(b"<!DOCTYPE html>") && holds(b"<meta name=\"generator\" content=\"slipbound\"/>");
    let is_lines = is_report || is_rest || is_table || is_slips || is_timings || is_block_log;
    is_lines || is_page || is_picture || avi_writer::is_ours(start)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ours_are_known_and_nothing_else_is() {
        for (start, expected) in [
            (&b"{\"format\":\"slipbound-report\",\"format_version\":1"[..], true),
            (b"{\"format\":\"slipbound-rest\",\"format_version\":1", true),
            (b"{\"seq\":0,\"imprint_us\":12.0,\"all_us\":13.0}\n", true),
            (b"{\"unix_ns\":1,\"force_n\":0.000,\"is_carried\":false}\n{", true),
            (b"{\"unix_ns\":1}\n{\"unix_ns\":2,\"is_carried\":false}\n", false),
            (b"finger,frame,seq,time_ns,state,reason,contact_area_px2,contact_area_mm2\n", true),
            (b"{\"slip\":1,\"finger\":\"left\"}\n", true),
            (b"<!DOCTYPE html>\n<html><meta name=\"generator\" content=\"slipbound\"/>", true),
            (b"<!DOCTYPE html>\n<html>", false),
            (b"finger,frame,note\n", false),
            (b"{\"seq\":0}\n{\"x_us\":1}", false),
            (b"{\"format\":\"other\"}", false),
            (b"RIFF....AVI LIST", false),
            (b"\x89PNG\r\n\x1a\n", false),
            (b"notes", false),
        ] {
            assert_eq!(has_our_start(start), expected, "{}", start.escape_ascii());
        }
    }
}
