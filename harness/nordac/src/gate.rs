//! The gate of a segment of NORDAC inverters: every octet is judged by the telegrams that it can complete (NORDAC 3, EN 1, 2).

use harness_bench::guard::{Denied, Gate, Guarded};
use harness_bench::link::{AnyStimulus, Capability, DriveFault, Line, Link, Moment, PlacedFault};
use harness_bench::medium::{HeardPiece, Medium, Out};
use harness_proto::limit::LimitSetting;
use harness_proto::nordac::guard::{self, FcsDenial, GuardedSlave, Limits, Missing};
use harness_proto::profibus::BusRate;
use harness_proto::time::Instant;
use std::any::Any;

/// The gate of one port.
#[derive(Clone, Debug)]
pub(crate) struct LineGate {
    gate: guard::OctetGate,
    /// Nothing is sent.
    listen_only: bool,
}

impl LineGate {
    /// A gate in front of a segment of this rate with these slaves. With `listen_only` it admits nothing.
    #[must_use]
    pub(crate) fn new(
        limits: Limits,
        rate: BusRate,
        slaves: &[GuardedSlave],
        listen_only: bool,
    ) -> Self {
        Self {
            gate: guard::OctetGate::new(limits, rate, slaves),
            listen_only,
        }
    }

    /// Judges octets that are sent together. None of them counts as sent unless all may be.
    fn admit_all(&mut self, now: Instant, octets: &[u8]) -> Result<(), Denied> {
        if self.listen_only && !octets.is_empty() {
            let why = "nothing is sent: the rig's file says `listen_only = true`".to_owned();
            return Err(Denied::never(why));
        }
        let mut gate = self.gate.clone();
        for octet in octets {
            gate.admit(now, *octet).map_err(|denial| Denied {
                why: format!("a telegram is not sent: {denial}"),
                settings: self.denying(denial),
            })?;
        }
        self.gate = gate;
        Ok(())
    }

    /// The settings that deny something for this reason, as far as they are common to all buses.
    fn denying(&self, denial: FcsDenial) -> Vec<LimitSetting> {
        let limits = self.gate.limits();
        let wanted: &[LimitSetting] = match denial {
            FcsDenial::NotPermitted {
                missing: Missing::Motion,
                ..
            } => &[LimitSetting::Motion],
            FcsDenial::NotPermitted {
                missing: Missing::Eeprom,
                ..
            } => &[LimitSetting::Eeprom],
            FcsDenial::Speed { .. } => &[LimitSetting::MaxSpeed],
            _ => &[],
        };
        let denies = |setting: &&LimitSetting| match setting {
            LimitSetting::Motion => !limits.motion,
            LimitSetting::Eeprom => !limits.eeprom,
            _ => true,
        };
        wanted.iter().filter(denies).copied().collect()
    }

    /// Whether octets may be changed on the line: they could become any telegram.
    const fn permits_faults(&self) -> bool {
        let limits = self.gate.limits();
        limits.motion && limits.eeprom && limits.motor_data && limits.bus_settings
    }
}

impl Gate for LineGate {
    fn admit(&mut self, now: Instant, what: Out<'_>) -> (usize, Option<Denied>) {
        if !what.frames().is_empty() {
            let why = "frames are not sent: this bus carries octets".to_owned();
            return (0, Some(Denied::never(why)));
        }
        match self.admit_all(now, what.octets()) {
            Ok(()) => (what.len(), None),
            Err(denied) => (0, Some(denied)),
        }
    }

    fn denies(&self, now: Instant, what: Out<'_>) -> Option<Denied> {
        self.clone().admit(now, what).1
    }

    fn probe(&mut self, now: Instant, octets: &[u8], copy: bool) -> Result<(), Denied> {
        match copy {
            true => self.clone().admit_all(now, octets),
            false => self.admit_all(now, octets),
        }
    }

    fn fault(&mut self, fault: PlacedFault, _: Moment, _settled: bool) -> Result<(), Denied> {
        match fault {
            PlacedFault::Drive(_, DriveFault::Off) => Ok(()),
            // It forgets its watchdog.
            PlacedFault::Drive(..) => {
                self.gate.doubt();
                Ok(())
            }
            PlacedFault::Stimulus(_, AnyStimulus::Nordac(_)) => Ok(()),
            _ if self.permits_faults() => {
                self.gate.doubt();
                Ok(())
            }
            _ => Err(Denied {
                why: format!(
                    "a fault on the line is not made: octets that it changes could become any telegram, so it needs {}",
                    Missing::Everything.name()
                ),
                settings: Vec::new(),
            }),
        }
    }

    fn hear(&mut self, heard: &HeardPiece) {
        if let HeardPiece::Octet(octet) = heard {
            let good = octet.error.is_none().then_some(octet.byte);
            self.gate.hear(good);
        }
    }

    fn begin(&mut self) {}

    fn at_rest(&self) -> bool {
        self.gate.at_rest()
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

/// A link to NORDAC inverters behind its gate. What the limits deny is no capability of it.
pub(crate) fn guarded<L: Link>(
    inner: L,
    limits: Limits,
    slaves: &[GuardedSlave],
    listen_only: bool,
) -> Guarded<L> {
    let rate = match inner.medium(0) {
        Medium::Octets(format) => BusRate::from_bits_per_second(format.bits_per_second),
        Medium::Frames(_) => None,
    };
    let has = |capability: &Capability| match capability {
        Capability::Motion => limits.motion,
        Capability::Eeprom => limits.eeprom,
        _ => true,
    };
    let available = inner.capabilities().iter().copied();
    let capabilities = available.filter(has).collect();
    let gate = LineGate::new(limits, rate.unwrap_or_default(), slaves, listen_only);
    Guarded::behind(inner, vec![Box::new(gate)], capabilities)
}

/// A line behind the gate of NORDAC inverters.
pub(crate) trait GuardsSlaves {
    /// What the gate of a line of NORDAC inverters knows, if this line has one.
    fn slaves(&self) -> Option<&guard::OctetGate>;

    /// The gate, mutable, to be told what was read.
    fn slaves_mut(&mut self) -> Option<&mut guard::OctetGate>;
}

impl<L: Line> GuardsSlaves for Guarded<L> {
    fn slaves(&self) -> Option<&guard::OctetGate> {
        self.gate::<LineGate>(0).map(|gate| &gate.gate)
    }

    fn slaves_mut(&mut self) -> Option<&mut guard::OctetGate> {
        self.gate_mut::<LineGate>(0).map(|gate| &mut gate.gate)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::talk::Talk;
    use crate::simulate::{Bench, Setup, SlaveSetup};
    use harness_bench::link::{Octets, Trouble};
    use harness_proto::nordac::PpoType;
    use harness_proto::profibus::fdl::check_sum;
    use harness_proto::time::Span;
    use proptest::prelude::*;

    const PATIENCE: Span = Span::from_millis(5);

    fn bench(limits: Limits) -> Guarded<Bench> {
        let setup = Setup::new(BusRate::K500, vec![SlaveSetup::new(8)]);
        let slave = GuardedSlave {
            address: 8,
            ppo: Some(PpoType::One),
        };
        guarded(Bench::new(&setup), limits, &[slave], false)
    }

    fn octets(text: &str) -> Vec<u8> {
        let octet = |text| u8::from_str_radix(text, 16).expect("an octet");
        text.split(' ').map(octet).collect()
    }

    /// A telegram of master 2 to slave 8 without SAPs.
    fn exchange(data: &[u8]) -> Vec<u8> {
        let length = u8::try_from(data.len() + 3).expect("short");
        let body = [&[8, 2, 0x6D], data].concat();
        let sum = check_sum(&body);
        [&[0x68, length, length, 0x68], body.as_slice(), &[sum, 0x16]].concat()
    }

    /// Sends octets in these pieces. Gives the reason of a denial.
    fn send(line: &mut Guarded<Bench>, pieces: &[&[u8]]) -> Option<String> {
        for piece in pieces {
            line.send_octets(0, piece);
        }
        let denied = match line.trouble() {
            Some(Trouble::Denied(why)) => Some(why.clone()),
            _ => None,
        };
        line.reset_after_denial();
        while line.inner().busy() && line.wait(Instant::NEVER) {}
        denied
    }

    /// PKE, IND, PWE, STW, HSW of PPO1.
    fn image(pke: u16, word: u16) -> Vec<u8> {
        let words = [pke, 0, 0, 0, word, 0];
        words.into_iter().flat_map(u16::to_be_bytes).collect()
    }

    #[test]
    fn a_denial_names_the_telegram_and_the_setting() {
        let mut line = bench(Limits::default());
        assert_eq!(send(&mut line, &[&octets("10 08 02 49 53 16")]), None);
        let start = exchange(&image(0, 0x047F));
        assert_eq!(
            send(&mut line, &[&start]).as_deref(),
            Some(
                "a telegram is not sent: control word 047F, which can enable the motor, to station 8 needs `allow_motion` in the rig's \
                 [limits] and --allow-motion"
            )
        );
        assert_eq!(line.denying(), [LimitSetting::Motion]);
        let carried = line.inner().carried();
        let write = exchange(&image(0x24B2, 0));
        let denied = send(&mut line, &[&write[..9], &write[9..]]).expect("denied");
        assert!(denied.contains("task 2 on parameter 1202"), "{denied}");
        assert!(denied.contains("`allow_eeprom`"), "{denied}");
        assert_eq!(line.inner().carried(), carried + 9, "the rest is kept back");
        let clear = octets("68 07 07 68 88 82 44 3A 3E 02 00 C8 16");
        let denied = send(&mut line, &[&clear]).expect("denied");
        assert!(denied.contains("Clear_Data"), "{denied}");
        assert!(!line.permits(0, Out::Frames(&["201#00".parse().expect("a frame")])));
    }

    #[test]
    fn nothing_is_sent_where_the_bench_only_listens() {
        let slaves = [SlaveSetup::new(8)];
        let setup = Setup::new(BusRate::K500, slaves.to_vec());
        let mut line = guarded(Bench::new(&setup), Limits::unlimited(), &[], true);
        let denied = send(&mut line, &[&octets("10 08 02 49 53 16")]).expect("denied");
        assert!(denied.contains("listen_only"), "{denied}");
        assert_eq!(line.inner().carried(), 0);
    }

    /// The gate reads replies along: a motor whose bus time-out was read and whose watchdog is on may be enabled.
    #[test]
    fn what_is_read_over_the_line_counts() {
        let mut line = bench(Limits {
            motion: true,
            eeprom: true,
            motor_data: true,
            ..Limits::default()
        });
        let start = exchange(&image(0, 0x047F));
        let tasks = |line: &mut Guarded<Bench>, pke: u16, value: u16| {
            let mut data = image(pke, 0);
            data[6..8].copy_from_slice(&value.to_be_bytes());
            let none = exchange(&image(0, 0));
            let task = exchange(&data);
            for octets in [&none, &none, &none, &task, &task, &task] {
                line.send_octets(0, octets);
                let end = line.now() + PATIENCE;
                while line.now() < end && line.wait(end) {
                    while line.receive(0).is_some() {}
                }
            }
        };
        let mut talk = Talk::new(Box::new(&mut line), PATIENCE);
        talk.start(8, PpoType::One, Some([1, 100])).expect("starts");
        drop(talk);
        let denied = send(&mut line, &[&start]).expect("denied");
        assert!(denied.contains("bus time-out (1625)"), "{denied}");
        tasks(&mut line, 0x2000 | 1625, 20);
        tasks(&mut line, 0x1000 | 1625, 0);
        assert_eq!(send(&mut line, &[&start]), None);
        tasks(&mut line, 0x2000 | 1625, 0);
        tasks(&mut line, 0x1000 | 1625, 0);
        assert!(send(&mut line, &[&start]).is_some());
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

        /// Whatever octets are sent and however they are split, an inverter behind a gate without permissions stays off, keeps its
        /// parameters, and takes no valid word that enables it.
        #[test]
        fn what_is_not_allowed_does_not_leave(
            telegrams in prop::collection::vec((
                prop_oneof![
                    (any::<u16>(), any::<u16>()).prop_map(|(pke, word)| exchange(&image(pke, word))),
                    (0x24B2_u16..0x24B6, Just(0x047F_u16)).prop_map(|(pke, word)| exchange(&image(pke, word))),
                    Just(octets("68 0C 0C 68 88 82 5C 3D 3E 80 00 00 0B 75 31 00 12 16")),
                    Just(octets("68 07 07 68 88 82 7C 3E 3E F3 F1 E6 16")),
                    Just(octets("68 07 07 68 88 82 44 3A 3E 02 00 C8 16")),
                    prop::collection::vec(any::<u8>(), 1..24),
                ],
                any::<prop::sample::Index>(),
                any::<bool>(),
            ), 1..30)
        ) {
            let mut line = bench(Limits::default());
            for (octets, place, split) in telegrams {
                let place = if split { place.index(octets.len()) } else { 0 };
                let _denied_or_not = send(&mut line, &[&octets[..place], &octets[place..]]);
            }
            let drive = line.inner().drive(8).expect("a drive");
            prop_assert!(!drive.inverter().state().output_on());
            let setup = SlaveSetup::new(8).drive(BusRate::K500, Instant::START);
            for parameter in harness_proto::nordac::PARAMETERS.iter() {
                let read = |drive: &harness_sim::nordac::Drive| drive.inverter().parameter(parameter, Default::default());
                if ![967, 968].contains(&parameter.number) {
                    prop_assert_eq!(read(drive), read(setup.drive()), "{}", parameter.number);
                }
            }
        }
    }
}
