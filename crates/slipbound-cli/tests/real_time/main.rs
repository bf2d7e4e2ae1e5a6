//! The commands on sockets, pipes and processes, in real time. Most of it is waiting, so all of it is one program:
//! while one test waits for a link to come back another continues.

mod full_disk;
mod gripper;
mod latency;
mod link_faults;
mod live;
#[path = "../program/mod.rs"]
mod program;
mod troubled_sources;
