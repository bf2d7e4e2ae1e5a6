//! The hand and the wrist when processes and links between them fail: `run` with real sockets, emulators that are
//! processes of their own, and between them a line that can be cut, stalled or left half open.
//! `cargo test -p slipbound-cli --test real_time link_faults -- --nocapture` prints the rows of docs/grippers.md.

use crate::program::{command, signal};
use serde_json::Value;
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::{Arc, OnceLock};
use std::thread::{sleep, spawn};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use tempfile::TempDir;

/// Longest time for which a wrist may move on after any fault: its time to live and a little for a busy computer.
const WRIST_MS: u64 = 450;

fn unix_ns() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).expect("after 1970").as_nanos() as u64
}

/// An emulator in a process of its own; killed when dropped.
struct Emulator {
    child: Child,
    place: String,
    log: PathBuf,
}

impl Emulator {
    fn start(name: &str, log: PathBuf, args: &[&str]) -> Self {
        let path = log.to_str().expect("UTF-8");
        let mut child = command(&["emulate", name, "--log", path])
            .args(args)
            .arg("--fail-stdin")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("starts");
        let mut line = String::new();
        BufReader::new(child.stdout.as_mut().expect("piped")).read_line(&mut line).expect("its address");
        let place = line.trim().rsplit('/').next().expect("an address").to_owned();
        Emulator { child, place, log }
    }

    fn fail(&mut self, fault: &str) {
        let stdin = self.child.stdin.as_mut().expect("piped");
        writeln!(stdin, "{fault}").and_then(|()| stdin.flush()).expect("taken");
    }

    fn lines(&self) -> Vec<Value> {
        let text = fs::read_to_string(&self.log).expect("a log");
        let whole = text.rfind('\n').map_or("", |end| &text[..end]);
        whole.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
    }

    fn last(&self, key: &str) -> f64 {
        self.lines().last().and_then(|line| line[key].as_f64()).unwrap_or(0.0)
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

const OPEN: u8 = 0;
const STALLED: u8 = 1;
const CUT: u8 = 2;
/// The far side is told nothing and receives nothing; our side is closed.
const HALF_OPEN: u8 = 3;

/// A line between driver and emulator.
struct Line {
    place: String,
    state: Arc<AtomicU8>,
}

impl Line {
    fn to(far: &str) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let place = listener.local_addr().expect("bound").to_string();
        let (state, far) = (Arc::new(AtomicU8::new(OPEN)), far.to_owned());
        let shared = state.clone();
        spawn(move || {
            for near in listener.incoming().map_while(Result::ok) {
                let Ok(far) = TcpStream::connect(&far) else { continue };
                let again = |stream: &TcpStream| stream.try_clone().expect("a second handle");
                let (near_2, far_2, ours, theirs) = (again(&near), again(&far), shared.clone(), shared.clone());
                spawn(move || carry(near, far, &ours, true));
                spawn(move || carry(far_2, near_2, &theirs, false));
            }
        });
        Line { place, state }
    }

    fn be(&self, state: u8) {
        self.state.store(state, Ordering::Relaxed);
    }
}

fn carry(mut from: TcpStream, mut to: TcpStream, state: &AtomicU8, is_near: bool) {
    from.set_read_timeout(Some(Duration::from_millis(2))).expect("a time");
    let mut bytes = [0; 4096];
    loop {
        match state.load(Ordering::Relaxed) {
            OPEN => {}
            STALLED => {
                sleep(Duration::from_millis(2));
                continue;
            }
            HALF_OPEN => {
                // The near side is closed; the far one stays open and receives nothing more.
                let near = if is_near { &from } else { &to };
                let _ = near.shutdown(std::net::Shutdown::Both);
                while state.load(Ordering::Relaxed) == HALF_OPEN {
                    sleep(Duration::from_millis(20));
                }
                sleep(Duration::from_secs(20));
                return;
            }
            _ => {
                let _ = from.shutdown(std::net::Shutdown::Both);
                let _ = to.shutdown(std::net::Shutdown::Both);
                return;
            }
        }
        match from.read(&mut bytes) {
            Ok(0) => {
                let _ = to.shutdown(std::net::Shutdown::Both);
                return;
            }
            Ok(count) if to.write_all(&bytes[..count]).is_err() => return,
            Ok(_) => {}
            Err(e) if matches!(e.kind(), std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut) => {}
            Err(_) => return,
        }
    }
}

/// A hand that lifts slowly, for ten seconds: it holds an object, and the wrist moves.
struct Lifting {
    run: Child,
    gripper: Emulator,
    wrist: Emulator,
    gripper_line: Line,
    wrist_line: Line,
    folder: PathBuf,
}

impl Lifting {
    /// Frames of a simulated finger that takes hold: made once for all tests.
    fn frames() -> &'static Path {
        static FRAMES: OnceLock<TempDir> = OnceLock::new();
        static LEFT: OnceLock<PathBuf> = OnceLock::new();
        let folder = FRAMES.get_or_init(|| {
            let folder = tempfile::tempdir().expect("a folder");
            let args = ["demo", "--task", "lift", "--fingers", "1", "--set", "height_px=320", "--record", "-o"];
            let run = folder.path().join("frames");
            let made = command(&[]).args(args).arg(run).stdout(Stdio::null()).status().expect("runs");
            assert!(made.success());
            folder
        });
        LEFT.get_or_init(|| folder.path().join("frames/left"))
    }

    fn start(query: &str) -> (TempDir, Self) {
        let frames = Lifting::frames();
        let scratch = tempfile::tempdir().expect("a folder");
        let folder = scratch.path().to_owned();
        let block = ["--width", "66", "--weight", "8", "--mu", "0.6"];
        let gripper = Emulator::start("wsg50", folder.join("gripper.jsonl"), &block);
        let wrist = Emulator::start("line", folder.join("wrist.jsonl"), &["--width", "0"]);
        let (gripper_line, wrist_line) = (Line::to(&gripper.place), Line::to(&wrist.place));
        let settings = folder.join("settings.toml");
        fs::write(&settings, "[lift]\nlift_mm = 400.0\nrate_mm_per_s = 20.0\n").expect("written");
        let gripper_address = format!("wsg50://{}?part_width_mm=66{query}", gripper_line.place);
        let run = command(&[])
            .args(["run", "lift"])
            .arg(frames)
            .arg("--sensor")
            .arg(frames.with_file_name("left.sensor.toml"))
            .args(["--rate-hz", "15", "--controller", "constant", "--gripper", &gripper_address])
            .args(["--wrist", &format!("line://{}", wrist_line.place), "--settings"])
            .arg(&settings)
            .arg("-o")
            .arg(folder.join("run"))
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .expect("starts");
        let lifting = Lifting { run, gripper, wrist, gripper_line, wrist_line, folder };
        let until = Instant::now() + Duration::from_secs(30);
        while lifting.wrist.last("lowered_mm") > -4.0 {
            assert!(Instant::now() < until, "it never lifted: {}", lifting.events());
            sleep(Duration::from_millis(20));
        }
        (scratch, lifting)
    }

    fn events(&self) -> String {
        fs::read_to_string(self.folder.join("run").join("events.jsonl")).unwrap_or_default()
    }

    /// Whether the wrist moves now, by its own report.
    fn wrist_moves(&self) -> bool {
        let before_mm = self.wrist.last("lowered_mm");
        sleep(Duration::from_millis(400));
        (self.wrist.last("lowered_mm") - before_mm).abs() > 0.5
    }

    /// Least force since a moment, N per finger, and whether the block was carried all the time.
    fn held_since(&self, since_ns: u64) -> (f64, bool) {
        let lines = self.gripper.lines();
        let after = lines.iter().filter(|line| line["unix_ns"].as_u64() >= Some(since_ns));
        let force_n = |line: &Value| line["force_n"].as_f64().expect("a force");
        let least_n = after.clone().map(force_n).fold(f64::INFINITY, f64::min);
        (least_n, after.clone().all(|line| line["is_carried"] == true) && after.count() > 0)
    }

    /// How long after a moment the wrist still moved, ms.
    fn moved_on_ms(&self, since_ns: u64, until_ns: u64) -> u64 {
        let lines = self.wrist.lines();
        let at = |line: &Value| line["unix_ns"].as_u64().expect("a time");
        let mut last_ns = since_ns;
        for pair in lines.windows(2) {
            if pair[0]["lowered_mm"] != pair[1]["lowered_mm"] && (since_ns..until_ns).contains(&at(&pair[1])) {
                last_ns = at(&pair[1]);
            }
        }
        (last_ns - since_ns) / 1_000_000
    }

    /// Ends the run if it has not ended; returns its exit code and its output.
    fn end(&mut self) -> (Option<i32>, String) {
        let until = Instant::now() + Duration::from_secs(20);
        while self.run.try_wait().expect("known").is_none() {
            assert!(Instant::now() < until, "it never ended: {}", self.events());
            sleep(Duration::from_millis(20));
        }
        let mut said = String::new();
        let _ = self.run.stderr.as_mut().expect("piped").read_to_string(&mut said);
        (self.run.wait().expect("ended").code(), said)
    }
}

impl Drop for Lifting {
    fn drop(&mut self) {
        let _ = self.run.kill();
        let _ = self.run.wait();
    }
}

/// A row of the table, after checking what must be true in every one of them: nothing fell, and the wrist soon stopped.
/// `noticed_ms`: how long the fault may go unnoticed.
fn row(what: &str, lifting: &Lifting, since_ns: u64, until_ns: u64, noticed_ms: u64, then: &str) {
    let (least_n, is_carried) = lifting.held_since(since_ns);
    assert!(is_carried && least_n > 9.0, "{what}: dropped, {least_n} N; {}", lifting.events());
    let moved_on_ms = lifting.moved_on_ms(since_ns, until_ns);
    assert!(moved_on_ms <= noticed_ms + WRIST_MS, "{what}: moved on for {moved_on_ms} ms; {}", lifting.events());
    println!("| {what} | {least_n:.1} N, held | {moved_on_ms} ms | {then} |");
}

/// Each case on a hand of its own, all at the same time: most of it is waiting.
fn side_by_side<T: Send>(cases: impl IntoIterator<Item = T>, check: impl Fn(T) + Sync) {
    std::thread::scope(|scope| {
        for case in cases {
            scope.spawn(|| check(case));
        }
    });
}

#[test]
fn a_program_told_to_end_pauses_the_wrist_and_keeps_the_force() {
    side_by_side(["-INT", "-TERM", "-QUIT"], |name| {
        let (_scratch, mut lifting) = Lifting::start("");
        let since_ns = unix_ns();
        signal(&lifting.run, name);
        let (got, said) = lifting.end();
        assert_eq!(got, Some(1), "{said}");
        assert!(said.contains("interrupted") && lifting.events().contains("interrupted"), "{said}");
        assert!(!lifting.events().contains("end of the source"), "{}", lifting.events());
        assert!(lifting.folder.join("run/report.html").exists());
        sleep(Duration::from_millis(500));
        row(&format!("our process: kill {name}"), &lifting, since_ns, unix_ns(), 0, "exit code 1, report written");
    });
}

#[test]
fn a_killed_program_leaves_the_force_and_a_wrist_that_pauses() {
    let (_scratch, mut lifting) = Lifting::start("");
    let since_ns = unix_ns();
    signal(&lifting.run, "-KILL");
    assert_eq!(lifting.end().0, None);
    sleep(Duration::from_millis(700));
    row("our process: kill -KILL", &lifting, since_ns, unix_ns(), 0, "fast stop latched, force kept");
    let told = command(&["gripper", &format!("wsg50://{}", lifting.gripper.place), "status"]).output();
    let told = String::from_utf8_lossy(&told.expect("runs").stdout).into_owned();
    assert!(told.contains("stopped"), "{told}");
}

/// Both at the same time: each waits ten seconds for the device to come back.
#[test]
fn a_killed_gripper_or_wrist_ends_the_task_with_an_error() {
    side_by_side([a_gripper_is_killed as fn(), a_wrist_is_killed], |case| case());
}

fn a_gripper_is_killed() {
    let (_scratch, mut lifting) = Lifting::start("");
    signal(&lifting.gripper.child, "-KILL");
    let since_ns = unix_ns();
    let (got, said) = lifting.end();
    assert_eq!(got, Some(1));
    assert!(said.contains("link is lost") && lifting.events().contains("link is lost"), "{said}");
    let moved_on_ms = lifting.moved_on_ms(since_ns, unix_ns());
    assert!(moved_on_ms <= WRIST_MS, "{moved_on_ms}");
    println!(
        "| the gripper's emulator: kill -KILL | not known | {moved_on_ms} ms | exit code 1 after 10 s: link lost |"
    );
}

fn a_wrist_is_killed() {
    let (_scratch, mut lifting) = Lifting::start("");
    let since_ns = unix_ns();
    signal(&lifting.wrist.child, "-KILL");
    let (got, said) = lifting.end();
    assert_eq!(got, Some(1));
    assert!(said.contains("wrist"), "{said}");
    row("the wrist's emulator: kill -KILL", &lifting, since_ns, unix_ns(), 0, "exit code 1 after 10 s: link lost");
}

/// A line that fails for a time: the checks meanwhile, and that the lifting continues afterwards.
fn fails_for_a_time(what: &str, state: u8, for_ms: u64) {
    side_by_side(["gripper", "wrist"], |finger| {
        let (_scratch, lifting) = Lifting::start("&acknowledge_own_fast_stop=true");
        let line = if finger == "gripper" { &lifting.gripper_line } else { &lifting.wrist_line };
        let since_ns = unix_ns();
        line.be(state);
        sleep(Duration::from_millis(for_ms));
        let until_ns = unix_ns();
        line.be(OPEN);
        let back = Instant::now();
        while !lifting.wrist_moves() {
            assert!(back.elapsed() < Duration::from_secs(8), "{what}: never went on: {}", lifting.events());
        }
        // A silent gripper is a fault after the longest silence allowed; a wrist's motion expires by itself.
        let noticed_ms = if state == STALLED && finger == "gripper" { 500 } else { 0 };
        row(&format!("{finger}: {what}"), &lifting, since_ns, until_ns, noticed_ms, "went on by itself");
    });
}

#[test]
fn a_cut_line_is_made_anew_and_the_lifting_goes_on() {
    side_by_side([("link cut", CUT), ("link half open", HALF_OPEN)], |(what, state)| {
        fails_for_a_time(what, state, 200);
    });
}

#[test]
fn a_line_that_stalls_for_five_seconds_stops_the_wrist_meanwhile() {
    fails_for_a_time("link stalled 5 s", STALLED, 5000);
}

#[test]
fn a_fast_stop_and_a_power_cycle_are_explained_and_nothing_moves_any_more() {
    let faults = [
        ("fast stop", "fast-stop", "fast stop latched"),
        ("power-cycle", "power-cycle", "jaws that know where they are"),
    ];
    side_by_side(faults, |(what, fault, says)| {
        let (_scratch, mut lifting) = Lifting::start("");
        let since_ns = unix_ns();
        lifting.gripper.fail(fault);
        let (got, said) = lifting.end();
        assert_eq!(got, Some(1), "{what}: {said}");
        assert!(lifting.events().contains(says), "{what}: {}", lifting.events());
        row(&format!("gripper: {what}"), &lifting, since_ns, unix_ns(), 0, "exit code 1 after 10 s, explained");
    });
}
