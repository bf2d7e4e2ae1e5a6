//! A node that is managed through all its states.

use crate::control::{CUTS, THERE, set_link};
use crate::node::{Bench, REST_COUNT, show, simulated};
use crate::process::{LONGEST_WAIT, Process, next};
use ros2_client::{Client, Message, ServiceMapping, ServiceTypeName};
use slipbound_ros2::msg::{
    ChangeStateRequest, ChangeStateResponse, Empty, GetAvailableStatesResponse, GetAvailableTransitionsResponse,
    GetStateResponse, LifecycleState, LifecycleTransition, SlipReport, TransitionEvent,
};
use slipbound_ros2::ros::{Inbox, LATCHED, RELIABLE, Ros};
use std::sync::PoisonError;
use std::thread::sleep;
use std::time::{Duration, Instant};

/// A service of the node.
fn client<Request, Response>(ros: &mut Ros, name: &str, kind: &str) -> Client<Request, Response>
where
    Request: Message + Clone + 'static,
    Response: Message + Clone + 'static,
{
    let name = ros2_client::Name::new("/slipbound", name).expect("a name");
    let kind = ServiceTypeName::new("lifecycle_msgs", kind);
    ros.node().create_client(ServiceMapping::Enhanced, &name, &kind, RELIABLE, RELIABLE).expect("a client")
}

/// Sends a request and repeats an action until there is an answer.
fn ask<Request, Response>(client: &Client<Request, Response>, request: Request, mut meanwhile: impl FnMut()) -> Response
where
    Request: Message + Clone + 'static,
    Response: Message + Clone + 'static,
{
    let id = client.send_request(request).expect("sent");
    let until = Instant::now() + LONGEST_WAIT;
    loop {
        while let Some((answered, response)) = client.receive_response().expect("readable") {
            if answered == id {
                return response;
            }
        }
        assert!(Instant::now() < until, "no answer");
        meanwhile();
    }
}

fn pause() {
    sleep(Duration::from_millis(5));
}

/// The node as its manager sees it.
struct Manager {
    bench: Bench,
    change_state: Client<ChangeStateRequest, ChangeStateResponse>,
    get_state: Client<Empty, GetStateResponse>,
    states: Inbox<LifecycleState>,
    events: Inbox<TransitionEvent>,
    told: Vec<TransitionEvent>,
}

impl Manager {
    fn new(mut bench: Bench) -> Self {
        Manager {
            change_state: client(&mut bench.ros, "change_state", "ChangeState"),
            get_state: client(&mut bench.ros, "get_state", "GetState"),
            states: bench.ros.inbox("/slipbound/state", &LATCHED).expect("an inbox"),
            events: bench.ros.inbox("/slipbound/transition_event", &RELIABLE).expect("an inbox"),
            told: Vec::new(),
            bench,
        }
    }

    /// Requests a transition; returns whether it succeeded.
    fn change(&mut self, id: u8, label: &str, meanwhile: impl FnMut(&mut Bench, &mut Inbox<LifecycleState>)) -> bool {
        let request = ChangeStateRequest { transition: LifecycleTransition { id, label: label.into() } };
        let (bench, states, mut meanwhile) = (&mut self.bench, &mut self.states, meanwhile);
        let answer = ask(&self.change_state, request, || meanwhile(bench, states));
        self.told.extend(std::iter::from_fn(|| next(&mut self.events, Duration::from_millis(100))));
        answer.success
    }

    /// Requests an immediate transition, and checks that it is published.
    fn go(&mut self, id: u8, label: &str, to: &str) {
        assert!(self.change(id, label, |_, _| pause()), "{id} {label}");
        self.is_told(to);
    }

    /// The answer arrives when the rest frame is known, not before images are shown.
    fn configure(&mut self) {
        let mut at_rest = simulated().1.iter().take(REST_COUNT).cycle();
        let mut was_told = false;
        assert!(self.change(1, "", |bench, states| {
            was_told = was_told || next(states, Duration::from_millis(20)).is_some_and(|s| s.label == "configuring");
            if was_told {
                show(bench, at_rest.next().expect("a cycle"));
            }
        }));
        self.is_told("inactive");
    }

    /// The state is published on the topic and returned on request.
    fn is_told(&mut self, label: &str) {
        let state = next(&mut self.states, LONGEST_WAIT).expect("a state");
        assert_eq!(state.label, label);
        assert_eq!(ask(&self.get_state, Empty::default(), pause).current_state, state);
    }

    /// Shows images of the untouched finger; returns the reports.
    fn show(&mut self, count: usize) -> Vec<SlipReport> {
        while next(&mut self.bench.reports, Duration::from_millis(300)).is_some() {}
        for shot in simulated().1.iter().take(REST_COUNT).cycle().take(count) {
            show(&self.bench, shot);
        }
        std::iter::from_fn(|| next(&mut self.bench.reports, Duration::from_millis(500))).collect()
    }
}

#[test]
fn a_managed_node_goes_through_its_states_and_reports_only_when_active() {
    let mut manager = Manager::new(Bench::new(4, "autostart = false"));
    let mut node = manager.bench.node();
    manager.bench.await_node();
    manager.is_told("unconfigured");
    assert!(manager.show(REST_COUNT + 5).is_empty(), "nobody asked it to look for rest");
    assert!(!manager.change(3, "", |_, _| pause()) && !manager.change(1, "activate", |_, _| pause()), "not configured");

    manager.configure();
    assert!(manager.show(5).is_empty(), "judged, not published");
    let available = client(&mut manager.bench.ros, "get_available_transitions", "GetAvailableTransitions");
    let graph = client(&mut manager.bench.ros, "get_transition_graph", "GetAvailableTransitions");
    let states = client(&mut manager.bench.ros, "get_available_states", "GetAvailableStates");
    sleep(Duration::from_millis(500)); // they are matched by then
    let told: GetAvailableTransitionsResponse = ask(&available, Empty::default(), pause);
    assert_eq!(told.available_transitions.iter().map(|t| t.transition.id).collect::<Vec<_>>(), [2, 3, 6]);
    assert!(told.available_transitions.iter().all(|t| t.start_state.label == "inactive"));
    let told: GetAvailableTransitionsResponse = ask(&graph, Empty::default(), pause);
    assert_eq!(told.available_transitions.len(), 13);
    let told: GetAvailableStatesResponse = ask(&states, Empty::default(), pause);
    assert_eq!(told.available_states.len(), 9);

    manager.go(0, "activate", "active");
    let first = manager.show(5);
    assert_eq!(first.iter().map(|report| report.frame).collect::<Vec<_>>(), [0, 1, 2, 3, 4]);
    assert!(!manager.change(2, "", |_, _| pause()), "an active node is not cleaned up");
    manager.go(4, "", "inactive");
    assert!(manager.show(5).is_empty(), "judged, not published");
    manager.go(3, "", "active");
    let second = manager.show(5);
    assert_eq!(second.len(), 5);
    assert_eq!(second[0].reference_seq, first[0].reference_seq, "the same rest frame");
    manager.go(4, "", "inactive");
    manager.go(2, "", "unconfigured");
    assert!(manager.show(REST_COUNT + 5).is_empty(), "it does not look for rest again");

    let began = Instant::now();
    assert!(!manager.change(1, "", |_, _| pause()), "no pictures, no rest frame");
    assert!(began.elapsed() >= Duration::from_secs(4), "{:?}", began.elapsed());
    while next(&mut manager.states, Duration::from_millis(300)).is_some_and(|state| state.label != "unconfigured") {}
    manager.go(0, "shutdown", "finalized");
    let until = Instant::now() + LONGEST_WAIT;
    while !node.has_ended_well() {
        assert!(Instant::now() < until, "it has not ended");
        pause();
    }
    let told: Vec<u8> = manager.told.iter().map(|event| event.transition.id).collect();
    assert_eq!(told, [1, 10, 3, 30, 4, 40, 3, 30, 4, 40, 2, 20, 1, 11, 5, 50]);
    for pair in manager.told.windows(2) {
        assert_eq!(pair[0].goal_state, pair[1].start_state);
        assert!(pair[0].timestamp > 0 && pair[0].timestamp <= pair[1].timestamp);
    }
}

#[test]
#[ignore = "needs another network namespace and a link to it: ros2/namespaces.sh; takes two minutes"]
fn the_state_stays_where_the_network_is_joined_anew() {
    let _cuts = CUTS.lock().unwrap_or_else(PoisonError::into_inner);
    let mut manager = Manager::new(Bench::new(8, "autostart = false"));
    let config = manager.bench.config.to_str().expect("UTF-8");
    let _node = Process::start_in(THERE, &["node", config], manager.bench.domain_id);
    manager.bench.await_node();
    manager.is_told("unconfigured");
    manager.configure();
    // The ends give each other up after 50 s.
    set_link("down");
    sleep(Duration::from_secs(75));
    set_link("up");
    manager.is_told("inactive"); // again: the node has joined again
    manager.bench.await_node();
    assert!(manager.show(5).is_empty(), "judged, not published");
    manager.go(3, "", "active");
    assert!(!manager.show(5).is_empty(), "its rest frame is known");
}
