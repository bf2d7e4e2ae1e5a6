//! `slipbound-ros2 measure`: the node in a separate process, cameras and readers in this one.
//!
//! ```text
//!   this process: images, stamped --DDS--> slipbound-ros2 node (a second process) --DDS--> reports: this process
//! ```
//!
//! The node's process may run in a separate network namespace; `ros2/namespaces.sh` makes one, and a link to it.

use super::simulate::jpegs;
use super::{Done, domain_id};
use ros2_client::Publisher;
use slipbound::sensor::Sensor;
use slipbound_rig::sensors;
use slipbound_ros2::error::Error;
use slipbound_ros2::msg::{CompressedImage, HandReport, Header, SlipReport, Time};
use slipbound_ros2::ros::{Inbox, RELIABLE, Ros, SENSOR_DATA, unix_ns};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle, sleep};
use std::time::{Duration, Instant};

/// Longest wait for the first reports, or for reports after an interruption.
const LONGEST_WAIT: Duration = Duration::from_secs(30);

/// Longest wait for reports after a link was down: a participant that was given up is announced every 10 s.
const LONGEST_RETURN: Duration = Duration::from_secs(120);

/// Time after the first reports before the measurement begins.
const SETTLE: Duration = Duration::from_secs(2);

/// Time for which one end is absent.
const AWAY: Duration = Duration::from_secs(2);

/// Longest travel time of data sent before a link went down.
const UNDERWAY: Duration = Duration::from_millis(300);

/// The arguments of `slipbound-ros2 measure`.
#[derive(Debug, clap::Args)]
pub struct Measure {
    /// Fingers, 1 to 4
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u8).range(1..=4))]
    fingers: u8,
    /// Pictures per second and finger
    #[arg(long, value_name = "HZ", default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..=250))]
    rate_hz: u32,
    /// For how long, s
    #[arg(long, value_name = "S", default_value_t = 20)]
    seconds: u64,
    /// What is simulated
    #[arg(long, default_value = "shear?distance_mm=3&grid=fast&rest_frames=24&jpeg_quality=75")]
    scene: String,
    /// Network namespace that the node runs in
    #[arg(long, value_name = "NAME")]
    node_netns: Option<String>,
    /// Network device to the node, here: taken down and up again
    #[arg(long, value_name = "DEVICE")]
    link: Option<String>,
    /// For how long the link is down, s; may be given again
    #[arg(long, value_name = "S", requires = "link", default_value = "2")]
    down_s: Vec<u64>,
}

/// Reports received of one finger: stamp and arrival, ns since 1970.
type Arrivals = Arc<Mutex<Vec<(u64, u64)>>>;

/// Readers of the reports, on threads of their own.
struct Readers {
    stop: Arc<AtomicBool>,
    fingers: Vec<Arrivals>,
    hand: Arrivals,
    threads: Vec<JoinHandle<()>>,
}

impl Readers {
    fn start(ros: &mut Ros, fingers_count: u8) -> Result<Self, Error> {
        let stop = Arc::new(AtomicBool::new(false));
        let (mut fingers, mut threads) = (Vec::new(), Vec::new());
        for i in 0..fingers_count {
            let inbox: Inbox<SlipReport> = ros.inbox(&format!("/slipbound/{}/report", name(i)), &RELIABLE)?;
            let arrivals = Arrivals::default();
            threads.push(thread::spawn(reader(inbox, stop.clone(), arrivals.clone(), |report| report.header.stamp)));
            fingers.push(arrivals);
        }
        let (inbox, hand): (Inbox<HandReport>, _) =
            (ros.inbox("/slipbound/hand/report", &RELIABLE)?, Arrivals::default());
        threads.push(thread::spawn(reader(inbox, stop.clone(), hand.clone(), |report| report.header.stamp)));
        Ok(Readers { stop, fingers, hand, threads })
    }

    fn forget(&self) {
        for arrivals in self.fingers.iter().chain([&self.hand]) {
            arrivals.lock().unwrap_or_else(PoisonError::into_inner).clear();
        }
    }

    /// Whether nothing has arrived since the last reset.
    fn is_silent(&self) -> bool {
        self.fingers.iter().all(|a| a.lock().unwrap_or_else(PoisonError::into_inner).is_empty())
    }

    /// Waits until every finger has reported again; returns the time since `since`.
    fn await_all(&self, since: Instant, longest: Duration, stop: &AtomicBool) -> Result<Duration, String> {
        self.forget();
        while since.elapsed() < longest && !stop.load(Ordering::Relaxed) {
            if self.fingers.iter().all(|a| !a.lock().unwrap_or_else(PoisonError::into_inner).is_empty()) {
                return Ok(since.elapsed());
            }
            sleep(Duration::from_millis(2));
        }
        Err(format!("expected reports of every finger within {} s, got none of some", longest.as_secs()))
    }
}

impl Drop for Readers {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            let _ = thread.join(); // what it has read is kept
        }
    }
}

fn reader<M: slipbound_ros2::msg::TopicType>(
    mut inbox: Inbox<M>,
    stop: Arc<AtomicBool>,
    arrivals: Arrivals,
    stamp: fn(&M) -> Time,
) -> impl FnOnce() + Send {
    move || {
        while !stop.load(Ordering::Relaxed) {
            while let Ok(Some(received)) = inbox.take() {
                let stamp_ns = stamp(&received.message).ns().unwrap_or(0);
                arrivals.lock().unwrap_or_else(PoisonError::into_inner).push((stamp_ns, unix_ns()));
            }
            inbox.wait(Duration::from_millis(20));
        }
    }
}

/// Cameras on a thread of their own; they end when this is dropped.
struct Cameras {
    stop: Arc<AtomicBool>,
    /// Stamps of the images sent, each by every finger, ns since 1970.
    sent: Arc<Mutex<Vec<u64>>>,
    thread: Option<JoinHandle<()>>,
}

impl Cameras {
    fn start(domain_id: u16, fingers_count: u8, rate_hz: u32, jpegs: Arc<Vec<Vec<u8>>>) -> Result<Self, Error> {
        let mut ros = Ros::new("/", "slipbound_measure_cameras", domain_id)?;
        let publishers: Result<Vec<Publisher<CompressedImage>>, _> =
            (0..fingers_count).map(|i| ros.publisher(&format!("/measure/{}", name(i)), &SENSOR_DATA)).collect();
        let publishers = publishers?;
        let (stop, sent) = (Arc::new(AtomicBool::new(false)), Arc::new(Mutex::new(Vec::new())));
        let (stops, sends) = (stop.clone(), sent.clone());
        let thread = thread::spawn(move || {
            let _joined = ros; // it leaves the network when this thread ends
            let mut due = Instant::now();
            for jpeg in jpegs.iter().cycle() {
                if stops.load(Ordering::Relaxed) {
                    return;
                }
                let stamp_ns = unix_ns();
                for publisher in &publishers {
                    let header = Header { stamp: Time::from_ns(stamp_ns), frame_id: "measure".into() };
                    let image = CompressedImage { header, format: "jpeg".into(), data: jpeg.clone() };
                    let _ = publisher.publish(image); // an image that is not sent counts as lost
                }
                sends.lock().unwrap_or_else(PoisonError::into_inner).push(stamp_ns);
                due += Duration::from_secs(1) / rate_hz;
                sleep(due.saturating_duration_since(Instant::now()));
            }
        });
        Ok(Cameras { stop, sent, thread: Some(thread) })
    }
}

impl Drop for Cameras {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// The node's process; killed when dropped.
struct NodeProcess(Child);

impl NodeProcess {
    fn start(config: &Path, netns: Option<&str>) -> std::io::Result<Self> {
        let program = std::env::current_exe()?;
        let mut command = match netns {
            None => Command::new(program),
            Some(name) => {
                let mut command = Command::new("ip");
                command.args(["netns", "exec", name]).arg(program);
                command
            }
        };
        Ok(NodeProcess(command.arg("node").arg(config).stdout(Stdio::null()).spawn()?))
    }
}

impl Drop for NodeProcess {
    fn drop(&mut self) {
        let _ = self.0.kill(); // it may have ended by itself
        let _ = self.0.wait();
    }
}

/// A network device of this namespace; up again when dropped.
struct Link<'a>(&'a str);

impl Link<'_> {
    fn set(&self, to: &str) -> Result<(), String> {
        let asked = Command::new("ip").args(["link", "set", self.0, to]).status();
        match asked.map_err(|e| format!("cannot run `ip`: {e}"))? {
            status if status.success() => Ok(()),
            status => Err(format!("`ip link set {} {to}`: {status}", self.0)),
        }
    }
}

impl Drop for Link<'_> {
    fn drop(&mut self) {
        if let Err(e) = self.set("up") {
            eprintln!("slipbound-ros2: {e}");
        }
    }
}

/// CPU load and build profile, without which the figures are meaningless.
fn machine_load() -> String {
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    let over_1_min = load.split(' ').next().filter(|word| !word.is_empty()).unwrap_or("unknown");
    let cores = std::thread::available_parallelism().map_or("unknown".into(), |count| count.to_string());
    let build = if cfg!(debug_assertions) { "development" } else { "release" };
    format!("cores {cores}, load over the last minute {over_1_min}, {build} build")
}

fn name(finger: u8) -> &'static str {
    ["first", "second", "third", "fourth"][usize::from(finger)]
}

impl Measure {
    /// Measures and prints the table.
    pub fn run(&self, stop: &AtomicBool) -> Done {
        let domain_id = domain_id()?;
        let (sensor, jpegs) = jpegs(&self.scene).map_err(Error::from)?;
        let jpegs = Arc::new(jpegs);
        let most_bytes = jpegs.iter().map(Vec::len).max().unwrap_or(0);
        let folder = tempfile::tempdir()?;
        let config = self.write_config(folder.path(), domain_id, &sensor)?;
        let mut ros = Ros::new("/", "slipbound_measure", domain_id)?;
        let readers = Readers::start(&mut ros, self.fingers)?;
        let cameras = Cameras::start(domain_id, self.fingers, self.rate_hz, jpegs.clone())?;
        let node = NodeProcess::start(&config, self.node_netns.as_deref())?;
        readers.await_all(Instant::now(), LONGEST_WAIT, stop)?;
        sleep(SETTLE);
        let from_ns = unix_ns();
        sleep(Duration::from_secs(self.seconds));
        let until_ns = unix_ns();
        sleep(Duration::from_millis(500)); // the last ones are on their way
        println!("{} fingers at {} Hz, JPEGs of at most {} kB", self.fingers, self.rate_hz, most_bytes / 1000);
        println!("{}", machine_load());
        println!("| of | pictures sent | reports | per second | lost | p50 ms | p99 ms | worst ms |");
        println!("|---|---|---|---|---|---|---|---|");
        let is_within = |stamp_ns: u64| (from_ns..until_ns).contains(&stamp_ns);
        let sent =
            cameras.sent.lock().unwrap_or_else(PoisonError::into_inner).iter().filter(|ns| is_within(**ns)).count();
        let mut all_ns = Vec::new();
        for (i, arrivals) in (0..self.fingers).zip(&readers.fingers) {
            let arrivals = arrivals.lock().unwrap_or_else(PoisonError::into_inner);
            let took = arrivals.iter().filter(|(stamp_ns, _)| is_within(*stamp_ns));
            let took_ns: Vec<u64> = took.map(|(stamp_ns, at_ns)| at_ns.saturating_sub(*stamp_ns)).collect();
            self.row(name(i), sent, &took_ns);
            all_ns.extend(took_ns);
        }
        self.row("all", sent * usize::from(self.fingers), &all_ns);
        let hand = readers.hand.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let hand_count = hand.iter().filter(|(_, at_ns)| is_within(*at_ns)).count();
        println!("\nreports of the hand: {:.1} a second", hand_count as f64 / self.seconds as f64);

        if let Some(device) = &self.link {
            for down_s in &self.down_s {
                Self::cut(&Link(device), Duration::from_secs(*down_s), &readers, stop)?;
            }
        }
        drop(node);
        sleep(AWAY);
        let began = Instant::now();
        let _node = NodeProcess::start(&config, self.node_netns.as_deref())?;
        let back = readers.await_all(began, LONGEST_WAIT, stop)?;
        println!(
            "node killed for {} s: all fingers report {:.2} s after its start",
            AWAY.as_secs(),
            back.as_secs_f64()
        );
        drop(cameras);
        sleep(AWAY);
        readers.forget();
        let began = Instant::now();
        let _cameras = Cameras::start(domain_id, self.fingers, self.rate_hz, jpegs)?;
        let back = readers.await_all(began, LONGEST_WAIT, stop)?;
        println!(
            "cameras away for {} s: all fingers report {:.2} s after their start",
            AWAY.as_secs(),
            back.as_secs_f64()
        );
        Ok(())
    }

    /// Takes the link down for this time and reports when reports arrive again. It is an error if they never stopped.
    fn cut(link: &Link<'_>, down: Duration, readers: &Readers, stop: &AtomicBool) -> Done {
        link.set("down")?;
        sleep(UNDERWAY);
        readers.forget();
        sleep(down.saturating_sub(UNDERWAY));
        if !readers.is_silent() {
            return Err(format!("expected no report while `{}` is down, got some: they go another way", link.0).into());
        }
        link.set("up")?;
        let back = readers.await_all(Instant::now(), LONGEST_RETURN, stop)?;
        println!("link down for {} s: all fingers report {:.2} s after it is up", down.as_secs(), back.as_secs_f64());
        Ok(())
    }

    fn row(&self, of: &str, sent: usize, took_ns: &[u64]) {
        let mut took_ns = took_ns.to_vec();
        took_ns.sort_unstable();
        let quantile_ms = |fraction: f64| {
            let at = (took_ns.len().saturating_sub(1) as f64 * fraction).round() as usize;
            took_ns.get(at).copied().unwrap_or(0) as f64 * 1e-6
        };
        let [p50, p99, worst] = [0.5, 0.99, 1.0].map(quantile_ms);
        let (count, lost) = (took_ns.len(), sent.saturating_sub(took_ns.len()));
        let rate_hz = count as f64 / self.seconds as f64;
        println!("| {of} | {sent} | {count} | {rate_hz:.1} | {lost} | {p50:.1} | {p99:.1} | {worst:.1} |");
    }

    fn write_config(
        &self,
        folder: &Path,
        domain_id: u16,
        sensor: &Sensor,
    ) -> Result<PathBuf, Box<dyn std::error::Error>> {
        std::fs::write(folder.join("sensor.toml"), sensors::to_toml(sensor)?)?;
        let mut hand = String::from("name = \"measured\"\n");
        let mut node = format!("hand = \"hand.toml\"\ndomain_id = {domain_id}\n");
        for i in 0..self.fingers {
            let (name, side) = (name(i), if i % 2 == 0 { "left" } else { "right" });
            write!(
                hand,
                "[[fingers]]\nname = \"{name}\"\nserial = \"{i}\"\nside = \"{side}\"\nsensor = \"sensor.toml\"\n"
            )?;
            write!(node, "[[fingers]]\nname = \"{name}\"\nimage_topic = \"/measure/{name}\"\n")?;
        }
        std::fs::write(folder.join("hand.toml"), hand)?;
        let path = folder.join("node.toml");
        std::fs::write(&path, node)?;
        Ok(path)
    }
}
