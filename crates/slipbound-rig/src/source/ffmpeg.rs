//! Every other codec, through the installed program `ffmpeg`: `ffmpeg -i FILE ... -c:v ppm -f image2pipe -`.
//!
//! Each frame comes as a PPM image, so its size is what the program decoded, whatever the container states. One thread
//! and the bit-exact flags give the same pixels on every run of one version of the program.

use super::Error;
use super::picture_size::checked_size;
use super::riff::{Survey, Video};
use super::video_times::{self, VideoTimes};
use slipbound::port::{FrameBuffer, FrameSource, Next, PixelFormat, SourceError};
use std::collections::VecDeque;
use std::ffi::{OsStr, OsString};
use std::io::{self, BufRead, BufReader, ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, ChildStdout, Command, ExitStatus, Stdio};
use std::thread::JoinHandle;

/// The name of standard input.
pub(super) const STDIN: &str = "-";

/// How much of the end of the program's messages is kept.
const STDERR_BYTES: usize = 2000;
/// The frames of a video as `ffmpeg` decodes them. The program is ended and reaped when this is dropped.
#[derive(Debug)]
pub struct Ffmpeg {
    path: PathBuf,
    times: VideoTimes,
    frames_count: Option<u64>,
    /// What the file lacks at its end, to be reported there.
    lacks: Option<String>,
    running: Option<(Running, Pictures)>,
    /// Place of the next frame, dropped ones counted, and the numbers of the dropped ones from there on.
    seq: u64,
    dropped: VecDeque<u64>,
    /// Whether a frame came.
    has_given: bool,
}

/// The program while it runs.
#[derive(Debug)]
pub(super) struct Running {
    child: Child,
    stderr: Option<JoinHandle<String>>,
}

/// The images that the program writes, for [`read_ppm`].
pub(super) type Pictures = BufReader<ChildStdout>;

/// Options that pass every frame once. The first is for ffmpeg 5.1 and later, the second for older versions.
pub(super) const EVERY_FRAME_ONCE: [&str; 2] = ["-fps_mode", "-vsync"];

/// Whether the program reported the first of them as unknown.
pub(super) fn is_older(stderr: &str) -> bool {
    stderr.contains(&EVERY_FRAME_ONCE[0][1..])
}

impl Ffmpeg {
    /// Starts the program on a video. `avi`: the result of our own reading of an AVI file; for other containers
    /// `ffprobe` gives the times, and without it there are none.
    pub(super) fn open(path: &Path, avi: Option<(Video, Survey)>) -> Result<Self, Error> {
        let codec = avi.as_ref().map_or("this kind of video".into(), |(v, _)| format!("the codec {}", v.codec_name()));
        let running = start(path, EVERY_FRAME_ONCE[0]).map_err(|source| match source.kind() {
            ErrorKind::NotFound => Error::FfmpegMissing { path: path.to_owned(), codec },
            _ => Error::FfmpegStart { path: path.to_owned(), source },
        })?;
        Ok(match avi {
            Some((video, Survey { frames_count, dropped, cut })) => Ffmpeg {
                frames_count: Some(frames_count),
                dropped,
                lacks: cut,
                ..Ffmpeg::new(path, VideoTimes::at(video.rate), running)
            },
            None => {
                let (times, frames_count) = video_times::probe(&file_argument(path));
                Ffmpeg { frames_count, ..Ffmpeg::new(path, times, running) }
            }
        })
    }

    /// Starts the program on what cannot be read twice: standard input (`-`) or a named pipe. There is no time.
    pub(super) fn open_pipe(path: &Path) -> Result<Self, Error> {
        let running = start(path, EVERY_FRAME_ONCE[0]).map_err(|source| match source.kind() {
            ErrorKind::NotFound => Error::FfmpegMissing { path: path.to_owned(), codec: "a pipe".into() },
            _ => Error::FfmpegStart { path: path.to_owned(), source },
        })?;
        Ok(Ffmpeg::new(path, VideoTimes::default(), running))
    }

    fn new(path: &Path, times: VideoTimes, running: (Running, Pictures)) -> Self {
        Ffmpeg {
            path: path.to_owned(),
            times,
            frames_count: None,
            lacks: None,
            running: Some(running),
            seq: 0,
            dropped: VecDeque::new(),
            has_given: false,
        }
    }

    /// The program has ended: normally, or with a reason.
    fn finish(&mut self, got: Option<String>) -> Result<Next, SourceError> {
        let Some((mut running, _pictures)) = self.running.take() else {
            return Ok(Next::End);
        };
        if got.is_some() {
            running.stop();
        }
        let (status, stderr) = running.reap().map_err(|source| Error::Read { path: self.path.clone(), source })?;
        if !self.has_given && is_older(&stderr) {
            let again = start(&self.path, EVERY_FRAME_ONCE[1]);
            self.running = Some(again.map_err(|source| Error::FfmpegStart { path: self.path.clone(), source })?);
            return Ok(Next::Silent);
        }
        let failed = match (status.success(), self.has_given) {
            (false, _) => Some(format!("{status}")),
            (true, false) => Some("none".into()),
            _ => None,
        };
        if let Some(got) = got.or(failed) {
            let stderr = if stderr.is_empty() { "nothing".into() } else { stderr };
            return Err(Error::Ffmpeg { path: self.path.clone(), got, stderr }.into());
        }
        match self.lacks.take().or_else(|| (!stderr.is_empty()).then(|| format!("ffmpeg says: {stderr}"))) {
            Some(reason) => Ok(Next::Torn { reason }),
            None => Ok(Next::End),
        }
    }
}

impl FrameSource for Ffmpeg {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        while self.dropped.front() == Some(&self.seq) {
            self.dropped.pop_front();
            self.seq += 1;
        }
        self.times.stamp(into, self.seq);
        into.encoded.clear();
        loop {
            let Some((_, pictures)) = &mut self.running else {
                return Ok(Next::End);
            };
            match read_ppm(pictures, into) {
                Ok(true) => {
                    self.seq += 1;
                    self.has_given = true;
                    return Ok(Next::Frame);
                }
                Ok(false) => match self.finish(None)? {
                    Next::Silent => {} // an older version, started again with its own option
                    over => return Ok(over),
                },
                Err(e) => return self.finish(Some(e.to_string())),
            }
        }
    }

    fn frames_count(&self) -> Option<u64> {
        self.frames_count
    }
}

impl Running {
    /// Waits for the program to end; its exit status and last messages on one line.
    fn reap(&mut self) -> io::Result<(ExitStatus, String)> {
        let status = self.child.wait()?;
        let stderr = self.stderr.take().and_then(|thread| thread.join().ok()).unwrap_or_default();
        Ok((status, stderr))
    }
}

impl Running {
    /// Ends the program; it may have ended by itself.
    fn stop(&mut self) {
        let _ = self.child.kill(); // fails only when it has ended already
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.stop();
        let _ = self.reap(); // nobody is left to report to
    }
}

/// `file:` keeps a name from being read as an option or a protocol.
fn file_argument(path: &Path) -> OsString {
    let mut argument = OsString::from("file:");
    argument.push(path);
    argument
}

fn start(path: &Path, every_frame_once: &str) -> io::Result<(Running, Pictures)> {
    let input = if path.as_os_str() == STDIN { "pipe:0".into() } else { file_argument(path) };
    Running::start(&["-flags", "+bitexact"], &input, every_frame_once)
}

impl Running {
    /// Starts the program on what `input` names, with these options of its own in front.
    pub(super) fn start(options: &[&str], input: &OsStr, every_frame_once: &str) -> io::Result<(Running, Pictures)> {
        let mut child = Command::new("ffmpeg")
            .args(["-nostdin", "-hide_banner", "-loglevel", "error", "-threads", "1"])
            .args(options)
            .arg("-i")
            .arg(input)
            .args(["-map", "0:v:0", every_frame_once, "passthrough", "-an", "-sn", "-dn"])
            .args(["-sws_flags", "bitexact+accurate_rnd+full_chroma_int", "-pix_fmt", "rgb24"])
            .args(["-threads", "1", "-flags", "+bitexact", "-c:v", "ppm", "-f", "image2pipe", "-"])
            .stdin(if input == "pipe:0" { Stdio::inherit() } else { Stdio::null() })
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()?;
        let missing = || io::Error::other("no pipe to the program");
        let stdout = BufReader::with_capacity(1 << 20, child.stdout.take().ok_or_else(missing)?);
        let stderr = child.stderr.take().ok_or_else(missing)?;
        Ok((Running { child, stderr: Some(std::thread::spawn(move || stderr_tail(stderr))) }, stdout))
    }

    /// Ends it; returns its last messages.
    pub(super) fn stderr_tail(mut self) -> String {
        self.stop();
        self.reap().map(|(_, said)| said).unwrap_or_default()
    }
}

/// Reads all messages of the program and keeps the end, on one line.
fn stderr_tail(stderr: ChildStderr) -> String {
    let mut kept: Vec<u8> = Vec::new();
    let mut reader = BufReader::new(stderr);
    while let Ok(bytes) = reader.fill_buf() {
        if bytes.is_empty() {
            break;
        }
        let count = bytes.len();
        kept.extend_from_slice(bytes);
        reader.consume(count);
        let excess = kept.len().saturating_sub(STDERR_BYTES);
        kept.drain(..excess);
    }
    String::from_utf8_lossy(&kept).lines().map(str::trim).filter(|l| !l.is_empty()).collect::<Vec<_>>().join("; ")
}

/// Reads one binary PPM image; false at the end of the stream.
pub(super) fn read_ppm(from: &mut impl BufRead, into: &mut FrameBuffer) -> io::Result<bool> {
    if from.fill_buf()?.is_empty() {
        return Ok(false);
    }
    let mut words = [0usize; 3];
    let wrong = |got: &[u8]| io::Error::other(format!("a PPM header `{}`", got.escape_ascii()));
    let magic = word(from)?;
    if magic != b"P6" {
        return Err(wrong(&magic));
    }
    for number in &mut words {
        let text = word(from)?;
        *number = std::str::from_utf8(&text).ok().and_then(|t| t.parse().ok()).ok_or_else(|| wrong(&text))?;
    }
    let [width, height, white] = words;
    if white != 255 {
        return Err(io::Error::other(format!("a picture of {width}x{height} with white at {white}")));
    }
    into.size = checked_size(width, height).map_err(io::Error::other)?;
    into.format = PixelFormat::Rgb;
    into.pixels.resize(3 * into.size.area(), 0);
    from.read_exact(&mut into.pixels)?;
    Ok(true)
}

/// The bytes up to the next blank or line end, which is taken too; at most 16.
fn word(from: &mut impl Read) -> io::Result<Vec<u8>> {
    let mut word = Vec::new();
    let mut byte = [0];
    while word.len() < 16 {
        from.read_exact(&mut byte)?;
        if byte[0].is_ascii_whitespace() {
            break;
        }
        word.push(byte[0]);
    }
    Ok(word)
}

#[cfg(test)]
mod tests {
    use super::*;
    use slipbound::image::SizePx;

    #[test]
    fn a_program_before_5_1_says_that_it_does_not_know_the_option() {
        assert!(is_older("Unrecognized option 'fps_mode'.; Error splitting the argument list: Option not found"));
        assert!(!is_older("rtsp://10.0.0.7/gel: Connection refused"));
    }

    #[test]
    fn ppm_pictures_follow_each_other() {
        let mut stream: &[u8] = b"P6\n2 1\n255\nabcdefP6\n1 1\n255\nxyzP6\n9 9\n255\n.";
        let mut frame = FrameBuffer::default();
        assert!(read_ppm(&mut stream, &mut frame).expect("first"));
        assert_eq!((frame.size, frame.pixels.as_slice()), (SizePx::new(2, 1), &b"abcdef"[..]));
        assert!(read_ppm(&mut stream, &mut frame).expect("second"));
        assert_eq!((frame.size, frame.pixels.as_slice()), (SizePx::new(1, 1), &b"xyz"[..]));
        assert!(read_ppm(&mut stream, &mut frame).is_err(), "a cut picture");
        assert!(!read_ppm(&mut &b""[..], &mut frame).expect("the end"));
        assert!(read_ppm(&mut &b"P6\n99999 1\n255\n"[..], &mut frame).is_err(), "a size beyond reason");
        assert!(read_ppm(&mut &b"GIF89a"[..], &mut frame).is_err());
    }
}
