//! Over real loopback sockets and a pseudo-terminal. Slow and few: the protocols are tested in lock-step.

use slipbound::plant::Plant;
use slipbound::port::{DriverEvent, GripCommand, Gripper, GripperState, Jaws, WristCommand, WristMotion};
use slipbound_rig::emulator::{Block, by_name, serve_tcp};
use slipbound_rig::gripper::{self, Device, Error, Request};
use slipbound_rig::wrist;
use std::io::Write;
use std::net::{SocketAddr, TcpListener};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{JoinHandle, sleep, spawn};
use std::time::{Duration, Instant};

/// A block that others may look at.
#[derive(Clone)]
struct Shown(Arc<Mutex<Block>>);

impl Shown {
    fn new() -> Self {
        Shown(Arc::new(Mutex::new(Block::new(50.0))))
    }

    fn look<T>(&self, at: impl Fn(&Block) -> T) -> T {
        at(&self.0.lock().expect("no panic"))
    }
}

impl Plant for Shown {
    fn width_mm(&self) -> Option<f64> {
        self.look(Block::width_mm)
    }

    fn press(&mut self, force_n: f64) {
        self.0.lock().expect("no panic").press(force_n);
    }

    fn place_wrist(&mut self, angle_rad: f64, lowered_mm: f64) {
        self.0.lock().expect("no panic").place_wrist(angle_rad, lowered_mm);
    }

    fn advance_to(&mut self, now_ns: u64) {
        self.0.lock().expect("no panic").advance_to(now_ns);
    }
}

/// An emulator on a port of its own, until dropped.
struct Server {
    address: SocketAddr,
    plant: Shown,
    go_on: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    fn at(address: &str, name: &str, faults: &str) -> Self {
        let listener = TcpListener::bind(address).expect("a port");
        let mut emulator = by_name(name).expect("a name").with_faults(faults.parse().expect("faults"));
        let (plant, go_on) = (Shown::new(), Arc::new(AtomicBool::new(true)));
        let (address, mut between, running) = (listener.local_addr().expect("bound"), plant.clone(), go_on.clone());
        let thread = spawn(move || {
            serve_tcp(listener, &mut emulator, &mut between, |_| running.load(Ordering::Relaxed)).expect("serves");
        });
        Server { address, plant, go_on, thread: Some(thread) }
    }

    fn new(name: &str, faults: &str) -> Self {
        Server::at("127.0.0.1:0", name, faults)
    }

    fn open(&self, scheme: &str) -> Device {
        let address = format!("{scheme}://{}?part_width_mm=50&lowering=allow", self.address);
        Device::open(&address, None).expect("opens")
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.go_on.store(false, Ordering::Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

fn grip(device: &mut Device, force_n: f64) -> Result<(), Error> {
    device.request(Request::Grip(GripCommand::Hold { force_n }))
}

fn until(device: &mut Device, wanted: impl Fn(&Result<GripperState, Error>) -> bool) -> Result<GripperState, Error> {
    let from = Instant::now();
    loop {
        let state = device.state();
        if wanted(&state) {
            return state;
        }
        assert!(from.elapsed() < Duration::from_secs(15), "still {state:?}");
        sleep(Duration::from_millis(2));
    }
}

fn holding(server: &Server, scheme: &str, force_n: f64) -> Device {
    let mut device = server.open(scheme);
    grip(&mut device, force_n).expect("taken over");
    until(&mut device, |state| state.as_ref().is_ok_and(|state| state.jaws == Jaws::Holding)).expect("holds");
    until(&mut device, |_| (server.plant.look(|block| block.force_n) - force_n).abs() < 0.5).expect("there");
    device
}

const PROTOCOLS: [&str; 4] = ["wsg50", "gcl", "robotiq", "line"];

/// All at the same time: most of it is waiting.
fn side_by_side(names: &[&str], test: impl Fn(&str) + Sync) {
    std::thread::scope(|scope| {
        for name in names {
            scope.spawn(|| test(name));
        }
    });
}

#[test]
fn every_protocol_grips_over_a_socket_and_leaves_without_letting_go() {
    let grips = |name: &str| {
        let server = Server::new(name, "");
        let mut device = holding(&server, name, 40.0);
        if name != "gcl" {
            grip(&mut device, 60.0).expect("taken over");
            until(&mut device, |_| (server.plant.look(|block| block.force_n) - 60.0).abs() < 0.7).expect("there");
        }
        drop(device);
        sleep(Duration::from_millis(100));
        let mut device = server.open(name);
        let state = until(&mut device, Result::is_ok).expect("there");
        assert_eq!(state.jaws, Jaws::Holding, "{name}: no fast stop after a farewell");
        assert!(server.plant.look(|block| block.force_n) > 39.0);
        device.command(GripCommand::Release).expect("taken over");
        until(&mut device, |_| server.plant.look(|block| block.force_n) == 0.0).expect("there");
    };
    side_by_side(&PROTOCOLS, grips);
}

#[test]
fn a_killed_server_is_told_and_a_new_one_found() {
    let server = Server::new("line", "");
    let address = server.address.to_string();
    let mut device = holding(&server, "line", 20.0);
    drop(server);
    let message = until(&mut device, Result::is_err).expect_err("lost").to_string();
    assert!(message.contains("the link is lost") && message.contains("keeps its force"), "{message}");
    assert!(matches!(grip(&mut device, 30.0), Err(Error::Lost { .. })));
    let server = Server::at(&address, "line", "");
    until(&mut device, Result::is_ok).expect("linked anew");
    assert!(std::iter::from_fn(|| device.next_event()).filter(|event| *event == DriverEvent::Linked).count() == 2);
    sleep(Duration::from_millis(300));
    assert_eq!(server.plant.look(|block| block.force_n), 0.0, "a new link moves nothing");
}

#[test]
fn a_stall_of_5_s_is_told_within_600_ms_no_call_waits_and_the_force_stays() {
    let server = Server::new("wsg50", "stall=5000@4000");
    let mut device = holding(&server, "wsg50", 30.0);
    // A farewell was sent before the link was given up, so no fast stop has latched when the gripper wakes.
    let mut longest = Duration::ZERO;
    let mut told = None;
    let from = Instant::now();
    let mut least_n = f64::INFINITY;
    while from.elapsed() < Duration::from_secs(9) {
        let call = Instant::now();
        if device.state().is_err() {
            told.get_or_insert(from.elapsed());
        }
        longest = longest.max(call.elapsed());
        least_n = least_n.min(server.plant.look(|block| block.force_n));
        sleep(Duration::from_millis(2));
    }
    assert!(told.is_some(), "the stall was told");
    assert!(longest < Duration::from_millis(250), "a call took {longest:?}");
    assert!(least_n > 29.0, "{least_n}");
    let state = until(&mut device, |state| state.as_ref().is_ok_and(|state| state.jaws != Jaws::Unknown));
    assert_eq!(state.expect("there").jaws, Jaws::Holding);
    grip(&mut device, 40.0).expect("taken over");
    until(&mut device, |_| (server.plant.look(|block| block.force_n) - 40.0).abs() < 0.5).expect("there");
}

#[test]
fn a_power_cycle_closes_the_link_and_the_force_stays() {
    let server = Server::new("wsg50", "power-cycle@4000");
    let mut device = holding(&server, "wsg50", 30.0);
    until(&mut device, Result::is_err).expect_err("lost");
    let state = until(&mut device, Result::is_ok).expect("linked anew");
    assert_eq!(state.jaws, Jaws::Unknown);
    assert!(matches!(grip(&mut device, 30.0), Err(Error::NotHomed { .. } | Error::NotReady { .. })));
    assert!(server.plant.look(|block| block.force_n) > 29.0);
}

#[test]
fn who_accepts_but_says_nothing_or_is_not_there_is_no_gripper() {
    let mute = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = mute.local_addr().expect("bound");
    side_by_side(&PROTOCOLS, |scheme| {
        let from = Instant::now();
        let message = Device::open(&format!("{scheme}://{address}"), None).err().expect("refused").to_string();
        assert!(message.contains(&address.to_string()) && message.contains("expected a sign of life"), "{message}");
        assert!(from.elapsed() < Duration::from_secs(4));
    });
    drop(mute);
    let message = Device::open(&format!("wsg50://{address}"), None).err().expect("refused").to_string();
    assert!(message.contains("expected a gripper, cannot connect: "), "{message}");
    let message = wrist::open(&format!("line://{address}")).err().expect("refused").to_string();
    assert!(message.contains("expected a wrist, cannot connect: "), "{message}");
}

/// A device that says the same lines again and again, to everyone.
fn says(lines: &'static str) -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("bound");
    spawn(move || {
        for link in listener.incoming() {
            let mut link = link.expect("a link");
            spawn(move || {
                while link.write_all(lines.as_bytes()).is_ok() {
                    sleep(Duration::from_millis(10))
                }
            });
        }
    });
    address
}

#[test]
fn who_speaks_another_version_or_does_not_say_where_its_wrist_is_is_not_opened() {
    let gripper = |lines| Device::open(&format!("line://{}", says(lines)), None).err().expect("refused").to_string();
    let wrist = |lines| wrist::open(&format!("line://{}", says(lines))).err().expect("refused").to_string();
    let other = "HELLO slipbound-line 2\nGRIPPER jaws open\nWRIST angle_rad 0 lowered_mm 0\n";
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let message = gripper(other);
            assert!(message.contains("expected HELLO to be done, got version 2, expected 1"), "{message}");
        });
        scope.spawn(|| {
            // Its state may be told in other lines.
            let message = gripper("HELLO slipbound-line 2\nJAWS open\n");
            assert!(message.contains("expected HELLO to be done, got version 2, expected 1"), "{message}");
        });
        scope.spawn(|| {
            let message = gripper("HELLO slipbound-line 1\nGRIPPER jaws gripped force_n 10\n");
            assert!(message.contains("expected jaws to be unknown, open,"), "{message}");
            assert!(message.contains("got `gripped`"), "{message}");
        });
        scope.spawn(|| {
            let message = wrist(other);
            assert!(message.contains("expected version 1 of the line protocol, got 2"), "{message}");
        });
        scope.spawn(|| {
            let message = wrist("HELLO slipbound-line 1\nGRIPPER jaws open\nWRIST lowered_mm 0 moving 0\n");
            assert!(message.contains("every WRIST line, got `WRIST lowered_mm 0 moving 0`"), "{message}");
        });
        let message = wrist("HELLO slipbound-line 1\nGRIPPER jaws open\n");
        assert!(message.contains("got no WRIST line"), "{message}");
    });
}

#[test]
fn a_wrist_turns_over_a_socket_and_pauses_when_nobody_renews() {
    let server = Server::new("line", "");
    let mut wrist = wrist::open(&format!("line://{}", server.address)).expect("opens");
    let turn = WristMotion::Turn { rate_rad_per_s: 0.3, most_rad: 1.0 };
    wrist.command(WristCommand::new(turn)).expect("taken over");
    sleep(Duration::from_millis(600));
    let state = wrist.poll().expect("there");
    assert!(!state.moving && (0.05..0.07).contains(&state.angle_rad), "{state:?}");
    assert!((server.plant.look(|block| block.angle_rad) - state.angle_rad).abs() < 1e-5);
    let mut dry = wrist::open("dry").expect("opens");
    dry.command(WristCommand::new(turn)).expect("taken over");
    assert!(dry.poll().expect("there").moving);
    assert!(dry.command(WristCommand::new(WristMotion::Turn { rate_rad_per_s: f64::NAN, most_rad: 1.0 })).is_err());
}

#[test]
fn addresses_that_are_none_are_told_apart() {
    for (address, said) in [
        ("wsg50:1000", "there is no `://` in it"),
        ("wsg5://x:1000", "got the protocol `wsg5`"),
        ("wsg50://x", "expected HOST:PORT, got `x`"),
        ("wsg50://:1000", "expected HOST:PORT, got `:1000`"),
        ("gcl:///dev/ttyS0", "expected HOST:PORT"),
        ("line://x:99999", "expected HOST:PORT"),
        ("dry?most=3", "unknown key `most`"),
    ] {
        let message = gripper::open(address, None).err().expect("refused").to_string();
        assert!(message.contains(said), "{address}: {message}");
    }
    let message = wrist::open("wsg50://x:1").err().expect("refused").to_string();
    assert_eq!(message, "wsg50://x:1: expected line://HOST:PORT or dry");
    let mut dry = gripper::open("dry", None).expect("opens");
    dry.command(GripCommand::Hold { force_n: 12.0 }).expect("taken over");
    assert_eq!(dry.poll().expect("there").target_n, Some(12.0));
    assert!(dry.command(GripCommand::Hold { force_n: f64::NAN }).is_err());
}

#[cfg(all(feature = "serial", target_os = "linux"))]
#[test]
fn a_2f85_grips_over_a_pseudo_terminal() {
    use slipbound_rig::emulator::serve_link;
    use slipbound_rig::link::PseudoTerminal;

    let mut terminal = PseudoTerminal::new().expect("a pseudo-terminal");
    let address = format!("robotiq://{}?lowering=allow", terminal.device.display());
    let (plant, go_on) = (Shown::new(), Arc::new(AtomicBool::new(true)));
    let (mut between, running) = (plant.clone(), go_on.clone());
    let server = spawn(move || {
        let mut emulator = by_name("robotiq-rtu").expect("a name").with_faults("".parse().expect("none"));
        let go_on = |_: &mut _| running.load(Ordering::Relaxed);
        serve_link(&mut terminal.link, &mut emulator, &mut between, go_on).expect("serves");
    });
    let mut device = Device::open(&address, None).expect("opens");
    for force_n in [40.0, 60.0, 30.0] {
        grip(&mut device, force_n).expect("taken over");
        until(&mut device, |_| (plant.look(|block| block.force_n) - force_n).abs() < 0.7).expect("there");
    }
    let state = until(&mut device, |state| state.as_ref().is_ok_and(|state| state.jaws == Jaws::Holding));
    assert!(state.expect("there").target_n.is_some_and(|target_n| (target_n - 30.0).abs() < 0.43));
    drop(device);
    go_on.store(false, Ordering::Relaxed);
    server.join().expect("no panic");
    assert!(plant.look(|block| block.force_n) > 29.0);
}
