//! The properties of a rig: the identities of its drives, how long a byte takes round its rings, and what went wrong meanwhile.

use super::line_test::{self, RingPace};
use super::open::stated_rate;
use super::shared::Shared;
pub(crate) use super::wrong_parity::WrongParity;
use super::wrong_parity::try_wrong_parity;
use crate::driver::{self, Axis, COUNT, Identity, OpenRings, SpelledOut};
use crate::rig::session::{OfRings as _, Session};
use harness_bench::link::{Line as _, Octets};
use harness_bench::rig::End;
use harness_bench::rig::Rig;
use harness_proto::line::Rate;
use harness_proto::nd21::State;
use harness_proto::novobus::address::RingSize;
use harness_proto::time::Span;

/// How many telegrams go round.
const ROUNDS: usize = 64;
/// How much longer than the ring needs a byte may take before it counts as lost.
const PATIENCE: Span = Span::from_millis(300);
/// Number of drives whose EEPROM is read at a time.
const SIDE_BY_SIDE: usize = 25;

/// What was measured on a ring.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct RingFigures {
    /// How many drives answer.
    pub size: RingSize,
    /// The rate at which SYNCO without a gap comes back (ND21 8.3, 9.2).
    pub rate: Rate,
    /// How late the last one of 256 came, where they came late and at no rate.
    pub late: Option<Span>,
    /// How long the ring itself needs for a byte, by the rule that each drive takes one byte time (ND21 8.2).
    pub nominal: Span,
    /// How long it took: from the shortest to the longest, sorted; what does not come back is missing.
    pub rounds: Vec<Span>,
    /// Telegrams that did not come back as they must (9.3).
    pub lost: usize,
    /// What became of a byte with a wrong parity bit; `None` where none was sent.
    pub wrong_parity: Option<WrongParity>,
    /// Bytes received with a line error, and errors that the transport reported without their bytes.
    pub line_errors: u64,
}

impl RingFigures {
    /// The shortest, the median and the longest time round the ring; `None` if nothing came back.
    #[must_use]
    pub(crate) fn spread(&self) -> Option<[Span; 3]> {
        let first = *self.rounds.first()?;
        let last = *self.rounds.last()?;
        Some([first, self.rounds[self.rounds.len() / 2], last])
    }
}

/// A drive as it shows itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct DriveFigures {
    pub axis: Axis,
    /// Its identity in its EEPROM (14.8).
    pub identity: Identity,
    /// Its mode and error.
    pub state: State,
    /// How this contradicts the rig's file, as a sentence.
    pub contradiction: Option<String>,
}

/// The properties of a rig.
#[derive(Clone, Debug)]
pub(crate) struct Figures {
    /// Its rings, in order.
    pub rings: Vec<RingFigures>,
    /// Its drives, in order.
    pub drives: Vec<DriveFigures>,
    /// Errors on the rings that were corrected while drives were read (11.5).
    pub corrected: u64,
    /// Drives that reported a fault before the ring was brought back: ring and drive.
    pub reported: Vec<(usize, SpelledOut)>,
}

/// Measures a rig in use and gives it back with its drives as they are, or, where one does not answer, in its safe state. `told`
/// hears of every drive that has been read.
pub(crate) fn measure(
    mut session: Session,
    told: &mut dyn FnMut(Axis),
) -> (Result<Figures, driver::Error>, Option<End>) {
    let reported = session
        .drives()
        .opening
        .as_ref()
        .map(|health| health.reported.clone());
    let sizes = session.rings().to_vec();
    let rings = (0..)
        .zip(&sizes)
        .map(|(ring, size)| round(&mut session, ring, *size));
    let mut rings: Vec<_> = rings.collect();
    for (ring, own) in rings.iter_mut().enumerate() {
        // A ring that stays in the error mode shows when its drives are read.
        own.wrong_parity = try_wrong_parity(&mut session, ring).ok().flatten();
    }
    let rig = session.rig().clone();
    let shared = Shared::new(session);
    let read = drives(&shared, &rig, &sizes, told);
    // It may have shown behind the last answer.
    let trouble = shared.with(|session| session.link().trouble().cloned());
    let read = match trouble.flatten() {
        Some(trouble) => Err(driver::Error::Link(trouble)),
        None => read,
    };
    match read {
        Ok((drives, corrected)) => {
            let figures = Figures {
                rings,
                drives,
                corrected,
                reported: reported.unwrap_or_default(),
            };
            (Ok(figures), shared.release())
        }
        Err(error) => (Err(error), shared.close(true)),
    }
}

/// Sends telegrams without a gap and times the first byte of each.
fn round(session: &mut Session, ring: usize, size: RingSize) -> RingFigures {
    let simulated = session.rig().is_simulated();
    let stated = stated_rate(session.rig());
    let link = session.link();
    let (rate, late) = match line_test::pace(link, ring, stated) {
        RingPace::AsSent => (stated, None),
        RingPace::Slower(rate) => (rate, None),
        RingPace::Late(late) => (stated, Some(late)),
    };
    let nominal = link.byte_time() * u64::from(size.drives());
    let telegrams = COUNT.repeat(ROUNDS);
    let before = link.send_octets(ring, &[]);
    let heard = line_test::answers(link, ring, &telegrams, nominal + PATIENCE);
    let back = [COUNT[0], size.drives(), COUNT[2]];
    let mut rounds = Vec::new();
    // When the first byte of a telegram has left.
    let mut sent = before + link.byte_time();
    for telegram in heard.chunks(COUNT.len()) {
        let sound = telegram.len() == back.len()
            && telegram
                .iter()
                .zip(back)
                .all(|((_, byte), back)| byte.is(back));
        if sound {
            rounds.push(telegram[0].0.since(sent));
        }
        sent += link.byte_time() * COUNT.len() as u64;
    }
    let lost = ROUNDS - rounds.len();
    let damaged = heard.iter().filter(|(_, byte)| byte.error.is_some());
    let mut line_errors = damaged.count() as u64;
    if !simulated && let Some(ports) = session.ports() {
        line_errors += ports.take_unplaced();
    }
    rounds.sort_unstable();
    RingFigures {
        size,
        rate,
        late,
        nominal,
        rounds,
        lost,
        wrong_parity: None,
        line_errors,
    }
}

fn drives(
    shared: &Shared,
    rig: &Rig,
    sizes: &[RingSize],
    told: &mut dyn FnMut(Axis),
) -> Result<(Vec<DriveFigures>, u64), driver::Error> {
    let bus = OpenRings::open(Box::new(shared.line()), sizes, driver::Options::default())?;
    let mut drives = Vec::new();
    for some in bus.axes().chunks(SIDE_BY_SIDE) {
        for (axis, identity) in some.iter().zip(bus.identities(some)?) {
            let state = bus.state(*axis)?;
            let contradiction = contradiction(rig, *axis, &identity);
            drives.push(DriveFigures {
                axis: *axis,
                identity,
                state,
                contradiction,
            });
            told(*axis);
        }
    }
    let corrected = bus.corrected_errors();
    bus.close();
    Ok((drives, corrected))
}

/// How a drive contradicts the rig's file.
fn contradiction(rig: &Rig, axis: Axis, identity: &Identity) -> Option<String> {
    let is_axis = |entry: &&harness_bench::rig::file::DriveEntry| {
        usize::from(entry.ring) == axis.ring() + 1 && entry.address == axis.drive()
    };
    let stated = rig.file.drive.iter().find(is_axis)?.serial.as_deref()?;
    let found = identity.serial_number;
    // Written with leading zeros or without.
    if stated.parse().ok() == found && found.is_some() {
        return None;
    }
    let found = found.map_or("none".to_owned(), |found| format!("{found:06}"));
    Some(format!(
        "its serial number is {found}, the rig's file says {stated}"
    ))
}
