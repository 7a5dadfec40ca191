//! What the engine of fuzz runs knows of this bus.

use super::act::{FrameAct, FrameActKind, FrameTalk};
use super::generate::{self, FrameSpice};
use super::idiom::idiom;
use super::oracle::{self, FrameDifference};
use super::play::{FramesSeen, play};
use super::text::steps;
use crate::judge::FrameSymptom;
use crate::language::Unitek;
use crate::manual::MANUAL;
use crate::report::FrameReport;
use crate::rig::axes;
use crate::serve;
use crate::simulate::Setup;
use harness_bench::bus_name::BusName;
use harness_bench::explore::line::{ActBounds, LineBus};
use harness_bench::explore::pool::hash;
use harness_bench::explore::{Dice, Differing};
use harness_bench::manual::Manual;
use harness_bench::rig::Rig;
use harness_bench::scenario::problem::Problems;
use harness_bench::scenario::source::Source;
use harness_bench::shown::SegmentReport;
use harness_proto::can::Frame;
use harness_proto::time::Instant;
use harness_proto::unitek::Register;
use harness_proto::unitek::properties::Properties;
use harness_sim::record::LineFrame;
use harness_sim::unitek::deviation::DEVIATIONS;

impl Differing for FrameDifference {
    fn is_like(&self, other: &Self) -> bool {
        (self.what, self.register) == (other.what, other.register)
    }
    fn key(&self) -> String {
        self.signature()
    }
    fn signature(&self) -> String {
        let register = Register::of(self.register);
        let drive = self
            .drive
            .map_or(String::new(), |drive| format!("drive {drive}: "));
        format!(
            "{drive}{} (UNITEK {}, register {:02X} {})",
            self.what.words(),
            self.section,
            self.register,
            register.name
        )
    }
    fn about(&self) -> &str {
        &self.about
    }
    fn place(&self) -> Option<usize> {
        Some(self.frame)
    }
    fn is_time(&self) -> bool {
        // Virtual time is the same in every attempt.
        false
    }
}

impl LineBus for Unitek {
    const BUS: BusName = BusName::Unitek;
    const MANUAL: Manual = MANUAL;
    const REPORT: &'static dyn SegmentReport = &FrameReport;
    const USUAL_SECTION: &'static str = "5.2";
    const DRIVES: &'static str = "UNITEK drives";
    const DRIVE: &'static str = "drive";
    const BOUNDS: ActBounds = ActBounds {
        times: 1,
        wait_us: generate::LONGEST_WAIT,
        total_us: 20_000_000,
    };
    const NEEDED: &'static [FrameSpice] = &[FrameSpice::Read, FrameSpice::Cycles];

    type Words = Self;
    type What = FrameActKind;
    type Spice = FrameSpice;
    /// Its number, and the identifier on which it receives.
    type Station = (u8, u16);
    type Setup = Setup;
    type Properties = Properties;
    type Said = LineFrame;
    /// The time at which an act began.
    type Done = Instant;
    type Difference = FrameDifference;

    fn fits(what: &FrameActKind) -> bool {
        match what {
            FrameActKind::Input { .. } | FrameActKind::Force { .. } => what.name().is_some(),
            FrameActKind::Send(_) | FrameActKind::Restart { .. } => true,
        }
    }

    fn sends(what: &FrameActKind) -> bool {
        matches!(what, FrameActKind::Send(_))
    }

    fn weight(what: &FrameActKind) -> u64 {
        match what {
            FrameActKind::Send(frame) => {
                let data = frame.data().iter().map(|byte| u64::from(*byte));
                1_000 * frame.dlc() as u64 + data.sum::<u64>()
            }
            _ => 1,
        }
    }

    /// Shorter frames, and lower bytes after the register.
    fn simpler(what: &FrameActKind) -> Vec<FrameActKind> {
        let FrameActKind::Send(frame) = what else {
            return Vec::new();
        };
        if frame.is_remote() {
            return Vec::new();
        }
        let data = frame.data();
        let mut all: Vec<_> = (0..data.len())
            .map(|length| data[..length].to_vec())
            .collect();
        for (index, value) in data.iter().enumerate().skip(1) {
            let lower = [0, 1, value & 0x0F, value / 2].into_iter();
            for byte in lower.filter(|byte| byte < value) {
                let mut other = data.to_vec();
                other[index] = byte;
                all.push(other);
            }
        }
        let frames = all
            .iter()
            .filter_map(|data| Frame::new(frame.id(), data).ok());
        frames.map(FrameActKind::Send).collect()
    }

    fn begin(_: (u8, u16), dice: &mut Dice) -> (Vec<FrameAct>, usize) {
        (Vec::new(), 2 + dice.below(18))
    }

    fn idiom(spice: FrameSpice, (_, rx): (u8, u16), dice: &mut Dice) -> Vec<FrameAct> {
        idiom(spice, rx, dice)
    }

    fn part(spice: FrameSpice, station: (u8, u16), dice: &mut Dice) -> Vec<FrameAct> {
        generate::part(spice, station, dice)
    }

    fn close(
        acts: &[FrameAct],
        (station, stations): ((u8, u16), &[(u8, u16)]),
        dice: &mut Dice,
    ) -> Vec<FrameAct> {
        generate::close(acts, station, stations, dice)
    }

    fn wait(dice: &mut Dice) -> u64 {
        generate::wait(dice)
    }

    fn change(what: &mut FrameActKind, dice: &mut Dice) {
        generate::change(what, dice);
    }

    fn header(rig: &Rig, _: &[(u8, u16)]) -> Vec<String> {
        let port = rig.port();
        let rate = port.map(|port| format!("rate {}", port.rate));
        let drives = port.map(axes).unwrap_or_default().into_iter();
        let drives =
            drives.map(|axis| format!("drive {} rx {:03X} tx {:03X}", axis.node, axis.rx, axis.tx));
        rate.into_iter().chain(drives).collect()
    }

    fn simulated(header: &Source) -> Result<Setup, Problems> {
        Ok(serve::bench(Some(0), Some(header))?.setup)
    }

    fn plant(setup: &mut Setup, drive: u8, name: &str) -> Option<bool> {
        let known = DEVIATIONS.named(name)?;
        let mut drives = setup.drives.iter_mut();
        let wrong = drives.find(|wrong| wrong.node == drive);
        Some(wrong.map(|wrong| wrong.deviation = Some(known)).is_some())
    }

    fn model(setup: &Setup, properties: &[Properties]) -> Setup {
        let mut model = setup.clone();
        for (drive, values) in model.drives.iter_mut().zip(properties) {
            drive.deviation = None;
            drive.properties = *values;
        }
        model
    }

    fn play(setup: &Setup, talk: &FrameTalk) -> FramesSeen {
        play(setup, talk)
    }

    fn features(talk: &FrameTalk, seen: &FramesSeen) -> Vec<u32> {
        features(talk, seen)
    }

    fn begins(setup: &Setup) -> Vec<Vec<Properties>> {
        oracle::begins(setup)
    }

    fn neighbours(_: &Setup, _: usize, properties: &Properties) -> Vec<Properties> {
        oracle::neighbours(properties).collect()
    }

    fn lines(setup: &Setup, values: &[Properties]) -> Vec<String> {
        oracle::lines(setup, values)
    }

    fn same(expected: &LineFrame, seen: &LineFrame) -> bool {
        oracle::same_frame(&expected.frame, &seen.frame) && expected.start == seen.start
    }

    fn unlike(expected: &LineFrame, seen: &LineFrame) -> i64 {
        oracle::unlike(expected, seen)
    }

    fn difference(
        setup: &Setup,
        place: usize,
        plays: (&FramesSeen, &FramesSeen),
        under: Vec<String>,
    ) -> Option<FrameDifference> {
        oracle::difference(setup, place, plays, under)
    }

    fn basis(found: &FrameDifference) -> (&str, &[String], bool) {
        let time = found.what == FrameSymptom::Time;
        (&found.section, &found.under, time)
    }

    fn steps(
        _: &Setup,
        talk: &FrameTalk,
        seen: &FramesSeen,
        timed: Option<usize>,
        text: &mut String,
    ) {
        steps(talk, seen, timed, text);
    }
}

/// What a case shows: which request followed which, what a frame was written to, and how the drives answered.
fn features(case: &FrameTalk, seen: &FramesSeen) -> Vec<u32> {
    let mut found = Vec::new();
    let mut before = 0;
    for act in &case.acts {
        let request = kind(&act.what);
        found.push(hash(&[1, before, request]));
        if let FrameActKind::Send(frame) = &act.what {
            let register = frame.data().first().copied().unwrap_or(0);
            found.push(hash(&[2, request, register.into()]));
        }
        before = request;
    }
    for frame in &seen.said {
        let data = frame.frame.data();
        let register = data.first().copied().unwrap_or(0);
        let shown = match register {
            0x40 | 0x51 | 0x8F => data[1..]
                .iter()
                .fold(0, |sum, byte| sum << 8 | u32::from(*byte)),
            _ => 0,
        };
        found.push(hash(&[3, register.into(), frame.frame.dlc() as u32, shown]));
    }
    found.push(hash(&[
        4,
        seen.said.len().min(64).next_power_of_two() as u32,
    ]));
    found
}

/// A number for what an act is.
fn kind(what: &FrameActKind) -> u32 {
    match what {
        FrameActKind::Send(frame) => {
            let length = frame.dlc() as u32;
            let head = 2 * u32::from(frame.is_remote()) + u32::from(frame.id().is_extended());
            let read = match frame.data() {
                [0x3D, _, 0, ..] => 1,
                [0x3D, _, 0xFF, ..] => 2,
                [0x3D, ..] => 3,
                [0x51, low, ..] => 4 + u32::from(*low),
                _ => 0,
            };
            hash(&[length, head, read])
        }
        FrameActKind::Input { on, .. } => 10 + u32::from(*on),
        FrameActKind::Force { .. } => 12,
        FrameActKind::Restart { .. } => 13,
    }
}
