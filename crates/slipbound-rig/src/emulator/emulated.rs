//! An emulator: a gripper's firmware on a link that can be made to fail.

use super::fault::Fault;
use super::faults::{FaultError, Faults, LATE_NS};
use super::firmware::Firmware;
use slipbound::plant::Plant;
use std::collections::VecDeque;

/// An emulated gripper without its link, a state machine that receives the time. Its owner moves the bytes, passes the
/// time and advances the plant.
pub struct Emulator {
    firmware: Box<dyn Firmware>,
    faults: Faults,
    random: u64,
    /// When the first tick was: times of faults count from there.
    from_ns: Option<u64>,
    now_ns: u64,
    /// Bytes received while stalled.
    unread: Vec<u8>,
    /// What the firmware has just answered.
    answer: Vec<u8>,
    /// Answers and when they are due.
    late: VecDeque<(u64, Vec<u8>)>,
    outgoing: Vec<u8>,
    answers_count: u32,
    is_hanging_up: bool,
}

impl Emulator {
    /// An emulator with this firmware that does not fail.
    pub fn new(firmware: Box<dyn Firmware>) -> Self {
        Emulator {
            firmware,
            faults: Faults::default(),
            random: 1,
            from_ns: None,
            now_ns: 0,
            unread: Vec::new(),
            answer: Vec::new(),
            late: VecDeque::new(),
            outgoing: Vec::new(),
            answers_count: 0,
            is_hanging_up: false,
        }
    }

    /// The same with these faults. Times of faults count from the first tick.
    pub fn with_faults(mut self, faults: Faults) -> Self {
        self.firmware.jaws_mut().set_sensor(faults.sensor, faults.seed);
        Emulator { random: faults.seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1, faults, ..self }
    }

    /// A client has connected.
    pub fn connected(&mut self, now_ns: u64) {
        self.unread.clear();
        self.answer.clear();
        self.late.clear();
        self.outgoing.clear();
        self.is_hanging_up = false; // what came before it has closed nothing
        self.firmware.connected(now_ns, &mut self.answer);
    }

    /// The connection was closed. An object that is held stays held.
    pub fn disconnected(&mut self, now_ns: u64) {
        // What was sent before the end, such as a farewell, is read first.
        let unread = std::mem::take(&mut self.unread);
        self.firmware.receive(now_ns, &unread, &mut self.answer);
        self.firmware.disconnected();
        self.answer.clear();
    }

    /// Bytes have been received.
    pub fn receive(&mut self, now_ns: u64, bytes: &[u8]) {
        self.now_ns = now_ns;
        if self.is_stalled() {
            self.unread.extend_from_slice(bytes);
        } else {
            self.firmware.receive(now_ns, bytes, &mut self.answer);
            self.collect();
            self.release();
        }
    }

    /// Time has passed: the jaws move and press; answers and periodic states fall due. Does not advance the plant.
    pub fn tick(&mut self, now_ns: u64, plant: &mut dyn Plant) {
        self.from_ns.get_or_insert(now_ns);
        self.now_ns = now_ns;
        self.inject_due();
        if !self.is_stalled() && !self.unread.is_empty() {
            let unread = std::mem::take(&mut self.unread);
            self.firmware.receive(now_ns, &unread, &mut self.answer);
        }
        self.firmware.tick(now_ns, plant, &mut self.answer);
        self.collect();
        self.release();
    }

    /// Bytes to be sent; the sender removes from the front what it has sent.
    pub fn outgoing(&mut self) -> &mut Vec<u8> {
        &mut self.outgoing
    }

    /// Injects a fault now. False if this kind of gripper cannot have it.
    pub fn inject(&mut self, fault: Fault) -> bool {
        self.is_hanging_up |= fault == Fault::PowerCycle;
        match fault {
            Fault::LosePart => self.firmware.jaws_mut().lose_part(),
            Fault::RefuseForce => self.firmware.jaws_mut().refuse_force(),
            Fault::FastStop | Fault::PowerCycle | Fault::FixedLimit | Fault::AllowRegrasp => {
                return self.firmware.inject(fault, &mut self.answer);
            }
        }
        true
    }

    /// Further faults, written as for [`Faults`]; their times count from the last tick. Nothing changes if a word is
    /// invalid.
    pub fn fail_further(&mut self, words: &str) -> Result<(), FaultError> {
        let faults = self.faults.clone().joined_by(words, self.since_ns())?;
        if faults.sensor != self.faults.sensor {
            self.firmware.jaws_mut().set_sensor(faults.sensor, faults.seed);
        }
        self.faults = faults;
        Ok(())
    }

    /// Whether the connection is to be closed now; true once per fault.
    pub fn take_hang_up(&mut self) -> bool {
        std::mem::take(&mut self.is_hanging_up)
    }

    /// Normal force per finger it presses with, N.
    pub fn force_n(&self) -> f64 {
        self.firmware.jaws().force_n()
    }

    /// Distance between its fingertips, mm.
    pub fn opening_mm(&self) -> f64 {
        self.firmware.jaws().opening_mm()
    }

    /// Time from the first tick, ns.
    fn since_ns(&self) -> u64 {
        self.now_ns.saturating_sub(self.from_ns.unwrap_or(self.now_ns))
    }

    fn is_stalled(&self) -> bool {
        let since_ns = self.since_ns();
        self.faults
            .stalls_ns
            .iter()
            .any(|(from_ns, for_ns)| (*from_ns..from_ns.saturating_add(*for_ns)).contains(&since_ns))
    }

    /// A number from 0 to 1 (xorshift64*).
    fn draw(&mut self) -> f64 {
        self.random ^= self.random >> 12;
        self.random ^= self.random << 25;
        self.random ^= self.random >> 27;
        (self.random.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn inject_due(&mut self) {
        let since_ns = self.since_ns();
        let due: Vec<Fault> = self.faults.injections.iter().filter(|(at, _)| *at <= since_ns).map(|f| f.1).collect();
        self.faults.injections.retain(|(at_ns, _)| *at_ns > since_ns);
        for fault in due {
            self.inject(fault);
        }
        let closes_count = self.faults.closes_ns.len();
        self.faults.closes_ns.retain(|at_ns| *at_ns > since_ns);
        self.is_hanging_up |= self.faults.closes_ns.len() < closes_count;
    }

    /// Puts the answer on the link, with the link's faults.
    fn collect(&mut self) {
        let mut answer = std::mem::take(&mut self.answer);
        if answer.is_empty() {
            return;
        }
        if self.faults.corrupt_fraction > 0.0 && self.draw() < self.faults.corrupt_fraction {
            let place = (self.draw() * answer.len() as f64) as usize;
            answer[place] ^= 1 + (self.draw() * 255.0) as u8;
        }
        if self.faults.drop_fraction > 0.0 && self.draw() < self.faults.drop_fraction {
            let place = (self.draw() * answer.len() as f64) as usize;
            answer.remove(place);
        }
        self.answers_count += 1;
        let every_count = self.faults.late_every_count;
        let is_late = every_count > 0 && self.answers_count.is_multiple_of(every_count);
        let late_ns = self.faults.late_ns.saturating_add(if is_late { LATE_NS } else { 0 });
        self.late.push_back((self.now_ns.saturating_add(late_ns), answer));
    }

    fn release(&mut self) {
        while !self.is_stalled() && self.late.front().is_some_and(|(due_ns, _)| *due_ns <= self.now_ns) {
            if let Some((_, answer)) = self.late.pop_front() {
                self.outgoing.extend(answer);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::emulator::{Block, by_name};

    const MS: u64 = 1_000_000;

    #[test]
    fn what_would_have_closed_a_connection_does_not_close_a_later_one() {
        for faults in ["close@100", "power-cycle@100"] {
            let mut emulator = by_name("wsg50").expect("known").with_faults(faults.parse().expect("a fault"));
            let mut block = Block::new(50.0);
            (0..300).for_each(|ms| emulator.tick(ms * MS, &mut block));
            emulator.connected(300 * MS);
            emulator.tick(301 * MS, &mut block);
            assert!(!emulator.take_hang_up(), "{faults}, 200 ms before the connection");
        }
        let mut emulator = by_name("wsg50").expect("known").with_faults("close@100".parse().expect("a fault"));
        let mut block = Block::new(50.0);
        emulator.connected(0);
        (0..=101).for_each(|ms| emulator.tick(ms * MS, &mut block));
        assert!(emulator.take_hang_up(), "while it is connected");
    }

    /// The longest that can be written, as late as can be written.
    #[test]
    fn a_stall_and_a_delay_without_end_do_not_overflow() {
        let faults = "stall=18446744073709@18446744073709,late=18446744073709";
        let mut emulator = by_name("line").expect("known").with_faults(faults.parse().expect("faults"));
        emulator.connected(0);
        (0..100).for_each(|ms| emulator.tick(ms * MS, &mut Block::new(50.0)));
        assert!(emulator.outgoing().is_empty());
    }
}
