//! Frames out of a ROS 2 bag in SQLite (`.db3`).

use super::cdr;
use super::pictures;
use super::sqlite::{Cursor, Sqlite};
use crate::source::Error;
use slipbound::port::{Clock, FrameBuffer, FrameSource, Next, SourceError};
use std::path::{Path, PathBuf};

/// The images of one topic, in the order in which they were recorded; times are those of the messages.
pub struct Db3Source {
    path: PathBuf,
    file: Sqlite,
    messages: Cursor,
    topic: i64,
    schema: String,
    seq: u64,
    is_over: bool,
}

impl Db3Source {
    /// Opens `FILE.db3` or `FILE.db3#TOPIC`. Fails when it holds no images, or those of several topics if none is
    /// named.
    pub fn open(path: &Path, wanted: Option<&str>) -> Result<Self, Error> {
        let wrong = |why: String| Error::Mcap { path: path.to_owned(), why };
        let mut file = Sqlite::open(path).map_err(wrong)?;
        let mut rows = file.table("topics").map_err(wrong)?;
        let mut topics = Vec::new();
        while let Some((id, row)) = file.next(&mut rows).map_err(wrong)? {
            // id, name, type, serialization format, ...
            let [_, name, schema, format, ..] = row.as_slice() else { continue };
            let (Some(name), Some(schema)) = (name.text(), schema.text()) else { continue };
            if [cdr::COMPRESSED, cdr::RAW].contains(&schema) && format.text() == Some("cdr") {
                topics.push((id, name.to_owned(), schema.to_owned()));
            }
        }
        if let Some(wanted) = wanted {
            topics.retain(|(_, name, _)| name == wanted);
        }
        let [(topic, _, schema)] = topics.as_slice() else {
            let names: Vec<&str> = topics.iter().map(|(_, name, _)| name.as_str()).collect();
            return Err(wrong(match names.is_empty() {
                false => format!("expected FILE.db3#TOPIC with one of {}", names.join(", ")),
                true => {
                    let named = wanted.map_or(String::new(), |wanted| format!(" {wanted}"));
                    format!("expected a topic{named} with {} or {} in CDR, got none", cdr::COMPRESSED, cdr::RAW)
                }
            }));
        };
        let messages = file.table("messages").map_err(wrong)?;
        let (path, topic, schema) = (path.to_owned(), *topic, schema.clone());
        Ok(Db3Source { path, file, messages, topic, schema, seq: 0, is_over: false })
    }
}

impl FrameSource for Db3Source {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        into.label.clear();
        while !self.is_over {
            let row = match self.file.next(&mut self.messages) {
                Ok(Some((_, row))) => row,
                Ok(None) => break,
                Err(why) => {
                    self.is_over = true;
                    into.encoded.clear();
                    (into.seq, into.time_ns, into.clock) = (self.seq, None, Clock::Container);
                    let path = self.path.display();
                    return Ok(Next::Torn { reason: format!("{path}: {why}; what came before was read") });
                }
            };
            // id, topic_id, timestamp, data
            let [_, topic, logged_ns, super::sqlite::Value::Bytes(data), ..] = row.as_slice() else { continue };
            if topic.whole() != Some(self.topic) {
                continue;
            }
            let read = pictures::read(&self.schema, "cdr", data, into);
            let logged_ns = logged_ns.whole().and_then(|ns| u64::try_from(ns).ok());
            let stamp_ns = read.as_ref().ok().copied().flatten().or(logged_ns);
            (into.seq, into.time_ns, into.clock) = (self.seq, stamp_ns, Clock::Container);
            self.seq += 1;
            return Ok(match read {
                Ok(_) => Next::Frame,
                Err(reason) => Next::Torn { reason },
            });
        }
        self.is_over = true;
        Ok(Next::End)
    }
}
