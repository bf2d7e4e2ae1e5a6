//! What is linked from outside: drivers against emulators, in lock-step through byte queues, then over real sockets and a pseudo-terminal, and
//! cameras over the network. Much of it is waiting, so all of it is one program.

mod bench;
mod client;
mod driver;
mod faults;
mod ffmpeg_live;
mod foreign;
mod foreign_robotiq;
mod foreign_weiss;
mod gcl;
mod gcl_motion;
mod home;
mod line;
mod mjpeg_http;
mod noise;
mod robotiq;
mod robotiq_home;
mod sockets;
mod tolerance;
mod unanswered;
mod wsg50;
mod wsg50_limit;
