//! Processes of the node, and messages received from them.

use slipbound_ros2::msg::TopicType;
use slipbound_ros2::ros::Inbox;
use std::io::Read as _;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Longest wait for anything: discovery takes seconds on a busy computer.
pub const LONGEST_WAIT: Duration = Duration::from_secs(40);

/// A process of `slipbound-ros2`; killed when dropped.
pub struct Process(Child);

impl Process {
    pub fn start(args: &[&str], domain_id: u16) -> Self {
        Process::run(Command::new(env!("CARGO_BIN_EXE_slipbound-ros2")), args, domain_id)
    }

    /// In a network namespace.
    pub fn start_in(netns: &str, args: &[&str], domain_id: u16) -> Self {
        let mut command = Command::new("ip");
        command.args(["netns", "exec", netns, env!("CARGO_BIN_EXE_slipbound-ros2")]);
        Process::run(command, args, domain_id)
    }

    fn run(mut command: Command, args: &[&str], domain_id: u16) -> Self {
        command.args(args).env("ROS_DOMAIN_ID", domain_id.to_string()).stdout(Stdio::piped()).stderr(Stdio::piped());
        Process(command.spawn().expect("starts"))
    }

    pub fn node(config: &Path, domain_id: u16) -> Self {
        Process::start(&["node", config.to_str().expect("UTF-8")], domain_id)
    }

    /// Runs a command that does not begin; its exit code and what it says.
    pub fn refused(args: &[&str]) -> (Option<i32>, String) {
        let done = Command::new(env!("CARGO_BIN_EXE_slipbound-ros2")).args(args).output().expect("starts");
        (done.status.code(), String::from_utf8_lossy(&done.stderr).into_owned())
    }

    /// As Ctrl-C does.
    pub fn interrupt(&self) {
        let asked = Command::new("kill").args(["-INT", &self.0.id().to_string()]).status().expect("runs");
        assert!(asked.success());
    }

    /// Waits for its end.
    pub fn exit_code(&mut self, longest: Duration) -> Option<i32> {
        let until = Instant::now() + longest;
        loop {
            if let Some(status) = self.0.try_wait().expect("known") {
                return status.code();
            }
            assert!(Instant::now() < until, "it has not ended within {longest:?}");
            sleep(Duration::from_millis(10));
        }
    }

    /// Its exit code at its end, and what it said; calls `meanwhile` until then.
    pub fn ended(mut self, longest: Duration, mut meanwhile: impl FnMut()) -> (Option<i32>, String) {
        let until = Instant::now() + longest;
        while self.0.try_wait().expect("known").is_none() && Instant::now() < until {
            meanwhile();
            sleep(Duration::from_millis(10));
        }
        let is_over = self.0.try_wait().expect("known").is_some();
        if !is_over {
            self.0.kill().expect("it can be killed");
        }
        let code = self.0.wait().expect("known").code();
        let mut said = String::new();
        self.0.stdout.take().expect("piped").read_to_string(&mut said).expect("UTF-8");
        self.0.stderr.take().expect("piped").read_to_string(&mut said).expect("UTF-8");
        assert!(is_over, "it has not ended within {longest:?}: {said}");
        (code, said)
    }

    /// Whether it has ended by itself, successfully.
    pub fn has_ended_well(&mut self) -> bool {
        self.0.try_wait().expect("known").is_some_and(|status| status.success())
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Waits for the next message.
pub fn next<M: TopicType>(inbox: &mut Inbox<M>, longest: Duration) -> Option<M> {
    let until = Instant::now() + longest;
    loop {
        if let Some(received) = inbox.take().expect("readable") {
            return Some(received.message);
        }
        let left = until.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return None;
        }
        inbox.wait(left);
    }
}

/// A separate domain for every test process and every test, so that none receives another's data: 1 to 75, whose ports
/// lie below the ephemeral ports.
pub fn domain_id(test: u16) -> u16 {
    assert!(test < 15, "a test of a number that is taken");
    1 + (std::process::id() % 5) as u16 * 15 + test
}
