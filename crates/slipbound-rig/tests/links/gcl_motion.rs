//! WSG-50, text interface: what becomes of its motions, with a gripper that answers by a script.

use crate::bench::{MS, config, driver};
use slipbound::port::{GripCommand, Jaws};
use slipbound_rig::gripper::{Driver, Request};
use slipbound_rig::link::Endpoint;

/// A driver, and a scripted gripper that answers questions from `state`.
struct Scripted {
    driver: Driver,
    now_ns: u64,
    /// GRIPSTATE.
    state: u8,
    /// Everything sent that is no question.
    commands: Vec<String>,
    /// Time between two rounds of the loop.
    tick_ms: u64,
}

impl Scripted {
    /// 20 N were requested, and GRIP was sent.
    fn gripping() -> Self {
        let mut driver = driver("gcl", config("gcl"));
        driver.linked(0);
        let mut scripted = Scripted { driver, now_ns: 0, state: 0, commands: Vec::new(), tick_ms: 1 };
        scripted.run(200);
        scripted.grip();
        assert!(scripted.run(100), "GRIP is sent");
        scripted
    }

    fn grip(&mut self) {
        let request = Request::Grip(GripCommand::Hold { force_n: 20.0 });
        self.driver.request(self.now_ns, request).expect("taken over");
    }

    fn say(&mut self, line: &str) {
        self.driver.receive(self.now_ns, format!("{line}\n").as_bytes());
    }

    /// Answers questions for this many ms; returns whether a GRIP was among what was sent.
    fn run(&mut self, ms: u64) -> bool {
        let mut is_gripping = false;
        for _ in 0..ms.div_ceil(self.tick_ms) {
            self.now_ns += self.tick_ms * MS;
            self.driver.tick(self.now_ns);
            let sent = String::from_utf8(std::mem::take(self.driver.outgoing())).expect("ASCII");
            for line in sent.lines() {
                match line.strip_suffix('?') {
                    Some("POS") => self.say("POS=110.00"),
                    Some("FORCE") => self.say("FORCE=0.00"),
                    Some(name) => self.say(&format!("{name}={}", self.state)),
                    None => {
                        is_gripping |= line.starts_with("GRIP");
                        self.commands.push(line.to_owned());
                    }
                }
            }
        }
        is_gripping
    }

    fn release(&mut self) {
        self.driver.request(self.now_ns, Request::Grip(GripCommand::Release)).expect("taken over");
    }

    /// The error that the driver reports within this many ms, while questions are answered.
    fn error_within(&mut self, ms: u64) -> Option<String> {
        (0..ms).find_map(|_| {
            self.run(1);
            self.driver.state(self.now_ns).err().map(|error| error.to_string())
        })
    }
}

#[test]
fn a_grip_that_fails_while_the_gripper_is_idle_is_told_at_once_with_its_reason() {
    for (answers, said) in [
        (&["ERR GRIP 18"][..], "status 18, command failed"),
        (&["ERR GRIP E_CMD_FAILED"], "status 18, command failed"),
        (&["ERR GRIP 19"], "status 19, aborted"),
        (&["ERR GRIP E_JAWS_COLD"], "\"E_JAWS_COLD\""),
        (&["ACK GRIP", "ERR GRIP 18"], "status 18, command failed"),
        (&["ACK GRIP", "ERR 18"], "status 18, command failed"),
        (&["ACK GRIP", "ERR GRIP 19"], "status 19, aborted"),
        (&["ACK GRIP", "ERR GRIP 4"], "status 4, another motion is under way"),
    ] {
        let mut scripted = Scripted::gripping();
        for answer in answers {
            scripted.say(answer);
        }
        let error = scripted.error_within(250).unwrap_or_else(|| panic!("{answers:?}: nothing told"));
        assert!(error.contains("expected GRIP to be done") && error.contains(said), "{answers:?}: {error}");
        assert!(scripted.error_within(1000).is_none() && !scripted.driver.is_busy(), "{answers:?}: told once");
        assert!(!scripted.run(500), "{answers:?}: not given again by itself");
        scripted.grip();
        assert!(scripted.run(100), "{answers:?}: the same force asked for again is sent again");
    }
}

#[test]
fn a_grip_that_fails_says_its_reason_even_where_the_state_never_changes() {
    let mut scripted = Scripted::gripping();
    scripted.state = 1; // grasping, for good
    scripted.say("ACK GRIP");
    scripted.say("ERR GRIP 18");
    let error = scripted.error_within(700).expect("told");
    assert!(error.contains("status 18, command failed"), "{error}");
    // However slow the loop is.
    let mut scripted = Scripted { tick_ms: 7, ..Scripted::gripping() };
    scripted.state = 1;
    scripted.say("ACK GRIP");
    scripted.say("ERR GRIP 18");
    assert!(scripted.error_within(700).is_some());
}

#[test]
fn a_grip_that_found_nothing_is_no_error_nor_one_that_our_own_stop_ended() {
    let mut scripted = Scripted::gripping();
    scripted.state = 1;
    scripted.say("ACK GRIP");
    scripted.run(50);
    scripted.say("ERR GRIP 18");
    scripted.run(100);
    scripted.state = 2;
    assert_eq!(scripted.error_within(1000), None);
    assert_eq!(scripted.driver.state(scripted.now_ns).expect("there").jaws, Jaws::Nothing);

    // The end of the stopped motion may be reported before the answer to STOP, or after it.
    for answers in [["ERR GRIP 19", "ACK STOP"], ["ACK STOP", "ERR GRIP 19"]] {
        let mut scripted = Scripted::gripping();
        scripted.say("ACK GRIP");
        scripted
            .driver
            .request(scripted.now_ns, Request::Grip(GripCommand::Hold { force_n: 30.0 }))
            .expect("taken over");
        scripted.run(60); // STOP is sent
        for answer in answers {
            scripted.say(answer);
        }
        scripted.run(60); // GRIP is sent
        scripted.say("ACK GRIP");
        assert_eq!(scripted.error_within(600), None, "{answers:?}");
        assert_eq!(scripted.driver.state(scripted.now_ns).expect("there").target_n, Some(30.0), "{answers:?}");
    }
}

/// A command that waits for the end of a motion is not sent if the gripper has stopped itself meanwhile.
#[test]
fn a_motion_that_ends_in_a_fast_stop_leaves_nothing_to_be_done() {
    let mut scripted = Scripted::gripping();
    scripted.say("ACK GRIP");
    scripted.run(100);
    scripted.now_ns += 100 * MS;
    scripted.driver.tick(scripted.now_ns); // a question is on its way
    let harder = Request::Grip(GripCommand::Hold { force_n: 30.0 });
    scripted.driver.request(scripted.now_ns, harder).expect("taken over");
    assert!(scripted.driver.outgoing().ends_with(b"?\n"), "only the question");
    scripted.say("ERR GRIP 16");
    assert!(scripted.error_within(100).is_some_and(|error| error.contains("status 16")));
    scripted.run(1000);
    assert!(!scripted.driver.is_busy());
}

/// Its end was garbled, or the line was lost: the state of the jaws tells that it is over.
#[test]
fn a_motion_whose_end_was_not_understood_is_over_once_the_state_says_so() {
    for end in ["F%N GRIP", ""] {
        let mut scripted = Scripted::gripping();
        scripted.say("ACK GRIP");
        scripted.state = 1;
        scripted.run(500);
        assert!(scripted.driver.is_busy(), "{end:?}: it closes");
        scripted.state = 4;
        if !end.is_empty() {
            scripted.say(end);
        }
        scripted.run(300);
        assert!(scripted.driver.is_busy(), "{end:?}: the end may still come");
        assert_eq!(scripted.error_within(500), None, "{end:?}");
        assert!(!scripted.driver.is_busy(), "{end:?}");
        scripted.commands.clear();
        scripted.release();
        scripted.run(20);
        assert_eq!(scripted.commands, ["RELEASE(0.00,50.00)"], "{end:?}: nothing is to be stopped");
        // Nor is there a stop before the next grip where the end of the release is lost.
        scripted.say("ACK RELEASE");
        scripted.state = 5;
        scripted.run(300);
        scripted.state = 0;
        scripted.run(700);
        scripted.commands.clear();
        scripted.grip();
        scripted.run(100);
        assert_eq!(scripted.commands, ["GRIP(20.00,50.00,50.00)"], "{end:?}");
        assert_eq!(scripted.error_within(11_000).map(|error| error.contains("GRIP")), Some(true), "not answered");
    }
}

/// Neither a state that has not changed yet nor one that flickers ends a motion, nor that of another motion.
#[test]
fn a_motion_that_still_runs_is_not_taken_for_over() {
    let mut scripted = Scripted::gripping();
    scripted.say("ACK GRIP"); // and the state says idle, as before
    scripted.run(1500);
    assert!(scripted.driver.is_busy());
    for _ in 0..10 {
        scripted.state = 1;
        scripted.run(150);
        scripted.state = 4;
        scripted.run(300);
        assert!(scripted.driver.is_busy());
    }
    scripted.say("FIN GRIP");
    assert!(!scripted.driver.is_busy());
}

/// The state before it and after it is the same, and a short one may run between two questions.
#[test]
fn a_regrip_and_a_short_move_whose_end_is_lost_are_over_without_a_fault() {
    let mut held = Scripted::gripping();
    held.say("ACK GRIP");
    held.state = 1;
    held.run(100);
    held.state = 4;
    held.run(100);
    held.say("FIN GRIP");
    let harder = Request::Grip(GripCommand::Hold { force_n: 30.0 });
    held.driver.request(held.now_ns, harder).expect("taken over");
    assert!(held.run(100));
    held.say("ACK GRIP");

    let mut open = Scripted::gripping();
    open.say("ERR GRIP 18");
    open.error_within(600);
    open.commands.clear();
    open.release();
    open.run(100);
    assert_eq!(open.commands, ["MOVE(110.00,50.00)"]);
    open.say("ACK MOVE");

    for (name, mut scripted) in [("GRIP", held), ("MOVE", open)] {
        scripted.run(300);
        assert!(scripted.driver.is_busy(), "{name}: the end may still come");
        assert_eq!(scripted.error_within(12_000), None, "{name}");
        assert!(!scripted.driver.is_busy(), "{name}");
    }
}

#[test]
fn a_grip_that_ended_idle_without_a_word_is_told_and_given_again_on_request() {
    let mut scripted = Scripted::gripping();
    scripted.say("ACK GRIP");
    scripted.state = 1;
    scripted.run(200);
    scripted.state = 0;
    let error = scripted.error_within(1000).expect("told");
    assert!(error.contains("expected GRIP to be done") && error.contains("not understood"), "{error}");
    scripted.grip();
    assert!(scripted.run(100), "the same force asked for again is sent again");
}

/// A stop leaves nothing held: RELEASE would be refused, and taken for a fast stop.
#[test]
fn a_release_after_a_stop_waits_for_what_the_jaws_do_now() {
    let mut scripted = Scripted::gripping();
    scripted.say("ACK GRIP");
    scripted.state = 4; // soon, and before it says that it has ended
    scripted.run(150);
    scripted.commands.clear();
    scripted.release();
    scripted.run(50);
    assert_eq!(scripted.commands, ["STOP()"]);
    scripted.state = 0;
    scripted.driver.tick(scripted.now_ns);
    scripted.say("ACK STOP");
    let sent = String::from_utf8(std::mem::take(scripted.driver.outgoing())).expect("ASCII");
    assert_eq!(sent, "GRIPSTATE?\n");
    scripted.say("GRIPSTATE=0");
    scripted.run(50);
    assert_eq!(scripted.commands, ["STOP()", "MOVE(110.00,50.00)"]);
}

/// What a force that is raised after a lost end finds: a gripper that may still call the part held.
#[test]
fn a_grip_after_a_stop_waits_for_what_the_jaws_do_now() {
    let mut scripted = Scripted::gripping();
    scripted.say("ACK GRIP");
    scripted.state = 1;
    scripted.run(150);
    let harder = Request::Grip(GripCommand::Hold { force_n: 30.0 });
    scripted.driver.request(scripted.now_ns, harder).expect("taken over");
    scripted.run(100); // STOP is sent
    scripted.driver.tick(scripted.now_ns);
    scripted.say("ACK STOP");
    let sent = String::from_utf8(std::mem::take(scripted.driver.outgoing())).expect("ASCII");
    assert_eq!(sent, "GRIPSTATE?\n");
    scripted.say("GRIPSTATE=0");
    assert!(scripted.run(50));
}

#[test]
fn a_release_survives_a_stop_that_is_never_answered() {
    let mut scripted = Scripted::gripping();
    scripted.say("ACK GRIP");
    scripted.state = 1;
    scripted.run(150);
    scripted.commands.clear();
    scripted.release();
    scripted.run(600);
    assert_eq!(scripted.commands, ["STOP()", "STOP()"], "again");
    scripted.say("ACK STOP");
    scripted.state = 0;
    scripted.run(100);
    assert_eq!(scripted.commands, ["STOP()", "STOP()", "MOVE(110.00,50.00)"]);
}
