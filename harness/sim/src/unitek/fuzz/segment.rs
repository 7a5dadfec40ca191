//! A segment with several drives and hosts, and faults: what always holds, and no drive influences another.

use super::replay::{Change, Replay};
use crate::fuzz::{Feature, LONGEST, Notebook};
use crate::record::{FrameEnd, LineFrame};
use crate::segment::{FrameFault, Host, Placed, Segment};
use crate::unitek::{Drive, Inputs, Member};
use arbitrary::{Arbitrary, Unstructured};
use harness_proto::can::{BitRate, CanError, CanEvent, ERROR_FRAME_BITS, Frame, Id};
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::frame::{CYCLES, DEFAULT_RX, DEFAULT_TX};
use harness_proto::unitek::properties::Properties;

/// Behind so much time a case ends, so that none takes long.
const MOST_TIME: Span = Span::from_millis(150);

/// Time after the last operation, in which everything that waits is sent.
const REST: Span = Span::from_millis(30);

/// Bits of the intermission, which begins where the last bit of a frame has passed.
const INTERMISSION: u32 = 3;

const RATES: [BitRate; 4] = [BitRate::K500, BitRate::K100, BitRate::K250, BitRate::M1];

const DRIVES: usize = 3;
const HOSTS: usize = 2;

/// What happens, and how much time passes after it.
#[derive(Clone, Copy, Debug)]
struct SegmentStep {
    what: SegmentAct,
    wait: Span,
}

#[derive(Clone, Copy, Debug)]
enum SegmentAct {
    /// A host sends a frame to the drive with this number.
    Send(usize, usize, [u8; 8], usize),
    /// A host sends a frame that no drive takes.
    Elsewhere(usize, Id, [u8; 8], usize),
    /// A fault is planned.
    Fault(Placed),
    /// An input of a drive is switched.
    Switch(usize, usize, bool),
    /// The controller of a host is restarted.
    Restart(usize),
    /// Time passes.
    Time,
}

impl<'a> Arbitrary<'a> for SegmentStep {
    /// Seven bytes: what, four operands, an operand, time. Of the first byte, bits 3 to 0 are the number of data bytes (9 to 11 mean 3, 12 to 15
    /// mean 5). 0_ to 9_: a frame (bit 4: the host; above: the drive); A_: a frame for no drive; B_: a fault; C_: an input; D_: the controller
    /// of a host is restarted; E_, F_: time.
    fn arbitrary(input: &mut Unstructured<'a>) -> arbitrary::Result<Self> {
        let mut bytes = [0; 7];
        input.fill_buffer(&mut bytes)?;
        let [what, register, a, b, c, d, wait] = bytes;
        let low = usize::from(what & 0xF);
        let len = match low {
            0..=8 => low,
            9..=11 => 3,
            _ => 5,
        };
        let (data, high) = ([register, a, b, c, d, 7, 8, 9], usize::from(what >> 4));
        let wait = match wait {
            0..=0x7F => Span::from_micros(20) * u64::from(wait),
            _ => Span::from_micros(100) * u64::from(wait & 0x7F),
        };
        let what = match high {
            0..=9 => SegmentAct::Send(high % HOSTS, high / HOSTS % DRIVES, data, len),
            0xA => {
                let number = u16::from_be_bytes([3, a]);
                let base = Id::base(number);
                let id = Id::extended(u32::from(number) << 18)
                    .filter(|_| b & 1 == 1)
                    .or(base);
                id.map_or(SegmentAct::Time, |id| {
                    SegmentAct::Elsewhere(low % HOSTS, id, data, len)
                })
            }
            0xB => SegmentAct::Fault(Placed {
                station: Some(usize::from(register)).filter(|place| *place < HOSTS + DRIVES),
                frame: 1 + u64::from(a % 32),
                fault: fault(low, b),
            }),
            0xC => SegmentAct::Switch(
                low % DRIVES,
                usize::from(register) % Inputs::SWITCHES.len(),
                a & 1 != 0,
            ),
            0xD => SegmentAct::Restart(low % HOSTS),
            _ => SegmentAct::Time,
        };
        Ok(Self { what, wait })
    }
}

fn fault(kind: usize, time: u8) -> FrameFault {
    match kind % 6 {
        0 => FrameFault::Lost,
        1 => FrameFault::Doubled,
        2 => FrameFault::Late(Span::from_micros(100) * u64::from(time)),
        3 => FrameFault::Corrupt,
        4 => FrameFault::NoAcknowledge,
        _ => FrameFault::BusOff,
    }
}

/// The first byte is the rate; the others are operations of seven bytes. There are two hosts and three drives with identifiers of their
/// own; writes of 69, which could make two drives send on one identifier, are left out.
///
/// # Panics
/// The segment breaks a rule of CAN, or a drive does something else than it does alone with the frames that it has heard.
pub fn segment(data: &[u8]) {
    noted(data, &mut Notebook::none());
}

/// The same, and what happens to the frames is noted.
///
/// # Panics
/// As [`segment`].
pub(super) fn noted(data: &[u8], notes: &mut Notebook<'_>) {
    let Some((&rate, data)) = data.split_first() else {
        return;
    };
    let mut case = Case::new(RATES[usize::from(rate) % RATES.len()]);
    let mut input = Unstructured::new(&data[..data.len().min(LONGEST)]);
    let end = Instant::START + MOST_TIME;
    while let (false, Ok(operation)) = (input.is_empty(), input.arbitrary::<SegmentStep>()) {
        case.happens(operation.what);
        if operation.wait > Span::ZERO {
            case.now += operation.wait;
            case.segment.run_until(case.now);
        }
        if case.now > end {
            break;
        }
    }
    case.segment.run_until(case.now + REST);
    case.judge(notes);
}

/// The identifiers of a drive.
fn identifiers(drive: usize) -> (u16, u16) {
    let number = u16::try_from(drive).unwrap_or(0);
    (DEFAULT_RX + number, DEFAULT_TX + number)
}

/// The drive with this number, as delivered.
fn delivered(number: usize) -> Drive {
    let (rx, tx) = identifiers(number);
    let setup = [(0x68, rx.into()), (0x69, tx.into())];
    Drive::new(Properties::default(), Inputs::default(), Instant::START).with_setup(&setup)
}

struct Case {
    segment: Segment<Member<Drive>>,
    now: Instant,
    /// What each host was given to send, and when.
    given: [Vec<(Instant, Frame)>; HOSTS],
    faults: Vec<Placed>,
    changes: Vec<Change>,
}

impl Case {
    fn new(rate: BitRate) -> Self {
        let hosts = (0..HOSTS).map(|_| Member::Host(Host::default()));
        let drives = (0..DRIVES).map(|number| Member::Drive(delivered(number)));
        Self {
            segment: Segment::new(rate, hosts.chain(drives).collect()),
            now: Instant::START,
            given: [const { Vec::new() }; HOSTS],
            faults: Vec::new(),
            changes: Vec::new(),
        }
    }

    fn happens(&mut self, what: SegmentAct) {
        match what {
            SegmentAct::Send(host, drive, data, len) => {
                let own_identifier = len > 2 && data[0] == 0x69;
                let frame = Frame::base(identifiers(drive).0, &data[..len]);
                if let (false, Ok(frame)) = (own_identifier, frame) {
                    self.send(host, frame);
                }
            }
            SegmentAct::Elsewhere(host, id, data, len) => {
                if let Ok(frame) = Frame::new(id, &data[..len]) {
                    self.send(host, frame);
                }
            }
            SegmentAct::Fault(placed) => {
                self.faults.push(placed);
                self.segment.inject(placed);
            }
            SegmentAct::Switch(number, input, on) => {
                let (now, behind) = (self.now, self.segment.record().len());
                let Some(drive) = self.segment.station_mut(HOSTS + number).drive_mut() else {
                    return;
                };
                let mut inputs = *drive.inputs();
                if let Some(input) = inputs.switch(Inputs::SWITCHES[input]) {
                    *input = on;
                }
                drive.set_inputs(now, inputs);
                self.changes.push(Change {
                    number,
                    behind,
                    at: now,
                    inputs,
                });
            }
            SegmentAct::Restart(host) => self.segment.restart(host),
            SegmentAct::Time => {}
        }
    }

    fn send(&mut self, host: usize, frame: Frame) {
        // A frame may have begun at this very instant already.
        let now = self.now + Span::from_units(1);
        if let Some(station) = self.segment.station_mut(host).host_mut() {
            station.send(now, frame);
            self.given[host].push((now, frame));
        }
    }

    fn judge(mut self, notes: &mut Notebook<'_>) {
        let record = self.segment.take_record();
        self.times(&record);
        let undisturbed = self.faults.len() == self.segment.unused_faults().len()
            && record.iter().all(|line| line.ended == FrameEnd::Good);
        for host in 0..HOSTS {
            self.host(host, &record, undisturbed);
        }
        for number in 0..DRIVES {
            let place = HOSTS + number;
            let off = self.segment.is_off(place);
            let Some(drive) = self.segment.station(place).drive() else {
                continue;
            };
            check(drive);
            // What a drive has heard before its controller went to bus-off is not in the record.
            if !off {
                let alone = Replay::new(place, delivered(number), self.segment.rate());
                alone.compare(&record, &self.changes, number, undisturbed, drive);
            }
            notes.note(|| Feature::new("11", format!("drive {number}"), words(drive, off)));
        }
        self.note(&record, notes);
    }

    /// No frame begins on a busy bus, and each lasts as long as its bits.
    fn times(&self, record: &[LineFrame]) {
        let rate = self.segment.rate();
        let mut free = Instant::START;
        for line in record {
            assert!(line.start >= free, "{line:?} begins on a busy bus");
            free = line.at + rate.time_of(INTERMISSION);
            let bits = line.frame.wire_bits();
            let took = line.at.since(line.start);
            let plain = rate.time_of(bits - INTERMISSION);
            let with_error = rate.time_of(bits + ERROR_FRAME_BITS - 2 * INTERMISSION);
            match line.ended {
                FrameEnd::Good | FrameEnd::Lost => {
                    assert!(took == plain || took == with_error, "{line:?} takes {took}");
                }
                FrameEnd::Error(_) => assert!(took <= with_error, "{line:?} takes {took}"),
            }
        }
        let elapsed = free.since(Instant::START).units();
        let busy = rate.time_of(1).units() * self.segment.busy_bits();
        assert!(busy <= elapsed, "busy for {busy} units of {elapsed}");
    }

    /// A host has heard every frame of the others, and has sent what it was given.
    fn host(&mut self, place: usize, record: &[LineFrame], undisturbed: bool) {
        let off = self.segment.is_off(place);
        let Some(host) = self.segment.station_mut(place).host_mut() else {
            return;
        };
        let confirmed: Vec<_> = std::iter::from_fn(|| host.confirmation()).collect();
        let given = &self.given[place];
        assert_eq!(
            confirmed.len() + host.waiting(),
            given.len(),
            "host {place}: frames are lost"
        );
        let heard: Vec<_> = std::iter::from_fn(|| host.receive())
            .filter_map(|(at, heard)| match heard {
                CanEvent::Frame(frame) => Some((at, frame)),
                CanEvent::Error(_) => None,
            })
            .collect();
        let waiting = host.waiting();
        if !undisturbed || off {
            return;
        }
        let others = record.iter().filter(|line| !confirmed.contains(&line.at));
        let others: Vec<_> = others.map(|line| (line.at, line.frame)).collect();
        assert_eq!(heard, others, "host {place} has heard something else");
        let cycles = |drive: usize| {
            self.segment
                .station(HOSTS + drive)
                .drive()
                .map_or(0, |d| d.running_cycles().count())
        };
        let may_wait = (0..DRIVES).any(|drive| cycles(drive) > 0);
        assert!(
            waiting == 0 || may_wait,
            "host {place}: {waiting} frames wait on a free bus"
        );
        self.arbitration(place, record, &confirmed);
    }

    /// While a frame of a host waited, only frames went that win against it.
    fn arbitration(&self, place: usize, record: &[LineFrame], confirmed: &[Instant]) {
        let mut ready = Instant::START;
        let mut left = record.iter().peekable();
        for ((given, frame), done) in self.given[place].iter().zip(confirmed) {
            ready = ready.max(*given);
            while let Some(line) = left.next_if(|line| line.at < *done) {
                let loses = line.frame.arbitration() > frame.arbitration();
                assert!(
                    line.start < ready || !loses,
                    "{} was ready at {ready:?}, and {line:?} went first",
                    frame
                );
            }
            ready = *done;
        }
    }

    fn note(&self, record: &[LineFrame], notes: &mut Notebook<'_>) {
        for line in record {
            notes.note(|| {
                let from = if usize::from(line.from.unwrap_or(0)) < HOSTS {
                    "a host"
                } else {
                    "a drive"
                };
                let what = match line.ended {
                    FrameEnd::Good => "good",
                    FrameEnd::Lost => "lost",
                    FrameEnd::Error(CanError::ErrorFrame) => "error frame",
                    FrameEnd::Error(CanError::NoAcknowledge) => "no acknowledge",
                    FrameEnd::Error(CanError::BusOff) => "bus-off",
                };
                Feature::new(
                    "4.1",
                    format!("a frame of {from}, length {}", line.frame.dlc()),
                    what,
                )
            });
        }
        for placed in &self.faults {
            let used = !self.segment.unused_faults().contains(placed);
            notes.note(|| {
                let who = match placed.station {
                    None => "any station",
                    Some(place) if place < HOSTS => "a host",
                    Some(_) => "a drive",
                };
                let kind = match placed.fault {
                    FrameFault::Late(_) => "late".to_owned(),
                    fault => fault.to_string(),
                };
                let what = if used { "happens" } else { "has no frame" };
                Feature::new("4.1", format!("{kind}, {who}"), what)
            });
        }
        for pair in record.windows(2) {
            let gap = pair[1].start.since(pair[0].at) == self.segment.rate().time_of(INTERMISSION);
            if gap {
                notes.note(|| {
                    let of = |line: &LineFrame| line.from.unwrap_or(0);
                    Feature::new(
                        "9",
                        format!("station {} follows at once", of(&pair[1])),
                        format!("station {}", of(&pair[0])),
                    )
                });
            }
        }
    }
}

/// What holds for a drive at any time.
fn check(drive: &Drive) {
    assert!(
        drive.running_cycles().count() <= CYCLES,
        "more than 8 cycles (App 8)"
    );
    let enabled = drive.register(0x40) & 1 != 0;
    let locked = drive.held()[0x51] & 4 != 0;
    assert!(!(enabled && locked), "locked and enabled (ex 2)");
}

/// The state of a drive in words.
fn words(drive: &Drive, off: bool) -> String {
    let cycles = match drive.running_cycles().count() {
        0 => "no cycle",
        CYCLES => "8 cycles",
        _ => "cycles",
    };
    let enabled = if drive.is_enabled() {
        "enabled"
    } else {
        "not enabled"
    };
    let off = if off { ", bus-off" } else { "" };
    format!("{enabled}, {cycles}{off}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn case() -> Case {
        let mut case = Case::new(BitRate::K500);
        for data in [[0x3D, 0x40, 0, 0, 0, 0, 0, 0], [0x31, 1, 0, 0, 0, 0, 0, 0]] {
            case.happens(SegmentAct::Send(0, 0, data, 3));
            case.now += Span::from_millis(1);
            case.segment.run_until(case.now);
        }
        case
    }

    #[test]
    fn a_right_segment_passes() {
        case().judge(&mut Notebook::none());
    }

    /// A drive that was changed by something other than frames is found.
    #[test]
    #[should_panic(expected = "register 1C")]
    fn an_influence_is_found() {
        let mut case = case();
        let drive = case.segment.station_mut(HOSTS).drive_mut();
        drive.expect("a drive").poke(0x1C, 11);
        case.judge(&mut Notebook::none());
    }

    /// A frame that a host was given and has not sent is found.
    #[test]
    #[should_panic(expected = "frames are lost")]
    fn a_lost_frame_is_found() {
        let mut case = case();
        case.given[1].push((Instant::START, Frame::base(1, &[]).expect("a frame")));
        case.judge(&mut Notebook::none());
    }

    /// A frame that begins before the bus is free is found.
    #[test]
    #[should_panic(expected = "busy bus")]
    fn an_overlap_is_found() {
        let case = case();
        let mut record = case.segment.record().to_vec();
        record[1].start = record[0].at;
        case.times(&record);
    }
}
