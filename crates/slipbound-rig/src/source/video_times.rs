//! Frame times of a video from its container, read by the program `ffprobe`.
//!
//! ```text
//!   0.000 0.050 0.100 0.600 0.650   uneven: somebody measured them    -> each frame its own stamp, clock `container`
//!   0.000 0.033 0.067 0.100 0.133   even: a rate written in advance   -> number times rate, clock `assumed`
//! ```

use super::Rate;
use super::avi::stamp;
use slipbound::port::{Clock, FrameBuffer};
use std::ffi::OsStr;
use std::process::{Command, Stdio};

/// Stamps this close to those of an even rate count as even: Matroska rounds them to milliseconds.
const EVEN_NS: u64 = 1_500_000;

/// The times of a video's frames.
#[derive(Debug, Default)]
pub(super) struct VideoTimes {
    rate: Option<Rate>,
    /// Since the first frame, ns; empty where they are even or unknown.
    stamps_ns: Vec<u64>,
}

impl VideoTimes {
    /// Frames at a constant rate.
    pub fn at(rate: Rate) -> Self {
        VideoTimes { rate: Some(rate), stamps_ns: Vec::new() }
    }

    /// Gives a frame its number, time and clock.
    pub fn stamp(&self, into: &mut FrameBuffer, seq: u64) {
        stamp(into, self.rate, seq);
        if !self.stamps_ns.is_empty() {
            into.time_ns = usize::try_from(seq).ok().and_then(|i| self.stamps_ns.get(i).copied());
            into.clock = if into.time_ns.is_some() { Clock::Container } else { Clock::Unknown };
        }
    }
}

/// Frame times and number of frames of `input`, as `ffprobe` reports them; nothing if it is not installed or does not
/// know. `ffmpeg` reports what is wrong with the file.
pub(super) fn probe(input: &OsStr) -> (VideoTimes, Option<u64>) {
    let ask = |entries: &str| {
        let asked = Command::new("ffprobe")
            .args(["-v", "quiet", "-select_streams", "v:0", "-show_entries", entries, "-of", "compact=p=0"])
            .arg(input)
            .stdin(Stdio::null())
            .output();
        asked.map(|o| String::from_utf8_lossy(&o.stdout).into_owned()).unwrap_or_default()
    };
    let packets = ask("packet=pts_time,flags:stream=avg_frame_rate,nb_frames");
    // Packets before the first key frame may give no frame, which only decoding shows.
    let first = packets.lines().find_map(|line| value(line, "flags"));
    match first.is_none_or(|flags| flags.contains('K')) {
        true => read(&packets),
        false => read(&format!("{}{packets}", ask("frame=best_effort_timestamp_time"))),
    }
}

/// The value of a key in a line of `key=value|key=value`.
fn value(line: &str, key: &str) -> Option<String> {
    line.split('|').find_map(|field| field.trim().strip_prefix(key)?.strip_prefix('=').map(str::to_owned))
}

/// Reads such lines: one per frame, where those were asked for, one per packet, and one for the stream.
fn read(text: &str) -> (VideoTimes, Option<u64>) {
    let of_stream = |key: &str| text.lines().find_map(|line| value(line, key));
    let rate = of_stream("avg_frame_rate").and_then(|rate| {
        let (frames, seconds) = rate.split_once('/')?;
        Some(Rate { frames: frames.parse().ok()?, seconds: seconds.parse().ok()? })
    });
    let times_of = |key: &str| -> Vec<(&str, String)> {
        text.lines().filter_map(|line| Some((line, value(line, key)?))).collect()
    };
    let frames = times_of("best_effort_timestamp_time");
    let timed = if frames.is_empty() { times_of("pts_time") } else { frames };
    // Frames that a player must not show are not decoded either.
    let shown = timed.iter().filter(|(line, _)| !value(line, "flags").is_some_and(|flags| flags.contains('D')));
    let stamps_s: Option<Vec<f64>> = shown.map(|(_, s)| s.parse().ok().filter(|s: &f64| s.is_finite())).collect();
    let mut stamps_s = stamps_s.unwrap_or_default();
    // Packets come in the order of decoding.
    stamps_s.sort_by(f64::total_cmp);
    let first_s = stamps_s.first().copied().unwrap_or(0.0);
    let stamps_ns: Vec<u64> = stamps_s.iter().map(|s| ((s - first_s) * 1e9).round() as u64).collect();
    let is_even = stamps_ns.last().is_none_or(|last_ns| {
        let steps = (stamps_ns.len() - 1).max(1) as f64;
        stamps_ns.iter().enumerate().all(|(i, ns)| ns.abs_diff((*last_ns as f64 / steps * i as f64) as u64) <= EVEN_NS)
    });
    let times = VideoTimes { rate, stamps_ns: if is_even { Vec::new() } else { stamps_ns } };
    (times, of_stream("nb_frames").and_then(|count| count.parse().ok()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(stamps_s: &[f64]) -> String {
        let packets: String = stamps_s.iter().map(|s| format!("pts_time={s:.6}|flags=__\n")).collect();
        packets + "avg_frame_rate=30/1|nb_frames=5\n"
    }

    fn seen(times: &VideoTimes, seq: u64) -> (Option<u64>, Clock) {
        let mut frame = FrameBuffer::default();
        times.stamp(&mut frame, seq);
        (frame.time_ns, frame.clock)
    }

    #[test]
    fn uneven_stamps_are_taken_and_even_ones_are_a_rate() {
        // Two packets out of order, as with frames that refer to later ones; the clock does not begin at 0.
        let (uneven, count) = read(&lines(&[1.0, 1.1, 1.05, 1.6, 1.65]));
        assert_eq!(count, Some(5));
        let stamps: Vec<_> = (0..5).map(|seq| seen(&uneven, seq)).collect();
        let expected = [0, 50, 100, 600, 650].map(|ms| (Some(ms * 1_000_000), Clock::Container));
        assert_eq!(stamps, expected);
        assert_eq!(seen(&uneven, 5), (None, Clock::Unknown), "more frames than packets");

        let (rounded, _) = read(&lines(&[0.0, 0.033, 0.067, 0.1, 0.133]));
        assert_eq!(seen(&rounded, 3), (Some(100_000_000), Clock::Assumed));
        let (hidden, _) =
            read("pts_time=0.0|flags=KD\npts_time=0.5|flags=_\npts_time=0.6|flags=_\npts_time=0.9|flags=_\n");
        assert_eq!(seen(&hidden, 1), (Some(100_000_000), Clock::Container), "the first is not shown");
        for nothing in ["", "pts_time=N/A|flags=K_\n", "garbage"] {
            assert_eq!(seen(&read(nothing).0, 0), (None, Clock::Unknown), "{nothing}");
        }
    }
}
