//! The calls of the kernel's Video4Linux2 interface that a camera needs, as safe functions: the only `unsafe` of this crate.
//!
//! Layouts and numbers are those of `linux/videodev2.h` on 64-bit machines; every structure's size is checked when this is
//! compiled, and the size is part of the request's number, so the kernel refuses one that it does not know.

#![allow(unsafe_code)]

use std::fs::{File, OpenOptions};
use std::io;
use std::mem::size_of;
use std::os::fd::AsRawFd;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::ptr::NonNull;

/// A single image plane is captured (`V4L2_BUF_TYPE_VIDEO_CAPTURE`).
const CAPTURE: u32 = 1;
/// Buffers are memory of the kernel (`V4L2_MEMORY_MMAP`).
const MMAP: u32 = 1;

/// The device hands over images (`V4L2_CAP_VIDEO_CAPTURE`) by buffers (`V4L2_CAP_STREAMING`).
pub const STREAMS_PICTURES: u32 = 0x0000_0001 | 0x0400_0000;
/// `V4L2_CAP_DEVICE_CAPS`: `device_caps` describes this node, `capabilities` the whole device.
const HAS_DEVICE_CAPS: u32 = 0x8000_0000;

/// The driver marked the image as damaged (`V4L2_BUF_FLAG_ERROR`).
pub const DAMAGED: u32 = 0x40;
/// `V4L2_BUF_FLAG_TIMESTAMP_MASK`, and the value for the system's monotonic clock.
pub const STAMP_MASK: u32 = 0xe000;
/// See [`STAMP_MASK`].
pub const STAMP_MONOTONIC: u32 = 0x2000;
/// `V4L2_CTRL_FLAG_DISABLED`.
const CONTROL_DISABLED: u32 = 1;

const WRITE: u32 = 1;
const READ: u32 = 2;

/// The number of a request (`_IOC`), with the size of what it passes.
const fn request<T>(direction: u32, number: u32) -> libc::Ioctl {
    (direction << 30 | (size_of::<T>() as u32) << 16 | (b'V' as u32) << 8 | number) as libc::Ioctl
}

/// Structures of the kernel: `repr(C)`, integers only, so that any bytes are a value.
///
/// # Safety
/// The structure must be just that.
unsafe trait Plain: Sized {
    /// All zero.
    fn zero() -> Self {
        // SAFETY: by the trait's contract, zeros are a value.
        unsafe { std::mem::zeroed() }
    }
}

macro_rules! plain {
    ($($type:ty: $bytes:literal),* $(,)?) => {$(
        // SAFETY: `repr(C)` and made of whole numbers, without padding that is read.
        unsafe impl Plain for $type {}
        const _: () = assert!(size_of::<$type>() == $bytes);
    )*};
}

#[repr(C)]
struct Capability {
    driver: [u8; 16],
    card: [u8; 32],
    bus: [u8; 32],
    version: u32,
    capabilities: u32,
    device_caps: u32,
    reserved: [u32; 3],
}

#[repr(C)]
struct FormatDescription {
    index: u32,
    kind: u32,
    flags: u32,
    description: [u8; 32],
    four_cc: [u8; 4],
    bus_code: u32,
    reserved: [u32; 3],
}

/// The layout of an image.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PictureLayout {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Four letters for the pixel format.
    pub four_cc: [u8; 4],
    field: u32,
    /// Row stride, bytes; 0 where that has no meaning.
    pub row_bytes: u32,
    /// Most bytes of an image.
    pub picture_bytes: u32,
    more: [u32; 6],
}

#[repr(C)]
struct Format {
    kind: u32,
    aligned: u32,
    layout: PictureLayout,
    rest: [u8; 152],
}

#[repr(C)]
struct BuffersRequest {
    count: u32,
    kind: u32,
    memory: u32,
    capabilities: u32,
    flags: u32,
}

#[repr(C)]
struct Buffer {
    index: u32,
    kind: u32,
    bytes_used: u32,
    flags: u32,
    field: u32,
    aligned: u32,
    stamp_s: i64,
    stamp_us: i64,
    timecode: [u32; 4],
    sequence: u32,
    memory: u32,
    offset: u64,
    length: u32,
    reserved: u32,
    request_fd: i32,
    aligned_too: u32,
}

#[repr(C)]
struct StreamParameters {
    kind: u32,
    capability: u32,
    mode: u32,
    interval_numerator: u32,
    interval_denominator: u32,
    rest: [u32; 46],
}

#[repr(C)]
struct ControlValue {
    id: u32,
    value: i32,
}

#[repr(C)]
struct ControlQuery {
    id: u32,
    kind: u32,
    name: [u8; 32],
    least: i32,
    most: i32,
    step: i32,
    default: i32,
    flags: u32,
    reserved: [u32; 2],
}

#[repr(C)]
struct SizeQuery {
    index: u32,
    four_cc: [u8; 4],
    kind: u32,
    sizes: [u32; 6],
    reserved: [u32; 2],
}

plain! {
    Capability: 104, FormatDescription: 64, Format: 208, BuffersRequest: 20, Buffer: 88, StreamParameters: 204,
    ControlValue: 8, ControlQuery: 68, SizeQuery: 44, libc::c_int: 4,
}

/// The identity that a node reports.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Identity {
    /// The camera's name.
    pub card: String,
    /// The driver.
    pub driver: String,
    /// The capabilities of this node, see [`STREAMS_PICTURES`].
    pub can: u32,
}

/// The range of a control.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ControlRange {
    /// The least value.
    pub least: i32,
    /// The greatest value.
    pub most: i32,
}

/// An open device.
#[derive(Debug)]
pub struct Device(File);

impl Device {
    /// Opens a node; no call on it will wait.
    pub fn open(path: &Path) -> io::Result<Self> {
        OpenOptions::new().read(true).write(true).custom_flags(libc::O_NONBLOCK).open(path).map(Device)
    }

    /// Passes `value` to the kernel and back.
    fn call<T: Plain>(&self, direction: u32, number: u32, value: &mut T) -> io::Result<()> {
        loop {
            // SAFETY: the descriptor is open; the request's number says the size of `T`, which is what the kernel reads and
            // writes at `value`, a valid and exclusive reference to plain numbers. No request used here keeps the
            // pointer, and none holds one.
            let result = unsafe { libc::ioctl(self.0.as_raw_fd(), request::<T>(direction, number), value as *mut T) };
            if result != -1 {
                return Ok(());
            }
            let error = io::Error::last_os_error();
            if error.kind() != io::ErrorKind::Interrupted {
                return Err(error);
            }
        }
    }

    /// Its identity.
    pub fn identity(&self) -> io::Result<Identity> {
        let mut capability = Capability::zero();
        self.call(READ, 0, &mut capability)?;
        let of_node = capability.capabilities & HAS_DEVICE_CAPS != 0;
        let can = if of_node { capability.device_caps } else { capability.capabilities };
        Ok(Identity { card: text(&capability.card), driver: text(&capability.driver), can })
    }

    /// Four letters for every pixel format that it offers.
    pub fn formats(&self) -> Vec<[u8; 4]> {
        let format = |index| {
            let mut format = FormatDescription { index, kind: CAPTURE, ..FormatDescription::zero() };
            self.call(READ | WRITE, 2, &mut format).ok().map(|()| format.four_cc)
        };
        (0..64).map_while(format).collect()
    }

    /// The image sizes of this format, width and height; of a range the least and the greatest.
    pub fn sizes(&self, four_cc: [u8; 4]) -> Vec<(u32, u32)> {
        let mut sizes = Vec::new();
        for index in 0..64 {
            let mut query = SizeQuery { index, four_cc, ..SizeQuery::zero() };
            if self.call(READ | WRITE, 74, &mut query).is_err() {
                break;
            }
            match (query.kind, query.sizes) {
                (1, [width, height, ..]) => sizes.push((width, height)),
                (_, [least_width, most_width, _, least_height, most_height, _]) => {
                    return vec![(least_width, least_height), (most_width, most_height)];
                }
            }
        }
        sizes
    }

    /// The image layout that is set.
    pub fn layout(&self) -> io::Result<PictureLayout> {
        let mut format = Format { kind: CAPTURE, ..Format::zero() };
        self.call(READ | WRITE, 4, &mut format)?;
        Ok(format.layout)
    }

    /// Requests a layout; returns what the driver set.
    pub fn set_layout(&self, width: u32, height: u32, four_cc: [u8; 4]) -> io::Result<PictureLayout> {
        let mut format = Format { kind: CAPTURE, ..Format::zero() };
        self.call(READ | WRITE, 4, &mut format)?;
        let asked = PictureLayout { width, height, four_cc, row_bytes: 0, picture_bytes: 0, ..format.layout };
        format.layout = asked;
        self.call(READ | WRITE, 5, &mut format)?;
        Ok(format.layout)
    }

    /// Requests a rate if one is given; returns the rate that is set, Hz; None if the driver does not state it.
    pub fn set_rate(&self, rate_hz: Option<f64>) -> Option<f64> {
        let mut parameters = StreamParameters { kind: CAPTURE, ..StreamParameters::zero() };
        self.call(READ | WRITE, 21, &mut parameters).ok()?;
        if let Some(rate_hz) = rate_hz {
            (parameters.interval_numerator, parameters.interval_denominator) =
                (1000, (rate_hz * 1000.0).round() as u32);
            // A refusal shows in the rate that is set.
            let _ = self.call(READ | WRITE, 22, &mut parameters);
            self.call(READ | WRITE, 21, &mut parameters).ok()?;
        }
        let StreamParameters { interval_numerator, interval_denominator, .. } = parameters;
        (interval_numerator > 0).then(|| f64::from(interval_denominator) / f64::from(interval_numerator))
    }

    /// The range of a control; None if the camera has no control of that number.
    pub fn control_range(&self, id: u32) -> Option<ControlRange> {
        let mut query = ControlQuery { id, ..ControlQuery::zero() };
        self.call(READ | WRITE, 36, &mut query).ok()?;
        let range = ControlRange { least: query.least, most: query.most };
        (query.flags & CONTROL_DISABLED == 0).then_some(range)
    }

    /// The value of a control.
    pub fn control(&self, id: u32) -> io::Result<i32> {
        let mut control = ControlValue { id, value: 0 };
        self.call(READ | WRITE, 27, &mut control).map(|()| control.value)
    }

    /// Sets a control.
    pub fn set_control(&self, id: u32, value: i32) -> io::Result<()> {
        self.call(READ | WRITE, 28, &mut ControlValue { id, value })
    }
}

/// An image as the driver hands it over.
#[derive(Debug, Clone, Copy)]
pub struct Picture<'a> {
    /// Its bytes.
    pub bytes: &'a [u8],
    /// The driver's running number; a gap is an image that was lost.
    pub sequence: u32,
    /// Time stamp of the driver, ns.
    pub stamp_ns: u64,
    /// See [`DAMAGED`] and [`STAMP_MASK`].
    pub flags: u32,
}

/// Memory of the kernel, mapped.
#[derive(Debug)]
struct Mapping {
    start: NonNull<u8>,
    length: usize,
}

// SAFETY: the mapping belongs to this value alone and may be read from any thread.
unsafe impl Send for Mapping {}

impl Drop for Mapping {
    fn drop(&mut self) {
        // SAFETY: mapped by `Stream::start` with this address and length, and unmapped nowhere else.
        unsafe { libc::munmap(self.start.as_ptr().cast(), self.length) };
    }
}

/// A device that streams.
#[derive(Debug)]
pub struct Stream {
    // Before the device: unmapped, then closed.
    mappings: Vec<Mapping>,
    device: Device,
}

impl Stream {
    /// Gives the driver this many buffers and starts it.
    pub fn start(device: Device, buffers_count: u32) -> io::Result<Self> {
        let mut asked = BuffersRequest { count: buffers_count, kind: CAPTURE, memory: MMAP, ..BuffersRequest::zero() };
        device.call(READ | WRITE, 8, &mut asked)?;
        let mut stream = Stream { mappings: Vec::new(), device };
        for index in 0..asked.count {
            let mut buffer = Buffer { index, kind: CAPTURE, memory: MMAP, ..Buffer::zero() };
            stream.device.call(READ | WRITE, 9, &mut buffer)?;
            let (length, offset) = (buffer.length as usize, (buffer.offset & u64::from(u32::MAX)) as libc::off_t);
            // SAFETY: a new mapping at an address of the kernel's choice, of a length and an offset that the driver has
            // just named for this buffer. It is only read.
            let start = unsafe {
                let (read, shared) = (libc::PROT_READ, libc::MAP_SHARED);
                libc::mmap(std::ptr::null_mut(), length, read, shared, stream.device.0.as_raw_fd(), offset)
            };
            if start == libc::MAP_FAILED {
                return Err(io::Error::last_os_error());
            }
            let start = NonNull::new(start.cast()).ok_or_else(|| io::Error::other("a mapping at address zero"))?;
            stream.mappings.push(Mapping { start, length });
            stream.device.call(READ | WRITE, 15, &mut buffer)?;
        }
        stream.device.call(WRITE, 18, &mut (CAPTURE as libc::c_int))?;
        Ok(stream)
    }

    /// The device behind it.
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// Waits at most this long for an image; returns whether there is one. An error means that the camera is gone.
    pub fn wait(&self, longest_ms: u16) -> io::Result<bool> {
        let mut poll = libc::pollfd { fd: self.device.0.as_raw_fd(), events: libc::POLLIN, revents: 0 };
        // SAFETY: one valid, exclusive `pollfd`, as the count says.
        let ready = unsafe { libc::poll(&mut poll, 1, i32::from(longest_ms)) };
        match ready {
            -1 => match io::Error::last_os_error() {
                e if e.kind() == io::ErrorKind::Interrupted => Ok(false),
                e => Err(e),
            },
            0 => Ok(false),
            _ if poll.revents & (libc::POLLERR | libc::POLLHUP | libc::POLLNVAL) != 0 => {
                Err(io::Error::from_raw_os_error(libc::ENODEV))
            }
            _ => Ok(true),
        }
    }

    /// Passes the oldest waiting image to `see`, then returns its buffer to the driver; None when none waits.
    pub fn take<T>(&mut self, see: impl FnOnce(Picture<'_>) -> T) -> io::Result<Option<T>> {
        let mut buffer = Buffer { kind: CAPTURE, memory: MMAP, ..Buffer::zero() };
        match self.device.call(READ | WRITE, 17, &mut buffer) {
            Err(e) if e.kind() == io::ErrorKind::WouldBlock => return Ok(None),
            other => other?,
        }
        let mapping =
            self.mappings.get(buffer.index as usize).ok_or_else(|| io::Error::other("a buffer nobody made"))?;
        let length = (buffer.bytes_used as usize).min(mapping.length);
        // SAFETY: within the mapping, which outlives `see`. The driver has handed the buffer over and does not write to it
        // before it is queued again below.
        let bytes = unsafe { std::slice::from_raw_parts(mapping.start.as_ptr(), length) };
        let stamp_ns =
            (buffer.stamp_s.max(0) as u64).saturating_mul(1_000_000_000) + buffer.stamp_us.max(0) as u64 * 1000;
        let seen = see(Picture { bytes, sequence: buffer.sequence, stamp_ns, flags: buffer.flags });
        self.device.call(READ | WRITE, 15, &mut buffer)?;
        Ok(Some(seen))
    }
}

impl Drop for Stream {
    fn drop(&mut self) {
        // A camera that is gone has stopped already.
        let _ = self.device.call(WRITE, 19, &mut (CAPTURE as libc::c_int));
    }
}

/// Text up to the first zero.
fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).trim().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_have_the_numbers_of_the_kernel_s_header() {
        assert_eq!(request::<Capability>(READ, 0), 0x8068_5600);
        assert_eq!(request::<FormatDescription>(READ | WRITE, 2), 0xc040_5602);
        assert_eq!(request::<Format>(READ | WRITE, 5), 0xc0d0_5605);
        assert_eq!(request::<BuffersRequest>(READ | WRITE, 8), 0xc014_5608);
        assert_eq!(request::<Buffer>(READ | WRITE, 17), 0xc058_5611);
        assert_eq!(request::<libc::c_int>(WRITE, 18), 0x4004_5612);
        assert_eq!(request::<StreamParameters>(READ | WRITE, 22), 0xc0cc_5616);
        assert_eq!(request::<ControlValue>(READ | WRITE, 28), 0xc008_561c);
        assert_eq!(request::<ControlQuery>(READ | WRITE, 36), 0xc044_5624);
        assert_eq!(request::<SizeQuery>(READ | WRITE, 74), 0xc02c_564a);
    }

    #[test]
    fn a_file_that_is_no_camera_is_an_error_and_nothing_else() {
        let device = Device::open(Path::new("/dev/null")).expect("opens");
        assert!(device.identity().is_err() && device.layout().is_err() && device.control(1).is_err());
        assert!(device.formats().is_empty() && device.sizes(*b"YUYV").is_empty());
        assert_eq!((device.set_rate(Some(30.0)), device.control_range(1)), (None, None));
        assert!(Stream::start(device, 4).is_err());
    }
}
