//! Signs of slip, drawn in a row, and the slip episodes derived from them.
//!
//! ```text
//!   .  a frame without slip     x  one with slip     o  no contact
//! ```

mod synthetic;

use slipbound::events::{SlipEpisodes, SlipEvent, SlipEvents, SlipObservation};
use slipbound::monitor::{ContactReport, Estimates, MarkerCounts, SlipKind, SlipReport, SlipState, SlipSummary};
use synthetic::hand;

/// Time of a frame of the row, ns: 20 Hz, so that 0.2 s are four frames.
const PERIOD_NS: u64 = 50_000_000;

fn observation(seq: u64, time_ns: Option<u64>, shown: char) -> SlipObservation {
    SlipObservation { seq, time_ns, is_judged: true, slips: shown == 'x', contact_lost: shown == 'o' }
}

/// The number of the slip that each frame belongs to, as known at that frame: a digit while it lasts, `.` after.
fn slips_in(row: &str, has_times: bool) -> String {
    let (mut episodes, mut now) = (SlipEpisodes::default(), '.');
    let drawn = row.chars().enumerate().map(|(i, shown)| {
        let time_ns = has_times.then_some(i as u64 * PERIOD_NS);
        let change = episodes.see(&observation(i as u64, time_ns, shown));
        if change.ended.is_some() {
            now = '.';
        }
        if let Some(slip) = change.began {
            now = char::from_digit(slip.number, 10).expect("few slips");
        }
        now
    });
    drawn.collect()
}

#[test]
fn a_slip_lasts_until_nothing_was_seen_of_it_for_a_fifth_of_a_second() {
    // At 20 Hz the fourth quiet frame ends it; a slip detected there is the next one.
    assert_eq!(slips_in("..xx.x....xx...x.......x", true), "..1111111.222223333....4");
}

/// One in four frames arrives: a frame with slip after a frame with slip goes on, one after a frame without is the next.
#[test]
fn at_five_frames_a_second_a_slip_ends_with_a_frame_without_slip_or_after_one_and_a_half_seconds() {
    let slips_of = |times_ms: &[(u64, char)]| {
        let mut episodes = SlipEpisodes::default();
        for (seq, &(ms, shown)) in times_ms.iter().enumerate() {
            let time_ns = Some(1_000_000 * ms);
            episodes.see(&observation(seq as u64, time_ns, shown));
        }
        episodes.count()
    };
    assert_eq!(slips_of(&[(0, 'x'), (200, 'x'), (400, 'x'), (600, 'x')]), 1);
    assert_eq!(slips_of(&[(0, 'x'), (200, '.'), (400, 'x')]), 2);
    assert_eq!(slips_of(&[(0, 'x'), (1499, 'x'), (2999, 'x')]), 2);
}

#[test]
fn without_times_six_frames_are_a_fifth_of_a_second() {
    assert_eq!(slips_in("x.....x......x.", false), "111111222222.33");
}

#[test]
fn a_slip_ends_with_the_contact() {
    assert_eq!(slips_in(".xxoox.o.", true), ".11..22..");
}

/// A finger's report of a frame of a row at 20 Hz, from number 100 on.
fn report(i: usize, shown: char) -> SlipReport {
    let state = match shown {
        'x' => SlipState::Incipient,
        'X' => SlipState::Gross,
        'o' => SlipState::NoContact,
        _ => SlipState::Stick,
    };
    SlipReport {
        seq: 100 + i as u64,
        time_ns: Some(7 + i as u64 * PERIOD_NS),
        state,
        reason: None,
        contact: ContactReport::default(),
        markers: MarkerCounts::default(),
        reference_seq: 0,
        grip_n: None,
        motion: None,
        shear: None,
        slip: SlipSummary {
            kind: Some(SlipKind::Translation),
            direction_rad: Some(0.1 * i as f64),
            ..SlipSummary::default()
        },
        estimates: Estimates::default(),
        evidence: None,
    }
}

#[test]
fn the_lines_of_a_recording_name_the_first_and_the_last_frame_of_each_slip() {
    let mut events = SlipEvents::new();
    let mut told: Vec<SlipEvent> = "..xX.x.....x"
        .chars()
        .enumerate()
        .flat_map(|(i, shown)| events.see(&report(i, shown)).collect::<Vec<_>>())
        .collect();
    told.extend(events.end());
    assert_eq!(events.end(), None, "nothing runs any more");
    let at = |i: u64| (100 + i, Some(7 + i * PERIOD_NS));
    let begins = |slip, i: u64| SlipEvent::Begins {
        slip,
        seq: at(i).0,
        time_ns: at(i).1,
        kind: Some(SlipKind::Translation),
        direction_rad: Some(0.1 * i as f64),
    };
    let ends = |slip, i, frames_count, ongoing| {
        let (seq, time_ns) = at(i);
        SlipEvent::Ends { slip, seq, time_ns, frames_count, ongoing }
    };
    assert_eq!(told, [begins(1, 2), ends(1, 5, 3, false), begins(2, 11), ends(2, 11, 1, true)]);
}

/// A camera that was plugged in again counts from 0; two seconds later it slips again.
#[test]
fn a_slip_after_a_clock_was_set_back_is_another_one() {
    let mut episodes = SlipEpisodes::default();
    let mut see = |time_ns, slips| {
        episodes.see(&observation(0, Some(time_ns), if slips { 'x' } else { '.' }));
        episodes.count()
    };
    assert_eq!(see(100 * PERIOD_NS, true), 1);
    assert_eq!((0..60).map(|i| see(i * PERIOD_NS, false)).last(), Some(1));
    assert_eq!(see(60 * PERIOD_NS, true), 2);
}

#[test]
fn a_hand_counts_slips_by_the_clock_of_the_loop() {
    let mut episodes = SlipEpisodes::default();
    // The fingers' frames have no times; the loop's cycles do.
    for (i, shown) in "xx....xx...x".chars().enumerate() {
        let state = if shown == 'x' { SlipState::Gross } else { SlipState::Stick };
        let observation = SlipObservation::of_hand(i as u64 * PERIOD_NS, &hand(state));
        assert_eq!((observation.seq, observation.time_ns), (1, Some(i as u64 * PERIOD_NS)));
        episodes.see(&observation);
    }
    assert_eq!(episodes.count(), 3);
}

/// A camera of 5 Hz: between its frames a cycle of the loop has nothing to judge.
#[test]
fn a_cycle_without_a_frame_is_none_without_slip() {
    use SlipState::{Gross, Stick, Unjudged};
    let slips_of = |states: &[SlipState]| {
        let mut episodes = SlipEpisodes::default();
        for (i, state) in states.iter().enumerate() {
            episodes.see(&SlipObservation::of_hand(i as u64 * 2 * PERIOD_NS, &hand(*state)));
        }
        episodes.count()
    };
    assert_eq!(slips_of(&[Gross, Unjudged, Unjudged, Gross]), 1);
    assert_eq!(slips_of(&[&[Gross][..], &[Unjudged; 14], &[Gross]].concat()), 2, "after 1.5 s");
    assert_eq!(slips_of(&[Gross, Unjudged, Stick, Gross]), 2, "a frame without slip came");
    assert_eq!(slips_of(&[Gross, Stick, Unjudged, Gross]), 2, "the same before");
}
