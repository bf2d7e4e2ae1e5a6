//! States and transitions of a managed node, with the numbers and labels of ROS 2. Independent of the network.
//!
//! ```text
//!   unconfigured --configure--> (configuring) --success--> inactive --activate--> (activating) --> active
//!        ^  ^                        | failure              ^  |  ^                                   |
//!        |  '------------------------'                      |  |  '---- (deactivating) <--deactivate--'
//!        '------------------ (cleaningup) <-----cleanup--------'
//!   unconfigured, inactive, active --shutdown--> (shuttingdown) --> finalized
//! ```
//!
//! States in brackets are transient: only `configuring` takes time.

use State::{
    Activating, Active, CleaningUp, Configuring, Deactivating, Finalized, Inactive, ShuttingDown, Unconfigured,
};

/// A state; its number is that of `lifecycle_msgs/State`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum State {
    /// No rest frame is known.
    #[default]
    Unconfigured = 1,
    /// Images are judged, reports are not published.
    Inactive = 2,
    /// Reports are published.
    Active = 3,
    /// The node ends.
    Finalized = 4,
    /// The rest frames are looked for, on request.
    Configuring = 10,
    /// The rest frames are being forgotten.
    CleaningUp = 11,
    /// The node is about to end.
    ShuttingDown = 12,
    /// About to publish.
    Activating = 13,
    /// About to publish no more.
    Deactivating = 14,
}

impl State {
    /// Every state of this node, in the order of the numbers.
    pub const ALL: [State; 9] =
        [Unconfigured, Inactive, Active, Finalized, Configuring, CleaningUp, ShuttingDown, Activating, Deactivating];

    /// Its number.
    pub fn id(self) -> u8 {
        self as u8
    }

    /// Its label.
    pub fn label(self) -> &'static str {
        match self {
            Unconfigured => "unconfigured",
            Inactive => "inactive",
            Active => "active",
            Finalized => "finalized",
            Configuring => "configuring",
            CleaningUp => "cleaningup",
            ShuttingDown => "shuttingdown",
            Activating => "activating",
            Deactivating => "deactivating",
        }
    }

    /// Whether every finger has its rest frame.
    pub fn is_configured(self) -> bool {
        matches!(self, Inactive | Activating | Active | Deactivating)
    }
}

/// A transition from one state to another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Transition {
    /// Its number, that of `lifecycle_msgs/Transition`.
    pub id: u8,
    /// Its label; several transitions may share one.
    pub label: &'static str,
    /// Start state.
    pub start: State,
    /// Goal state.
    pub goal: State,
}

const fn way(id: u8, label: &'static str, start: State, goal: State) -> Transition {
    Transition { id, label, start, goal }
}

const SUCCESS: &str = "transition_success";
const FAILURE: &str = "transition_failure";

/// Transitions that may be requested.
const REQUESTS: [Transition; 7] = [
    way(1, "configure", Unconfigured, Configuring),
    way(2, "cleanup", Inactive, CleaningUp),
    way(3, "activate", Inactive, Activating),
    way(4, "deactivate", Active, Deactivating),
    way(5, "shutdown", Unconfigured, ShuttingDown),
    way(6, "shutdown", Inactive, ShuttingDown),
    way(7, "shutdown", Active, ShuttingDown),
];

/// How they end: here only `configure` can fail.
const ENDS: [Transition; 6] = [
    way(10, SUCCESS, Configuring, Inactive),
    way(11, FAILURE, Configuring, Unconfigured),
    way(20, SUCCESS, CleaningUp, Unconfigured),
    way(30, SUCCESS, Activating, Active),
    way(40, SUCCESS, Deactivating, Inactive),
    way(50, SUCCESS, ShuttingDown, Finalized),
];

/// The state of a node, changed by requests only.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Lifecycle {
    state: State,
}

impl Lifecycle {
    /// The present state.
    pub fn state(&self) -> State {
        self.state
    }

    /// Every transition.
    pub fn graph() -> impl Iterator<Item = Transition> {
        REQUESTS.into_iter().chain(ENDS)
    }

    /// The transitions that begin in the present state.
    pub fn available(&self) -> impl Iterator<Item = Transition> {
        let state = self.state;
        Lifecycle::graph().filter(move |transition| transition.start == state)
    }

    /// Begins the requested transition: by its label, or by its number if that is empty. None, without any change, if
    /// the state does not allow it.
    pub fn request(&mut self, id: u8, label: &str) -> Option<Transition> {
        let is_meant = |way: &&Transition| if label.is_empty() { way.id == id } else { way.label == label };
        let begun = REQUESTS.iter().filter(is_meant).find(|way| way.start == self.state)?;
        self.state = begun.goal;
        Some(*begun)
    }

    /// Ends the transition in progress, successfully or not. None, without any change, if there is none or it cannot
    /// end so.
    pub fn end(&mut self, is_well: bool) -> Option<Transition> {
        let word = if is_well { SUCCESS } else { FAILURE };
        let ended = ENDS.iter().find(|way| way.start == self.state && way.label == word)?;
        self.state = ended.goal;
        Some(*ended)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By number or label, where it is allowed and where it leads on success.
    const TABLE: [(u8, &str, State, State); 7] = [
        (1, "configure", Unconfigured, Inactive),
        (2, "cleanup", Inactive, Unconfigured),
        (3, "activate", Inactive, Active),
        (4, "deactivate", Active, Inactive),
        (5, "shutdown", Unconfigured, Finalized),
        (6, "shutdown", Inactive, Finalized),
        (7, "shutdown", Active, Finalized),
    ];

    #[test]
    fn every_transition_in_every_state() {
        for state in State::ALL {
            for id in 0..=u8::MAX {
                let row = TABLE.iter().find(|(by_id, _, from, _)| *by_id == id && *from == state);
                let mut lifecycle = Lifecycle { state };
                let begun = lifecycle.request(id, "");
                assert_eq!(begun.map(|way| (way.id, way.start)), row.map(|_| (id, state)), "{id} in {state:?}");
                match row {
                    Some((.., to)) => {
                        assert_eq!(begun.map(|way| way.goal), Some(lifecycle.state()));
                        let ended = lifecycle.end(true).expect("it ends");
                        assert_eq!((ended.goal, lifecycle.state()), (*to, *to), "{id} from {state:?}");
                    }
                    None => assert_eq!(lifecycle.state(), state, "{id} is refused, nothing changes"),
                }
            }
        }
    }

    #[test]
    fn a_label_counts_before_the_number() {
        for state in State::ALL {
            for label in ["configure", "cleanup", "activate", "deactivate", "shutdown", SUCCESS, FAILURE, "create", " "]
            {
                let row = TABLE.iter().find(|(_, word, from, _)| *word == label && *from == state);
                for id in [0, 1, 3, 5, 10] {
                    let mut lifecycle = Lifecycle { state };
                    let begun = lifecycle.request(id, label).map(|way| way.id);
                    assert_eq!(begun, row.map(|row| row.0), "{label} with {id} in {state:?}");
                    assert_eq!(lifecycle.state() == state, row.is_none());
                }
            }
        }
    }

    #[test]
    fn only_what_is_under_way_ends_and_only_configure_fails() {
        for state in State::ALL {
            let (mut well, mut failed) = (Lifecycle { state }, Lifecycle { state });
            assert_eq!(well.end(true).is_some(), state.id() >= 10, "{state:?}");
            assert_eq!(failed.end(false).is_some(), state == Configuring, "{state:?}");
            assert_eq!(failed.state(), if state == Configuring { Unconfigured } else { state });
        }
    }

    #[test]
    fn numbers_and_words_are_those_of_ros() {
        let told = State::ALL.map(|state| format!("{} {}", state.id(), state.label())).join(", ");
        assert_eq!(
            told,
            "1 unconfigured, 2 inactive, 3 active, 4 finalized, 10 configuring, 11 cleaningup, 12 shuttingdown, \
             13 activating, 14 deactivating"
        );
        let told = Lifecycle { state: Inactive }.available().map(|way| (way.id, way.label, way.goal.id()));
        assert_eq!(told.collect::<Vec<_>>(), [(2, "cleanup", 11), (3, "activate", 13), (6, "shutdown", 12)]);
        assert_eq!(Lifecycle { state: Finalized }.available().count(), 0);
        let mut ids: Vec<u8> = Lifecycle::graph().map(|way| way.id).collect();
        ids.dedup();
        assert_eq!(ids, [1, 2, 3, 4, 5, 6, 7, 10, 11, 20, 30, 40, 50]);
    }

    #[test]
    fn configured_is_whoever_has_rest_frames() {
        let configured = State::ALL.into_iter().filter(|state| state.is_configured());
        assert_eq!(configured.collect::<Vec<_>>(), [Inactive, Active, Activating, Deactivating]);
    }
}
