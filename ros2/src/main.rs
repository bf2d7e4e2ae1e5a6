//! The command `slipbound-ros2`: the node, by a file of parameters.

use clap::Parser;
use slipbound_ros2::config;
use slipbound_ros2::node::SlipNode;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Judges the pictures of tactile fingers in ROS 2: slip reports out, one a picture.
#[derive(Debug, Parser)]
#[command(version)]
struct Arguments {
    /// Parameters: ros2/example.toml has them all
    #[arg(value_name = "FILE.toml")]
    config: PathBuf,
}

fn main() -> ExitCode {
    let Arguments { config } = Arguments::parse();
    let domain_id = std::env::var("ROS_DOMAIN_ID").ok();
    let config = match config::load(&config, domain_id.as_deref()) {
        Ok(config) => config,
        Err(e) => {
            eprintln!("slipbound-ros2: {e}");
            return ExitCode::from(2);
        }
    };
    match run(&config) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("slipbound-ros2: {e}");
            ExitCode::FAILURE
        }
    }
}

fn run(config: &config::Config) -> Result<(), Box<dyn std::error::Error>> {
    let stop = Arc::new(AtomicBool::new(false));
    let stops = stop.clone();
    ctrlc::set_handler(move || stops.store(true, Ordering::Relaxed))?;
    let node = SlipNode::start(config)?;
    println!("{} runs in domain {}; Ctrl-C ends it", node.full_name(), config.domain_id);
    node.run(&stop);
    Ok(())
}
