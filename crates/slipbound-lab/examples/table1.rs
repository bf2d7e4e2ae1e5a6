//! The paper's rule over ten objects and three forces, as it falls; beside it the settings we ship.
//!
//! `cargo run --release -p slipbound-lab --example table1 [-- --trials N] [--seed N]`: N of the 24 trials of every
//! object. Runs on all cores; the table does not depend on how many there are.

use slipbound::monitor::Settings;
use slipbound_lab::objects::OBJECTS;
use slipbound_lab::protocol::{FORCES_N, Push, RuleOutcome, Verdict, evaluate, pushes};
use std::sync::atomic::{AtomicUsize, Ordering};

fn argument(name: &str, default: u64) -> u64 {
    let arguments: Vec<String> = std::env::args().collect();
    match arguments.iter().position(|argument| argument == name) {
        None => default,
        Some(at) => arguments.get(at + 1).and_then(|value| value.parse().ok()).unwrap_or_else(|| {
            eprintln!("{name}: expected a whole number");
            std::process::exit(2)
        }),
    }
}

/// Counts over some trials.
#[derive(Debug, Default)]
struct Counts {
    trials: u32,
    right: u32,
    false_alarms: u32,
    late: u32,
    missed: u32,
    gripping: u32,
    frames: u32,
    unsure: u32,
    fractions: Vec<f64>,
}

impl Counts {
    fn add(&mut self, outcome: &RuleOutcome) {
        self.trials += 1;
        self.gripping += u32::from(outcome.alarm_while_gripping);
        self.frames += outcome.frames_count;
        self.unsure += outcome.unsure_count;
        match outcome.verdict {
            Verdict::InTime(fraction) => {
                self.right += 1;
                self.fractions.push(fraction);
            }
            Verdict::Quiet => self.right += 1,
            Verdict::False => self.false_alarms += 1,
            Verdict::Late => self.late += 1,
            Verdict::Missed => self.missed += 1,
        }
    }

    fn row(&mut self, name: &str) -> String {
        let share = |count: u32, of: u32| if of == 0 { 0.0 } else { 100.0 * f64::from(count) / f64::from(of) };
        self.fractions.sort_by(f64::total_cmp);
        let median = self.fractions.get(self.fractions.len() / 2).map_or("-".into(), |f| format!("{f:.2}"));
        format!(
            "| {name} | {} | {:.1} | {:.1} | {:.1} | {} + {} | {median} | {:.0} | {} |",
            self.trials,
            share(self.right, self.trials),
            share(self.false_alarms, self.trials),
            share(self.late + self.missed, self.trials),
            self.late,
            self.missed,
            share(self.unsure, self.frames),
            self.gripping
        )
    }
}

fn main() {
    let (count, seed) = (argument("--trials", 24).min(24) as usize, argument("--seed", 0));
    let rules = [Settings::paper(), Settings::default()];
    let trials: Vec<(usize, Push)> = OBJECTS[..10]
        .iter()
        .enumerate()
        .flat_map(|(n, object)| {
            // Spread over the 24, so that few trials still cover all forces and kinds.
            let all = pushes(object.name, seed);
            (0..count).map(move |k| (n, all[k * 24 / count].clone()))
        })
        .collect();
    let next = AtomicUsize::new(0);
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let mut results: Vec<(usize, Vec<RuleOutcome>)> = std::thread::scope(|scope| {
        let work = || {
            let mut done = Vec::new();
            loop {
                let at = next.fetch_add(1, Ordering::Relaxed);
                let Some((_, push)) = trials.get(at) else { return done };
                match evaluate(push, &rules) {
                    Ok(outcomes) => done.push((at, outcomes)),
                    Err(error) => eprintln!("{}: {error}", push.trial),
                }
            }
        };
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        workers.into_iter().flat_map(|worker| worker.join().expect("no panic")).collect()
    });
    results.sort_by_key(|(at, _)| *at);
    for (rule, name) in ["the paper's rule, Settings::paper()", "Settings::default()"].into_iter().enumerate() {
        println!("\n{name}\n");
        println!(
            "| object | trials | right % | FP % | FN % | late + missed | f at alarm | unsure % | while gripping |"
        );
        println!("|---|---|---|---|---|---|---|---|---|");
        let table = |name: &str, of: &dyn Fn(usize, &Push) -> bool| {
            let mut counts = Counts::default();
            for (at, outcomes) in &results {
                let (object, push) = &trials[*at];
                if of(*object, push) {
                    counts.add(&outcomes[rule]);
                }
            }
            println!("{}", counts.row(name));
        };
        for (n, object) in OBJECTS[..10].iter().enumerate() {
            table(object.name, &|object, _| object == n);
        }
        for force_n in FORCES_N {
            table(&format!("all at {force_n} N"), &|_, push| push.trial.number("force_n") == force_n);
        }
        table("**all**", &|_, _| true);
    }
    let failed = trials.len() - results.len();
    if failed > 0 {
        eprintln!("{failed} trials failed");
        std::process::exit(1);
    }
}
