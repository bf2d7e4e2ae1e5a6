//! The size limit of an image, checked before anything is allocated for it.

use slipbound::image::SizePx;

/// Most pixels of an image, whatever decodes it; a header that states more counts as damaged. 100 MB in colour.
const MOST_PIXELS: usize = 32 << 20;

/// The size that a header states, before any buffer is allocated for it; the error says what is wrong with it.
pub(crate) fn checked_size(width_px: usize, height_px: usize) -> Result<SizePx, String> {
    match width_px.checked_mul(height_px) {
        Some(1..=MOST_PIXELS) => Ok(SizePx::new(width_px, height_px)),
        _ => Err(format!("expected 1 to {MOST_PIXELS} pixels, got {width_px} x {height_px}")),
    }
}
