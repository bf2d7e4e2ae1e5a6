//! What third-party clients expect of a 2F-85: each test is a fault that one of them revealed.

use crate::bench::{Bench, config};
use crate::client::{Client, modbus};
use slipbound::port::Jaws;
use slipbound_rig::gripper::Request;

const OPEN: u8 = 3;

/// A client with nothing between the jaws.
fn empty(name: &str) -> Client {
    let mut client = Client::of(name);
    client.block.width_mm = None;
    client
}

/// The six bytes of the status.
fn status(client: &mut Client) -> [u8; 6] {
    *client.say(&modbus("09 04 07 D0 00 03"), 1)[3..].first_chunk().expect("a status")
}

fn position(client: &mut Client) -> u8 {
    client.line("GET POS", 1).trim_start_matches("POS ").trim().parse().expect("a number")
}

#[test]
fn function_23_writes_and_then_reads() {
    let mut client = empty("robotiq-rtu");
    let asked = [0x09, 0x17, 0x07, 0xD0, 0, 3, 0x03, 0xE8, 0, 3, 6, 9, 0, 0, 0, 0xFF, 0x80, 0x97, 0xEE];
    assert_eq!(client.say(&asked, 1), modbus("09 17 06 39 00 00 00 03 00"), "GTO and what it was told are new");
    assert_eq!(client.say(&modbus("09 03 03 E8 00 03"), 1), modbus("09 03 06 09 00 00 00 FF 80"));
    // The manual's own: it sets position, speed and force, and reads two registers.
    let manual = [0x09, 0x17, 0x07, 0xD0, 0, 2, 0x03, 0xE9, 0, 2, 4, 0, 0xE6, 0x3C, 0xC8, 0x2D, 0x0C];
    assert_eq!(client.say(&manual, 1), modbus("09 17 04 39 00 00 E6"));
    for (asked, answered) in [
        ("09 17 07 D0 00 03 03 E7 00 01 02 01 02", "09 97 02"), // writes elsewhere
        ("09 17 07 D0 00 04 03 E8 00 01 02 01 02", "09 97 02"), // reads elsewhere
        ("09 17 07 D0 00 00 03 E8 00 01 02 01 02", "09 97 03"), // reads nothing
    ] {
        assert_eq!(client.say(&modbus(asked), 1), modbus(answered), "{asked}");
    }
    assert_eq!(client.say(&modbus("09 03 03 E8 00 01"), 1), modbus("09 03 02 09 00"), "refused, it writes nothing");
}

#[test]
fn other_functions_are_refused_after_the_silence_that_ends_them() {
    let mut client = empty("robotiq-rtu");
    for (asked, answered) in [
        ("09 16 03 E8 FF FF 00 00", "09 96 01"), // 10 bytes
        ("09 07", "09 87 01"),                   // 4 bytes
        ("09 2B 0E 01 00 00", "09 AB 01"),
        ("09 0F 00 00 00 14 03 01 02 03", "09 8F 01"),
        ("09 04 07 D0", "09 84 03"), // a function that it has, cut short
    ] {
        assert_eq!(client.say(&modbus(asked), 1), b"", "{asked}: it might go on");
        assert_eq!(client.say(&[], 20), modbus(answered), "{asked}");
    }
    for (asked, answered) in [
        ("09 10 03 E9 00 03 06 01 02 03 04 05 06", "09 90 02"),
        ("09 10 03 E8 00 04 08 01 02 03 04 05 06 07 08", "09 90 02"),
        ("09 04 07 D0 01 00", "09 84 02"),
        ("09 04 07 D0 00 00", "09 84 03"),
        ("09 10 03 E8 00 03 02 01 02", "09 90 03"), // 2 bytes are not 3 registers
    ] {
        assert_eq!(client.say(&modbus(asked), 1), modbus(answered), "{asked}");
    }
    let mut spoilt = modbus("09 16 03 E8 FF FF 00 00");
    spoilt[5] ^= 1;
    assert_eq!(client.say(&spoilt, 20), b"", "a wrong checksum has no answer");
    assert_eq!(client.say(&[9, 4, 7], 200), b"");
    assert_eq!(client.say(&modbus("09 04 07 D0 00 01"), 1).len(), 7, "and half a message is forgotten");
}

#[test]
fn without_gto_the_jaws_stop_and_object_detection_says_nothing() {
    let mut client = empty("robotiq");
    client.line("SET POS 255 SPE 255 FOR 0 GTO 1", 300);
    assert_eq!(client.line("SET GTO 0", 100), "ack");
    let stopped_at = position(&mut client);
    assert!((20..150).contains(&stopped_at), "{stopped_at}");
    client.say(&[], 1000);
    assert_eq!(position(&mut client), stopped_at);
    assert_eq!(client.line("GET OBJ", 1), "OBJ 0\n");
    client.line("SET GTO 1", 2000);
    assert_eq!(client.line("GET OBJ", 1), "OBJ 3\n", "and goes on with it");

    let mut client = empty("robotiq-rtu");
    client.say(&modbus("09 10 03 E8 00 03 06 09 00 00 FF FF 00"), 300);
    client.say(&modbus("09 06 03 E8 01 00"), 100);
    let stopped = status(&mut client);
    client.say(&[], 1000);
    assert_eq!(status(&mut client), stopped);
    assert_eq!((stopped[0], (20..150).contains(&stopped[4])), (0x31, true), "{stopped:02X?}");

    let mut client = Client::of("robotiq");
    client.line("SET POS 255 SPE 255 FOR 0 GTO 1", 3000);
    client.line("SET GTO 0", 1000);
    assert!((client.block.force_n - 20.0).abs() < 1e-6, "what is held stays held: {}", client.block.force_n);
}

#[test]
fn every_position_is_reached_where_nothing_is_and_a_part_on_the_way_is_gripped() {
    for asked in [20, 199, 200, 215, 229] {
        let mut client = empty("robotiq");
        client.line(&format!("SET POS {asked} SPE 255 FOR 0 GTO 1"), 1500);
        assert_eq!((client.line("GET OBJ", 1), position(&mut client)), ("OBJ 3\n".into(), asked));
    }
    // 97 is an opening of 49.8 mm, 96 of 50.2.
    for (asked, object, force_n) in [(96, "OBJ 3\n", 0.0), (97, "OBJ 2\n", 235.0), (230, "OBJ 2\n", 235.0)] {
        let mut client = Client::of("robotiq");
        client.line(&format!("SET POS {asked} SPE 255 FOR 255 GTO 1"), 3000);
        assert_eq!(client.line("GET OBJ", 1), object, "{asked}");
        assert!((client.block.force_n - force_n).abs() < 0.5, "{asked}: {}", client.block.force_n);
    }
    let mut client = Client::of("robotiq");
    client.line("SET POS 150 SPE 255 FOR 255 GTO 1", 3000);
    client.block.width_mm = None;
    client.say(&[], 1000);
    assert_eq!(
        (client.line("GET OBJ", 1), position(&mut client)),
        ("OBJ 3\n".into(), 150),
        "it goes where it was told"
    );
}

#[test]
fn the_speed_is_that_asked_for() {
    for (speed, least_ms, most_ms) in [(0, 2000, 2080), (255, 270, 340)] {
        let mut client = empty("robotiq");
        client.line(&format!("SET POS 110 SPE {speed} FOR 0 GTO 1"), 1); // 40.07 mm
        let from_ns = client.now_ns;
        while client.line("GET OBJ", 1) != "OBJ 3\n" {
            assert!(client.now_ns - from_ns < 5_000_000_000);
        }
        let ms = (client.now_ns - from_ns) / 1_000_000;
        assert!((least_ms..most_ms).contains(&ms), "{speed}: {ms}");
    }
}

#[test]
fn activation_closes_and_opens_the_jaws_and_then_the_example_of_the_manual_holds() {
    for width_mm in [None, Some(50.0)] {
        let mut client = empty("robotiq-rtu");
        client.block.width_mm = width_mm;
        client.say(&modbus("09 10 03 E8 00 03 06 00 00 00 00 00 00"), 20);
        assert_eq!(status(&mut client)[0], 0);
        client.say(&modbus("09 10 03 E8 00 03 06 01 00 00 00 00 00"), 20);
        let (mut most, from_ns) = (0, client.now_ns);
        loop {
            let now = status(&mut client);
            most = most.max(now[4]);
            match now[0] {
                0x31 => break,
                activating => assert_eq!(activating, 0x11),
            }
        }
        let ms = (client.now_ns - from_ns) / 1_000_000;
        let (closed, least_ms, most_ms) = if width_mm.is_none() { (230, 1100, 1300) } else { (96, 500, 700) };
        assert!(most >= closed && (least_ms..most_ms).contains(&ms), "{most}, {ms} ms");
        assert_eq!((status(&mut client)[4], client.block.force_n), (OPEN, 0.0));
        assert_eq!(client.say(&modbus("09 03 07 D0 00 01"), 1), [0x09, 3, 2, 0x31, 0, 0x4C, 0x15], "as printed");
    }
    let mut client = empty("robotiq");
    client.line("SET ACT 0", 20);
    client.line("SET ACT 1 GTO 1 POS 100 SPE 255", 3000);
    assert_eq!((client.line("GET OBJ", 1), position(&mut client)), ("OBJ 3\n".into(), 100), "asked for meanwhile");
}

/// Our own driver homes by it, waits for it, and never does it with something held.
#[test]
fn our_driver_waits_for_the_stroke_of_an_activation() {
    for name in ["robotiq-rtu", "robotiq"] {
        let mut bench = Bench::of(name, "");
        bench.plant.width_mm = None;
        bench.run(200);
        bench.request(Request::Home).expect("taken over");
        bench.run(600);
        assert!(bench.driver.is_busy() && bench.emulator.opening_mm() < 20.0, "{name}");
        assert_eq!(bench.state().expect("there").jaws, Jaws::Unknown);
        bench.until(3000, |state| state.jaws == Jaws::Open);
        bench.run(100);
        assert!(!bench.driver.is_busy() && bench.emulator.opening_mm() == 85.0, "{name}");
        let mut bench = Bench::holding(name, config(name), "", 40.0);
        bench.request(Request::Home).expect_err("something is held");
        bench.run(3000);
        assert!(bench.least_n > 39.0, "{name}: {}", bench.least_n);
    }
}
