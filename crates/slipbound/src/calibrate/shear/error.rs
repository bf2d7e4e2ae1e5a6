//! Why a recording of a hanging mass gives no stiffness, and the limits for it.

use super::frames::FEWEST_FRAMES;
use std::fmt;

/// The sum of displacement must be at least this, in pitches: half a dozen markers by a tenth each.
pub(super) const LEAST_SUM_PITCH: f64 = 0.6;
/// Largest standard deviation of the sum over the frames of the held mass, and of the hanging one, as a share of the
/// load.
pub(super) const MOST_SCATTER: f64 = 0.1;
/// Largest standard error of the difference of both means, as a share of it.
pub(super) const MOST_ERROR: f64 = 0.05;
/// Largest share of the load at the outermost markers: with more, part of the loaded skin is out of view. In simulation
/// 0.02 to 0.05 in full view (stiffness 2 to 21 % too high), 0.25 to 0.32 where the contact is cut (21 to 76 %).
pub(super) const MOST_AT_BORDER: f64 = 0.1;

/// Why there is no stiffness.
#[derive(Debug, Clone, PartialEq)]
pub enum ShearError {
    /// Too few frames show the mass hanging.
    FewFrames {
        /// Frames there were.
        got_count: usize,
    },
    /// Too few frames show it held while it is still supported.
    NotHeld {
        /// Frames there were.
        got_count: usize,
    },
    /// The frames in which it is held do not precede those in which it hangs.
    Order {
        /// The first and the last number of the frames in which it is held.
        held_seqs: [u64; 2],
        /// The same of those in which it hangs.
        hanging_seqs: [u64; 2],
    },
    /// No contact in these frames.
    NoContact,
    /// It slips: then friction carries the mass, not the skin alone.
    Slips {
        /// Number of the frame.
        seq: u64,
    },
    /// Markers are lost, and their share of the load with them.
    MarkersLost {
        /// Number of the frame.
        seq: u64,
        /// Markers lost.
        lost_count: u32,
        /// Markers in all.
        markers_count: usize,
    },
    /// The outermost markers move, too: skin beyond them is not visible.
    Cut {
        /// Share of the load that they show.
        at_border_fraction: f64,
    },
    /// The skin hardly moves.
    Faint {
        /// Sum of the displacements, in pitches.
        sum_pitch: f64,
    },
    /// The mass moves while it is held.
    Moves {
        /// Standard deviation over load.
        scatter_fraction: f64,
    },
    /// The mass swings.
    Swings {
        /// Standard deviation over load.
        scatter_fraction: f64,
    },
    /// Too few frames for their noise.
    Noisy {
        /// Standard error over load.
        error_fraction: f64,
    },
}

impl fmt::Display for ShearError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ShearError::FewFrames { got_count } => {
                write!(f, "expected at least {FEWEST_FRAMES} frames of the hanging mass, got {got_count}")
            }
            ShearError::NotHeld { got_count } => write!(
                f,
                "expected at least {FEWEST_FRAMES} stationary frames in which the mass is held and still stands, got {got_count} \
                 (grip it, wait, then lift; or say when it is held: --held A..B)"
            ),
            ShearError::Order { held_seqs: [held_from, held_to], hanging_seqs: [from, to] } => write!(
                f,
                "expected the mass to be held before it hangs, got frames {held_from} to {held_to} for held and {from} to {to} \
                 for hanging"
            ),
            ShearError::NoContact => f.write_str("expected the mass to be held by the finger, got no contact"),
            ShearError::Slips { seq } => {
                write!(f, "expected the mass to hang still, got slip in frame {seq} (grip harder)")
            }
            ShearError::MarkersLost { seq, lost_count, markers_count } => {
                write!(f, "expected all markers in sight, got {lost_count} of {markers_count} lost in frame {seq}")
            }
            ShearError::Cut { at_border_fraction } => write!(
                f,
                "expected the sheared skin in full view, at most {:.0} % of the load at its outermost markers, got {:.0} % \
                 (hold a smaller object, or in the middle)",
                100.0 * MOST_AT_BORDER,
                100.0 * at_border_fraction
            ),
            ShearError::Faint { sum_pitch } => write!(
                f,
                "expected the skin to move by {LEAST_SUM_PITCH} pitch summed over all markers, got {sum_pitch:.2} \
                 (take a heavier mass)"
            ),
            ShearError::Moves { scatter_fraction } => write!(
                f,
                "expected the mass to stand still while it is held, to {:.0} % of the load, got {:.0} % (say when it does: \
                 --held A..B)",
                100.0 * MOST_SCATTER,
                100.0 * scatter_fraction
            ),
            ShearError::Swings { scatter_fraction } => write!(
                f,
                "expected the mass to hang still, to {:.0} %, got {:.0} % (wait until it does, or say when: --hanging A..B)",
                100.0 * MOST_SCATTER,
                100.0 * scatter_fraction
            ),
            ShearError::Noisy { error_fraction } => write!(
                f,
                "expected a load known to {:.0} %, got {:.0} % (take a heavier mass, or record longer)",
                100.0 * MOST_ERROR,
                100.0 * error_fraction
            ),
        }
    }
}

impl std::error::Error for ShearError {}
