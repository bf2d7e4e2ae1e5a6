//! The kinds of surroundings, by name.

use serde::{Deserialize, Serialize};

/// Surroundings of the gel, and dirt on its lens.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Surroundings {
    /// A dark housing of one colour.
    Housing,
    /// Bright, textured walls that mirror the dots faintly, red on the left and green on the right, with a red rim and
    /// shadows on the gel.
    Walls,
    /// Walls, and along the far border two chains of highlights with dark middles, which look like dots but are off the
    /// grid.
    Glare,
    /// Walls, and on the lens dirt beside a marker and a scratch.
    Dirt,
    /// Walls, highlights and dirt: what a GelSlim shows.
    Full,
}

/// The words for surroundings in a scene: every kind, and `camera` for the camera's own.
pub(crate) const SURROUNDINGS: [&str; 6] = {
    let [a, b, c, d, e] = Surroundings::ALL;
    ["camera", a.name(), b.name(), c.name(), d.name(), e.name()]
};

impl Surroundings {
    /// Every kind.
    pub const ALL: [Surroundings; 5] = [Self::Housing, Self::Walls, Self::Glare, Self::Dirt, Self::Full];

    /// Its name in settings.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Housing => "housing",
            Self::Walls => "walls",
            Self::Glare => "glare",
            Self::Dirt => "dirt",
            Self::Full => "full",
        }
    }

    /// The kind of a name; None for any other word.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    pub(super) const fn walls(self) -> bool {
        !matches!(self, Self::Housing)
    }

    pub(super) const fn highlights(self) -> bool {
        matches!(self, Self::Glare | Self::Full)
    }

    pub(super) const fn dirt(self) -> bool {
        matches!(self, Self::Dirt | Self::Full)
    }
}
