//! The arm behind the hand, by the line protocol (docs/grippers.md): `line://HOST:PORT`, or `dry` for none.
//!
//! Every motion is bounded by an angle or a distance and by a time to live, which the wrist itself enforces: without a
//! new command it pauses. No call waits.

mod address;
mod device;
mod dry;
mod error;
mod line;
mod zero;

pub use address::open;
pub use device::Device;
pub use dry::Dry;
pub use error::Error;
pub use line::LineWrist;
pub use zero::ZeroCheck;
