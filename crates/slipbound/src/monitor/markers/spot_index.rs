//! The spots of a frame, sorted into square buckets for fast lookup near a position.

use crate::image::SizePx;
use crate::pixels::dots::Spot;
use crate::plane::Vec2;

/// Spots by bucket; owns all memory.
#[derive(Debug, Clone)]
pub(super) struct SpotIndex {
    bucket_px: f64,
    buckets: SizePx,
    bucket_start: Vec<u32>,
    bucket_spots: Vec<(u32, Vec2)>,
    spots: Vec<Spot>,
}

impl SpotIndex {
    /// For spots within an image of `size`.
    pub(super) fn new(size: SizePx, bucket_px: f64) -> Self {
        let along = |px: usize| (px as f64 / bucket_px).ceil() as usize + 1;
        let buckets = SizePx::new(along(size.width), along(size.height));
        SpotIndex {
            bucket_px,
            buckets,
            bucket_start: vec![0; buckets.area() + 1],
            bucket_spots: Vec::with_capacity(Self::most_spots(size)),
            spots: Vec::with_capacity(Self::most_spots(size)),
        }
    }

    /// The most spots an image of `size` can have: peaks are two pixels apart.
    pub(super) fn most_spots(size: SizePx) -> usize {
        size.area() / 4 + size.width + size.height
    }

    /// Replaces the spots by those of a new frame.
    pub(super) fn take(&mut self, spots: &[Spot]) {
        self.spots.clear();
        self.spots.extend_from_slice(spots);
        // A counting sort: an entry first holds the count of its bucket, then its end and, after the spots are inserted
        // from the back, its start.
        self.bucket_start.fill(0);
        for spot in &self.spots {
            let bucket = self.bucket(spot.position);
            self.bucket_start[bucket] += 1;
        }
        let mut end = 0;
        for start in &mut self.bucket_start {
            end += *start;
            *start = end;
        }
        self.bucket_spots.clear();
        self.bucket_spots.resize(spots.len(), (0, Vec2::ZERO));
        for i in (0..spots.len()).rev() {
            let position = self.spots[i].position;
            let bucket = self.bucket(position);
            self.bucket_start[bucket] -= 1;
            self.bucket_spots[self.bucket_start[bucket] as usize] = (i as u32, position);
        }
    }

    /// All spots, in the order they were taken in.
    pub(super) fn all(&self) -> &[Spot] {
        &self.spots
    }

    /// Calls `see` with the index and the squared distance in px of every spot in the nine buckets around a position:
    /// all within the side of a bucket, and some beyond.
    pub(super) fn near(&self, place: Vec2, mut see: impl FnMut(u32, f64)) {
        if !place.is_finite() {
            return;
        }
        let (column, row) = self.cell(place);
        let (first, end) = (column.saturating_sub(1), (column + 2).min(self.buckets.width));
        for row in row.saturating_sub(1)..(row + 2).min(self.buckets.height) {
            // The buckets of a row are contiguous.
            let start = &self.bucket_start[row * self.buckets.width..];
            for &(spot, position) in &self.bucket_spots[start[first] as usize..start[end] as usize] {
                see(spot, (position - place).length_squared());
            }
        }
    }

    fn bucket(&self, p: Vec2) -> usize {
        let (column, row) = self.cell(p);
        row * self.buckets.width + column
    }

    /// Column and row of the bucket at a position; those of the nearest bucket beyond the image.
    fn cell(&self, p: Vec2) -> (usize, usize) {
        let index = |v: f64, end: usize| ((v / self.bucket_px).max(0.0) as usize).min(end - 1);
        (index(p.x, self.buckets.width), index(p.y, self.buckets.height))
    }
}
