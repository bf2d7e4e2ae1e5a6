//! A gripper of your own behind the port that the control loop uses. `cargo run -p slipbound --example my_gripper`
#![allow(clippy::disallowed_macros)] // an example prints

use slipbound::port::{GripCommand, Gripper, GripperError, GripperErrorKind, GripperState, Jaws};

/// Replace it by your gripper's driver. It accepts 5 N to 80 N per finger.
struct MyGripper {
    time_ns: u64,
    target_n: Option<f64>,
    jaws: Jaws,
}

impl Gripper for MyGripper {
    /// Send the command and return: do not wait for the jaws.
    fn command(&mut self, command: GripCommand) -> Result<(), GripperError> {
        match command {
            GripCommand::Hold { force_n } if !(5.0..=80.0).contains(&force_n) => {
                let why = format!("my gripper: expected 5 N to 80 N per finger, got {force_n} N");
                return Err(GripperError::new(GripperErrorKind::Value, why)); // the force stays as it was
            }
            GripCommand::Hold { force_n } => (self.target_n, self.jaws) = (Some(force_n), Jaws::Holding),
            GripCommand::Release => (self.target_n, self.jaws) = (None, Jaws::Open),
        }
        Ok(())
    }

    /// Return the newest state received.
    fn poll(&mut self) -> Result<GripperState, GripperError> {
        self.time_ns += 20_000_000; // your driver's time stamp, on the clock of the loop
        let (time_ns, target_n, jaws) = (self.time_ns, self.target_n, self.jaws);
        // This one measures neither force nor opening.
        Ok(GripperState { time_ns, force_n: None, force_error_n: None, target_n, opening_mm: None, jaws })
    }
}

fn main() -> Result<(), GripperError> {
    let mut gripper = MyGripper { time_ns: 0, target_n: None, jaws: Jaws::Open };
    let hold = |force_n| GripCommand::Hold { force_n };
    for command in [hold(12.0), hold(300.0), hold(18.0), GripCommand::Release] {
        match gripper.command(command) {
            Ok(()) => println!("{command:?}: taken over"),
            Err(error) => println!("{command:?}: {:?}, {error}", error.kind),
        }
        let state = gripper.poll()?;
        println!("    jaws {:?}, target {:?} N per finger", state.jaws, state.target_n);
    }
    Ok(())
}
