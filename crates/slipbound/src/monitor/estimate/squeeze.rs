//! The squeeze: displacement that the grip alone makes, at any grip.
//!
//! ```text
//!   pressing:  fields S1 S2 S3 ... St   each kept when it has grown by a fifth      amplitude of each: its part along St
//!   later:     amplitude (P / Pt)^0.85 --> between two of the kept fields; beyond St, St in proportion
//! ```
//!
//! A contact that is let go runs through the same fields backwards: on a cylinder the strip grows narrower, which no field
//! in proportion to the last one can show.

use crate::plane::Vec2;

/// Fields that are kept; with the step between them they span a factor of nine.
const LEVELS_COUNT: usize = 12;
/// A field is kept when its RMS is larger than that of the last one by this factor.
const LEVEL_STEP: f64 = 1.2;

/// Displacement by the squeeze alone, of every marker.
#[derive(Debug, Clone)]
pub(super) struct Squeeze {
    markers_count: usize,
    /// Fields kept, one after another from the weakest; [`LEVELS_COUNT`] at most.
    fields_px: Vec<Vec2>,
    /// RMS of each field.
    rms_px: Vec<f64>,
    /// Amplitude of each field against the last one; known once that is taken.
    amplitudes: Vec<f64>,
}

impl Squeeze {
    pub fn new(markers_count: usize) -> Self {
        Squeeze {
            markers_count,
            fields_px: Vec::with_capacity(LEVELS_COUNT * markers_count),
            rms_px: Vec::with_capacity(LEVELS_COUNT),
            amplitudes: Vec::with_capacity(LEVELS_COUNT),
        }
    }

    /// A new contact.
    pub fn clear(&mut self) {
        self.fields_px.clear();
        self.rms_px.clear();
        self.amplitudes.clear();
    }

    fn drop_last(&mut self) {
        self.rms_px.pop();
        self.fields_px.truncate(self.rms_px.len() * self.markers_count);
    }

    /// Displacement of all markers in a frame of the press.
    pub fn press(&mut self, field_px: impl Iterator<Item = Vec2> + Clone) {
        let rms_px =
            (field_px.clone().map(Vec2::length_squared).sum::<f64>() / self.markers_count.max(1) as f64).sqrt();
        // A grip that is let go on the way: what it had reached is no longer part of this press.
        while self.rms_px.last().is_some_and(|&last| rms_px < last / LEVEL_STEP) {
            self.drop_last();
        }
        if self.rms_px.last().is_none_or(|&last| rms_px > last * LEVEL_STEP) {
            self.keep(rms_px, field_px);
        }
    }

    fn keep(&mut self, rms_px: f64, field_px: impl Iterator<Item = Vec2>) {
        if self.rms_px.len() == LEVELS_COUNT {
            self.rms_px.remove(0);
            self.fields_px.drain(..self.markers_count);
        }
        self.rms_px.push(rms_px);
        self.fields_px.extend(field_px.take(self.markers_count));
    }

    /// The press is over: this is the field to which all others are put in proportion.
    pub fn take(&mut self, field_px: impl Iterator<Item = Vec2> + Clone) {
        let rms_px =
            (field_px.clone().map(Vec2::length_squared).sum::<f64>() / self.markers_count.max(1) as f64).sqrt();
        while self.rms_px.last().is_some_and(|&last| rms_px < last * LEVEL_STEP) {
            self.drop_last();
        }
        self.keep(rms_px, field_px);
        let last = &self.fields_px[self.fields_px.len() - self.markers_count..];
        let whole = last.iter().map(|u| u.length_squared()).sum::<f64>();
        self.amplitudes.clear();
        let mut below = 0.0;
        for field in self.fields_px.chunks_exact(self.markers_count.max(1)) {
            let along = field.iter().zip(last).map(|(u, of_last)| u.dot(*of_last)).sum::<f64>();
            below = if whole > 0.0 { (along / whole).clamp(below, 1.0) } else { 1.0 };
            self.amplitudes.push(below);
        }
    }

    /// Displacement of a marker at an amplitude, 1 at the end of the press, px.
    pub fn at(&self, marker: usize, amplitude: f64) -> Vec2 {
        let field =
            |level: usize| self.fields_px.get(level * self.markers_count + marker).copied().unwrap_or(Vec2::ZERO);
        let above = self.amplitudes.iter().position(|&a| a >= amplitude).unwrap_or(self.amplitudes.len());
        let Some(below) = above.checked_sub(1) else {
            let least = self.amplitudes.first().copied().unwrap_or(1.0);
            return if least > 0.0 { field(0) * (amplitude / least) } else { Vec2::ZERO };
        };
        let from = self.amplitudes[below];
        match self.amplitudes.get(above) {
            Some(&to) => {
                let share = (amplitude - from) / (to - from);
                field(below) * (1.0 - share) + field(above) * share
            }
            None => field(below) * (amplitude / from),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A strip that grows wider with the grip: displacement of marker i at amplitude a.
    fn strip(i: usize, a: f64) -> Vec2 {
        let x = i as f64 - 10.0;
        Vec2::new(x * a * libm::exp(-x * x / (20.0 * a + 1.0)), 0.0)
    }

    fn field(a: f64) -> impl Iterator<Item = Vec2> + Clone {
        (0..21).map(move |i| strip(i, a))
    }

    #[test]
    fn a_field_of_the_press_comes_back_when_the_grip_is_let_go() {
        let mut squeeze = Squeeze::new(21);
        (1..=40).for_each(|step| squeeze.press(field(f64::from(step) / 40.0)));
        squeeze.take(field(1.0));
        assert!(squeeze.amplitudes.is_sorted() && squeeze.amplitudes.len() == LEVELS_COUNT, "{:?}", squeeze.amplitudes);
        for a in [0.3, 0.45, 0.7, 0.85, 1.0] {
            // Its amplitude, as the markers show it.
            let dot = |u: &dyn Fn(usize) -> Vec2| (0..21).map(|i| u(i).dot(strip(i, 1.0))).sum::<f64>();
            let amplitude = dot(&|i| strip(i, a)) / dot(&|i| strip(i, 1.0));
            for i in 0..21 {
                let error = (squeeze.at(i, amplitude) - strip(i, a)).length();
                let in_proportion = (strip(i, 1.0) * amplitude - strip(i, a)).length();
                assert!(
                    error < 0.05 && (error < 0.02 || error < 0.3 * in_proportion),
                    "{a} {i}: {error} {in_proportion}"
                );
            }
        }
        assert_eq!(squeeze.at(3, 2.0), strip(3, 1.0) * 2.0);
        assert_eq!(squeeze.at(3, 0.0), Vec2::ZERO);
    }

    #[test]
    fn a_press_that_is_taken_back_leaves_nothing_and_without_one_the_last_field_counts() {
        let mut squeeze = Squeeze::new(21);
        squeeze.press(field(1.0));
        squeeze.press(field(0.2));
        squeeze.take(field(0.5));
        assert_eq!(squeeze.rms_px.len(), 2);
        squeeze.clear();
        squeeze.take(field(0.0));
        assert_eq!(squeeze.at(5, 1.0), Vec2::ZERO);
        squeeze.clear();
        squeeze.take(field(1.0));
        assert_eq!(squeeze.at(5, 0.5), strip(5, 1.0) * 0.5);
    }
}
