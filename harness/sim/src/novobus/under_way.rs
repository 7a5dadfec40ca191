//! What is on a wire, and what has come out of it.

use crate::record::LineByte;
use harness_proto::line::LineError;
use harness_proto::time::Instant;

/// A [`LineByte`] in two words: composed of single bytes, a line byte is stored in pieces and loaded
/// whole, which costs more than all the rest of passing a byte on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct UnderWay {
    /// When it arrives.
    pub(crate) at: Instant,
    word: u32,
}

impl UnderWay {
    const SENT: u32 = 1 << 16;
    const RECEIVED: u32 = 1 << 17;
    const SOLICITED: u32 = 1 << 18;
    const ERROR_SHIFT: u32 = 24;
    /// By the number that stands for each, so that a byte is read without a branch.
    const ERRORS: [Option<LineError>; 8] = [
        None,
        Some(LineError::Parity),
        Some(LineError::Framing),
        Some(LineError::Break),
        Some(LineError::Overrun),
        None,
        None,
        None,
    ];

    /// A byte that arrives as it was sent.
    #[inline]
    pub(crate) fn whole(at: Instant, byte: u8, solicited: bool) -> Self {
        let word = (u32::from(byte) * 0x0101) | Self::SENT | Self::RECEIVED;
        let solicited = if solicited { Self::SOLICITED } else { 0 };
        Self {
            at,
            word: word | solicited,
        }
    }

    pub(crate) fn pack(byte: LineByte) -> Self {
        let sent = byte.sent.map_or(0, |b| Self::SENT | u32::from(b));
        let received = byte
            .received
            .map_or(0, |b| Self::RECEIVED | u32::from(b) << 8);
        let solicited = if byte.solicited { Self::SOLICITED } else { 0 };
        let known = (0..).zip(Self::ERRORS);
        let mut same = known.filter(|(_, known)| *known == byte.error);
        let error = same.next().map_or(0, |(number, _)| number);
        Self {
            at: byte.at,
            word: sent | received | solicited | error << Self::ERROR_SHIFT,
        }
    }

    #[inline]
    pub(crate) fn unpack(self) -> LineByte {
        let [sent, received, _, error] = self.word.to_le_bytes();
        LineByte {
            at: self.at,
            sent: (self.word & Self::SENT != 0).then_some(sent),
            received: (self.word & Self::RECEIVED != 0).then_some(received),
            error: Self::ERRORS[usize::from(error) % Self::ERRORS.len()],
            solicited: self.solicited(),
        }
    }

    /// The byte, where it arrives as it was sent and goes back to one of the master's.
    #[inline]
    pub(crate) fn plain(self) -> Option<u8> {
        let [_, received, ..] = self.word.to_le_bytes();
        (self.word == Self::whole(self.at, received, true).word).then_some(received)
    }

    /// The byte as it was sent; 0 where it was not.
    #[inline]
    pub(crate) fn sent(self) -> u8 {
        self.word.to_le_bytes()[0]
    }

    /// Whether a transmitter has sent it.
    pub(crate) fn is_sent(self) -> bool {
        self.word & Self::SENT != 0
    }

    #[inline]
    pub(crate) fn solicited(self) -> bool {
        self.word & Self::SOLICITED != 0
    }

    /// Lets the byte be lost on the wire.
    pub(crate) fn lose(&mut self) {
        self.word &= Self::SENT | Self::SOLICITED | 0xFF;
    }
}

/// The bytes of a wire in the order in which they arrive: those under way, and in front of them, where a record is kept, those that have
/// arrived. So a byte is written once and stays where it is.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub(crate) struct WireBytes {
    bytes: Vec<UnderWay>,
    /// How many of them have arrived.
    arrived: usize,
    recording: bool,
}

impl WireBytes {
    /// How many that have arrived are kept at most where no record is.
    const SPENT: usize = 128;

    /// Of a wire whose bytes are recorded.
    pub(crate) fn recorded() -> Self {
        Self {
            recording: true,
            ..Self::default()
        }
    }

    /// Forgets all of them.
    pub(crate) fn clear(&mut self) {
        self.bytes.clear();
        self.arrived = 0;
    }

    /// Forgets those that have arrived, and says whether the next ones are recorded.
    pub(crate) fn record(&mut self, recording: bool) {
        self.forget_arrived();
        self.recording = recording;
    }

    /// Forgets those that have arrived.
    pub(crate) fn forget_arrived(&mut self) {
        self.bytes.drain(..self.arrived);
        self.arrived = 0;
    }

    /// How many that have arrived are recorded.
    pub(crate) const fn logged(&self) -> usize {
        if self.recording { self.arrived } else { 0 }
    }

    /// All of them, in order.
    pub(crate) fn log(&self) -> impl Iterator<Item = LineByte> + '_ {
        self.bytes[..self.logged()].iter().map(|byte| byte.unpack())
    }

    /// One of them.
    #[inline]
    pub(crate) fn logged_byte(&self, index: usize) -> Option<LineByte> {
        self.bytes.get(index).map(|byte| byte.unpack())
    }

    /// Makes room.
    pub(crate) fn reserve(&mut self, bytes: usize) {
        self.bytes.reserve(bytes);
    }

    /// Those under way.
    pub(crate) fn under_way(&self) -> &[UnderWay] {
        &self.bytes[self.arrived..]
    }

    /// Takes those under way, where no record is kept.
    pub(crate) fn take_under_way(&mut self) -> Vec<UnderWay> {
        self.forget_arrived();
        std::mem::take(&mut self.bytes)
    }

    /// Those under way.
    pub(crate) fn under_way_mut(&mut self) -> &mut [UnderWay] {
        &mut self.bytes[self.arrived..]
    }

    /// When the next one arrives.
    #[inline]
    pub(crate) fn next_arrival(&self) -> Instant {
        self.bytes
            .get(self.arrived)
            .map_or(Instant::NEVER, |byte| byte.at)
    }

    /// Adds one behind all others.
    #[inline]
    pub(crate) fn push(&mut self, byte: UnderWay) {
        self.bytes.push(byte);
    }

    /// Adds one behind those that arrive no later.
    pub(crate) fn insert(&mut self, byte: UnderWay) {
        let place = self
            .under_way()
            .partition_point(|other| other.at <= byte.at);
        self.bytes.insert(self.arrived + place, byte);
    }

    /// The next one arrives.
    #[inline]
    pub(crate) fn take(&mut self) -> Option<UnderWay> {
        let byte = *self.bytes.get(self.arrived)?;
        self.arrived += 1;
        self.forget_spent();
        Some(byte)
    }

    /// The next one that arrives.
    #[inline]
    pub(crate) fn peek(&self) -> Option<UnderWay> {
        self.bytes.get(self.arrived).copied()
    }

    /// Counts this many more as arrived, without forgetting any.
    #[inline]
    pub(crate) fn advance(&mut self, count: usize) {
        self.arrived += count;
    }

    /// The last ones to arrive have not arrived after all. They must not have been forgotten.
    pub(crate) fn give_back(&mut self, count: usize) {
        self.arrived -= count;
    }

    /// Forgets those that have arrived where no record is kept and there are many.
    #[inline]
    pub(crate) fn forget_spent(&mut self) {
        if !self.recording && self.arrived >= Self::SPENT && self.arrived * 2 >= self.bytes.len() {
            self.forget_arrived();
        }
    }

    /// Whether those that arrive are recorded.
    pub(crate) const fn is_recording(&self) -> bool {
        self.recording
    }
}
