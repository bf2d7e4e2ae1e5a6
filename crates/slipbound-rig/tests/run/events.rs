//! The events of a run.

use crate::{events, screw, written};
use slipbound::control::{Cycle, CycleOutcome, CycleView, Fault, FaultKind};
use slipbound::monitor::SlipState;
use slipbound::port::GripCommand;
use slipbound::task::{Ending, Phase};
use slipbound_rig::run::{Event, RunNotes, TimedEvent};

#[test]
fn events_tell_what_happened() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut run = written(folder.path(), &screw::info(), &screw::cycles());
    assert_eq!(run.slips_count(), 4);
    run.note(9_990_000_000, "the gripper was switched off").expect("writes");
    run.finish(&screw::results(), None).expect("finishes");
    let events = events(folder.path());
    let begins: Vec<_> = events
        .iter()
        .filter_map(|e| match &e.event {
            Event::SlipBegins { slip, direction, force_n, .. } => {
                Some((e.time_ns, *slip, direction.as_str(), force_n.is_some()))
            }
            _ => None,
        })
        .collect();
    let expected: Vec<_> = screw::SLIPS
        .iter()
        .zip(1..)
        .map(|(&at, n)| (screw::cycles()[at as usize].time_ns, n, "around", true))
        .collect();
    assert_eq!(begins, expected);
    let count = |wanted: fn(&Event) -> bool| events.iter().filter(|e| wanted(&e.event)).count();
    assert_eq!(count(|e| matches!(e, Event::SlipEnds { .. })), 4);
    assert_eq!(count(|e| matches!(e, Event::Grip { .. })), 4);
    assert_eq!(count(|e| matches!(e, Event::Finger { finger, .. } if finger == "right")), 2);
    assert_eq!(count(|e| matches!(e, Event::Note { .. })), 1);
    assert_eq!(count(|e| matches!(e, Event::Ended { .. })), 1);
    assert_eq!(count(|e| matches!(e, Event::Result(_))), screw::results().len());
}

/// A fault that clears when the object is gone, and with it the task, is not followed by anything.
#[test]
fn after_the_end_of_the_task_nothing_is_said_to_go_on() {
    let fault = Fault { kind: FaultKind::ForceShortfall, text: "too little".into() };
    for (phase, goes_on) in [(Phase::Working, true), (Phase::Ended(Ending::Lost), false)] {
        let outcome = CycleOutcome::Commanded(Cycle { phase, ..screw::cycles()[100] });
        let mut notes = RunNotes::default();
        let told = [Some(&fault), None].map(|fault| {
            notes.see(&CycleView {
                now_ns: 1,
                outcome: Some(&outcome),
                fingers: &[],
                fault,
                refused_lowering: None,
                driver_events: &[],
                truth: None,
            })
        });
        assert_eq!(told[0], ["too little; the wrist pauses, the grip stays"]);
        assert_eq!(told[1].iter().any(|line| line.contains("going on")), goes_on, "{told:?}");
    }
}

#[test]
fn a_grip_that_rises_while_the_hand_is_unsure_is_told_of_once_a_contact_or_slip() {
    let mut notes = RunNotes::default();
    // `.` stick, `?` unsure, `!` torn, `x` slip, with the force of the command, N.
    let course = [
        ('.', 10.0),
        ('.', 20.0),
        ('?', 20.0),
        ('?', 20.4),
        ('?', 20.8),
        ('!', 20.8),
        ('?', 21.0),
        ('.', 21.0),
        ('?', 21.2),
        ('x', 31.0),
        ('?', 31.2),
    ];
    let told = course.map(|(sign, force_n)| {
        let mut cycle = screw::cycles()[100];
        cycle.hand.state = match sign {
            '?' => SlipState::Unsure,
            '!' => SlipState::Unjudged,
            'x' => SlipState::Incipient,
            _ => SlipState::Stick,
        };
        cycle.grip_command = GripCommand::Hold { force_n };
        notes.see(&CycleView {
            now_ns: 1,
            outcome: Some(&CycleOutcome::Commanded(cycle)),
            fingers: &[],
            fault: None,
            refused_lowering: None,
            driver_events: &[],
            truth: None,
        })
    });
    let rise = |from_n: &str| vec![format!("the hand is unsure: the grip rises from {from_n} N")];
    for (at, lines) in told.iter().enumerate() {
        let expected = [(3, rise("20.0")), (10, rise("31.0"))].into_iter().find(|(i, _)| *i == at);
        assert_eq!(*lines, expected.map(|(_, lines)| lines).unwrap_or_default(), "cycle {at}");
    }
}

/// A task whose time is over while there is a fault: what has ended it is noted by whoever drives the loop.
#[test]
fn what_is_held_to_the_end_with_a_fault_is_not_told_as_held() {
    for (fault, told) in [(false, 1), (true, 0)] {
        let mut cycles = screw::cycles()[..=100].to_vec();
        cycles.push(Cycle { phase: Phase::Ended(Ending::Held), fault, ..screw::cycles()[101] });
        let folder = tempfile::tempdir().expect("a folder");
        written(folder.path(), &screw::info(), &cycles).finish(&[], None).expect("finishes");
        let last_ns = screw::cycles()[101].time_ns;
        let at_end: Vec<_> = events(folder.path()).into_iter().filter(|e| e.time_ns == last_ns).collect();
        assert_eq!(at_end.iter().filter(|e| matches!(e.event, Event::Ended { .. })).count(), told, "{at_end:?}");
        assert!(!at_end.iter().any(|e| matches!(e.event, Event::Phase { .. })), "{at_end:?}");
        let page = std::fs::read_to_string(folder.path().join("report.html")).expect("a page");
        assert_eq!(page.contains("until it broke off"), fault, "the duration");
    }
}

#[test]
fn a_slip_is_over_when_it_is_quiet_however_often_it_is_answered() {
    // `x`: slips, `!`: slips and the controller responds, 33 ms per character.
    for (course, expected) in [
        ("..!x........x.........", vec![(2, 33), (12, 0)]),
        ("..x.x...x......!......", vec![(2, 200), (15, 0)]),
        ("..x!xx!xxxx!..........", vec![(2, 300)]),
        (".......!", vec![(7, 0)]),
    ] {
        let mut cycles = screw::cycles()[..course.len()].to_vec();
        let mut alarms_count = 0;
        for (cycle, sign) in cycles.iter_mut().zip(course.chars()) {
            alarms_count += u32::from(sign == '!');
            cycle.alarms_count = alarms_count;
            cycle.hand.state = if sign == '.' { SlipState::Stick } else { SlipState::Incipient };
        }
        let cycles = screw::numbered(cycles);
        let folder = tempfile::tempdir().expect("a folder");
        written(folder.path(), &screw::info(), &cycles).finish(&[], None).expect("finishes");
        let (mut begins, mut ends) = (Vec::new(), Vec::new());
        for event in events(folder.path()) {
            match event.event {
                Event::SlipBegins { .. } => begins.push((event.time_ns as f64 * 30.0 / 1e9).round() as u64),
                Event::SlipEnds { lasted_ns, .. } => ends.push(lasted_ns / 1_000_000),
                _ => {}
            }
        }
        let got: Vec<(u64, u64)> = begins.iter().copied().zip(ends.iter().copied()).collect();
        assert_eq!((got, begins.len()), (expected, ends.len()), "{course}");
    }
}

#[test]
fn a_slip_of_the_last_cycle_is_over_before_what_is_noted_after_it() {
    let cycles = &screw::cycles()[..=screw::SLIPS[1] as usize];
    let last_ns = cycles[cycles.len() - 1].time_ns;
    let folder = tempfile::tempdir().expect("a folder");
    let mut run = written(folder.path(), &screw::info(), cycles);
    run.end_cycles().expect("writes");
    run.note(last_ns + 40_000_000, "left: 84 frames").expect("writes");
    run.finish(&screw::results(), None).expect("finishes");
    let events = events(folder.path());
    assert!(events.is_sorted_by_key(|e| e.time_ns), "{events:?}");
    let after = events.iter().skip_while(|e| !matches!(e.event, Event::SlipBegins { slip: 2, .. }));
    let ends: Vec<_> = after.filter(|e| matches!(e.event, Event::SlipEnds { .. })).collect();
    assert!(matches!(ends[..], [TimedEvent { event: Event::SlipEnds { slip: 2, .. }, .. }]), "{ends:?}");
}

#[test]
fn a_slip_is_at_the_force_before_its_answer_also_where_the_gripper_measures_none() {
    for (measures, tells_target) in [(true, true), (false, true), (false, false)] {
        let mut cycles = screw::cycles();
        for i in 1..cycles.len() {
            let commanded_n = cycles[i - 1].grip_command.force_n();
            cycles[i].gripper.force_n = commanded_n.filter(|_| measures);
            cycles[i].gripper.target_n = commanded_n.filter(|_| tells_target);
        }
        let at = screw::SLIPS[1] as usize;
        let before_n = cycles[at - 1].grip_command.force_n();
        cycles[at].grip_command = GripCommand::Hold { force_n: 57.0 }; // answered at once
        let folder = tempfile::tempdir().expect("a folder");
        let page = written(folder.path(), &screw::info(), &cycles).finish(&[], None).expect("finishes");
        let told = events(folder.path()).into_iter().find_map(|e| match e.event {
            Event::SlipBegins { slip: 2, force_n, force_measured, .. } => Some((force_n, force_measured)),
            _ => None,
        });
        assert_eq!(told, Some((before_n, Some(measures))), "measures {measures}, tells its target {tells_target}");
        let html = std::fs::read_to_string(page).expect("reads");
        let card = html.split("<article id=\"slip-2\">").nth(1).and_then(|card| card.split("</h3>").next());
        let kind = if measures { "measured" } else { "commanded" };
        let expected = format!("at {:.1} N {kind}", before_n.expect("held"));
        assert!(card.is_some_and(|card| card.contains(&expected)), "{expected}: {card:?}");
    }
}
