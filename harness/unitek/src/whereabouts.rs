//! Where a drive is whose identifiers were written (68 and 69, UNITEK 3.1), and its way back to those of the rig's file.

use crate::gate::GuardsSegment as _;
use harness_bench::guard::Guarded;
use harness_bench::link::Line;
use harness_bench::medium::{HeardPiece, Out};
use harness_proto::can::{self, BadFrame, Frame};
use harness_proto::time::Span;
use harness_proto::unitek::frame::{Data, Reply, Request};
use harness_proto::unitek::guard::Places;

/// How often each identifier is tried.
const ROUNDS: usize = 3;

/// By how much a frame may be late.
const SLACK: Span = Span::from_millis(30);

/// The registers of the identifiers: to receive, and to send.
const IDENTIFIERS: [u8; 2] = [0x68, 0x69];

/// Registers by which a drive is asked whether it is there: two more than it has cycles, so that two come only when they are asked for.
const ASKED: [u8; 10] = [0x68, 0x69, 0x1B, 0x73, 0xC8, 0xCE, 0xC6, 0xD9, 0x59, 0x8C];

/// A drive that was looked for.
pub(super) struct Search<'s, L> {
    pub(super) line: &'s mut Guarded<L>,
    pub(super) places: &'s Places,
    /// How long a reply may take.
    pub(super) patience: Span,
}

impl<L: Line> Search<'_, L> {
    /// Asks for a register on one identifier. Returns on which of those that are listened to the reply came, and what it holds.
    fn asks(&mut self, rx: u16, tx: &[u16], register: u8) -> Option<(u16, u16)> {
        let frame = Request::Read { register }.encode(rx).ok()?;
        while self.line.receive(0).is_some() {}
        if !self.line.permits(0, Out::Frames(&[frame])) {
            return None;
        }
        let end = self.line.send(0, Out::Frames(&[frame])) + self.patience;
        loop {
            while let Some((_, heard)) = self.line.receive(0) {
                let HeardPiece::Frame(can::CanEvent::Frame(frame)) = heard else {
                    continue;
                };
                let reply = |tx: &u16| Some((*tx, Reply::decode(&frame, *tx).ok()?));
                let mut replies = tx.iter().filter_map(reply);
                if let Some((tx, reply)) = replies.find(|answer| answer.1.register == register) {
                    return Some((tx, (reply.data.bits() & 0xFFFF) as u16));
                }
            }
            if self.line.now() >= end || self.line.trouble().is_some() {
                return None;
            }
            self.line.wait(end);
        }
    }

    /// Whether it answers on an identifier, and on which one: for two registers that it sends only when it is asked for them. A reply that
    /// is still under way from a request before is not that of both.
    fn answers(&mut self, rx: u16, tx: &[u16]) -> Option<u16> {
        let gate = self.line.segment();
        let started = gate
            .into_iter()
            .flat_map(|gate| gate.started(self.places.first.0));
        let cyclic: Vec<_> = started.map(|cycle| cycle.0).collect();
        let single = |register: &u8| !cyclic.contains(register);
        let mut asked = ASKED.into_iter().filter(single);
        let (one, other) = (asked.next()?, asked.next()?);
        let (tx, _) = self.asks(rx, tx, one)?;
        self.reads((rx, tx), other).map(|_| tx)
    }

    /// What a register of a drive that answers holds, asked again where a frame was lost.
    fn reads(&mut self, (rx, tx): (u16, u16), register: u8) -> Option<u16> {
        let mut tries = 0..ROUNDS;
        tries.find_map(|_| self.asks(rx, &[tx], register).map(|answer| answer.1))
    }

    /// The identifiers on which it answers: those of the rig's file, others that were given to it, or any that was given to a drive, which
    /// it may have taken too. The gate takes notice of them.
    pub(super) fn find(&mut self) -> Option<(u16, u16)> {
        let first = self.places.first;
        let (rx, tx) = (self.places.rx.clone(), self.places.tx.clone());
        let near = rx.iter().cycle().take(rx.len() * ROUNDS).copied();
        let gate = self.line.segment();
        let [more_rx, mut more_tx] = gate.map(|gate| gate.given().clone()).unwrap_or_default();
        let others: Vec<_> = gate.into_iter().flat_map(|gate| gate.places()).collect();
        more_tx.retain(|id| {
            others
                .iter()
                .all(|place| place.first == first || !place.tx.contains(id))
        });
        more_tx.extend(&tx);
        let far = more_rx
            .into_iter()
            .chain(others.iter().flat_map(|place| place.rx.clone()));
        let far: Vec<_> = far
            .filter(|id| !rx.contains(id))
            .map(|rx| (rx, more_tx.clone()))
            .collect();
        let near: Vec<_> = near.map(|id| (id, tx.clone())).collect();
        let found = near.into_iter().chain(far).find_map(|(rx, tx)| {
            let tx = self.answers(rx, &tx)?;
            Some((rx, tx))
        });
        if let (Some((rx, _)), Some(gate)) = (found, self.line.segment_mut()) {
            gate.found(first.0, rx);
        }
        found
    }

    /// Sets the identifiers of a drive that answers on `at` back to those of the rig's file, and reads them there. Returns whether they were
    /// others.
    ///
    /// # Errors
    /// Where it answers instead, and the frames that set it back, in a sentence.
    pub(super) fn bring_back(&mut self, mut at: (u16, u16)) -> Result<bool, String> {
        let first = self.places.first;
        let mut others = false;
        for _ in 0..ROUNDS {
            let mut right = at == first;
            // The identifier of the replies first: those that follow come where the rig's file expects them.
            for (register, wanted, used) in [
                (IDENTIFIERS[1], first.1, at.1),
                (IDENTIFIERS[0], first.0, at.0),
            ] {
                let holds = self.reads(at, register);
                if holds == Some(wanted) && used == wanted {
                    continue;
                }
                right = false;
                let Ok(frame) = back(at.0, register, wanted) else {
                    continue;
                };
                if let Some(why) = self.line.denied(0, Out::Frames(&[frame])) {
                    return Err(self.away(at, Some(&why)));
                }
                let end = self.line.send(0, Out::Frames(&[frame]));
                while self.line.now() < end && self.line.wait(end) {}
                let Some(found) = self.find() else {
                    return Err(self.away(at, None));
                };
                at = found;
            }
            if right {
                return Ok(others);
            }
            others = true;
        }
        Err(self.away(at, None))
    }

    /// Asks a drive that is back on the other identifiers that were given to it. Returns the first on which it still answers; where it
    /// answers on none, the gate forgets them.
    pub(super) fn settle(&mut self) -> Option<u16> {
        let (rx, tx) = (self.places.rx.clone(), self.places.tx.clone());
        let mut others = rx.into_iter().skip(1);
        let still = others.find(|rx| self.answers(*rx, &tx).is_some());
        if let (None, Some(gate)) = (still, self.line.segment_mut()) {
            gate.settled(self.places.first.0);
        }
        still
    }

    /// Where a drive answers that is not back, why its frames were not sent, and which ones set it back.
    fn away(&self, at: (u16, u16), denied: Option<&str>) -> String {
        let first = self.places.first;
        let needed = [
            (IDENTIFIERS[1], first.1, at.1),
            (IDENTIFIERS[0], first.0, at.0),
        ];
        let needed = needed.iter().filter(|row| at == first || row.1 != row.2);
        let frames = needed.filter_map(|row| back(at.0, row.0, row.1).ok());
        let frames: Vec<_> = frames.map(|frame| frame.to_string()).collect();
        let set = if frames.len() == 1 { "sets" } else { "set" };
        let frames = format!("{} {set} it back", frames.join(" and "));
        let place = match at == first {
            true => format!(
                "registers 68 and 69 do not hold {:03X} and {:03X}, which it uses now",
                first.0, first.1
            ),
            false => format!(
                "it receives on {:03X} and sends on {:03X}, not on {:03X} and {:03X} as in the rig's file",
                at.0, at.1, first.0, first.1
            ),
        };
        match denied {
            Some(why) => format!(
                "{place}; {why}; with no other drive that receives on {:03X} on the bus, {frames}",
                at.0
            ),
            None => format!("{place}, and did not take the way back; {frames}"),
        }
    }
}

/// Stops the cycles of a drive again that it still sends, because a frame was lost. `first` is its identifier in the rig's file. Returns
/// those that it does not end.
pub(super) fn still_sent<L: Line>(line: &mut Guarded<L>, first: u16, at: (u16, u16)) -> Vec<u8> {
    let gate = line.segment();
    let started: Vec<_> = gate
        .into_iter()
        .flat_map(|gate| gate.started(first))
        .collect();
    let Some(longest) = started.iter().map(|cycle| cycle.1).max() else {
        return Vec::new();
    };
    let mut left = Vec::new();
    for _ in 0..ROUNDS {
        left.clear();
        let end = line.now() + Span::from_millis(longest.into()) + SLACK;
        while line.now() < end && line.trouble().is_none() {
            line.wait(end);
            while let Some((_, heard)) = line.receive(0) {
                let HeardPiece::Frame(can::CanEvent::Frame(frame)) = heard else {
                    continue;
                };
                let shown = Reply::decode(&frame, at.1).map(|reply| reply.register);
                let register = shown
                    .ok()
                    .filter(|number| started.iter().any(|(register, _)| register == number));
                left.extend(register.filter(|register| !left.contains(register)));
            }
        }
        if left.is_empty() && line.trouble().is_none() {
            if let Some(gate) = line.segment_mut() {
                gate.sends_nothing(first);
            }
            break;
        }
        for register in &left {
            let stop = Request::Stop {
                register: *register,
            };
            let frames: Vec<_> = stop.encode(at.0).into_iter().collect();
            line.send(0, Out::Frames(&frames));
        }
    }
    left
}

/// The frame that writes an identifier.
fn back(rx: u16, register: u8, id: u16) -> Result<Frame, BadFrame> {
    let data = Data::Short(id);
    Request::Write { register, data }.encode(rx)
}
