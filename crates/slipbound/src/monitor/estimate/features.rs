//! Features of the estimates: dimensionless numbers of a contact's displacement field.

/// Number of features.
pub const FEATURES_COUNT: usize = 25;

/// Number of leading features that trees without grip force use: these need neither it nor stiffness. (`hidden` needs
/// neither, but those trees were fitted without it.)
pub const GEOMETRIC_COUNT: usize = 20;

/// Names of the features, in order. With d the displacement of a marker in contact under load, r that of the rigid
/// motion of the sticking markers, s = |d - r|, p the pitch, P the grip force, k the shear stiffness (N/mm3), A the
/// contact area:
///
/// | name | definition |
/// |---|---|
/// | `residual_over_rigid` | mean s / (mean abs(r) + 0.013 p) |
/// | `rim_over_centre` | mean abs(d) of the outer third by radius / (of the inner third + 0.013 p) |
/// | `over_fraction` | share of markers with s > 0.1 abs(r) + 0.03 p |
/// | `secant` | load doing work on the rigid motion, over that of a wide patch that sticks: (F.t + T w) / (k (A + 1.92 mm perimeter) D^2), D the RMS of r |
/// | `work_lost` | 1 - sum d.r / sum r^2 |
/// | `tangent` | load added over motion added in the last fifth or two of the motion, over that of a wide patch that sticks |
/// | `softening` | 1 - secant stiffness / largest so far |
/// | `q25` `q50` `q75` `q90` | quantiles of s / (abs(r) + 0.013 p) |
/// | `noise` | 0.013 p / (D + 0.013 p) |
/// | `cut` | share of markers in contact within a pitch of the border of the view |
/// | `sticking` | mean weight 1 / (1 + (s / 0.1 p)^2)^2 |
/// | `slope` | slope of s / (abs(r) + 0.013 p) over the radius |
/// | `turning` | share of the rotation in the motion at mean radius |
/// | `narrow` `wide` | standard deviations of the places of the markers along their main axes, in p |
/// | `over_twentieth` | share of markers with s > 0.05 p |
/// | `moving` | whether the contact moves: change of D in the last 0.18 s / (D + 0.013 p), at most 0.01 either way |
/// | `load` | abs(F, T / mean radius) / (0.6 P), F and T from all markers |
/// | `mean_shear` | abs(mean d) k A / (0.6 P) |
/// | `residual_shear` | RMS s k A / (0.6 P) |
/// | `far_shear` | 90th percentile of abs(d) k A / (0.6 P) |
/// | `hidden` | share of A that is out of view: 0 where the length of the gel is not known |
pub const FEATURE_NAMES: [&str; FEATURES_COUNT] = [
    "residual_over_rigid",
    "rim_over_centre",
    "over_fraction",
    "secant",
    "work_lost",
    "tangent",
    "softening",
    "q25",
    "q50",
    "q75",
    "q90",
    "noise",
    "cut",
    "sticking",
    "slope",
    "turning",
    "narrow",
    "wide",
    "over_twentieth",
    "moving",
    "load",
    "mean_shear",
    "residual_shear",
    "far_shear",
    "hidden",
];

/// Their indices.
pub(in crate::monitor) const RESIDUAL_OVER_RIGID: usize = 0;
pub(in crate::monitor) const RIM_OVER_CENTRE: usize = 1;
pub(in crate::monitor) const OVER_FRACTION: usize = 2;
pub(in crate::monitor) const SECANT: usize = 3;
pub(in crate::monitor) const WORK_LOST: usize = 4;
pub(in crate::monitor) const TANGENT: usize = 5;
pub(in crate::monitor) const SOFTENING: usize = 6;
pub(in crate::monitor) const Q25: usize = 7;
pub(in crate::monitor) const Q50: usize = 8;
pub(in crate::monitor) const Q75: usize = 9;
pub(in crate::monitor) const Q90: usize = 10;
pub(in crate::monitor) const NOISE: usize = 11;
pub(in crate::monitor) const CUT: usize = 12;
pub(in crate::monitor) const STICKING: usize = 13;
pub(in crate::monitor) const SLOPE: usize = 14;
pub(in crate::monitor) const TURNING: usize = 15;
pub(in crate::monitor) const NARROW: usize = 16;
pub(in crate::monitor) const WIDE: usize = 17;
pub(in crate::monitor) const OVER_TWENTIETH: usize = 18;
pub(in crate::monitor) const MOVING: usize = 19;
pub(in crate::monitor) const LOAD: usize = 20;
pub(in crate::monitor) const MEAN_SHEAR: usize = 21;
pub(in crate::monitor) const RESIDUAL_SHEAR: usize = 22;
pub(in crate::monitor) const FAR_SHEAR: usize = 23;
pub(in crate::monitor) const HIDDEN: usize = 24;

/// Friction coefficient that makes the load dimensionless; a scale, not an estimate.
pub(super) const SCALE_MU: f64 = 0.6;

/// Values of the features of a frame.
pub type Features = [f64; FEATURES_COUNT];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_feature_is_at_the_index_of_its_name() {
        let indices = [
            RESIDUAL_OVER_RIGID,
            RIM_OVER_CENTRE,
            OVER_FRACTION,
            SECANT,
            WORK_LOST,
            TANGENT,
            SOFTENING,
            Q25,
            Q50,
            Q75,
            Q90,
            NOISE,
            CUT,
            STICKING,
            SLOPE,
            TURNING,
            NARROW,
            WIDE,
            OVER_TWENTIETH,
            MOVING,
            LOAD,
            MEAN_SHEAR,
            RESIDUAL_SHEAR,
            FAR_SHEAR,
            HIDDEN,
        ];
        let named = [
            "residual_over_rigid",
            "rim_over_centre",
            "over_fraction",
            "secant",
            "work_lost",
            "tangent",
            "softening",
            "q25",
            "q50",
            "q75",
            "q90",
            "noise",
            "cut",
            "sticking",
            "slope",
            "turning",
            "narrow",
            "wide",
            "over_twentieth",
            "moving",
            "load",
            "mean_shear",
            "residual_shear",
            "far_shear",
            "hidden",
        ];
        assert_eq!(indices.map(|at| FEATURE_NAMES[at]), named);
    }
}
