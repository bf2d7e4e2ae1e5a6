//! The commands `gripper` and `emulate` from outside, over loopback.

use crate::program::{command, signal};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpListener;
use std::process::{Child, ChildStdout, Stdio};
use std::thread::{self, sleep};
use std::time::{Duration, Instant};

/// An emulator in a process of its own, and its address.
struct Emulator {
    process: Child,
    out: BufReader<ChildStdout>,
    address: String,
}

impl Emulator {
    fn new(arguments: &[&str]) -> Self {
        let arguments = [&["emulate"], arguments].concat();
        let mut process = command(&arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("runs");
        let mut out = BufReader::new(process.stdout.take().expect("piped"));
        let mut address = String::new();
        out.read_line(&mut address).expect("an address");
        Emulator { process, out, address: address.trim().into() }
    }

    /// The outcome of a gripper command: exit code, standard output, standard error.
    fn gripper(&self, query: &str, action: &[&str]) -> (Option<i32>, String, String) {
        let address = format!("{}{query}", self.address);
        let output = command(&[&["gripper", &address], action].concat()).output().expect("runs");
        let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
        (output.status.code(), text(output.stdout), text(output.stderr))
    }

    /// Ends it by Ctrl-C; returns its last output.
    fn end(mut self) -> String {
        signal(&self.process, "-INT");
        let mut rest = String::new();
        self.out.read_to_string(&mut rest).expect("text");
        assert!(self.process.wait().expect("ends").success());
        rest
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        let _ = self.process.kill(); // it may have ended already
        let _ = self.process.wait();
    }
}

const WIDE: &str = "?part_width_mm=50";

#[test]
fn a_block_is_grasped_checked_and_released() {
    let emulator = Emulator::new(&["wsg50"]);
    assert!(emulator.address.starts_with("wsg50://127.0.0.1:"), "{}", emulator.address);
    let (code, out, err) = emulator.gripper(WIDE, &["grasp", "20"]);
    let held = "jaws holding, opening 50.00 mm, force 19.";
    assert!(code == Some(0) && (out.contains(held) || out.contains("force 20.0")), "{code:?} {out} {err}");
    assert!(out.contains("asked for 20.00 N per finger"), "{out}");
    let (code, _, err) = emulator.gripper(WIDE, &["grasp", "10"]);
    assert!(code == Some(1) && err.contains("run check-hold"), "{code:?} {err}");
    let (code, out, err) = emulator.gripper(WIDE, &["check-hold"]);
    assert!(code == Some(0) && out.contains("it held on: least force "), "{code:?} {out} {err}");
    assert!(err.contains("force is changed by setting the force limit alone"), "{err}");
    let (code, out, err) = emulator.gripper("", &["release"]);
    assert!(code == Some(0) && out.contains("jaws open, opening 100.00 mm, force 0.00 N"), "{code:?} {out} {err}");
    assert!(emulator.end().contains("at the end: 0.00 N per finger, opening 100.00 mm"));
}

#[test]
fn a_killed_command_leaves_the_force_and_a_fast_stop_that_is_explained() {
    let emulator = Emulator::new(&["wsg50"]);
    let address = format!("{}{WIDE}", emulator.address);
    let mut command = command(&["gripper", &address, "check-hold"]);
    let mut running = command.stdout(Stdio::piped()).spawn().expect("runs");
    let mut lines = BufReader::new(running.stdout.take().expect("piped")).lines();
    for _ in 0..2 {
        lines.next().expect("a line").expect("text");
    }
    running.kill().expect("kill -9");
    running.wait().expect("ends");
    sleep(Duration::from_millis(200));
    let (code, out, _) = emulator.gripper(WIDE, &["status"]);
    assert!(code == Some(0) && out.contains("jaws stopped, opening 50.00 mm, force "), "{out}");
    let (code, _, err) = emulator.gripper(WIDE, &["grasp", "40"]);
    assert!(code == Some(1) && err.contains("latched fast stop") && err.contains("acknowledge"), "{err}");
    let (code, _, err) = emulator.gripper(WIDE, &["acknowledge"]);
    assert_eq!(code, Some(0), "{err}");
    let (code, out, err) = emulator.gripper(WIDE, &["grasp", "40"]);
    assert!(code == Some(0) && out.contains("jaws holding"), "{out} {err}");
    let end = emulator.end();
    assert!(end.contains("at the end: 39.") || end.contains("at the end: 40.00"), "{end}");
}

#[test]
fn the_other_protocols_grasp_too() {
    let grasps = |name: &str| {
        let emulator = Emulator::new(&[name]);
        let (code, out, err) = emulator.gripper(WIDE, &["grasp", "30"]);
        assert!(code == Some(0) && out.contains("jaws holding, opening 5"), "{name} {code:?} {out} {err}");
        let (code, out, err) = emulator.gripper("", &["release"]);
        assert!(code == Some(0) && out.contains("jaws open"), "{name} {code:?} {out} {err}");
        assert!(emulator.end().contains("at the end: 0.00 N"), "{name}");
    };
    // All at the same time: most of it is waiting for jaws.
    thread::scope(|scope| {
        for name in ["gcl", "robotiq", "line"] {
            scope.spawn(move || grasps(name));
        }
    });
}

#[test]
fn a_gripper_that_refuses_or_is_silent_exits_with_1_and_its_reason() {
    let emulator = Emulator::new(&["wsg50", "--fail", "refuse-force"]);
    let (code, _, err) = emulator.gripper(WIDE, &["grasp", "30"]);
    assert!(code == Some(1) && err.contains("got status 28, out of range"), "{err}");
    let emulator = Emulator::new(&["wsg50", "--fail", "stall=20000@0"]);
    let from = Instant::now();
    let (code, _, err) = emulator.gripper(WIDE, &["status"]);
    assert!(code == Some(1) && err.contains("expected a sign of life every 500 ms"), "{err}");
    assert!(from.elapsed() < Duration::from_secs(6));
}

#[test]
fn faults_are_taken_from_standard_input_while_it_serves() {
    let mut emulator = Emulator::new(&["wsg50", "--fail-stdin"]);
    let (code, _, err) = emulator.gripper(WIDE, &["grasp", "20"]);
    assert_eq!(code, Some(0), "{err}");
    let stdin = emulator.process.stdin.as_mut().expect("piped");
    stdin.write_all(b"banana\nfast-stop\n").expect("taken");
    let until = Instant::now() + Duration::from_secs(10);
    while !emulator.gripper(WIDE, &["status"]).1.contains("jaws stopped") {
        assert!(Instant::now() < until, "it never stopped");
    }
    let mut said = String::new();
    BufReader::new(emulator.process.stderr.take().expect("piped")).read_line(&mut said).expect("text");
    assert!(said.contains("standard input: expected faults") && said.contains("got `banana`"), "{said}");
    assert!(emulator.end().contains("at the end: 20.00 N per finger, opening 50.00 mm, the block is held"));
}

/// A script that continues after `grasp` assumes that it holds something.
#[test]
fn a_grasp_of_nothing_is_a_failure() {
    let grasps = |arguments: &[&str], state: &str, got: &str| {
        // Slow jaws, so that a stop finds them on their way however busy the computer is.
        let slow = if arguments[0] == "robotiq" { 20 } else { 10 };
        let settings = format!("?part_width_mm=50&speed_mm_per_s={slow}");
        let (code, out, err) = Emulator::new(arguments).gripper(&settings, &["grasp", "30"]);
        assert!(out.contains(state), "{arguments:?}: {out} {err}");
        let expected = "expected an object held with 30 N per finger, got ";
        assert!(code == Some(1) && err.contains(&format!("{expected}{got}")), "{arguments:?}: {code:?} {err}");
    };
    // All at the same time: most of it is waiting for jaws.
    thread::scope(|scope| {
        for name in ["wsg50", "gcl", "robotiq", "line"] {
            scope.spawn(move || grasps(&[name, "--width", "0"], "jaws nothing", "jaws that closed on nothing"));
        }
        scope.spawn(|| grasps(&["wsg50", "--fail", "fast-stop@4000"], "jaws stopped", "jaws that have stopped"));
    });
}

#[test]
fn invalid_arguments_exit_with_2_and_an_absent_gripper_with_1() {
    for (arguments, code, said) in [
        (&["gripper", "wsg5://x:1", "status"][..], 2, "got the protocol `wsg5`"),
        (&["gripper", "dry?most=3", "status"], 2, "did you mean `most_n`?"),
        (&["gripper", "dry", "--config", "missing.toml", "status"], 2, "missing.toml: cannot read"),
        (&["gripper", "dry", "grasp", "nan"], 2, "expected a force from 5 N to 80 N per finger, got NaN"),
        (&["gripper", "dry", "grasp", "inf"], 2, "expected a force from 5 N to 80 N per finger, got inf"),
        (&["gripper", "dry", "check-hold", "--low", "nan"], 2, "expected two forces in N per finger"),
        (&["gripper", "dry", "check-hold", "--low", "30", "--high", "20"], 2, "got 30 and 20"),
        (&["gripper", "wsg50://127.0.0.1:1", "status"], 1, "expected a gripper, cannot connect"),
        (&["emulate", "wsg50", "--fail", "banana"], 2, "got `banana`"),
        (&["emulate", "wsg51"], 2, "possible values: wsg50, gcl, robotiq, robotiq-rtu, line"),
        (&["emulate", "wsg50", "--width", "-3"], 2, "-3"),
    ] {
        let output = command(arguments).output().expect("runs");
        let err = String::from_utf8(output.stderr).expect("UTF-8");
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {err}");
        assert!(err.contains(said), "no `{said}` in {err}");
    }
}

/// A recording, in a folder, of a finger that is pressed for this long.
fn pressed_finger(folder: &std::path::Path, hold_s: u32) -> (String, String) {
    let clip = folder.join("clip").display().to_string();
    let scene = format!("press?rest_frames=30&hold_s={hold_s}&grid=fast&camera=gelsight_mini");
    assert!(command(&["simulate", &scene, "-o", &clip]).output().expect("runs").status.success());
    let sensor = format!("{clip}/sensor.toml");
    (clip, sensor)
}

/// With a stopped terminal, or a reader that does not read: it is ended by SIGTERM like any other, and leaves its page.
#[cfg(target_os = "linux")]
#[test]
fn a_terminal_that_takes_nothing_keeps_no_hold_from_its_end() {
    use std::io::Write;
    use std::os::unix::net::UnixStream;
    let folder = tempfile::tempdir().expect("a folder");
    let (clip, sensor) = pressed_finger(folder.path(), 10);
    let (mut full, unread) = UnixStream::pair().expect("a pair of sockets");
    full.set_nonblocking(true).expect("set");
    while full.write(&[b'x'; 512]).or_else(|_| full.write(b"x")).is_ok() {}
    full.set_nonblocking(false).expect("set");
    let run = folder.path().join("run").display().to_string();
    let mut hold = command(&["hold", &clip, "--sensor", &sensor, "--gripper", "dry", "-o", &run])
        .stdout(std::os::fd::OwnedFd::from(full.try_clone().expect("cloned")))
        .stderr(std::os::fd::OwnedFd::from(full))
        .spawn()
        .expect("runs");
    sleep(Duration::from_secs(4));
    signal(&hold, "-TERM");
    let from = Instant::now();
    let ended = loop {
        match hold.try_wait().expect("waits") {
            None if from.elapsed() < Duration::from_secs(20) => sleep(Duration::from_millis(20)),
            ended => break ended,
        }
    };
    if ended.is_none() {
        hold.kill().expect("killed");
    }
    assert_eq!(ended.expect("ended").code(), Some(1));
    assert!(std::path::Path::new(&run).join("report.html").is_file());
    drop(unread);
}

/// A gripper behind the line protocol that holds for two seconds after a grasp, and then reports this. At the end of the
/// link it returns how many grasps it was told, the first and later ones.
fn holding_for_two_seconds(then: &'static str) -> (String, thread::JoinHandle<[u32; 2]>) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = format!("line://{}", listener.local_addr().expect("an address"));
    let server = thread::spawn(move || {
        let (mut link, _) = listener.accept().expect("a client");
        link.write_all(b"HELLO slipbound-line 1\n").expect("taken");
        link.set_nonblocking(true).expect("set");
        let (mut lines, mut buffer, mut grasped, mut grasps_count) = (String::new(), [0; 512], None, [0; 2]);
        loop {
            let jaws = match grasped.map(|at: Instant| at.elapsed() > Duration::from_secs(2)) {
                Some(false) => "holding force_n 10 target_n 10 opening_mm 30",
                Some(true) => then,
                None => "open force_n 0 opening_mm 100",
            };
            match link.read(&mut buffer) {
                Ok(0) => return grasps_count,
                Ok(count) => lines.push_str(std::str::from_utf8(&buffer[..count]).expect("text")),
                Err(_) => {} // nothing to read
            }
            let mut told = format!("GRIPPER jaws {jaws}\n");
            while let Some((line, rest)) = lines.split_once('\n') {
                if line.contains("GRASP") {
                    grasps_count[usize::from(grasped.is_some())] += 1;
                    grasped.get_or_insert_with(Instant::now);
                }
                told += &format!("ACK {line}\n");
                lines = rest.into();
            }
            let _ = link.write_all(told.as_bytes()); // the client may have left
            sleep(Duration::from_millis(20));
        }
    });
    (address, server)
}

#[test]
fn who_holds_to_the_end_of_the_time_with_half_the_force_has_failed() {
    let folder = tempfile::tempdir().expect("a folder");
    let (clip, sensor) = pressed_finger(folder.path(), 8);
    let (address, server) = holding_for_two_seconds("holding force_n 5 target_n 10 opening_mm 30");
    let run = folder.path().join("run").display().to_string();
    let hold = ["hold", &clip, "--sensor", &sensor, "--gripper", &address, "--for-s", "5", "-o", &run];
    let output = command(&hold).output().expect("runs");
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{told}");
    assert!(told.contains("expected 10.0 N per finger, measured 5.0 N"), "{told}");
    server.join().expect("ends");
}

/// The jaws are opened by another program, and not closed again; or they have closed further just before the end.
#[test]
fn jaws_that_do_not_hold_at_the_end_have_held_nothing_to_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let (clip, sensor) = pressed_finger(folder.path(), 2);
    for (then, why) in [
        ("open force_n 0 opening_mm 100", vec!["expected jaws that hold, got open"]),
        // On a busy machine it lasts long enough to be a fault.
        (
            "closing force_n 0 opening_mm 30",
            vec!["does not report that it holds", "expected jaws that hold, got closing"],
        ),
    ] {
        let (address, server) = holding_for_two_seconds(then);
        let run = folder.path().join(&then[..4]).display().to_string();
        let hold = ["hold", &clip, "--sensor", &sensor, "--gripper", &address, "-o", &run];
        let output = command(&hold).output().expect("runs");
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{told}");
        assert!(why.iter().any(|why| told.contains(why)), "{told}");
        assert_eq!(server.join().expect("ends"), [1, 0], "{then}: {told}");
    }
}

#[test]
fn a_recording_falls_on_nothing_that_is_read_and_on_no_other_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let (clip, sensor) = pressed_finger(folder.path(), 1);
    let notes = folder.path().join("notes.txt").display().to_string();
    std::fs::write(&notes, "mine").expect("written");
    let linked = folder.path().join("linked.mcap").display().to_string();
    std::fs::hard_link(format!("{clip}/frame_000004.jpg"), &linked).expect("linked");
    for path in [format!("{clip}/frame_000003.jpg"), linked, sensor.clone(), notes] {
        let before = std::fs::read(&path).expect("there");
        let written = format!("--record={path}");
        let hold = ["hold", &clip, "--sensor", &sensor, "--gripper", "dry", "--for-s", "0", &written];
        for arguments in [&hold[..], &["record", &clip, "--sensor", &sensor, "-o", &path], &["demo", &written]] {
            // The demo reads none of them, but a file that is not a recording is not overwritten either.
            let output = command(arguments).current_dir(folder.path()).output().expect("runs");
            let err = String::from_utf8(output.stderr).expect("UTF-8");
            let named = err.contains("--record") || err.contains("--output");
            assert!(output.status.code() == Some(2) && named, "{arguments:?}: {:?} {err}", output.status);
        }
        assert_eq!(std::fs::read(&path).expect("there"), before, "{path}");
    }
}

/// A gripper at this address that answers each line with the given text.
fn answering(scheme: &str, mut answer: impl FnMut(&str) -> String + Send + 'static) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = format!("{scheme}://{}", listener.local_addr().expect("an address"));
    thread::spawn(move || {
        let (link, _) = listener.accept().expect("a client");
        for line in BufReader::new(link.try_clone().expect("a second handle")).lines().map_while(Result::ok) {
            let _ = (&link).write_all(answer(&line).as_bytes()); // the client may have left
        }
    });
    address
}

#[test]
fn a_gripper_that_says_why_it_cannot_grip_is_not_waited_for() {
    // Reports idle to every question; a grip fails.
    let address = answering("gcl", |line| {
        match line {
            "POS?" => "POS=110.00\n",
            "FORCE?" => "FORCE=0.00\n",
            "GRIPSTATE?" => "GRIPSTATE=0\n",
            line if line.starts_with("GRIP(") => "ACK GRIP\nERR GRIP 18\n",
            _ => "ACK BYE\n",
        }
        .into()
    });
    let from = Instant::now();
    let output = command(&["gripper", &address, "grasp", "20"]).output().expect("runs");
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{told}");
    assert!(told.contains("expected GRIP to be done, got status 18, command failed"), "{told}");
    assert!(from.elapsed() < Duration::from_secs(15), "it waited {:?}", from.elapsed());
}

#[test]
fn homing_that_does_not_end_a_fault_is_a_failure() {
    let mut activation = 3;
    let address = answering("robotiq", move |line| match line.split_once(' ') {
        Some(("GET", "STA")) => format!("STA {activation}\n"),
        Some(("GET", "FLT")) => "FLT 14\n".into(),
        Some(("GET", name)) => format!("{name} 0\n"),
        _ => {
            activation = if line.starts_with("SET ACT 1") { 3 } else { 0 };
            "ack".into()
        }
    });
    let output = command(&["gripper", &address, "home"]).output().expect("runs");
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(1) && told.contains("expected homed jaws, got"), "{told}");
}
