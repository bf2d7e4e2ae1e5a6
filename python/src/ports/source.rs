//! A camera written in Python: an array or the lack of one in -> a frame.

use super::{FirstException, SharedObject, pair};
use crate::picture::{Picture, buffer};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use slipbound::image::{ByteOrder, Frame};
use slipbound::port::{Clock, FrameBuffer, FrameSource, Next, SourceError, SourceErrorKind};

/// What a source returns instead of a frame when the camera is there but gave none. The end of the recording is None.
#[pyclass(eq, frozen, hash, module = "slipbound.control")]
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub enum NoFrame {
    /// No frame within the duration of a frame; more may come.
    #[pyo3(name = "SILENT")]
    Silent,
    /// A frame came but cannot be decoded completely.
    #[pyo3(name = "TORN")]
    Torn,
}

const EXPECTED: &str = "FrameSource.next: expected a frame, (frame, time_ns), SILENT, TORN or None";

/// A source whose `next` is a method of a Python object.
pub struct PythonSource {
    pub object: SharedObject,
    pub order: ByteOrder,
    pub raised: FirstException,
    pub frames_count: u64,
}

impl PythonSource {
    fn read(&self, py: Python<'_>, into: &mut FrameBuffer) -> PyResult<Next> {
        let got = self.object.bind(py)?.call_method0("next")?;
        if got.is_none() {
            return Ok(Next::End);
        }
        if let Ok(kind) = got.cast::<NoFrame>() {
            return Ok(match kind.get() {
                NoFrame::Silent => Next::Silent,
                NoFrame::Torn => {
                    (into.seq, into.time_ns) = (self.frames_count, None);
                    Next::Torn { reason: "the source said so".into() }
                }
            });
        }
        let (array, time_ns) = match got.cast::<PyTuple>() {
            Ok(tuple) => {
                let (array, time_ns) = pair(tuple, EXPECTED)?;
                (array, crate::monitor::time(time_ns.extract()?)?)
            }
            Err(_) => (got, None),
        };
        let picture = Picture::new(&array, self.order)?;
        let mut scratch = Vec::new();
        let pixels = picture.pixels(&mut scratch)?;
        *into = buffer(&Frame { pixels, seq: self.frames_count, time_ns });
        into.clock = if time_ns.is_some() { Clock::Device } else { Clock::Unknown };
        Ok(Next::Frame)
    }
}

impl FrameSource for PythonSource {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        let next = Python::attach(|py| self.read(py, into));
        // A frame that never came has no number.
        self.frames_count += u64::from(!matches!(next, Ok(Next::Silent)));
        next.map_err(|e| SourceError::new(SourceErrorKind::Other, self.raised.keep(e)))
    }
}
