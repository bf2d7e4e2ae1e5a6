//! Images in files: a folder, a pattern or a single one, in the natural order of their names.

use super::file_ending::has_ending;
use super::{Error, jpeg, natural_sort, picture};
use slipbound::port::{Clock, FrameBuffer, FrameSource, Next, SourceError};
use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Images in files as frames. They carry no time: the clock is [`Clock::Unknown`].
#[derive(Debug)]
pub struct Folder {
    files: Vec<PathBuf>,
    next: usize,
    /// Images of kinds that are not read, beside these: the ending of the first, and how many.
    others: Option<(&'static str, usize)>,
}

impl Folder {
    /// The images of a folder; other files are ignored.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let read = |source| Error::Read { path: path.to_owned(), source };
        let mut all = Vec::new();
        for entry in fs::read_dir(path).map_err(read)? {
            all.push(entry.map_err(read)?.path());
        }
        Self::of_images(path, all)
    }

    /// The images that a pattern (`*`, `?`, `[...]`, `**`; numbers also as `%d` or `%06d`) matches.
    pub fn matching(pattern: &str) -> Result<Self, Error> {
        let paths = glob::glob(&without_numbers(pattern)).map_err(|e| Error::Pattern {
            pattern: pattern.into(),
            at: e.pos,
            why: e.msg.into(),
        })?;
        let mut all = Vec::new();
        for path in paths {
            all.push(path.map_err(|e| Error::Read { path: e.path().to_owned(), source: e.into() })?);
        }
        let numbered = numbered_components(pattern);
        all.retain(|path| numbered.iter().all(|(from_end, name)| name.fits_component(path, *from_end)));
        Self::of_images(Path::new(pattern), all)
    }

    /// One image.
    pub fn single(path: &Path) -> Self {
        Folder { files: vec![path.to_owned()], next: 0, others: None }
    }

    fn of_images(path: &Path, all: Vec<PathBuf>) -> Result<Self, Error> {
        let (mut files, named): (Vec<PathBuf>, Vec<PathBuf>) =
            all.into_iter().partition(|p| has_image_name(p) && is_frame(p));
        let others: Vec<&str> = named.iter().filter_map(|path| other_image(path)).collect();
        let others = others.first().map(|kind| (*kind, others.len()));
        if files.is_empty() {
            let path = path.to_owned();
            if let Some((kind, count)) = others {
                return Err(Error::OtherImages { path, kind, count });
            }
            let folders_count = named.iter().filter(|path| path.is_dir()).count();
            return Err(Error::NoImages { path, others_count: named.len() - folders_count, folders_count });
        }
        natural_sort::sort(&mut files);
        Ok(Folder { files, next: 0, others })
    }
}

/// The ending of an unsupported image; None for any other file.
pub(super) fn other_image(path: &Path) -> Option<&'static str> {
    const ENDINGS: [&str; 6] = ["bmp", "tif", "tiff", "webp", "pgm", "ppm"];
    ENDINGS.into_iter().find(|ending| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending)))
}

/// Most digits of a number in a name.
const MOST_DIGITS: usize = 20;

/// A pattern with `%d` and `%06d`, as C and ffmpeg number files, as its parts: text, and the least width of each number
/// between them.
fn numbers_of(pattern: &str) -> (Vec<String>, Vec<usize>) {
    let (mut texts, mut widths) = (vec![String::new()], Vec::new());
    let mut rest = pattern;
    while let Some((before, after)) = rest.split_once('%') {
        let digits = after.bytes().take_while(u8::is_ascii_digit).count();
        let width = after[..digits].strip_prefix('0').map(str::parse::<usize>);
        let text = texts.last_mut().expect("never empty");
        text.push_str(before);
        let least = match (width, digits) {
            (Some(Ok(width @ 1..=MOST_DIGITS)), _) => Some(width),
            (None, 0) => Some(1),
            _ => None,
        };
        match after[digits..].strip_prefix('d').zip(least) {
            Some((then, least)) => {
                widths.push(least);
                texts.push(String::new());
                rest = then;
            }
            None => {
                text.push('%');
                rest = after;
            }
        }
    }
    texts.last_mut().expect("never empty").push_str(rest);
    (texts, widths)
}

/// Endings of videos and recordings.
const VIDEO_ENDINGS: [&str; 8] = ["avi", "mp4", "mkv", "mov", "webm", "m4v", "mcap", "db3"];

/// Whether a name that nothing matches cannot be meant as a pattern of images: it ends as a video does, or its only
/// signs of one are `%` without a number.
pub(super) fn is_no_pattern(uri: &str) -> bool {
    let is_video = VIDEO_ENDINGS.iter().any(|ending| has_ending(Path::new(uri), ending));
    is_video || !uri.contains(['*', '?', '[']) && numbers_of(uri).1.is_empty()
}

/// The same with any text in place of numbers, in the form of this crate's patterns.
fn without_numbers(pattern: &str) -> String {
    numbers_of(pattern).0.join("*")
}

/// A name with numbers: the patterns between them, and the least width of each.
struct NumberedName {
    texts: Vec<glob::Pattern>,
    widths: Vec<usize>,
}

/// The components of a pattern that contain numbers, each with its place from the end, which `.`, `//` and the folders
/// before do not change. Before `**` there is no such place: numbers there are any text.
fn numbered_components(pattern: &str) -> Vec<(usize, NumberedName)> {
    let components = Path::new(pattern).components().rev().map(|component| component.as_os_str().to_string_lossy());
    let numbered =
        components.take_while(|component| component != "**").enumerate().filter_map(|(from_end, component)| {
            let (texts, widths) = numbers_of(&component);
            let texts = texts.iter().map(|text| glob::Pattern::new(text).ok()).collect::<Option<Vec<_>>>()?;
            (!widths.is_empty()).then_some((from_end, NumberedName { texts, widths }))
        });
    numbered.collect()
}

impl NumberedName {
    fn fits_component(&self, path: &Path, from_end: usize) -> bool {
        let component = path.components().rev().nth(from_end);
        component.is_some_and(|name| fits(&self.texts, &self.widths, &name.as_os_str().to_string_lossy()))
    }
}

/// Whether a name consists of the texts and numbers between them: the width in `%06d` is the least, and only a number as
/// wide as that begins with zeros.
fn fits(texts: &[glob::Pattern], widths: &[usize], name: &str) -> bool {
    let Some((&least, widths)) = widths.split_first() else { return texts[0].matches(name) };
    let places = name.char_indices().filter(|(_, c)| c.is_ascii_digit());
    places.filter(|(at, _)| texts[0].matches(&name[..*at])).any(|(at, first)| {
        let rest = &name[at..];
        let most = rest.bytes().take_while(u8::is_ascii_digit).count();
        let is_number = |width: usize| width == least || least == 1 || first != '0';
        (least..=most).any(|width| is_number(width) && fits(&texts[1..], widths, &rest[width..]))
    })
}

/// The image files that a folder, a pattern or the name of an image stands for; none where it is something else.
pub(super) fn image_files(uri: &str) -> Vec<PathBuf> {
    images(uri).map_or_else(Vec::new, |folder| folder.files)
}

/// The ending of the first image of a kind that is not read, and how many there are, in a folder or pattern with others
/// that are.
pub(super) fn images_left_out(uri: &str) -> Option<(&'static str, usize)> {
    images(uri).and_then(|folder| folder.others)
}

/// The EXIF orientation of the first image where that asks for it to be mirrored or turned.
pub(super) fn orientation(uri: &str) -> Option<u16> {
    let bytes = images(uri).and_then(|folder| fs::read(folder.files.first()?).ok())?;
    jpeg::orientation(&bytes).filter(|orientation| (2..=8).contains(orientation))
}

fn images(uri: &str) -> Option<Folder> {
    let path = Path::new(uri);
    let folder = match fs::metadata(path) {
        Ok(there) if there.is_dir() => Folder::open(path),
        Ok(_) if has_image_name(path) => Ok(Folder::single(path)),
        Ok(_) => return None,
        Err(_) => Folder::matching(uri),
    };
    folder.ok()
}

/// Whether a file of a folder or pattern can be a frame: not `._1.jpg`, which macOS puts beside `1.jpg`, and no pipe or
/// device, which would block. A file that cannot be inspected is a frame, and torn.
fn is_frame(path: &Path) -> bool {
    let is_hidden = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
    !is_hidden && fs::metadata(path).map_or(true, |there| there.is_file())
}

/// Whether a file has the name of a supported image.
pub fn has_image_name(path: &Path) -> bool {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    matches!(extension.as_str(), "jpg" | "jpeg" | "png")
}

impl FrameSource for Folder {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        let Some(path) = self.files.get(self.next) else {
            return Ok(Next::End);
        };
        into.seq = self.next as u64;
        into.time_ns = None;
        into.clock = Clock::Unknown;
        into.label.clear();
        into.label.push_str(&path.file_name().unwrap_or_default().to_string_lossy());
        into.encoded.clear();
        self.next += 1;
        let read = File::open(path).and_then(|mut file| file.read_to_end(&mut into.encoded));
        let decoded = match read {
            Ok(_) => picture::decode(into),
            Err(e) => {
                into.encoded.clear();
                Err(format!("cannot read: {e}"))
            }
        };
        Ok(match decoded {
            Ok(()) => Next::Frame,
            Err(reason) => Next::Torn { reason },
        })
    }

    fn frames_count(&self) -> Option<u64> {
        Some(self.files.len() as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_as_c_writes_them_are_a_pattern() {
        let folder = tempfile::tempdir().expect("a folder");
        for name in ["f8", "f08", "f09", "f10", "f99", "f100", "f0101", "f9_mask", "f10_cam2", "fx"] {
            std::fs::write(folder.path().join(format!("{name}.png")), "").expect("written");
        }
        let names = |pattern: &str| -> Vec<String> {
            let found = Folder::matching(&folder.path().join(pattern).to_string_lossy());
            let files = found.map_or_else(|_| Vec::new(), |found| found.files);
            let stem = |path: &PathBuf| path.file_stem().expect("named").to_string_lossy().into_owned();
            files.iter().map(stem).collect()
        };
        assert_eq!(names("f%02d.png"), ["f08", "f09", "f10", "f99", "f100"], "the width is the least");
        assert_eq!(names("f%d.png"), ["f8", "f08", "f09", "f10", "f99", "f100", "f0101"]);
        assert_eq!(names("f%d_cam%d.p?g"), ["f10_cam2"]);
        assert_eq!(
            (names(".//./f%02d.png").len(), names("f?.png"), names("f[x]*.png").len()),
            (5, vec!["f8".into(), "fx".into()], 1)
        );
        for plain in ["100%", "50%.png", "%s.png", "%6d.png", "%00d", "a%999999d.png"] {
            assert_eq!(without_numbers(plain), plain);
        }
    }

    #[test]
    fn pictures_of_other_kinds_are_named_with_what_to_do() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("notes.txt"), "").expect("written");
        let open = || Folder::open(folder.path()).expect_err("no images").to_string();
        assert!(open().contains("got none among 1 other files"), "{}", open());
        std::fs::write(folder.path().join("a.BMP"), "").expect("written");
        assert!(open().contains("got 1 .bmp file") && open().contains("ffmpeg"), "{}", open());
        std::fs::write(folder.path().join("b.jpg"), "").expect("written");
        assert_eq!(Folder::open(folder.path()).expect("an image").files.len(), 1);
        let said = super::super::doubt(&folder.path().to_string_lossy());
        assert!(said.is_some_and(|said| said.contains(": 1 image of other kinds (.bmp) left out")));
    }

    #[test]
    fn folders_in_place_of_images_are_named_with_what_to_do() {
        let clips = tempfile::tempdir().expect("a folder");
        ["a", "b"].iter().for_each(|name| fs::create_dir(clips.path().join(name)).expect("made"));
        let pattern = clips.path().join("*").display().to_string();
        let expected =
            format!("among 0 other files and 2 folders: name each one, as the shell does for {pattern} without quotes");
        for got in [Folder::open(clips.path()), Folder::matching(&pattern)] {
            let error = got.expect_err("no images").to_string();
            assert!(error.ends_with(&expected), "{error}");
        }
    }
}
