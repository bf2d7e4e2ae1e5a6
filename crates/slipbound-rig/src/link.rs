//! Links to devices: bytes in and out of a socket or a serial line without waiting, and the clock.

mod clock;
mod connection;
mod endpoint;
mod health;
mod in_flight;
mod lines;
#[cfg(feature = "serial")]
mod serial;
mod stream;
mod tcp;

pub use clock::{now_ns, time_of_day_ns};
pub use connection::Connection;
pub use endpoint::Endpoint;
pub(crate) use health::{LinkHealth, LinkProblem};
pub(crate) use in_flight::InFlight;
pub(crate) use lines::{Lines, write_line};
#[cfg(all(feature = "serial", target_os = "linux"))]
pub use serial::PseudoTerminal;
#[cfg(feature = "serial")]
pub use serial::{SerialConnector, SerialLink};
pub use stream::{Connector, Link};
pub use tcp::{TcpConnector, TcpLink};
