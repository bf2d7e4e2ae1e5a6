//! How large a picture may be, checked before anything is made for it.

use slipbound::image::SizePx;

/// Most pixels of a picture, whatever it is decoded by; a header that says more is taken for damaged. 100 MB in colour.
const MOST_PIXELS: usize = 32 << 20;

/// The size that a header says, before any buffer is made for it; the text of the failure says what is wrong with it.
pub(super) fn checked_size(width_px: usize, height_px: usize) -> Result<SizePx, String> {
    match width_px.checked_mul(height_px) {
        Some(1..=MOST_PIXELS) => Ok(SizePx::new(width_px, height_px)),
        _ => Err(format!("expected 1 to {MOST_PIXELS} pixels, got {width_px} x {height_px}")),
    }
}
