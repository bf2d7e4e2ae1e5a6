//! `slipbound emulate hand`: cameras, gripper and wrist of one simulated hand, reached like a real one.
//!
//! ```text
//!   world, in real time --> a camera a finger: http://..     gripper: wsg50://..     wrist: line://..
//!           ^                                                    |                      |
//!           '------------- presses and moves --------------------'----------------------'
//! ```

use crate::commands::inputs;
use crate::emulated::{EmulatedGripper, wrist_emulator};
use crate::interruption;
use crate::loopback::{WorldFrame, world};
use crate::outcome::{Failure, Outcome};
use crate::set_option;
use crate::terminal::Terminal;
use anyhow::{Context, anyhow};
use slipbound::hand::Side;
use slipbound::task::TaskKind;
use slipbound_lab::hand::{HandScene, HandTruth, SimHand};
use slipbound_rig::emulator::{CameraServer, Faults, Server};
use slipbound_rig::link::now_ns;
use std::fs;
use std::net::{IpAddr, Ipv4Addr, TcpListener};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::thread;
use std::time::Duration;

/// Longest wait for the world, between two checks for Ctrl-C.
const PAUSE: Duration = Duration::from_millis(50);

/// The arguments of `slipbound emulate hand`.
#[derive(Debug, clap::Args)]
pub struct Hand {
    /// The task, which determines the object between the jaws
    #[arg(long, default_value = "screw", value_parser = TaskKind::NAMES)]
    task: String,
    /// Which gripper, as wsg50 or robotiq?most_n=40
    #[arg(long, default_value = "wsg50", value_name = "GRIPPER?KEY=VALUE")]
    gripper: EmulatedGripper,
    /// Seed of noise and disturbances
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Set a parameter of the scene, as mu=0.6; may be given several times
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Address to listen at. Everyone who reaches it can command the hand
    #[arg(long, default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    listen: IpAddr,
    /// Folder for the sensor file of every finger, hand.toml, and a script `try.sh`; files of these names are replaced
    #[arg(short, long, value_name = "FOLDER", default_value = "slipbound-hand")]
    output: PathBuf,
    /// Faults of the gripper, joined by commas (see `slipbound emulate --help`)
    #[arg(long, value_name = "FAULTS", default_value = "", hide_default_value = true)]
    fail: Faults,
}

impl Hand {
    /// Serves until Ctrl-C, or the end of the scene.
    pub fn run(&self) -> Result<Outcome, Failure> {
        inputs::refuse_stdout_folder(&self.output)?;
        set_option::refuse_own(&self.set, &[("seed", "--seed")])?;
        let mut text = format!("{}?seed={}", self.task, self.seed);
        if !self.set.iter().any(|setting| setting.starts_with("longest_s=")) {
            text.push_str("&longest_s=3600");
        }
        self.set.iter().for_each(|setting| text = format!("{text}&{setting}"));
        let scene = HandScene::parse(&text).map_err(Failure::arguments)?;
        if scene.faults().is_some() {
            let expected = "expected with `demo` and `trials` only: these cameras send every frame as it is";
            return Err(Failure::Arguments(anyhow!("--set fault: {expected}")));
        }
        let hand = SimHand::new(&scene).map_err(Failure::arguments)?;
        let bind = || TcpListener::bind((self.listen, 0)).context("cannot listen");
        let (gripper_port, wrist_port) = (bind()?, bind()?);
        let place = |listener: &TcpListener| listener.local_addr().map(|at| at.to_string()).context("cannot listen");
        let gripper = self.gripper.address(&place(&gripper_port)?, scene.width_mm());
        let wrist = format!("line://{}", place(&wrist_port)?);
        let mut cameras = Vec::new();
        for _ in 0..scene.fingers_count() {
            cameras.push(CameraServer::new(bind()?).context("cannot listen")?);
        }
        let stop = interruption::listen()?;
        let urls: Vec<String> = cameras
            .iter()
            .zip(Side::NAMES)
            .map(|(camera, name)| format!("http://{}/{name}", camera.address()))
            .collect();
        self.write_files(&hand, &urls, &gripper, &wrist)?;
        let mut terminal = Terminal::with_status();
        Side::NAMES.iter().zip(&urls).try_for_each(|(name, url)| terminal.say(&format!("{name}: {url}")))?;
        terminal.say(&format!("gripper: {gripper}"))?;
        terminal.say(&format!("wrist: {wrist}"))?;
        terminal.say(&format!("{scene}; sensor files, hand.toml and try.sh are in {}", self.output.display()))?;
        let emulators = (self.gripper.emulator(&self.fail)?, wrist_emulator(&Faults::default())?);
        let ports =
            (Server::new(gripper_port).context("cannot listen")?, Server::new(wrist_port).context("cannot listen")?);
        let (send, frames) = sync_channel::<WorldFrame>(2);
        let is_running = Arc::new(AtomicBool::new(true));
        let (runs, from_ns) = (is_running.clone(), now_ns());
        let running = thread::spawn(move || world(&scene, ports, emulators, &send, &runs));
        let (mut last, mut late_most_ns): (Option<HandTruth>, u64) = (None, 0);
        while !stop.load(Ordering::Relaxed) {
            let shown = match frames.recv_timeout(PAUSE) {
                Ok(shown) => shown,
                Err(RecvTimeoutError::Timeout) => continue,
                Err(RecvTimeoutError::Disconnected) => break,
            };
            for (camera, frame) in cameras.iter().zip(&shown.frames) {
                camera.show(&frame.encoded, frame.time_ns.unwrap_or(0));
                let late_ns = (now_ns() - from_ns).saturating_sub(frame.time_ns.unwrap_or(0));
                late_most_ns = late_most_ns.max(late_ns);
            }
            terminal.status(&truth_line(&shown.truth));
            last = Some(shown.truth);
        }
        is_running.store(false, Ordering::Relaxed);
        drop(frames);
        terminal.clear_bar();
        running.join().map_err(|_| anyhow!("the simulated world broke down"))??;
        let at_end = last.as_ref().map_or("no frame was drawn".into(), truth_line);
        terminal
            .say(&format!("at the end: {at_end}; a frame was shown at most {} ms late", late_most_ns / 1_000_000))?;
        Ok(Outcome::Done)
    }

    /// Writes the sensor file of every finger, the hand file, and the command that uses all of them.
    fn write_files(&self, hand: &SimHand, urls: &[String], gripper: &str, wrist: &str) -> Result<(), Failure> {
        let write = |path: &Path, text: &str| {
            fs::write(path, text).map_err(|e| Failure::work(format!("{}: cannot write", path.display()), e))
        };
        let folder = &self.output;
        fs::create_dir_all(folder).map_err(|e| Failure::work(format!("{}: cannot write", folder.display()), e))?;
        let mut hand_file = String::from("name = \"simulated hand\"\n");
        for (finger, name) in Side::NAMES.iter().enumerate().take(urls.len()) {
            let mut sensor = hand.sensor(finger);
            let serial = format!("simulated-{name}");
            sensor.serial = Some(serial.clone());
            let text = toml::to_string(&sensor).map_err(|e| Failure::work("sensor", e))?;
            write(&folder.join(format!("{name}.sensor.toml")), &text)?;
            hand_file.push_str(&format!(
                "\n[[fingers]]\nname = \"{name}\"\nserial = \"{serial}\"\nside = \"{name}\"\nsensor = \"{name}.sensor.toml\"\n"
            ));
        }
        write(&folder.join("hand.toml"), &hand_file)?;
        let sources = urls.join(" ");
        let script = format!(
            "#!/bin/sh\n# The task on this hand: sh try.sh, and what else `slipbound run` is to be told.\n\
             exec slipbound run {} {sources} --hand \"$(dirname \"$0\")/hand.toml\" --gripper '{gripper}' \\\n    \
             --wrist {wrist} --rest live:20 \"$@\"\n",
            self.task
        );
        write(&folder.join("try.sh"), &script)
    }
}

/// The truth of the world, in a line.
fn truth_line(truth: &HandTruth) -> String {
    let mut parts = vec![format!("slid {:.2} mm", truth.slid_mm)];
    if let Some(cap) = &truth.cap {
        parts.push(format!("torque on the cap {:.0} N mm", cap.torque_n_mm));
    }
    if let Some(bottle) = &truth.bottle {
        parts.push(format!("{:.2} kg{}", bottle.mass_kg, if bottle.dropped { ", dropped" } else { "" }));
    }
    parts.join(", ")
}
