//! A numpy array as a frame: borrowed where it is contiguous as a whole, else copied row by row, whole or by pixels.

use crate::errors::FrameError;
use numpy::ndarray::{ArrayView3, ArrayViewD, ArrayViewMut1, Axis, Zip};
use numpy::{Element, PyArrayDescrMethods as _, PyArrayMethods as _, PyReadonlyArrayDyn, PyUntypedArray};
use numpy::{PyArrayDyn, PyUntypedArrayMethods as _};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use slipbound::image::{ByteOrder, Frame, Gray, Pixels, Rgb, SizePx};
use slipbound::port::{Clock, FrameBuffer, PixelFormat};

/// Longest side of an image, pixels, as for images from files: a view can claim any size without having it.
const LONGEST_SIDE_PX: usize = 8192;

/// The order of the bytes of a pixel, by its name.
pub fn byte_order(name: &str) -> PyResult<ByteOrder> {
    match name {
        "BGR" => Ok(ByteOrder::Bgr),
        "RGB" => Ok(ByteOrder::Rgb),
        _ => Err(crate::errors::SettingError::new_err(format!("order: expected \"BGR\" or \"RGB\", got {name:?}"))),
    }
}

/// An array that is an image, held while it is read.
pub struct Picture<'py> {
    array: PyReadonlyArrayDyn<'py, u8>,
    order: ByteOrder,
}

impl<'py> Picture<'py> {
    /// Refuses an array that is not an image, and says why.
    pub fn new(array: &Bound<'py, PyAny>, order: ByteOrder) -> PyResult<Self> {
        let Ok(untyped) = array.cast::<PyUntypedArray>() else {
            let got = array.get_type().fully_qualified_name()?;
            return Err(PyTypeError::new_err(format!(
                "expected a numpy array of uint8, H x W x 3 or H x W, got {got}"
            )));
        };
        let shape = untyped.shape().to_vec();
        let refused = |got: String| Err(FrameError::new_err(format!("expected uint8, H x W x 3 or H x W, got {got}")));
        if !untyped.dtype().is_equiv_to(&u8::get_dtype(array.py())) {
            return refused(format!("{} of shape {shape:?}", untyped.dtype()));
        }
        match *shape.as_slice() {
            [h, w] | [h, w, 1 | 3] if h.max(w) > LONGEST_SIDE_PX => {
                return Err(FrameError::new_err(format!(
                    "expected a picture of at most {LONGEST_SIDE_PX} px a side, got shape {shape:?}"
                )));
            }
            [h, w] | [h, w, 1 | 3] if h > 0 && w > 0 => {}
            [_, _, 4] => return refused(format!("shape {shape:?}: take the fourth channel off, array[:, :, :3]")),
            _ => return refused(format!("shape {shape:?}")),
        }
        let array = array.cast::<PyArrayDyn<u8>>().map_err(|e| FrameError::new_err(e.to_string()))?;
        let array = array.try_readonly().map_err(|e| FrameError::new_err(e.to_string()))?;
        Ok(Picture { array, order })
    }

    /// The pixels, borrowed from the array, or from `scratch` where it is not contiguous.
    pub fn pixels<'a>(&'a self, scratch: &'a mut Vec<u8>) -> PyResult<Pixels<'a>> {
        let view = three_axes(self.array.as_array())?;
        let (height, width, channels) = view.dim();
        let (view, order) = forward(view, self.order);
        let size = SizePx::new(width, height);
        let bytes: &'a [u8] = match view.to_slice() {
            Some(bytes) => bytes,
            None => {
                gather(&view, scratch);
                scratch
            }
        };
        let refused = |e: slipbound::image::ImageError| FrameError::new_err(e.to_string());
        Ok(match channels {
            1 => Pixels::Gray(Gray::new(bytes, size).map_err(refused)?),
            _ => Pixels::Rgb(Rgb::new(bytes, size).map_err(refused)?.in_order(order)),
        })
    }
}

/// The images of an argument that is one, several, or an array of several.
pub fn pictures_of<'py>(pictures: &Bound<'py, PyAny>, order: ByteOrder) -> PyResult<Vec<Picture<'py>>> {
    if pictures.cast::<PyUntypedArray>().is_ok_and(|array| is_one(array.shape())) {
        return Ok(vec![Picture::new(pictures, order)?]);
    }
    pictures.try_iter()?.map(|picture| Picture::new(&picture?, order)).collect()
}

/// Whether an array of this shape is one image, or no image at all; N x H x W is N grey ones, unless so few columns can
/// only be channels.
fn is_one(shape: &[usize]) -> bool {
    matches!(shape, [] | [_] | [_, _] | [_, _, 0..=4])
}

/// The view with its third axis, of one channel or three.
fn three_axes(view: ArrayViewD<'_, u8>) -> PyResult<ArrayView3<'_, u8>> {
    let view = if view.ndim() == 2 { view.insert_axis(Axis(2)) } else { view };
    view.into_dimensionality().map_err(|e| FrameError::new_err(e.to_string()))
}

/// `bgr[:, :, ::-1]` is the same bytes in the other order: they need not be copied.
fn forward(mut view: ArrayView3<'_, u8>, order: ByteOrder) -> (ArrayView3<'_, u8>, ByteOrder) {
    if view.dim().2 != 3 || view.strides()[2] >= 0 {
        return (view, order);
    }
    view.invert_axis(Axis(2));
    (view, if order == ByteOrder::Bgr { ByteOrder::Rgb } else { ByteOrder::Bgr })
}

fn gather(view: &ArrayView3<'_, u8>, into: &mut Vec<u8>) {
    let (_, width, channels) = view.dim();
    into.resize(view.len(), 0);
    for (to, row) in into.chunks_exact_mut(width * channels).zip(view.axis_iter(Axis(0))) {
        let channel = |c| row.index_axis(Axis(1), c);
        match row.to_slice() {
            Some(bytes) => to.copy_from_slice(bytes),
            None if channels == 1 => ArrayViewMut1::from(to).assign(&channel(0)),
            None => Zip::from(ArrayViewMut1::from(to.as_chunks_mut::<3>().0))
                .and(channel(0))
                .and(channel(1))
                .and(channel(2))
                .for_each(|to, &first, &second, &third| *to = [first, second, third]),
        }
    }
}

/// A copy of a frame that can be kept.
pub fn buffer(frame: &Frame<'_>) -> FrameBuffer {
    let size = frame.pixels.size();
    let (format, pixels) = match frame.pixels {
        Pixels::Gray(grey) => (PixelFormat::Gray, (0..size.height).flat_map(|y| grey.row(y)).copied().collect()),
        Pixels::Rgb(image) => {
            let pixels = (0..size.height).flat_map(|y| image.row(y).as_chunks::<3>().0);
            (PixelFormat::Rgb, pixels.flat_map(|pixel| image.order().rgb(*pixel)).collect())
        }
    };
    let (seq, time_ns) = (frame.seq, frame.time_ns);
    FrameBuffer { pixels, format, size, seq, time_ns, clock: Clock::Unknown, ..FrameBuffer::default() }
}

/// Red, green, blue bytes, or grey ones, as a new array in `order`.
pub fn array<'py>(
    py: Python<'py>,
    pixels: Vec<u8>,
    size: SizePx,
    format: PixelFormat,
    order: ByteOrder,
) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    let mut pixels = pixels;
    if format == PixelFormat::Rgb && order == ByteOrder::Bgr {
        pixels.as_chunks_mut::<3>().0.iter_mut().for_each(|pixel| pixel.reverse());
    }
    let flat = numpy::PyArray1::from_vec(py, pixels);
    match format {
        PixelFormat::Gray => flat.reshape(vec![size.height, size.width]),
        PixelFormat::Rgb => flat.reshape(vec![size.height, size.width, 3]),
    }
}
