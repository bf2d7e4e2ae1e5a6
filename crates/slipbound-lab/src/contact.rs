//! Contact of the gel with one object, step by step in time.
//!
//! ```text
//!   command (grip, pose or wrench)
//!      |
//!      v
//!   gap of every cell          shape   where the object is above each piece of gel
//!   pressure                   normal  who touches
//!   friction bounds            friction
//!   traction, object motion    tangential, body   who sticks, where the object goes
//!   displacement, truth        response, strain, truth
//! ```
//!
//! The order is that of `increment`; each row is a file.

mod body;
mod finger;
mod fourier;
mod friction;
mod grid;
mod half_space;
mod increment;
mod normal;
mod pair;
mod path;
mod reading;
mod response;
mod responses;
mod settings;
pub mod shape;
mod strain;
mod tangential;
mod transform;
mod truth;

pub use body::{Body, Drive, Inertia, Mount, Pose, Rail, Springs, Wrench};
pub use finger::Finger;
pub use friction::{Friction, Law};
pub use grid::{Grid, Region};
pub use normal::{Grip, Stop};
pub use pair::FingerPair;
pub use path::{Change, Leg, Path};
pub use settings::{Command, FingerSettings, GelEdge};
pub use truth::{Displacement, Event, Events, GROSS_FRICTION_FRACTION, LINEAR_STRAIN, LoadRecord, Truth};

pub(crate) use half_space::half_space_response;
pub(crate) use normal::{Normal, NormalProblem};
pub(crate) use response::Response;
pub(crate) use tangential::{OneSurface, Tangential, TangentialProblem};
