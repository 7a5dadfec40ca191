//! The parts of a file with several buses, and which of them is wanted.

use crate::capture::{CaptureError, ChannelTarget, NamedLink};

/// What interfaces of a file belong together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum InterfaceGroup {
    /// The links of a ring.
    Ring,
    /// The stations of a shared line.
    Stations,
    /// A shared line, by its name.
    Line(String),
    /// The senders of a bus of frames.
    Senders,
    /// A bus of frames, by its name.
    Frames(String),
}

impl InterfaceGroup {
    /// How `--link` names it.
    fn name(&self) -> &str {
        match self {
            Self::Ring => "ring",
            Self::Stations => "bus=stations",
            Self::Senders => "bus=senders",
            Self::Line(name) | Self::Frames(name) => name,
        }
    }

    /// Whether `--link` chooses it.
    fn is_chosen(&self, link: &NamedLink) -> bool {
        match (link.target, self) {
            (ChannelTarget::Ring, part) => *part == Self::Ring,
            (ChannelTarget::Bus, Self::Ring) => false,
            (ChannelTarget::Bus, part) => {
                let wanted = link.channel.as_deref();
                wanted.is_none_or(|wanted| part.name().trim_start_matches("bus=") == wanted)
            }
            _ => false,
        }
    }

    /// What it carries, in words.
    fn words(&self) -> String {
        match self {
            Self::Ring => "bytes of a ring (--link ring)".to_owned(),
            Self::Stations => "telegrams of a shared line (--link bus=stations)".to_owned(),
            Self::Line(name) => format!("telegrams of a shared line (--link \"bus={name}\")"),
            Self::Senders => "frames of CAN (--link bus=senders)".to_owned(),
            Self::Frames(name) => format!("frames of CAN (--link \"bus={name}\")"),
        }
    }
}

/// The number of the part that is wanted: the chosen one, or the only one that carries anything.
///
/// # Errors
/// None or several are chosen; several carry something and none is chosen.
pub(super) fn chosen(
    all: &[InterfaceGroup],
    carries: impl Fn(usize) -> bool,
    links: &[NamedLink],
) -> Result<usize, CaptureError> {
    let wrong = |what: String| CaptureError::Link {
        place: "the capture".to_owned(),
        what,
    };
    let known = || {
        all.iter()
            .map(InterfaceGroup::words)
            .collect::<Vec<_>>()
            .join(", ")
    };
    let choice = links
        .iter()
        .find(|link| matches!(link.target, ChannelTarget::Ring | ChannelTarget::Bus));
    let numbers = 0..all.len();
    if let Some(link) = choice {
        let chosen: Vec<_> = numbers.filter(|part| all[*part].is_chosen(link)).collect();
        return match chosen.as_slice() {
            [one] => Ok(*one),
            _ => Err(wrong(format!(
                "`--link {}` chooses no single part of it; it has {}",
                link.link,
                known()
            ))),
        };
    }
    let carrying: Vec<_> = numbers.filter(|part| carries(*part)).collect();
    match carrying.as_slice() {
        [] => Ok(0),
        [one] => Ok(*one),
        _ => Err(wrong(format!("it has {}: choose one", known()))),
    }
}
