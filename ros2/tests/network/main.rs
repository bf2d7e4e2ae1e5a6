//! The node in a separate process, over loopback; each test has its own domain.

mod control;
mod gripper_action;
mod lifecycle;
mod node;
mod overlay;
mod process;
