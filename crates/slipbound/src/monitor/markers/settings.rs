//! Settings of step 2.

use crate::setting::{SettingError, within};
use serde::{Deserialize, Serialize};

/// How markers are found in an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Finder {
    /// Peaks of dot-sized contrast, then the pull of the dot's edge: sub-pixel, for dots of any regularity.
    Edges,
    /// The paper: a threshold on the flat image, morphology, centres of the blobs.
    Threshold,
}

/// Settings of step 2.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct MarkerSettings {
    /// How markers are found.
    pub finder: Finder,
    /// A marker of the rest frame has at least this contrast.
    pub birth_min_levels: f64,
    /// And at least this share of the median marker's contrast.
    pub birth_contrast_fraction: f64,
    /// A known marker is recognised down to this share of its own contrast at rest.
    pub keep_contrast_fraction: f64,
    /// Whether a marker's next position is predicted from its last motion. The released code looks where it last was.
    pub predict: bool,
    /// A spot this near to the predicted position is the marker. The released code: 7 px at a pitch of 15.2 px.
    pub match_within_pitch: f64,
    /// Whether markers not found that way are searched for where their neighbours moved, and whether a match that
    /// contradicts its neighbours is undone.
    pub ask_neighbours: bool,
    /// Minimum time between two spot searches of the whole image while something touches, ms; twice that while no
    /// marker is missing. In between, each marker is followed from the position predicted by its own motion. Zero: a
    /// search in every frame.
    pub search_period_ms: f64,
}

impl Default for MarkerSettings {
    fn default() -> Self {
        MarkerSettings {
            finder: Finder::Edges,
            birth_min_levels: 4.0,
            birth_contrast_fraction: 0.2,
            keep_contrast_fraction: 0.3,
            predict: true,
            match_within_pitch: 0.3,
            ask_neighbours: true,
            search_period_ms: 25.0,
        }
    }
}

impl MarkerSettings {
    /// Whether markers are detected on the flat image ([`Finder::Threshold`]) instead of the grey one.
    pub(in crate::monitor) fn finder_needs_flat(&self) -> bool {
        self.finder == Finder::Threshold
    }

    /// Whether markers can be followed from one frame to the next without a search.
    pub(super) fn follows(&self) -> bool {
        self.finder == Finder::Edges && self.predict && self.ask_neighbours
    }

    pub(in crate::monitor) fn check(&self) -> Result<(), SettingError> {
        within("markers.birth_min_levels", self.birth_min_levels, 0.5, 128.0)?;
        within("markers.birth_contrast_fraction", self.birth_contrast_fraction, 0.0, 1.0)?;
        within("markers.keep_contrast_fraction", self.keep_contrast_fraction, 0.05, 1.0)?;
        within("markers.match_within_pitch", self.match_within_pitch, 0.01, 0.5)?;
        within("markers.search_period_ms", self.search_period_ms, 0.0, 1000.0)
    }
}
