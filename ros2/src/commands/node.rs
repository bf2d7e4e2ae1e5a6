//! `slipbound-ros2 node`.

use super::Done;
use slipbound_ros2::config;
use slipbound_ros2::node::SlipNode;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

/// The arguments of `slipbound-ros2 node`.
#[derive(Debug, clap::Args)]
pub struct Node {
    /// Parameters: ros2/example.toml has them all
    #[arg(value_name = "FILE.toml")]
    config: PathBuf,
}

impl Node {
    /// Runs the node until it is stopped.
    pub fn run(&self, stop: &AtomicBool) -> Done {
        let domain_id = std::env::var("ROS_DOMAIN_ID").ok();
        let config = config::load(&self.config, domain_id.as_deref())?;
        let node = SlipNode::start(&config)?;
        println!("{} runs in domain {}; Ctrl-C ends it", node.full_name(), config.domain_id);
        node.run(stop)?;
        Ok(())
    }
}
