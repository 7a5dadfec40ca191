//! The live page of drives on CAN: frames as arrows between stations, time down.

use super::report::table::hex;
use super::report::{bits, meaning};
use super::serve::SharedDrives;
use crate::language::identifier;
use crate::rig::Axis;
use harness_bench::counted::counted;
use harness_bench::serve::ControlAnswer;
use harness_bench::serve::frames::SharedBus;
use harness_bench::web::{
    ARROWS, FaultPlace, LiveNews, LiveOrder, LivePicture, LiveRow, LiveScene, LiveView, MAX_ROWS,
};
use harness_proto::can::Frame;
use harness_proto::unitek::Register;
use harness_proto::unitek::words::{ERRORS, MODE, STATUS};
use harness_sim::record::{FrameEnd, LineFrame};
use harness_sim::segment::Host;

/// The faults of a frame: as the language of scenarios writes them, and in words.
const FAULTS: [(&str, &str); 6] = [
    (
        "lost",
        "lost: no station receives it, and its sender does not notice",
    ),
    (
        "doubled",
        "doubled: its sender sees an error in its last bit and repeats it",
    ),
    ("delay 3ms", "late: its sender holds it back for 3 ms"),
    ("corrupt", "corrupt: an error frame, and a repetition"),
    ("no-acknowledge", "not acknowledged, and repeated"),
    ("bus-off", "damaged, and its sender takes no part any more"),
];

/// Which frame a fault meets, from the next one on.
const PLACES: [&str; 2] = ["the next frame", "the frame after it"];

/// What the page sends to the first drive (UNITEK 5.2): in words, and the data bytes.
const SCRIPTS: [(&str, &[u8]); 5] = [
    ("read 30 SPEED_ACTUAL", &[0x3D, 0x30, 0x00]),
    ("read 40 STATUS", &[0x3D, 0x40, 0x00]),
    ("read 8F, warnings and errors", &[0x3D, 0x8F, 0x00]),
    ("send 30 SPEED_ACTUAL every 100 ms", &[0x3D, 0x30, 0x64]),
    ("stop sending it", &[0x3D, 0x30, 0xFF]),
];

const MODE_REGISTER: u8 = 0x51;
const STATUS_REGISTER: u8 = 0x40;
const ERROR_REGISTER: u8 = 0x8F;
const SPEED: u8 = 0x30;
const POSITION: u8 = 0x6D;

/// Frames of the page that may wait for the bus.
const ROOM: usize = 16;

/// The picture of frames: a column for all masters, and one a drive.
pub(super) fn picture(masters: &str, drives: impl Iterator<Item = String>) -> LivePicture {
    LivePicture {
        heading: "Frames",
        note: "A column is a station, a row is a frame, and time goes down.",
        columns: std::iter::once(masters.to_owned()).chain(drives).collect(),
        folded: ["frame", "frames"],
        legend: ARROWS.to_vec(),
    }
}

/// A frame that a bench with these drives has sent or received.
pub(super) fn at_port(frame: &LineFrame, drives: &[Axis]) -> LiveRow {
    let number = frame.frame.id().number();
    let place = |id: fn(&Axis) -> u16| {
        let found = drives.iter().position(|axis| u32::from(id(axis)) == number);
        found.map(|place| place + 1)
    };
    let ends = match place(|axis| axis.tx) {
        Some(from) => (from, Some(0)),
        None => (0, place(|axis| axis.rx)),
    };
    arrow(frame, drives.len() + 1, ends)
}

/// A frame from one column to another, or to all; drives have the columns after the first.
fn arrow(frame: &LineFrame, columns: usize, (from, to): (usize, Option<usize>)) -> LiveRow {
    let end = match frame.ended {
        FrameEnd::Good => String::new(),
        FrameEnd::Lost => "  [lost]".to_owned(),
        FrameEnd::Error(error) => format!("  [{error}]"),
    };
    let words = format!(
        "{}  {}  {}{end}",
        identifier(frame.frame.id()),
        hex(&frame.frame),
        meaning(&frame.frame, from > 0)
    );
    let good = frame.ended == FrameEnd::Good;
    LiveRow::arrow(columns, (from, to), good, frame.at.to_string(), words)
}

impl SharedDrives {
    /// The column of a drive, counted after that of all clients.
    fn column(&self, node: u8) -> Option<usize> {
        let place = self.bench.nodes.iter().position(|other| *other == node)?;
        Some(place + 1)
    }

    /// The drive that receives frames with this identifier.
    fn receiver(&self, frame: &Frame) -> Option<usize> {
        let nodes = self.bench.nodes.iter();
        let mut drives = nodes.filter_map(|node| Some((*node, self.bench.drive(*node)?)));
        let number = frame.id().number();
        let (node, _) = drives.find(|(_, drive)| u32::from(drive.identifiers().0) == number)?;
        self.column(node)
    }

    fn row(&self, frame: &LineFrame) -> LiveRow {
        let drives = self.bench.nodes.len();
        let place = usize::from(frame.from.unwrap_or(0));
        let of_drive = (1..=drives).contains(&place);
        let from = if of_drive { place } else { 0 };
        let to = match of_drive {
            true => Some(0),
            false => self.receiver(&frame.frame),
        };
        arrow(frame, drives + 1, (from, to))
    }

    fn station(&self, node: u8) -> Vec<String> {
        let Some(drive) = self.bench.drive(node) else {
            return Vec::new();
        };
        let or_none = |bits: String| {
            if bits.is_empty() {
                "-".to_owned()
            } else {
                bits
            }
        };
        let register = |number| drive.register(number);
        let power = if drive.is_powered() { "on" } else { "off" };
        let ready = if drive.is_ready() {
            "ready"
        } else {
            "not ready"
        };
        let run = if drive.is_enabled() {
            "enabled"
        } else {
            "blocked"
        };
        let signed = |number: u8| i64::from(register(number).cast_signed());
        let short = |number: u8| {
            let low = u16::try_from(register(number) & 0xFFFF).unwrap_or(0);
            Register::of(number).extend(low).cast_signed()
        };
        vec![
            node.to_string(),
            power.to_owned(),
            ready.to_owned(),
            run.to_owned(),
            or_none(bits(MODE, register(MODE_REGISTER))),
            or_none(bits(STATUS, register(STATUS_REGISTER))),
            or_none(bits(ERRORS, register(ERROR_REGISTER))),
            short(SPEED).to_string(),
            signed(POSITION).to_string(),
        ]
    }

    /// Lets the bench's own host send a frame to the first drive.
    fn play(&mut self, data: &[u8]) -> Result<String, String> {
        let node = self.bench.nodes.first().copied();
        let drive = node.and_then(|node| self.bench.drive(node));
        let id = drive.ok_or("there is no drive")?.identifiers().0;
        let frame = Frame::base(id, data).map_err(|error| error.to_string())?;
        let now = self.bench.clock.now;
        let host = self.bench.host().ok_or("the bench has no host")?;
        if host.waiting() >= ROOM {
            return Err(
                "frames of the page still wait for the bus; try again in a moment".to_owned(),
            );
        }
        if host.waiting() == 0 {
            // A listener would not send, and would not acknowledge what a lone drive sends.
            *host = Host::default();
        }
        host.send(now, frame);
        Ok(frame.to_string())
    }
}

impl LiveView for SharedDrives {
    fn scene(&self) -> LiveScene {
        let drives = self.bench.nodes.iter().map(|node| format!("drive {node}"));
        let place = |name: &str| FaultPlace {
            name: name.to_owned(),
            column: None,
        };
        let first = self.bench.nodes.first().copied().unwrap_or(1);
        LiveScene {
            title: format!("UNITEK on CAN, {}", self.about()),
            stations: vec![
                "drive",
                "supply",
                "ready",
                "output stage",
                "MODE",
                "STATUS",
                "errors",
                "SPEED_ACTUAL",
                "POS_ACTUAL",
            ],
            traffic: vec!["bus", "frames"],
            picture: Some(picture("clients", drives)),
            places: PLACES.map(place).to_vec(),
            faults: FAULTS.map(|(_, words)| words).to_vec(),
            scripts: SCRIPTS
                .iter()
                .map(|(words, _)| format!("drive {first}: {words}"))
                .collect(),
            read_only: None,
        }
    }

    fn watch(&mut self, on: bool) {
        match on {
            true => self.bench.segment.record_anew(),
            false => {
                self.bench.segment.keep_no_record();
                // Back to the bench's host that takes no part.
                if let Some(host) = self.bench.host()
                    && host.waiting() == 0
                {
                    *host = Host::listener();
                }
            }
        }
    }

    fn news(&mut self) -> LiveNews {
        let frames = self.bench.segment.take_record();
        let hidden = frames.len().saturating_sub(MAX_ROWS);
        let rows = frames.iter().skip(hidden).map(|frame| self.row(frame));
        let rows = rows.collect();
        LiveNews {
            at: self.bench.clock.now.to_string(),
            stations: self
                .bench
                .nodes
                .iter()
                .map(|node| self.station(*node))
                .collect(),
            traffic: vec![vec!["CAN".to_owned(), self.bench.frames().to_string()]],
            left_out: hidden as u64,
            rows,
            ..LiveNews::default()
        }
    }

    fn order(&mut self, order: LiveOrder) -> Result<String, String> {
        match order {
            LiveOrder::Fault { place, fault } => {
                PLACES.get(place).ok_or("there is no such frame")?;
                let (fault, _) = FAULTS.get(fault).ok_or("there is no such fault")?;
                let number = self.bench.frames() + 1 + place as u64;
                let line = format!("! frame {number}: {fault}");
                match self.control(&line) {
                    Some(ControlAnswer::Ok) => Ok(format!(
                        "{line}. {} so far on the bus.",
                        counted(number - 1 - place as u64, "frame")
                    )),
                    answer => {
                        let said = answer.map(|answer| answer.to_string());
                        Err(format!("{line}: {}", said.unwrap_or_default()))
                    }
                }
            }
            LiveOrder::Play { script } => {
                let (_, data) = SCRIPTS.get(script).ok_or("there is no such frame")?;
                let sent = self.play(data)?;
                Ok(format!("{sent} sent."))
            }
        }
    }
}
