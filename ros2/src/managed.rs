//! Topics and services of a managed node.

use crate::error::Error;
use crate::lifecycle::{Lifecycle, State, Transition};
use crate::msg::{
    ChangeStateRequest, ChangeStateResponse, Empty, GetAvailableStatesResponse, GetAvailableTransitionsResponse,
    GetStateResponse, LifecycleState, LifecycleTransition, TransitionEvent,
};
use crate::ros::{LATCHED, RELIABLE, Ros, unix_ns};
use ros2_client::service::RmwRequestId;
use ros2_client::{Message, Publisher, Server};

/// Topics and services that publish, report and change the state.
pub struct Managed {
    states: Publisher<LifecycleState>,
    events: Publisher<TransitionEvent>,
    change_state: Server<ChangeStateRequest, ChangeStateResponse>,
    get_state: Server<Empty, GetStateResponse>,
    get_available_states: Server<Empty, GetAvailableStatesResponse>,
    get_available_transitions: Server<Empty, GetAvailableTransitionsResponse>,
    get_transition_graph: Server<Empty, GetAvailableTransitionsResponse>,
}

impl Managed {
    /// The topics and services of this node.
    pub fn new(ros: &mut Ros) -> Result<Self, Error> {
        let package = "lifecycle_msgs";
        Ok(Managed {
            states: ros.publisher("state", &LATCHED)?,
            events: ros.publisher("transition_event", &RELIABLE)?,
            change_state: ros.server("change_state", package, "ChangeState")?,
            get_state: ros.server("get_state", package, "GetState")?,
            get_available_states: ros.server("get_available_states", package, "GetAvailableStates")?,
            get_available_transitions: ros.server("get_available_transitions", package, "GetAvailableTransitions")?,
            get_transition_graph: ros.server("get_transition_graph", package, "GetAvailableTransitions")?,
        })
    }

    /// Publishes the state.
    pub fn publish_state(&self, state: State) {
        let _ = self.states.publish(state.into()); // also answered on request, and in the diagnostics
    }

    /// Publishes a transition.
    pub fn publish_transition(&self, transition: Transition) {
        let _ = self.events.publish(TransitionEvent::of(transition, unix_ns())); // the state is published separately
    }

    /// The next requested transition.
    pub fn request(&self) -> Option<(RmwRequestId, LifecycleTransition)> {
        let (id, request) = self.change_state.receive_request().ok()??;
        Some((id, request.transition))
    }

    /// Answers a request for a transition.
    pub fn done(&self, id: RmwRequestId, success: bool) {
        let _ = self.change_state.send_response(id, ChangeStateResponse { success }); // the client may be gone
    }

    /// Answers all requests for the state.
    pub fn answer(&self, lifecycle: &Lifecycle) {
        answer(&self.get_state, || GetStateResponse { current_state: lifecycle.state().into() });
        answer(&self.get_available_states, || GetAvailableStatesResponse {
            available_states: State::ALL.map(LifecycleState::from).into(),
        });
        answer(&self.get_available_transitions, || GetAvailableTransitionsResponse {
            available_transitions: lifecycle.available().map(Into::into).collect(),
        });
        answer(&self.get_transition_graph, || GetAvailableTransitionsResponse {
            available_transitions: Lifecycle::graph().map(Into::into).collect(),
        });
    }
}

fn answer<Response: Message + 'static>(server: &Server<Empty, Response>, response: impl Fn() -> Response) {
    while let Ok(Some((id, _))) = server.receive_request() {
        let _ = server.send_response(id, response()); // the client may be gone
    }
}
