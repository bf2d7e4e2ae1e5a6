//! The command `slipbound`.

fn main() {}
