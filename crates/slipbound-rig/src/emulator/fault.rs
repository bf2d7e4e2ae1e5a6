//! Faults of the emulated gripper itself, not of its link.

/// Faults of the emulated gripper itself, not of its link.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// It stops itself and must be acknowledged.
    FastStop,
    /// From now on it refuses every new force.
    RefuseForce,
    /// The object is lost.
    LosePart,
    /// Its supply fails and comes back: the link breaks, it forgets where its jaws are. They keep their force.
    PowerCycle,
    /// A new force limit has no effect on what is already held.
    FixedLimit,
    /// A grasp may be given again while holding.
    AllowRegrasp,
}
