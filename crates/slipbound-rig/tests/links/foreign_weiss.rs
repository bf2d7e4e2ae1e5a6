//! What third-party clients expect of a WSG-50, on either interface: each test is a fault that one of them revealed.

use crate::bench::Bench;
use crate::client::{Client, numbers};

const MOVE: u8 = 0x21;
const SYSTEM_STATE: u8 = 0x40;
const OPENING: u8 = 0x43;
const RELATIVE: u8 = 1;
const STOPS_ON_BLOCK: u8 = 2;

/// A client with nothing between the jaws.
fn empty(name: &str) -> Client {
    let mut client = Client::of(name);
    client.block.width_mm = None;
    client
}

/// The statuses of a MOVE that has 3 s.
fn moved(client: &mut Client, flags: u8, opening_mm: f32, speed_mm_per_s: f32) -> Vec<u16> {
    let answers = client.frame(MOVE, &numbers(&[flags], &[opening_mm, speed_mm_per_s]), 3000);
    answers.iter().map(|answer| answer.1).collect()
}

fn state(client: &mut Client, id: u8) -> [u8; 4] {
    let answers = client.frame(id, &[0, 0, 0], 1);
    *answers[0].2.first_chunk().expect("four bytes")
}

fn number(client: &mut Client, id: u8) -> f32 {
    f32::from_le_bytes(state(client, id))
}

#[test]
fn a_relative_move_counts_from_where_the_fingers_are() {
    let mut client = empty("wsg50");
    assert_eq!(moved(&mut client, 0, 80.0, 200.0), [26, 0]);
    assert_eq!(moved(&mut client, RELATIVE, -10.0, 200.0), [26, 0]);
    assert_eq!(number(&mut client, OPENING), 70.0);
    assert_eq!(moved(&mut client, RELATIVE, 40.0, 200.0), [26, 0]);
    assert_eq!(number(&mut client, OPENING), 110.0);
    assert_eq!(moved(&mut client, RELATIVE, 1.0, 200.0), [28], "beyond the end");
}

#[test]
fn a_move_onto_a_part_clamps_it_or_stops_as_it_is_told() {
    let mut client = Client::of("wsg50");
    client.frame(0x32, &numbers(&[], &[20.0]), 1);
    assert_eq!(moved(&mut client, STOPS_ON_BLOCK, 40.0, 200.0), [26, 29]);
    assert_eq!(client.block.force_n, 0.0);
    assert_eq!(moved(&mut client, 0, 80.0, 200.0), [26, 0]);
    assert_eq!(moved(&mut client, 0, 40.0, 200.0), [26, 29]);
    assert!((client.block.force_n - 20.0).abs() < 0.1, "{}", client.block.force_n);
    assert_eq!(client.frame(0x38, &[], 1)[0].1, 16, "no tare while it presses");
    client.frame(0x32, &numbers(&[], &[30.0]), 1000);
    assert!((client.block.force_n - 30.0).abs() < 0.1, "a new limit counts: {}", client.block.force_n);
    client.frame(0x22, &[], 1000);
    assert!((client.block.force_n - 30.0).abs() < 0.1, "a stop keeps it: {}", client.block.force_n);
    assert_eq!(moved(&mut client, 0, 80.0, 200.0), [26, 0]);
    assert_eq!(client.block.force_n, 0.0);
    assert_eq!(moved(&mut client, 0, 40.0, 200.0), [26, 29]);
    client.block.width_mm = None;
    client.say(&[], 1000);
    assert_eq!(number(&mut client, 0x45), 0.0, "what was in the way is gone");
}

#[test]
fn the_system_state_tells_how_the_last_motion_ended() {
    let mut client = Client::of("wsg50");
    let system = |client: &mut Client| u32::from_le_bytes(state(client, SYSTEM_STATE)) & !1;
    assert_eq!(system(&mut client), 0);
    moved(&mut client, 0, 80.0, 200.0);
    assert_eq!(system(&mut client), 1 << 7, "there");
    client.frame(MOVE, &numbers(&[0], &[70.0, 50.0]), 20);
    assert_eq!(system(&mut client), 1 << 1, "on the way");
    client.say(&[], 1000);
    moved(&mut client, 0, 40.0, 200.0);
    assert_eq!(system(&mut client), 1 << 2, "blocked while closing");
    client.frame(MOVE, &numbers(&[0], &[100.0, 50.0]), 200);
    client.frame(0x22, &[], 1);
    assert_eq!(system(&mut client), 1 << 6, "stopped");
    client.frame(0x22, &[], 1);
    assert_eq!(moved(&mut client, 0, 500.0, 50.0), [28]);
    assert_eq!(system(&mut client), 1 << 6, "what is refused is no motion");
}

#[test]
fn a_motion_has_the_speed_asked_for_and_tells_it() {
    for speed_mm_per_s in [20.0f32, 100.0, 400.0] {
        let mut client = empty("wsg50");
        let payload = numbers(&[0], &[70.0, speed_mm_per_s]);
        let ms = 25 + (20_000.0 / speed_mm_per_s) as u64;
        client.frame(MOVE, &payload, ms);
        assert!((number(&mut client, OPENING) - 90.0).abs() < 0.5, "after half the way");
        assert!((number(&mut client, 0x44) + speed_mm_per_s).abs() < 0.1, "closing");
        client.say(&[], ms + 10);
        assert_eq!((number(&mut client, OPENING), number(&mut client, 0x44)), (70.0, 0.0));

        let mut client = empty("gcl");
        client.line(&format!("MOVE(70,{speed_mm_per_s})"), ms);
        assert_eq!(client.line("SPEED?", 1), format!("SPEED=-{speed_mm_per_s:.2}\n"));
        assert_eq!(client.say(&[], ms + 10), b"FIN MOVE\n");
        assert_eq!(client.line("SPEED?", 1), "SPEED=0.00\n");
    }
    // A grasp approaches with its speed; the force then rises as it always does.
    let mut client = Client::of("wsg50");
    client.frame(0x25, &numbers(&[], &[50.0, 20.0]), 3000);
    assert_eq!((client.block.force_n, client.emulator.opening_mm() > 50.0), (0.0, true));
    client.say(&[], 1000);
    assert!((client.block.force_n - 80.0).abs() < 0.1, "{}", client.block.force_n);
}

#[test]
fn states_on_change_only_come_when_they_change() {
    let mut client = empty("wsg50");
    assert_eq!(client.frame(OPENING, &[3, 20, 0], 500).len(), 1, "the answer itself");
    let answers = client.frame(MOVE, &numbers(&[0], &[90.0, 100.0]), 1000);
    let openings: Vec<f32> = (answers.iter().filter(|answer| answer.0 == OPENING))
        .map(|answer| f32::from_le_bytes(*answer.2.first_chunk().expect("a number")))
        .collect();
    assert!((10..=12).contains(&openings.len()), "200 ms of motion: {openings:?}");
    assert!(openings.is_sorted_by(|before, after| before > after), "{openings:?}");
    assert_eq!(openings.last(), Some(&90.0));
    assert_eq!(client.frame(OPENING, &[1, 20, 0], 500).len(), 26, "and without the flag every period");
}

#[test]
fn the_text_interface_homes_either_way() {
    let mut client = empty("gcl");
    for (line, opening) in [("HOME(0)", "POS=0.00\n"), ("HOME(1)", "POS=110.00\n"), ("HOME()", "POS=110.00\n")] {
        assert_eq!(client.line(line, 3000), "ACK HOME\nFIN HOME\n");
        assert_eq!(client.line("POS?", 1), opening, "{line}");
    }
}

#[test]
fn a_grip_without_a_width_takes_hold_of_itself() {
    let mut client = empty("gcl");
    assert_eq!(client.line("GRIP(20)", 3000), "ACK GRIP\nFIN GRIP\n");
    for (question, answer) in [("GRIPSTATE?", "GRIPSTATE=4\n"), ("POS?", "POS=0.00\n"), ("FORCE?", "FORCE=20.00\n")] {
        assert_eq!(client.line(question, 1), answer);
    }
    assert_eq!(client.block.force_n, 0.0, "there is nothing");
    assert_eq!(client.line("RELEASE(30)", 2000), "ACK RELEASE\nFIN RELEASE\n");
    assert_eq!(client.line("FORCE?", 1), "FORCE=0.00\n");
    assert_eq!(client.line("GRIP(20,25)", 2000), "ACK GRIP\nERR GRIP 18\n", "but a part is missed");

    let mut client = Client::of("gcl");
    assert_eq!(client.line("GRIP(20)", 3000), "ACK GRIP\nFIN GRIP\n");
    client.block.width_mm = None;
    client.say(&[], 1000);
    assert_eq!(client.line("GRIPSTATE?", 1), "GRIPSTATE=3\n", "a part that is lost is not the other finger");
    assert_eq!(client.line("FORCE?", 1), "FORCE=0.00\n");
}

#[test]
fn a_refused_grip_leaves_the_force_as_it_is() {
    let mut client = Client::of("gcl");
    assert_eq!(client.line("GRIP(60)", 100), "ACK GRIP\n");
    assert_eq!(client.line("GRIP(10)", 3000), "ERR GRIP 4\nFIN GRIP\n", "it is closing");
    assert_eq!(client.line("FORCE?", 1), "FORCE=60.00\n");

    let mut client = Client::of("gcl");
    assert_eq!(client.line("GRIP(10,200)", 100), "ERR GRIP 28\n", "wider than it opens");
    assert_eq!(client.line("GRIP(20,,50)", 100), "ERR GRIP 15\n", "50 is no width");
    assert_eq!(client.line("GRIP()", 3000), "ACK GRIP\nFIN GRIP\n");
    assert_eq!(client.line("FORCE?", 1), "FORCE=80.00\n");
}

#[test]
fn a_new_connection_has_the_tolerances_that_are_configured() {
    let mut client = empty("gcl");
    for line in ["PWT=3", "CLT=4", "VERBOSE=1", "BYE()"] {
        assert!(!client.line(line, 1).starts_with("ERR"), "{line}");
    }
    client.emulator.disconnected(client.now_ns);
    client.emulator.connected(client.now_ns);
    for (question, answer) in [("PWT?", "PWT=10.00\n"), ("CLT?", "CLT=5.00\n"), ("VERBOSE?", "VERBOSE=0\n")] {
        assert_eq!(client.line(question, 1), answer);
    }
}

#[test]
fn our_driver_reads_values_that_come_by_themselves_with_and_without_their_mark() {
    use slipbound::port::DriverEvent;
    use slipbound_rig::link::Endpoint;
    let mut bench = Bench::of("gcl", "");
    bench.run(200);
    let now_ns = bench.now_ns();
    for (line, opening_mm) in [("@POS=77.50\n", 77.5), ("POS=66.50\n", 66.5)] {
        bench.pair.driver.receive(now_ns, line.as_bytes());
        assert_eq!(bench.pair.driver.state(now_ns).expect("there").opening_mm, Some(opening_mm));
    }
    bench.emulator.receive(now_ns, b"AUTOSEND(\"POS\",20)\nAUTOSEND(\"SPEED\",20)\n");
    bench.run(1000);
    assert_eq!(bench.state().expect("there").opening_mm, Some(110.0));
    assert!(!bench.events.iter().any(|event| matches!(event, DriverEvent::Garbled { .. })), "{:?}", bench.events);
}
