//! A node on the network: topics and services by their ROS names, received without waiting or with a limit.

use crate::error::Error;
use crate::msg::{Time, TopicType};
use ros2_client::qos::{Durability, History, WhenFull};
use ros2_client::{
    Context, ContextOptions, Message, MessageTypeName, Name, Node, NodeName, NodeOptions, Publisher, QosProfile,
    Server, ServiceTypeName, Subscription,
};
use rustdds::RTPSEntity as _;
use rustdds::mio1::{Events, Interest, Poll, Token};
use serde::Deserialize;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Sensor data: best effort, the last five.
pub const SENSOR_DATA: QosProfile =
    QosProfile::subscription_default().reliability_best_effort().history(History::KeepLast { depth: 5 });

/// Data that must arrive: reliable, the last ten. A slow reader does not block the writer.
pub const RELIABLE: QosProfile =
    QosProfile::publisher_default().reliability_reliable(WhenFull::Fail).history(History::KeepLast { depth: 10 });

/// Commands, of which only the newest counts: reliable, the last one.
pub const LAST_RELIABLE: QosProfile =
    QosProfile::publisher_default().reliability_reliable(WhenFull::Fail).history(History::KeepLast { depth: 1 });

/// For late joiners: reliable, the last one is kept.
pub const LATCHED: QosProfile = QosProfile::publisher_default()
    .reliability_reliable(WhenFull::Fail)
    .durability(Durability::TransientLocal)
    .history(History::KeepLast { depth: 1 });

/// How a service's requests and answers are laid out on DDS topics. Both ends must use the same layout, and which one a ROS 2
/// node uses depends on its middleware.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum ServiceMapping {
    /// The request's identity travels in the inline QoS, as DDS-RPC calls it: `rmw_fastrtps_cpp`, and `rmw_connextdds` where it
    /// is set to `extended`.
    #[default]
    Enhanced,
    /// The request's identity travels in 16 bytes before the payload: `rmw_cyclonedds_cpp`.
    Cyclone,
}

impl From<ServiceMapping> for ros2_client::ServiceMapping {
    fn from(mapping: ServiceMapping) -> Self {
        match mapping {
            ServiceMapping::Enhanced => ros2_client::ServiceMapping::Enhanced,
            ServiceMapping::Cyclone => ros2_client::ServiceMapping::Cyclone,
        }
    }
}

/// Now, ns since 1970: the clock of header stamps.
pub fn unix_ns() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)
}

/// Now, as a stamp.
pub fn stamp() -> Time {
    Time::from_ns(unix_ns())
}

/// The full name of a node; the error names the part that ROS does not accept.
pub(crate) fn checked_node(namespace: &str, name: &str) -> Result<NodeName, Error> {
    let refuse =
        |key: &str, name: &str, why| Error::Name { key: key.into(), name: name.into(), why: format!("{why:?}") };
    NodeName::new("/", name).map_err(|e| refuse("node", name, e))?;
    NodeName::new(namespace, name).map_err(|e| refuse("namespace", namespace, e))
}

/// The full name of a topic: one that does not begin with `/` is private to the node.
pub(crate) fn full_topic(node: &str, topic: &str) -> String {
    if topic.starts_with('/') { topic.to_owned() } else { format!("{node}/{topic}") }
}

/// A node on the network.
pub struct Ros {
    context: Context,
    node: Node,
    namespace: String,
    services: ServiceMapping,
}

impl Ros {
    /// A node of this name in this domain, its services in the default mapping.
    pub fn new(namespace: &str, name: &str, domain_id: u16) -> Result<Self, Error> {
        let node_name = checked_node(namespace, name)?;
        let context = Context::with_options(ContextOptions::new().domain_id(domain_id))
            .map_err(|e| Error::middleware(format!("domain {domain_id}"), e))?;
        // Parameters come from the file: none can be set while the node runs.
        let options = NodeOptions::new().enable_rosout(true).start_parameter_services(false);
        let node = context
            .new_node(node_name.clone(), options)
            .map_err(|e| Error::middleware(format!("node `{name}`"), format!("{e:?}")))?;
        let namespace = node_name.fully_qualified_name();
        Ok(Ros { context, node, namespace, services: ServiceMapping::default() })
    }

    /// The same node; services and actions that it offers or calls from now on use this mapping.
    #[must_use]
    pub fn with_services(mut self, services: ServiceMapping) -> Self {
        self.services = services;
        self
    }

    /// The mapping of its services and actions.
    pub fn services(&self) -> ros2_client::ServiceMapping {
        self.services.into()
    }

    /// The node's full name, the prefix of its own topics.
    pub fn full_name(&self) -> &str {
        &self.namespace
    }

    /// The topic `name`; one that does not begin with `/` is private to the node.
    fn name(&self, name: &str) -> Result<Name, Error> {
        let full = full_topic(&self.namespace, name);
        Name::parse(&full).map_err(|e| Error::Name { key: "topic".into(), name: name.into(), why: format!("{e:?}") })
    }

    /// Publishes on a topic.
    pub fn publisher<M: TopicType>(&mut self, topic: &str, qos: &QosProfile) -> Result<Publisher<M>, Error> {
        let name = self.name(topic)?;
        let refused = |e| Error::middleware(format!("publisher of {topic}"), e);
        let topic = self.node.create_topic(&name, MessageTypeName::new(M::PACKAGE, M::NAME), qos).map_err(refused)?;
        self.node.create_publisher(&topic, Some(qos.clone())).map_err(refused)
    }

    /// Subscribes to a topic.
    pub fn inbox<M: TopicType>(&mut self, topic: &str, qos: &QosProfile) -> Result<Inbox<M>, Error> {
        let name = self.name(topic)?;
        let what = format!("subscription of {topic}");
        let refused = |e| Error::middleware(what.as_str(), e);
        let topic = self.node.create_topic(&name, MessageTypeName::new(M::PACKAGE, M::NAME), qos).map_err(refused)?;
        let mut subscription = self.node.create_subscription(&topic, Some(qos.clone())).map_err(refused)?;
        let failed = |e: std::io::Error| Error::middleware(what.as_str(), e);
        let poll = Poll::new().map_err(failed)?;
        poll.registry().register(&mut subscription, Token(0), Interest::READABLE).map_err(failed)?;
        Ok(Inbox { subscription, poll, events: Events::with_capacity(4), writer: None, offset: 0, last_seq: 0 })
    }

    /// Offers a service.
    pub fn server<Request, Response>(
        &mut self,
        service: &str,
        package: &str,
        kind: &str,
    ) -> Result<Server<Request, Response>, Error>
    where
        Request: Message + Clone + 'static,
        Response: Message + 'static,
    {
        let name = self.name(service)?;
        let kind = ServiceTypeName::new(package, kind);
        self.node
            .create_server(self.services.into(), &name, &kind, RELIABLE, RELIABLE)
            .map_err(|e| Error::middleware(format!("service {service}"), e))
    }

    /// Whether a publisher of another participant is known on a topic; this node's own do not count.
    pub fn is_published_by_others(&self, topic: &str) -> bool {
        let participant = self.context.domain_participant();
        let name = format!("rt{}", full_topic(&self.namespace, topic));
        participant.discovered_writers().iter().any(|writer| {
            let is_own = writer.writer_proxy.remote_writer_guid.prefix == participant.guid().prefix;
            !is_own && writer.publication_topic_data.topic_name == name
        })
    }

    /// The node itself, for functions not wrapped here.
    pub fn node(&mut self) -> &mut Node {
        &mut self.node
    }

    /// Its DDS participant.
    pub fn context(&self) -> &Context {
        &self.context
    }
}

/// A message and its number.
#[derive(Debug, Clone)]
pub struct Received<M> {
    /// What was received.
    pub message: M,
    /// The writer's sequence number, from 0; a gap means messages that never arrived. It continues with another writer.
    pub seq: u64,
}

/// Receives messages on a topic.
pub struct Inbox<M: TopicType> {
    subscription: Subscription<M>,
    poll: Poll,
    events: Events,
    writer: Option<ros2_client::gid::Gid>,
    offset: i64,
    last_seq: i64,
}

impl<M: TopicType> Inbox<M> {
    /// Continues from the number of the last message of a previous inbox.
    pub fn count_from(&mut self, last_seq: i64) {
        self.last_seq = last_seq;
    }

    /// The argument of [`Inbox::count_from`] for the next inbox.
    pub fn last_seq(&self) -> i64 {
        self.last_seq
    }

    /// Waits until something arrives, at most this long. To be called when [`Inbox::take`] has nothing more.
    pub fn wait(&mut self, longest: Duration) {
        // An interrupting signal counts as no message.
        let _ = self.poll.poll(&mut self.events, Some(longest));
    }

    /// The next message; None when there is none. An unreadable message is skipped, with the reason in the error.
    pub fn take(&mut self) -> Result<Option<Received<M>>, String> {
        let Some((message, info)) = self.subscription.take().map_err(|e| e.to_string())? else { return Ok(None) };
        if self.writer.replace(info.publisher_gid()).is_none_or(|last| last != info.publisher_gid()) {
            // The first message of a writer: a late joiner has missed nothing.
            self.offset = self.last_seq + 1 - info.sequence_number();
        }
        self.last_seq = info.sequence_number() + self.offset;
        Ok(Some(Received { message, seq: u64::try_from(self.last_seq - 1).unwrap_or(0) }))
    }

    /// The newest message; None when none came since the last call.
    pub fn newest(&mut self) -> Option<M> {
        let mut newest = None;
        loop {
            match self.take() {
                Ok(Some(received)) => newest = Some(received.message),
                Ok(None) => return newest,
                Err(_) => {} // unreadable: skipped
            }
        }
    }
}
