//! The bytes of a trace in order of time, and what its drives were doing at each.

use super::meaning::{ByteRole, Meaning, Observer};
use harness_proto::novobus::error_mode::Marks;
use harness_sim::novobus::mark::Mark as _;
use harness_sim::record::LineByte;
use harness_sim::record::{Channel, Remark, Trace};

/// What the sender of a byte was doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SenderState {
    /// It passed on SYNCO or PAUSE.
    Idle,
    /// It passed on a telegram for another drive.
    Forwarding,
    /// It is the addressed drive, and answered.
    Addressed,
    /// It sent a zero of the error mode (ND21 9.7).
    Zero,
    /// It sent received + 1, which spells out a number (9.7).
    Counting,
    /// It passed on, or the master sent, a check sequence (9.8).
    Sequence,
    /// Nothing arrived, or what arrived is no telegram.
    Other,
}

impl SenderState {
    /// All of them, in the order of a legend.
    pub(crate) const ALL: [Self; 7] = [
        Self::Idle,
        Self::Forwarding,
        Self::Addressed,
        Self::Zero,
        Self::Counting,
        Self::Sequence,
        Self::Other,
    ];

    /// The text in a legend.
    #[must_use]
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Idle => "normal: SYNCO or PAUSE",
            Self::Forwarding => "forwarding a telegram",
            Self::Addressed => "addressed: the drive's answer",
            Self::Zero => "error mode: zero",
            Self::Counting => "error mode: received + 1",
            Self::Sequence => "check sequence",
            Self::Other => "lost, or no telegram",
        }
    }
}

/// What a byte is, and what its sender was doing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ByteSeen<'t> {
    /// What it is to its receiver.
    pub meaning: Meaning,
    /// The meaning of the byte to its sender; the same as for the receiver if nothing more is known.
    pub sent: Meaning,
    /// What its sender was doing.
    pub state: SenderState,
    /// What its sender remarked at it.
    pub mark: Option<&'t Remark>,
}

/// Reads one link of a trace byte by byte: its bytes, and what its sender remarked.
pub(crate) struct LinkReader<'t> {
    observer: Observer,
    /// Reads what was sent; a trace that knows what drives remarked knows that as well.
    sender: Observer,
    from: Option<u8>,
    to: Option<u8>,
    /// The sender's marks, each with the byte of this link at which it stands.
    marks: std::iter::Peekable<std::vec::IntoIter<(usize, &'t Remark)>>,
    /// Whether the sender is known to be in the error mode; `None` where a trace has no marks at all.
    in_error: Option<bool>,
    next: usize,
}

impl<'t> LinkReader<'t> {
    /// For every link of a trace.
    pub(crate) fn all(trace: &'t Trace) -> Vec<Self> {
        let known = !trace.remarks.is_empty();
        let links = trace.channels.iter();
        links
            .map(|link| {
                let mut marks = placed(link, &trace.remarks);
                marks.sort_by_key(|(place, _)| *place);
                Self {
                    observer: Observer::new(link.from, link.to),
                    sender: Observer::new(link.from, link.to),
                    from: link.from,
                    to: link.to,
                    marks: marks.into_iter().peekable(),
                    in_error: (known && link.from.is_some()).then_some(false),
                    next: 0,
                }
            })
            .collect()
    }

    /// Reads the next byte.
    pub(crate) fn see(&mut self, byte: &LineByte) -> ByteSeen<'t> {
        let mut meaning = self.observer.see(byte.received, byte.error);
        let mut shown: Option<&Remark> = None;
        let mut leaves = false;
        while let Some((_, mark)) = self.marks.next_if(|(place, _)| *place <= self.next) {
            if mark.marks().contains(Marks::DETECTED) {
                self.in_error = Some(true);
            }
            leaves |= mark.marks().contains(Marks::RECOVERED);
            let graver = mark.marks().contains(Marks::DETECTED) || shown.is_none();
            if graver {
                shown = Some(mark);
            }
        }
        self.next += 1;
        if self.in_error == Some(true) && meaning.role != ByteRole::CheckSequence {
            meaning.role = match byte.received {
                None => ByteRole::Lost,
                Some(0) => ByteRole::ErrorZero,
                Some(_) if byte.error.is_none() => ByteRole::ErrorAddress,
                Some(_) => ByteRole::Foreign,
            };
            meaning.drive = None;
        }
        let sent = match (byte.sent, self.in_error) {
            // What a drive in the error mode sends is nothing to be read.
            (Some(sent), Some(false)) => self.sender.see(Some(sent), None),
            _ => meaning,
        };
        if leaves {
            self.in_error = Some(false);
            self.sender = Observer::new(self.from, self.to);
        }
        ByteSeen {
            state: self.state(&sent),
            sent,
            meaning,
            mark: shown,
        }
    }

    fn state(&self, meaning: &Meaning) -> SenderState {
        match meaning.role {
            ByteRole::Synco | ByteRole::Pause => SenderState::Idle,
            ByteRole::CheckSequence => SenderState::Sequence,
            // The zeros in front of the check sequence.
            ByteRole::ErrorZero if self.from.is_none() => SenderState::Sequence,
            ByteRole::ErrorZero => SenderState::Zero,
            ByteRole::ErrorAddress => SenderState::Counting,
            ByteRole::Foreign | ByteRole::Lost => SenderState::Other,
            ByteRole::Sync | ByteRole::Address => SenderState::Forwarding,
            _ if meaning.drive.is_some() && meaning.drive == self.from => SenderState::Addressed,
            _ => SenderState::Forwarding,
        }
    }
}

/// The marks of a link's sender, each with the byte of the link at which it stands: the answer to the byte that was
/// remarked, or the next byte where none was sent (a time-out).
fn placed<'t>(link: &Channel, marks: &'t [Remark]) -> Vec<(usize, &'t Remark)> {
    let of_sender: Vec<_> = marks
        .iter()
        .filter(|mark| link.from == Some(mark.station))
        .collect();
    if of_sender.is_empty() {
        return Vec::new();
    }
    let sent: Vec<_> = (0..link.octets().len())
        .filter(|place| link.octets()[*place].sent.is_some())
        .collect();
    of_sender
        .into_iter()
        .filter_map(|mark| {
            let number = match mark.answered_as {
                Some(number) => usize::try_from(number).ok()?.checked_sub(1)?,
                None => sent.partition_point(|place| link.octets()[*place].at <= mark.at),
            };
            Some((*sent.get(number)?, mark))
        })
        .collect()
}
