//! Events of a link as lines of a record, and back.

use super::record::RecordLine;
use crate::link::{Lead, LinkEvent, LinkFault, Look, Moment, PlacedFault, Trouble};
use crate::medium::{HeardPiece, Pieces};
use crate::report::pcapng::error_named;
use crate::scenario::run::record::{from_hex, hex};
use harness_proto::can::{self, CanError, Frame};
use harness_proto::line::Received;
use harness_proto::time::{Instant, Span};
use harness_sim::fault::Flips;

/// The byte that a probe sends where its line does not name the bytes.
const PROBED: u8 = 0x80;

fn received(byte: &str, error: Option<&str>) -> Option<Received> {
    let [byte] = from_hex(byte)?[..] else {
        return None;
    };
    let error = match error {
        None => None,
        Some(name) => Some(error_named(name)?),
    };
    Some(Received { byte, error })
}

fn written(byte: Received) -> (String, Option<String>) {
    (
        hex(&[byte.byte]),
        byte.error.map(|error| error.name().to_owned()),
    )
}

fn fault(what: LinkFault) -> (String, u64) {
    let (kind, number) = match what {
        LinkFault::Flip(flips) => {
            let bits = u64::from(flips.data);
            (
                "flip",
                bits | u64::from(flips.parity) << 8
                    | u64::from(flips.stop) << 9
                    | u64::from(flips.start) << 10,
            )
        }
        LinkFault::Replace(byte) => ("replace", byte.into()),
        LinkFault::Drop => ("drop", 0),
        LinkFault::Duplicate => ("duplicate", 0),
        LinkFault::Insert(byte) => ("insert", byte.into()),
        LinkFault::Delay(span) => ("delay", span.units()),
        LinkFault::Break(span) => ("break", span.units()),
        LinkFault::Overrun => ("overrun", 0),
        LinkFault::Cut => ("cut", 0),
        LinkFault::Join => ("join", 0),
    };
    (kind.to_owned(), number)
}

fn unfault((kind, number): &(String, u64)) -> Option<LinkFault> {
    let byte = u8::try_from(number & 0xFF).ok()?;
    Some(match kind.as_str() {
        "flip" => LinkFault::Flip(Flips {
            data: byte,
            parity: number >> 8 & 1 == 1,
            stop: number >> 9 & 1 == 1,
            start: number >> 10 & 1 == 1,
        }),
        "replace" => LinkFault::Replace(byte),
        "drop" => LinkFault::Drop,
        "duplicate" => LinkFault::Duplicate,
        "insert" => LinkFault::Insert(byte),
        "delay" => LinkFault::Delay(Span::from_units(*number)),
        "break" => LinkFault::Break(Span::from_units(*number)),
        "overrun" => LinkFault::Overrun,
        "cut" => LinkFault::Cut,
        "join" => LinkFault::Join,
        _ => return None,
    })
}

impl RecordLine {
    /// An event as a line; `None` for what no rig can do: drives' power and stimuli outside the bus.
    #[must_use]
    pub fn of(event: &LinkEvent) -> Option<Self> {
        let units = |at: &Instant| at.since_start().units();
        Some(match event {
            LinkEvent::Begin(at) => Self::Begin { t: units(at) },
            LinkEvent::Step(place) => Self::Step { place: *place },
            LinkEvent::Sent(ring, at, Pieces::Octets(bytes)) => Self::Sent {
                ring: ring + 1,
                t: units(at),
                bytes: hex(bytes),
            },
            LinkEvent::Sent(ring, at, Pieces::Frames(frames)) => Self::SentFrames {
                ring: ring + 1,
                t: units(at),
                frames: frames.iter().map(Frame::to_string).collect(),
            },
            LinkEvent::Received(ring, at, HeardPiece::Octet(byte)) => {
                let (byte, error) = written(*byte);
                Self::Received {
                    ring: ring + 1,
                    t: units(at),
                    byte,
                    error,
                }
            }
            LinkEvent::Received(ring, at, HeardPiece::Frame(heard)) => Self::Frame {
                ring: ring + 1,
                t: units(at),
                frame: match heard {
                    can::CanEvent::Frame(frame) => Some(frame.to_string()),
                    can::CanEvent::Error(_) => None,
                },
                error: match heard {
                    can::CanEvent::Frame(_) => None,
                    can::CanEvent::Error(error) => Some(error.to_string()),
                },
            },
            LinkEvent::Fault(ring, at, PlacedFault::Link(link, what), moment) => Self::Fault {
                ring: ring + 1,
                t: units(at),
                link: *link,
                byte: match moment {
                    Moment::Byte(byte) => Some(*byte),
                    _ => None,
                },
                at: match moment {
                    Moment::At(at) => Some(units(at)),
                    _ => None,
                },
                what: fault(*what),
            },
            LinkEvent::Fault(..) => return None,
            LinkEvent::Look(look) => Self::Look {
                t: units(&look.at),
                busy: look.busy,
                lead: look.lead.map(|lead| (lead.far.units(), lead.near.units())),
                pause: look.pause.as_ref().map(units),
                since: look.since.as_ref().map(units),
            },
            LinkEvent::Trouble(trouble) => Self::Trouble {
                cause: match trouble {
                    Trouble::Denied(_) => "denied",
                    Trouble::Lost(_) => "lost",
                    Trouble::Garbled(_) => "garbled",
                    Trouble::Interlock(_) => "interlock",
                    Trouble::Interrupted => "interrupted",
                }
                .to_owned(),
                text: trouble.to_string(),
            },
            LinkEvent::Tapped(ring, link, at, bytes) => Self::Tapped {
                ring: ring + 1,
                link: *link,
                t: units(at),
                bytes: bytes.iter().map(|byte| written(*byte)).collect(),
            },
            LinkEvent::Probe(ring, at, sent, came) => Self::Probe {
                ring: ring + 1,
                t: units(at),
                count: sent.len(),
                sent: sent.iter().any(|byte| *byte != PROBED).then(|| hex(sent)),
                bytes: came.iter().map(|byte| written(*byte)).collect(),
            },
        })
    }

    /// The latest time that it names, that which a fault is to happen at and how long one lasts among them.
    #[must_use]
    pub fn time(&self) -> Span {
        let units = match self {
            Self::Begin { t }
            | Self::Sent { t, .. }
            | Self::SentFrames { t, .. }
            | Self::Received { t, .. }
            | Self::Frame { t, .. }
            | Self::Tapped { t, .. }
            | Self::Probe { t, .. } => *t,
            Self::Look { t, pause, .. } => (*t).max(pause.unwrap_or(0)),
            Self::Fault { t, at, what, .. } => (*t).max(at.unwrap_or(0)).max(what.1),
            Self::Run { .. }
            | Self::Scenario { .. }
            | Self::Step { .. }
            | Self::Trouble { .. }
            | Self::Verdict { .. }
            | Self::Case { .. }
            | Self::End { .. } => 0,
        };
        Span::from_units(units)
    }

    /// The event of a line; `None` if it is no event or has impossible values.
    #[must_use]
    pub fn event(&self) -> Option<LinkEvent> {
        let instant = |t: &u64| Instant::START + Span::from_units(*t);
        let index = |ring: &usize| ring.checked_sub(1).filter(|ring| *ring < 2);
        Some(match self {
            Self::Begin { t } => LinkEvent::Begin(instant(t)),
            Self::Step { place } => LinkEvent::Step(*place),
            Self::Sent { ring, t, bytes } => {
                LinkEvent::Sent(index(ring)?, instant(t), Pieces::Octets(from_hex(bytes)?))
            }
            Self::SentFrames { ring, t, frames } => {
                let frames: Option<_> = frames.iter().map(|frame| frame.parse().ok()).collect();
                LinkEvent::Sent(index(ring)?, instant(t), Pieces::Frames(frames?))
            }
            Self::Frame {
                ring,
                t,
                frame,
                error,
            } => {
                let heard = match (frame, error) {
                    (Some(frame), None) => can::CanEvent::Frame(frame.parse().ok()?),
                    (None, Some(error)) => can::CanEvent::Error(CanError::from_name(error)?),
                    _ => return None,
                };
                LinkEvent::Received(index(ring)?, instant(t), HeardPiece::Frame(heard))
            }
            Self::Received {
                ring,
                t,
                byte,
                error,
            } => {
                let octet = received(byte, error.as_deref())?;
                LinkEvent::Received(index(ring)?, instant(t), HeardPiece::Octet(octet))
            }
            Self::Fault {
                ring,
                t,
                link,
                byte,
                at,
                what,
            } => {
                let moment = match (byte, at) {
                    (Some(byte), _) => Moment::Byte(*byte),
                    (None, Some(at)) => Moment::At(instant(at)),
                    (None, None) => Moment::Now,
                };
                let what = PlacedFault::Link(*link, unfault(what)?);
                LinkEvent::Fault(index(ring)?, instant(t), what, moment)
            }
            Self::Look {
                t,
                busy,
                lead,
                pause,
                since,
            } => LinkEvent::Look(Look {
                at: instant(t),
                busy: *busy,
                lead: lead.map(|(far, near)| Lead {
                    far: Span::from_units(far),
                    near: Span::from_units(near),
                }),
                pause: pause.as_ref().map(instant),
                since: since.as_ref().map(instant),
            }),
            Self::Trouble { cause, text } => LinkEvent::Trouble(match cause.as_str() {
                "denied" => Trouble::Denied(text.clone()),
                "lost" => Trouble::Lost(text.clone()),
                "garbled" => Trouble::Garbled(text.clone()),
                "interlock" => Trouble::Interlock(text.clone()),
                "interrupted" => Trouble::Interrupted,
                _ => return None,
            }),
            Self::Tapped {
                ring,
                link,
                t,
                bytes,
            } => LinkEvent::Tapped(index(ring)?, *link, instant(t), all_received(bytes)?),
            Self::Probe {
                ring,
                t,
                count,
                sent,
                bytes,
            } => {
                let sent = match sent {
                    Some(sent) => from_hex(sent).filter(|sent| sent.len() == *count)?,
                    None => vec![PROBED; *count],
                };
                LinkEvent::Probe(index(ring)?, instant(t), sent, all_received(bytes)?)
            }
            Self::Run { .. }
            | Self::Scenario { .. }
            | Self::Verdict { .. }
            | Self::Case { .. }
            | Self::End { .. } => return None,
        })
    }
}

/// Bytes as they are written; `None` where one cannot be.
fn all_received(bytes: &[(String, Option<String>)]) -> Option<Vec<Received>> {
    let all = bytes.iter();
    all.map(|(byte, error)| received(byte, error.as_deref()))
        .collect()
}
