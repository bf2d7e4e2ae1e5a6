//! Lines, a progress bar and error messages on the terminal.

use crate::outcome::Failure;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use slipbound_rig::printable::printable;
use std::borrow::Cow;
use std::io::{self, ErrorKind, IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::sync_channel;
use std::thread;
use std::time::Duration;

/// Writes the error and its causes to standard error, each once; returns the exit code.
pub fn complain(e: &anyhow::Error, code: u8) -> u8 {
    let line = format!("slipbound: {}", printable(&in_words(e)));
    // A closed standard error is not a failure, and a blocked one does not prevent the end.
    let _ = within(LONGEST, move || writeln!(io::stderr(), "{line}"));
    code
}

/// The error and its causes, each once: most of our errors contain their cause.
pub fn in_words(e: &anyhow::Error) -> String {
    let mut text = String::new();
    for cause in e.chain().map(ToString::to_string) {
        if text.is_empty() {
            text = cause;
        } else if !text.contains(&cause) {
            text = format!("{text}: {cause}");
        }
    }
    text
}

/// A word of a command that is shown, quoted where the shell would take it for something else.
pub fn quoted(word: &str) -> Cow<'_, str> {
    let is_plain = |c: char| c.is_alphanumeric() || "-_./:=,+@%".contains(c);
    match !word.is_empty() && word.chars().all(is_plain) {
        true => Cow::Borrowed(word),
        false => Cow::Owned(format!("'{}'", word.replace('\'', r"'\''"))),
    }
}

/// Longest wait for standard error to take the last message.
const LONGEST: Duration = Duration::from_secs(1);

/// Writes on a thread of its own and waits this long for it. None where nothing is taken: the thread is left running.
fn within<T: Send + 'static>(longest: Duration, write: impl FnOnce() -> T + Send + 'static) -> Option<T> {
    let (give_back, written) = sync_channel(1);
    thread::spawn(move || drop(give_back.send(write()))); // nobody waited so long
    written.recv_timeout(longest).ok()
}

/// Lines for a person, above a progress bar if standard error is a terminal.
#[derive(Debug)]
pub struct Terminal {
    bar: ProgressBar,
    to_stderr: bool,
    /// Longest wait for a line to be taken; None: no limit.
    longest: Option<Duration>,
    /// Whether standard output and standard error take nothing any more.
    is_stuck: [AtomicBool; 2],
}

impl Terminal {
    /// Lines on standard output, no bar.
    pub fn plain() -> Self {
        Terminal::new(ProgressBar::hidden(), false)
    }

    fn new(bar: ProgressBar, to_stderr: bool) -> Self {
        Terminal { bar, to_stderr, longest: None, is_stuck: Default::default() }
    }

    /// The same, with this longest wait for a line to be taken: after that, later lines are not written either.
    #[must_use]
    pub fn with_timeout(self, longest: Duration) -> Self {
        Terminal { longest: Some(longest), ..self }
    }

    /// Lines, and a bar for this many frames. `to_stderr`: standard output is used for something else.
    pub fn with_bar(frames_count: Option<u64>, to_stderr: bool) -> Self {
        if !io::stderr().is_terminal() {
            return Terminal::new(ProgressBar::hidden(), to_stderr);
        }
        let bar = ProgressBar::with_draw_target(frames_count, ProgressDrawTarget::stderr_with_hz(10));
        let looks = match frames_count {
            Some(_) => "{bar:40} {pos}/{len} frames, {eta} left",
            None => "{spinner} {pos} frames",
        };
        bar.set_style(ProgressStyle::with_template(looks).unwrap_or_else(|_| ProgressStyle::default_bar()));
        Terminal::new(bar, to_stderr)
    }

    /// Lines, and a bar for this many of something.
    pub fn with_bar_of(count: u64, what: &str) -> Self {
        if !io::stderr().is_terminal() {
            return Terminal::plain();
        }
        let bar = ProgressBar::with_draw_target(Some(count), ProgressDrawTarget::stderr_with_hz(10));
        let looks = format!("{{bar:40}} {{pos}}/{{len}} {what}, {{eta}} left");
        bar.set_style(ProgressStyle::with_template(&looks).unwrap_or_else(|_| ProgressStyle::default_bar()));
        Terminal::new(bar, false)
    }

    /// Lines, and below them a status if standard error is a terminal.
    pub fn with_status() -> Self {
        if !io::stderr().is_terminal() {
            return Terminal::plain();
        }
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr_with_hz(15));
        bar.set_style(ProgressStyle::with_template("{msg}").unwrap_or_else(|_| ProgressStyle::default_bar()));
        Terminal::new(bar, false)
    }

    /// The text of the status line.
    pub fn status(&self, text: &str) {
        self.bar.set_message(text.to_owned());
    }

    /// One frame further.
    pub fn advance(&self) {
        self.bar.inc(1);
    }

    /// Removes the bar.
    pub fn clear_bar(&self) {
        let bar = self.bar.clone();
        let clear = move || bar.finish_and_clear();
        match self.longest {
            None => clear(),
            Some(longest) => drop(within(longest, clear)), // a blocked terminal keeps its bar
        }
    }

    /// A line.
    pub fn say(&mut self, line: &str) -> Result<(), Failure> {
        match self.write(self.to_stderr, printable(line).into_owned()) {
            Err(e) if e.kind() == ErrorKind::BrokenPipe => Err(Failure::ReaderLeft),
            other => other.map_err(|e| Failure::work("cannot write", e)),
        }
    }

    /// A line that is not part of the result, on standard error.
    pub fn note(&self, line: &str) {
        let _ = self.write(true, format!("slipbound: {}", printable(line))); // a closed standard error is not a failure
    }

    fn write(&self, to_stderr: bool, line: String) -> io::Result<()> {
        let (bar, is_stuck) = (self.bar.clone(), &self.is_stuck[usize::from(to_stderr)]);
        let write = move || {
            bar.suspend(|| match to_stderr {
                true => writeln!(io::stderr(), "{line}"),
                false => writeln!(io::stdout(), "{line}"),
            })
        };
        match self.longest {
            None => write(),
            Some(_) if is_stuck.load(Ordering::Relaxed) => Ok(()),
            Some(longest) => within(longest, write).unwrap_or_else(|| {
                is_stuck.store(true, Ordering::Relaxed);
                Ok(())
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use slipbound_rig::avi_writer;

    #[test]
    fn a_word_that_the_shell_would_take_apart_is_quoted() {
        for (word, shown) in [
            ("out/rest.json", "out/rest.json"),
            ("my run/0.jpg", "'my run/0.jpg'"),
            ("sim:press?seed=1", "'sim:press?seed=1'"),
            ("it's.toml", r"'it'\''s.toml'"),
            ("", "''"),
        ] {
            assert_eq!(quoted(word), shown);
        }
    }

    #[test]
    fn a_cause_that_the_error_contains_is_not_told_again() {
        let source = io::Error::from(ErrorKind::StorageFull);
        let cause = source.to_string();
        let full = anyhow::Error::new(avi_writer::Error::Write { path: "drawn.avi".into(), source });
        assert_eq!(in_words(&full), format!("drawn.avi: cannot write: {cause}"));
        assert_eq!(in_words(&full.context("clip")), format!("clip: drawn.avi: cannot write: {cause}"));
    }
}
