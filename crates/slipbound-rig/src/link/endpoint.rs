//! One end of a link.

/// The state machine at one end of a link. It receives the time and bytes, and provides bytes to be sent; it opens no
/// socket and reads no clock. Its owner moves the bytes. Time never decreases.
pub trait Endpoint: Send {
    /// The link is up: nothing of an earlier one remains. Asks for the state of the device, moves nothing.
    fn linked(&mut self, now_ns: u64);

    /// The link is down, for this reason.
    fn unlinked(&mut self, now_ns: u64, why: &str);

    /// Bytes have been received.
    fn receive(&mut self, now_ns: u64, bytes: &[u8]);

    /// Time has passed: deadlines and periodic requests fall due. To be called every few ms.
    fn tick(&mut self, now_ns: u64);

    /// Bytes to be sent; the sender removes from the front what it has sent.
    fn outgoing(&mut self) -> &mut Vec<u8>;
}
