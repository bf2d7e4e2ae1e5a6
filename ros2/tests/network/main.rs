//! The node in a process of its own, over loopback, in a domain of each test's own.

mod control;
mod gripper_action;
mod lifecycle;
mod node;
mod process;
