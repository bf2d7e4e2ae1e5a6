//! The node in a process of its own, over loopback, in a domain of each test's own.

mod control;
mod node;
mod process;
