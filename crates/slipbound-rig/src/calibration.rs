//! Calibration results as files, and the shear stiffness from a recording of a hanging mass.
//!
//! ```text
//!   Calibration --raise_edges (fabric skins)----> sensor_file, write_grid_picture
//!   ReadAhead --HangingMass::measure--> Shear --> sensor_file_with_shear
//! ```

mod hanging_mass;
mod quiet_edges;
mod sensor_file;
mod shear_file;

pub use hanging_mass::{HangingMass, HangingMassError, MeasuredShear};
pub use quiet_edges::raise_edges;
pub use sensor_file::{sensor_file, shear_table, write_grid_picture};
pub use shear_file::{ShearFileError, sensor_file_with_shear};
