//! Messages of `lifecycle_msgs`.

use super::topic_types;
use crate::lifecycle::{State, Transition};
use serde::{Deserialize, Serialize};

/// `lifecycle_msgs/State`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct LifecycleState {
    /// 1 unconfigured, 2 inactive, 3 active, 4 finalized; from 10 on transient states.
    pub id: u8,
    /// Its label.
    pub label: String,
}

/// `lifecycle_msgs/Transition`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct LifecycleTransition {
    /// Its number.
    pub id: u8,
    /// Its label; in a request it has priority over the number, unless it is empty.
    pub label: String,
}

/// `lifecycle_msgs/TransitionDescription`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct TransitionDescription {
    /// The transition.
    pub transition: LifecycleTransition,
    /// Start state.
    pub start_state: LifecycleState,
    /// Goal state.
    pub goal_state: LifecycleState,
}

/// `lifecycle_msgs/TransitionEvent`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct TransitionEvent {
    /// Time, ns since 1970.
    pub timestamp: u64,
    /// The transition.
    pub transition: LifecycleTransition,
    /// Start state.
    pub start_state: LifecycleState,
    /// Goal state.
    pub goal_state: LifecycleState,
}

/// The request of `lifecycle_msgs/ChangeState`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct ChangeStateRequest {
    /// The requested transition.
    pub transition: LifecycleTransition,
}

/// The answer of `lifecycle_msgs/ChangeState`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct ChangeStateResponse {
    /// Whether it succeeded.
    pub success: bool,
}

/// The answer of `lifecycle_msgs/GetState`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct GetStateResponse {
    /// The state.
    pub current_state: LifecycleState,
}

/// The answer of `lifecycle_msgs/GetAvailableStates`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct GetAvailableStatesResponse {
    /// Every state there is.
    pub available_states: Vec<LifecycleState>,
}

/// The answer of `lifecycle_msgs/GetAvailableTransitions`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct GetAvailableTransitionsResponse {
    /// Those that begin in the state, or all.
    pub available_transitions: Vec<TransitionDescription>,
}

impl From<State> for LifecycleState {
    fn from(state: State) -> Self {
        LifecycleState { id: state.id(), label: state.label().into() }
    }
}

impl From<Transition> for TransitionDescription {
    fn from(way: Transition) -> Self {
        TransitionDescription {
            transition: LifecycleTransition { id: way.id, label: way.label.into() },
            start_state: way.start.into(),
            goal_state: way.goal.into(),
        }
    }
}

impl TransitionEvent {
    /// The event of this transition at this time, ns since 1970.
    pub fn of(transition: Transition, timestamp: u64) -> Self {
        let TransitionDescription { transition, start_state, goal_state } = transition.into();
        TransitionEvent { timestamp, transition, start_state, goal_state }
    }
}

topic_types! {
    "lifecycle_msgs" / TransitionEvent;
}

impl ros2_client::Message for LifecycleState {}
impl super::TopicType for LifecycleState {
    const PACKAGE: &'static str = "lifecycle_msgs";
    const NAME: &'static str = "State";
}

impl ros2_client::Message for ChangeStateRequest {}
impl ros2_client::Message for ChangeStateResponse {}
impl ros2_client::Message for GetStateResponse {}
impl ros2_client::Message for GetAvailableStatesResponse {}
impl ros2_client::Message for GetAvailableTransitionsResponse {}
