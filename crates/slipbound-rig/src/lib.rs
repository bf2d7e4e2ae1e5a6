//! Files, cameras and grippers for `slipbound`.
