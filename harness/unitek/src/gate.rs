//! The gate of a segment of UNITEK drives: every frame is judged by what a drive would read out of it (UNITEK chapters 4 and 5).

use harness_bench::guard::{Denied, Gate, Guarded};
use harness_bench::link::{Capability, DriveFault, Line, Link, Moment, PlacedFault};
use harness_bench::medium::{HeardPiece, Medium, Out};
use harness_proto::can::{self, BitRate, Frame};
use harness_proto::limit::LimitSetting;
use harness_proto::time::Instant;
use harness_proto::unitek::guard::{self, Denial, Limits, Missing};
use std::any::Any;

/// The gate of one port.
#[derive(Clone, Debug)]
pub(crate) struct SegmentGate {
    gate: guard::FrameGate,
    /// Nothing is sent.
    listen_only: bool,
}

impl SegmentGate {
    /// A gate in front of a bus of this rate with drives that receive and send on these identifiers. With `listen_only` it admits
    /// nothing.
    #[must_use]
    pub(crate) fn new(
        limits: Limits,
        rate: BitRate,
        drives: &[(u16, u16)],
        listen_only: bool,
    ) -> Self {
        Self {
            gate: guard::FrameGate::new(limits, rate, drives),
            listen_only,
        }
    }

    fn admit_frame(&mut self, now: Instant, frame: &Frame) -> Result<(), Denied> {
        if self.listen_only {
            let why = format!("{frame} is not sent: the rig's file says `listen_only = true`");
            return Err(Denied::never(why));
        }
        let judged = self.gate.admit(now, frame);
        judged.map_err(|denial| Denied {
            why: format!("{frame} is not sent: {denial}"),
            settings: self.denying(denial),
        })
    }

    /// The settings that deny something for this reason.
    fn denying(&self, denial: Denial) -> Vec<LimitSetting> {
        let limits = self.gate.limits();
        let wanted: &[LimitSetting] = match denial {
            Denial::NotPermitted { missing, .. } => match missing {
                Missing::Motion => &[LimitSetting::Motion],
                Missing::Eeprom => &[LimitSetting::Eeprom],
                Missing::All => &[LimitSetting::Motion, LimitSetting::Eeprom],
                Missing::BusSettings | Missing::WayBack | Missing::Named => &[],
            },
            Denial::Speed { .. } => &[LimitSetting::MaxSpeed],
            _ => &[],
        };
        let denies = |setting: &&LimitSetting| match setting {
            LimitSetting::Motion => !limits.motion,
            LimitSetting::Eeprom => !limits.eeprom,
            _ => true,
        };
        wanted.iter().filter(denies).copied().collect()
    }
}

fn no_octets() -> Denied {
    Denied::never("octets are not sent: a CAN bus carries frames".to_owned())
}

impl Gate for SegmentGate {
    fn admit(&mut self, now: Instant, what: Out<'_>) -> (usize, Option<Denied>) {
        if !what.octets().is_empty() {
            return (0, Some(no_octets()));
        }
        for (admitted, frame) in what.frames().iter().enumerate() {
            if let Err(denied) = self.admit_frame(now, frame) {
                return (admitted, Some(denied));
            }
        }
        (what.len(), None)
    }

    fn denies(&self, now: Instant, what: Out<'_>) -> Option<Denied> {
        self.clone().admit(now, what).1
    }

    fn probe(&mut self, _now: Instant, octets: &[u8], _copy: bool) -> Result<(), Denied> {
        match octets.is_empty() {
            true => Ok(()),
            false => Err(no_octets()),
        }
    }

    fn fault(&mut self, fault: PlacedFault, _: Moment, _settled: bool) -> Result<(), Denied> {
        match fault {
            PlacedFault::Stimulus(..) | PlacedFault::Drive(_, DriveFault::Off) => Ok(()),
            // It forgets a lock.
            PlacedFault::Drive(..) => {
                self.gate.doubt();
                Ok(())
            }
            _ if self.gate.limits().motion => {
                self.gate.doubt();
                Ok(())
            }
            _ => Err(Denied {
                why: format!(
                    "the fault `{fault}` is not made: a drive could miss the frame that locks it, so it needs `allow_motion` in the \
                     rig's [limits] and --allow-motion"
                ),
                settings: vec![LimitSetting::Motion],
            }),
        }
    }

    fn hear(&mut self, heard: &HeardPiece) {
        match heard {
            HeardPiece::Frame(can::CanEvent::Frame(frame)) => self.gate.overhear(frame),
            // The bench's own last frame may be lost.
            HeardPiece::Frame(can::CanEvent::Error(_)) => self.gate.doubt(),
            HeardPiece::Octet(_) => {}
        }
    }

    fn begin(&mut self) {}

    fn at_rest(&self) -> bool {
        true
    }

    fn can_pause(&self) -> bool {
        true
    }

    fn assume_fresh(&mut self) {
        self.gate.doubt();
    }

    fn reset_after_denial(&mut self) {}

    fn know_as(&mut self, other: &dyn Gate) {
        let other: &dyn Any = other;
        if let Some(other) = other.downcast_ref::<Self>() {
            self.gate.know_as(&other.gate);
        }
    }
}

/// A link to UNITEK drives, which receive and send on these identifiers, behind its gate. What the limits deny is no capability of it.
pub(crate) fn guarded<L: Link>(
    inner: L,
    limits: Limits,
    drives: &[(u16, u16)],
    listen_only: bool,
) -> Guarded<L> {
    let rate = match inner.medium(0) {
        Medium::Frames(rate) => rate,
        Medium::Octets(_) => BitRate::K500,
    };
    let has = |capability: &Capability| match capability {
        Capability::Motion => limits.motion,
        Capability::Eeprom => limits.eeprom,
        _ => true,
    };
    let available = inner.capabilities().iter().copied();
    let capabilities = available.filter(has).collect();
    let gate = SegmentGate::new(limits, rate, drives, listen_only);
    Guarded::behind(inner, vec![Box::new(gate)], capabilities)
}

/// A line behind the gate of a segment.
pub(crate) trait GuardsSegment {
    /// What the gate of a segment knows, if this line has one.
    fn segment(&self) -> Option<&guard::FrameGate>;

    /// The gate, mutable, to be told what was read.
    fn segment_mut(&mut self) -> Option<&mut guard::FrameGate>;
}

impl<L: Line> GuardsSegment for Guarded<L> {
    fn segment(&self) -> Option<&guard::FrameGate> {
        self.gate::<SegmentGate>(0).map(|gate| &gate.gate)
    }

    fn segment_mut(&mut self) -> Option<&mut guard::FrameGate> {
        self.gate_mut::<SegmentGate>(0).map(|gate| &mut gate.gate)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Bench, Setup};
    use harness_bench::link::Trouble;
    use harness_proto::time::Span;
    use harness_proto::unitek::frame::Request;
    use harness_proto::unitek::properties::Dlc4;
    use proptest::prelude::*;

    const DRIVES: [(u16, u16); 2] = [(0x201, 0x181), (0x202, 0x182)];

    fn bench(limits: Limits) -> Guarded<Bench> {
        guarded(Bench::new(&Setup::of(2)), limits, &DRIVES, false)
    }

    fn frame(text: &str) -> Frame {
        text.parse().expect("a frame")
    }

    fn send(line: &mut Guarded<Bench>, text: &str) -> Option<String> {
        line.send(0, Out::Frames(&[frame(text)]));
        let denied = match line.trouble() {
            Some(Trouble::Denied(why)) => Some(why.clone()),
            _ => None,
        };
        line.reset_after_denial();
        denied
    }

    #[test]
    fn a_denial_names_the_frame_the_register_and_the_setting() {
        let mut line = bench(Limits::default());
        assert_eq!(send(&mut line, "201#3D4000"), None);
        assert_eq!(
            send(&mut line, "201#510000").as_deref(),
            Some(
                "201#510000 is not sent: a write to register 51 (MODE) needs `allow_motion` in the rig's [limits] and --allow-motion"
            )
        );
        assert_eq!(line.denying(), [LimitSetting::Motion]);
        assert!(!line.permits(0, Out::Frames(&[frame("201#310100")])));
        assert!(!line.permits(0, Out::Octets(&[0x88])));
        let idle = |line: &mut Guarded<Bench>| {
            while line.inner().busy() && line.wait(Instant::NEVER) {}
        };
        idle(&mut line);
        let carried = line.inner().carried();
        line.send(0, Out::Octets(&[0x88]));
        assert_eq!(line.inner().carried(), carried);
        // Behind a denial nothing passes, whatever is permitted, until it is reset.
        let passes = |line: &mut Guarded<Bench>| {
            line.send(0, Out::Frames(&[frame("201#3D4000")]));
            idle(line);
            line.inner().carried() > carried
        };
        assert!(!passes(&mut line));
        line.reset_after_denial();
        assert!(passes(&mut line));
    }

    #[test]
    fn nothing_is_sent_where_the_bench_only_listens() {
        let limits = Limits::unlimited();
        let mut line = guarded(Bench::new(&Setup::of(2)), limits, &DRIVES, true);
        let denied = send(&mut line, "201#3D4000").expect("denied");
        assert!(denied.contains("listen_only"), "{denied}");
        assert_eq!(line.inner().carried(), 0);
    }

    /// A frame that is lost may have been the lock, and so may one that a drive has not heard while it restarted.
    #[test]
    fn a_lock_is_forgotten_where_frames_are_lost() {
        let stop = "201#310000";
        let mut line = bench(Limits::default());
        assert_eq!(send(&mut line, "201#510400"), None);
        assert_eq!(send(&mut line, stop), None);
        line.inject(0, PlacedFault::Drive(1, DriveFault::On), Moment::Now);
        assert!(send(&mut line, stop).is_some());
        let lost = PlacedFault::Frame(harness_bench::link::FrameFault::Lost);
        line.inject(0, lost, Moment::Byte(9));
        assert!(matches!(line.trouble(), Some(Trouble::Denied(why)) if why.contains("locks it")));
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

        /// Whatever is sent, drives behind a gate without permissions keep every register that can move them, and reach no bus load
        /// above one half.
        #[test]
        fn what_is_not_allowed_does_not_leave(
            frames in prop::collection::vec((
                prop_oneof![6 => 0x201u16..=0x202, 1 => 0..0x800u16],
                prop_oneof![Just(0x51u8), Just(0x31), Just(0x90), Just(0x6E), Just(0x84), Just(0x3D), any::<u8>()],
                prop::collection::vec(any::<u8>(), 0..=7),
            ), 1..40)
        ) {
            let mut line = bench(Limits::default());
            for (id, register, data) in frames {
                let data = [&[register], data.as_slice()].concat();
                let frame = Frame::base(id, &data).expect("8 bytes at most");
                line.send(0, Out::Frames(&[frame]));
                line.reset_after_denial();
                let until = line.now() + harness_proto::time::Span::from_millis(1);
                while line.now() < until {
                    line.wait(until);
                }
            }
            for sent in line.inner().trace(0).channels[0].frames().iter().filter(|frame| frame.from.is_none()) {
                let frame = sent.frame;
                let rx = u16::try_from(frame.id().number()).expect("11 bits");
                prop_assert!(DRIVES.iter().any(|(receives, _)| *receives == rx), "{frame}");
                let Ok(Request::Write { register, .. }) = Request::decode(&frame, rx, Dlc4::As3) else { continue };
                let harmless = [0x10, 0x12, 0x13, 0x14, 0x15, 0x16, 0x17, 0x18, 0x31, 0x51, 0x52, 0x90];
                prop_assert!(harmless.contains(&register), "{frame}");
            }
            for node in [1, 2] {
                let drive = line.inner().drive(node).expect("a drive");
                prop_assert_eq!((drive.register(0x31), drive.register(0x90)), (0, 0));
            }
        }
    }

    /// A record without a bound of its own ends the conversation; a new limit lets it go on.
    #[test]
    fn a_record_can_be_limited() {
        let wait = |line: &mut Guarded<Bench>| {
            let until = line.now() + Span::from_millis(5);
            while line.now() < until {
                line.wait(until);
            }
        };
        let mut line = bench(Limits::default());
        line.limit_record(Some(4));
        // Two requests and their replies.
        for _ in 0..2 {
            assert_eq!(send(&mut line, "201#3D3000"), None);
            wait(&mut line);
        }
        assert_eq!((line.carried(), line.trouble()), (4, None));
        assert_eq!(send(&mut line, "201#3D3000"), None);
        wait(&mut line);
        assert!(matches!(line.trouble(), Some(Trouble::Denied(_))));
        line.reset_after_denial();
        line.record(true);
        line.limit_record(Some(4));
        wait(&mut line);
        assert_eq!((line.carried(), line.trouble()), (0, None));
    }
}
