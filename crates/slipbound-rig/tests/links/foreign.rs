//! Commands that other clients send and our drivers do not, and the emulators' answers.

use crate::bench::MS;
use crate::client::{Client, modbus, numbers};
use slipbound_rig::emulator::by_name;
use slipbound_rig::gripper::robotiq::rtu;

#[test]
fn wsg50_move_onto_a_part_ends_and_homing_acceleration_and_tare_are_known() {
    let mut client = Client::of("wsg50");
    let answers = client.frame(0x21, &numbers(&[0], &[20.0, 50.0]), 3000);
    assert_eq!(answers, [(0x21, 26, vec![]), (0x21, 29, vec![])], "under way, then blocked");
    assert!((client.emulator.opening_mm() - 50.0).abs() < 0.01);
    let answers = client.frame(0x21, &numbers(&[0], &[80.0, 50.0]), 3000);
    assert_eq!(answers, [(0x21, 26, vec![]), (0x21, 0, vec![])], "and it can be moved away");
    for (direction, statuses, opening_mm) in [(1u8, [26, 0], 110.0), (0, [26, 0], 110.0), (2, [26, 29], 50.0)] {
        let answers = client.frame(0x20, &[direction], 3000);
        assert_eq!(answers.iter().map(|answer| answer.1).collect::<Vec<u16>>(), statuses, "{direction}");
        assert!((client.emulator.opening_mm() - opening_mm).abs() < 0.01, "{direction}");
    }
    assert_eq!(client.frame(0x20, &[3], 10)[0].1, 28);
    client.block.width_mm = None;
    assert_eq!(client.frame(0x20, &[2], 3000).last().map(|answer| answer.1), Some(0));
    assert_eq!(client.emulator.opening_mm(), 0.0);
    assert_eq!(client.frame(0x30, &numbers(&[], &[2500.0]), 1), [(0x30, 0, vec![])]);
    assert_eq!(client.frame(0x31, &[], 1), [(0x31, 0, 2500f32.to_le_bytes().to_vec())]);
    assert_eq!(client.frame(0x30, &numbers(&[], &[1e9]), 1)[0].1, 28);
    assert_eq!(client.frame(0x38, &[], 1), [(0x38, 0, vec![])]);
}

#[test]
fn a_tare_takes_the_idle_reading_out() {
    let mut client = Client::of("wsg50");
    client.emulator = by_name("wsg50").expect("a name").with_faults("idle=4".parse().expect("faults"));
    client.emulator.connected(0);
    let reads_n = |client: &mut Client| {
        let answers = client.frame(0x45, &[0, 0, 0], 5);
        f32::from_le_bytes(*answers[0].2.first_chunk().expect("a number"))
    };
    client.say(&[], 10);
    assert_eq!(reads_n(&mut client), 4.0);
    client.frame(0x38, &[], 5);
    assert_eq!(reads_n(&mut client), 0.0);
}

#[test]
fn the_text_interface_takes_commands_with_their_last_numbers_left_out() {
    let mut client = Client::of("gcl");
    assert_eq!(client.line("MOVE(80)", 2000), "ACK MOVE\nFIN MOVE\n");
    assert_eq!(client.line("MOVE(20)", 2000), "ACK MOVE\nERR MOVE 29\n");
    assert_eq!(client.line("MOVE(80)", 2000), "ACK MOVE\nFIN MOVE\n");
    assert_eq!(client.line("GRIP()", 3000), "ACK GRIP\nFIN GRIP\n");
    assert!((client.block.force_n - 80.0).abs() < 0.1, "with the force it has set: {}", client.block.force_n);
    assert_eq!(client.line("RELEASE(20)", 2000), "ACK RELEASE\nFIN RELEASE\n");
    assert!((client.emulator.opening_mm() - 70.0).abs() < 0.01);
    assert_eq!(client.line("GRIP(20)", 3000), "ACK GRIP\nFIN GRIP\n");
    assert_eq!(client.line("RELEASE()", 2000), "ACK RELEASE\nFIN RELEASE\n");
    for (question, answer) in [
        ("SPEED?", "SPEED=0.00\n"),
        ("PWT?", "PWT=10.00\n"),
        ("PWT=3.5", "PWT=3.5\n"),
        ("PWT?", "PWT=3.50\n"),
        ("CLT=4", "CLT=4\n"),
        ("CLT?", "CLT=4.00\n"),
        ("CLT=-4", "ERR CLT 28\n"),
        ("MOVE(300)", "ERR MOVE 28\n"),
        ("VERBOSE?", "VERBOSE=0\n"),
        ("VERBOSE=1", "VERBOSE=1\n"),
        ("MOVE(300)", "ERR MOVE E_RANGE_ERROR\n"),
        ("DANCE()", "ERR E_CMD_UNKNOWN\n"),
        ("FSTOP()", "ACK FSTOP\n"),
        ("MOVE(90)", "ERR MOVE E_ACCESS_DENIED\n"),
        ("FSACK()", "ACK FSACK\n"),
        ("HOME(1)", "ACK HOME\n"),
    ] {
        assert_eq!(client.line(question, 1), answer, "{question}");
    }
    client.say(&[], 3000);
    assert_eq!(client.line("AUTOSEND(\"POS\",100,true)", 350), "ACK AUTOSEND\n@POS=110.00\n@POS=110.00\n@POS=110.00\n");
    assert_eq!(client.line("AUTOSEND(\"POS\",0)", 350), "ACK AUTOSEND\n");
}

#[test]
fn robotiq_met_by_a_part_on_the_way_says_so_and_takes_short_writes() {
    let mut client = Client::of("robotiq");
    for (line, answer) in [
        ("SET ATR 1", "ack"),
        ("GET ATR", "ATR 1\n"),
        ("SET ADR 1", "ack"),
        ("GET ADR", "ADR 1\n"),
        ("SET ATR 0", "ack"),
        ("SET SPE 77 FOR 12", "ack"),
        ("GET SPE", "SPE 77\n"),
        ("GET FOR", "FOR 12\n"),
        ("SET POS 150 SPE 255 FOR 0 GTO 1", "ack"),
        ("GET OBJ", "OBJ 0\n"),
    ] {
        assert_eq!(client.line(line, 1), answer, "{line}");
    }
    client.say(&[], 2000);
    assert_eq!(client.line("GET OBJ", 1), "OBJ 2\n");
    assert!((client.block.force_n - 20.0).abs() < 0.1, "it presses: {}", client.block.force_n);
    assert_eq!(client.line("SET POS 3", 2500), "ack");
    assert_eq!(client.line("GET OBJ", 1), "OBJ 3\n");

    let mut client = Client::of("robotiq-rtu");
    for (asked, answered) in [
        ("09 06 03 E8 09 00", "09 06 03 E8 09 00"), // activate and go, by function 6
        ("09 10 03 E9 00 01 02 00 96", "09 10 03 E9 00 01"), // position 150
        ("09 10 03 E9 00 02 04 00 96 80 40", "09 10 03 E9 00 02"), // with speed and force
        ("09 03 03 E8 00 03", "09 03 06 09 00 00 96 80 40"), // what was written
        ("09 03 03 E9 00 01", "09 03 02 00 96"),
        ("09 04 07 D2 00 01", "09 04 02 03 00"), // position of 110 mm opening is 3, no current
        ("09 03 07 D3 00 01", "09 83 02"),       // no such register
        ("09 06 07 D0 00 00", "09 86 02"),
    ] {
        let answer = client.say(&modbus(asked), 1);
        assert_eq!(answer, modbus(answered), "{asked}: {answer:02X?}");
    }
    client.say(&[], 3000);
    let answer = client.say(&modbus("09 04 07 D0 00 01"), 1);
    assert_eq!(answer[3], 0xB9, "active, goes, met something closing: {answer:02X?}");
    assert!(client.block.force_n > 70.0, "{}", client.block.force_n);
    let mut whole = Vec::new();
    rtu::request_write(&mut whole, [9, 0, 0, 3, 255, 0]);
    assert_eq!(client.say(&whole, 2000), modbus("09 10 03 E8 00 03"));
}

/// A gripper that sends unsolicited values is not reported as garbled, and real garbage is not reported a hundred
/// times.
#[test]
fn a_driver_stays_quiet_about_what_others_asked_for() {
    use crate::bench::{config, driver};
    use slipbound::port::DriverEvent;
    use slipbound_rig::link::Endpoint;
    let mut driver = driver("gcl", config("gcl"));
    driver.linked(0);
    let garbled = |driver: &mut slipbound_rig::gripper::Driver| {
        std::iter::from_fn(|| driver.next_event())
            .filter_map(|event| match event {
                DriverEvent::Garbled { bytes_count } => Some(bytes_count),
                _ => None,
            })
            .collect::<Vec<usize>>()
    };
    for i in 0..500u64 {
        driver.tick(i * 20 * MS);
        driver.receive(i * 20 * MS, b"SPEED=12.5\nTEMP=31.0\n");
    }
    assert!(garbled(&mut driver).is_empty());
    for i in 500..1600u64 {
        driver.tick(i * 20 * MS);
        driver.receive(i * 20 * MS, b"what is this\n");
    }
    let told = garbled(&mut driver);
    assert_eq!(told.len(), 3, "22 s of it: {told:?}");
    driver.tick(1600 * 20 * MS);
    assert_eq!(garbled(&mut driver), [0usize; 0], "not yet");
    driver.tick(2200 * 20 * MS);
    let rest = garbled(&mut driver);
    assert_eq!((rest.len(), told.iter().sum::<usize>() + rest[0]), (1, 12 * 1100));
}
