//! The force sensor of an emulated gripper: reads the force of the jaws, with configurable errors.
//!
//! ```text
//!   force --lag--> x gain, + bias, + drift t, + idle reading while nothing is touched --+ noise--> steps --> reading, kept for its period
//! ```

/// Errors of a force sensor. Default: none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorFaults {
    /// Added to every reading, N per finger.
    pub bias_n: f64,
    /// Factor on the force.
    pub gain: f64,
    /// Standard deviation of the noise, N per finger.
    pub noise_n: f64,
    /// Step of the reading, N per finger; 0 for none.
    pub step_n: f64,
    /// Growth of the bias, N per finger and second.
    pub drift_n_per_s: f64,
    /// Added while nothing is touched: what a motor's current reads when it only holds itself, N per finger.
    pub idle_n: f64,
    /// Time constant with which the reading follows the force, s.
    pub lag_s: f64,
    /// Time between two readings, ns; 0: always anew.
    pub period_ns: u64,
}

impl Default for SensorFaults {
    fn default() -> Self {
        SensorFaults {
            bias_n: 0.0,
            gain: 1.0,
            noise_n: 0.0,
            step_n: 0.0,
            drift_n_per_s: 0.0,
            idle_n: 0.0,
            lag_s: 0.0,
            period_ns: 0,
        }
    }
}

/// A force sensor that receives the time and the force.
#[derive(Debug, Clone, Default)]
pub(super) struct ForceSensor {
    faults: SensorFaults,
    random: u64,
    from_ns: Option<u64>,
    now_ns: u64,
    /// When the next reading is due, ns.
    due_ns: u64,
    lagged_n: f64,
    reading_n: f64,
    tared_n: f64,
}

impl ForceSensor {
    /// A sensor with these faults; its noise is drawn from `seed`.
    pub fn new(faults: SensorFaults, seed: u64) -> Self {
        ForceSensor { faults, random: seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1, ..ForceSensor::default() }
    }

    /// The force at this time, N per finger, and whether something is touched.
    pub fn see(&mut self, now_ns: u64, force_n: f64, touches: bool) {
        let faults = self.faults;
        let elapsed_s = now_ns.saturating_sub(self.now_ns) as f64 * 1e-9;
        let since_s = now_ns.saturating_sub(*self.from_ns.get_or_insert(now_ns)) as f64 * 1e-9;
        self.now_ns = now_ns;
        let share = if faults.lag_s > 0.0 { 1.0 - (-elapsed_s / faults.lag_s).exp() } else { 1.0 };
        self.lagged_n += share * (force_n - self.lagged_n);
        if now_ns < self.due_ns {
            return;
        }
        self.due_ns = now_ns + faults.period_ns;
        let idle_n = if touches { 0.0 } else { faults.idle_n };
        let noise_n = if faults.noise_n > 0.0 { faults.noise_n * self.draw() } else { 0.0 };
        let now_n = self.lagged_n * faults.gain + faults.bias_n + faults.drift_n_per_s * since_s + idle_n + noise_n;
        let step_n = faults.step_n;
        self.reading_n = if step_n > 0.0 { (now_n / step_n).round() * step_n } else { now_n };
        self.reading_n -= self.tared_n;
    }

    /// The present reading counts as no force.
    pub fn tare(&mut self) {
        self.tared_n += self.reading_n;
        self.reading_n = 0.0;
    }

    /// The reading, N per finger.
    pub fn reading_n(&self) -> f64 {
        self.reading_n
    }

    /// A number with mean 0 and standard deviation 1, from twelve uniform numbers.
    fn draw(&mut self) -> f64 {
        let mut sum = -6.0;
        for _ in 0..12 {
            self.random ^= self.random >> 12;
            self.random ^= self.random << 25;
            self.random ^= self.random >> 27;
            sum += (self.random.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1u64 << 53) as f64;
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    /// Mean and standard deviation of a sensor's readings over 20 s of this force.
    fn reads(faults: SensorFaults, force_n: f64, touches: bool) -> (f64, f64) {
        let mut sensor = ForceSensor::new(faults, 3);
        let readings: Vec<f64> = (0..10_000)
            .map(|i| {
                sensor.see(i * 2 * MS, force_n, touches);
                sensor.reading_n()
            })
            .collect();
        let mean = readings.iter().sum::<f64>() / 1e4;
        let variance = readings.iter().map(|n| (n - mean) * (n - mean)).sum::<f64>() / 1e4;
        (mean, variance.sqrt())
    }

    #[test]
    fn every_fault_does_what_it_is_called() {
        let good = SensorFaults::default();
        assert_eq!(reads(good, 10.0, true), (10.0, 0.0));
        assert_eq!(reads(SensorFaults { bias_n: -3.0, gain: 0.85, ..good }, 10.0, true), (5.5, 0.0));
        assert_eq!(reads(SensorFaults { idle_n: 4.0, ..good }, 0.0, false), (4.0, 0.0));
        assert_eq!(reads(SensorFaults { idle_n: 4.0, ..good }, 10.0, true), (10.0, 0.0));
        let (mean_n, sd_n) = reads(SensorFaults { noise_n: 1.5, ..good }, 10.0, true);
        assert!((mean_n - 10.0).abs() < 0.05 && (sd_n - 1.5).abs() < 0.05, "{mean_n} {sd_n}");
        let (mean_n, _) = reads(SensorFaults { drift_n_per_s: 0.1, ..good }, 10.0, true);
        assert!((mean_n - 11.0).abs() < 0.01, "{mean_n}: 1 N in the mean of 20 s");
        assert_eq!(reads(SensorFaults { step_n: 4.0, ..good }, 9.0, true), (8.0, 0.0));
        let mut rare = ForceSensor::new(SensorFaults { period_ns: 100 * MS, ..good }, 1);
        let told_n = [0, 50, 99, 100, 150].map(|ms| {
            rare.see(ms * MS, ms as f64, true);
            rare.reading_n()
        });
        assert_eq!(told_n, [0.0, 0.0, 0.0, 100.0, 100.0]);
        let mut slow = ForceSensor::new(SensorFaults { lag_s: 0.1, ..good }, 1);
        slow.see(0, 0.0, true);
        slow.see(100 * MS, 10.0, true);
        assert!((slow.reading_n() - 6.32).abs() < 0.01);
    }
}
