//! Drivers against emulators: in lock-step through byte queues, then over real sockets and a pseudo-terminal.

mod bench;
mod client;
mod driver;
mod faults;
mod foreign;
mod foreign_robotiq;
mod foreign_weiss;
mod gcl;
mod line;
mod noise;
mod robotiq;
mod sockets;
mod tolerance;
mod wsg50;
