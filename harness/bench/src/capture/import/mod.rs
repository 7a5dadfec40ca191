//! Files of other programs: one table of the formats that are read (`FORMATS`).
//!
//! Each format says by the first bytes whether a file is of it, and reads it: into a capture, where the file says which links it
//! is of, or into channels, of which the user says which links they are ([`NamedLink`]). Levels of a line are decoded by a receiver of
//! octets ([`UartFormat`]), whose format is given or found.

pub mod asc;
pub mod csv;
pub mod cut;
pub mod dsview;
pub mod forms;
pub mod levels;
pub mod links;
pub mod logs;
pub mod numbers;
pub mod saleae;
pub mod sigrok;
pub mod table;
pub mod uart;
pub mod vcd;

pub(super) use links::unread_octets;
pub use links::{ChannelTarget, NamedLink};
pub(super) use logs::candump_time;
pub use uart::UartFormat;

use super::{Capture, CaptureError, frames, json, pcap, pcapng, telegrams};
use crate::scenario::verdict::Verdict;
use cut::{Parts, whole_part};
use harness_proto::line::Rate;
use links::ChannelRead;

/// What is known of a file besides its bytes.
#[derive(Clone, Debug, Default)]
pub struct ReadSettings {
    /// The rate of a ring's line, where the file does not say it.
    pub rate: Option<Rate>,
    /// The format of lines of which the file has the levels; found where it is not given.
    pub uart: Option<UartFormat>,
    /// Samples a second, where the file has neither them nor times.
    pub samples: Option<u64>,
    /// Which channel is which link.
    pub links: Vec<NamedLink>,
}

/// A capture, and what is to be told about it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ImportedCapture {
    pub capture: Capture,
    /// What was found and what was not read, in sentences.
    pub notes: Vec<String>,
    /// Whether the program that wrote it has noted that something is missing.
    pub lost: bool,
    /// What was heard and not read, where a drive may have sent it: nothing passes then.
    pub unread: Option<String>,
}

impl ImportedCapture {
    /// A verdict on a capture of which a part may be missing, and why it is another one than `verdict`: what differs does not accuse a drive,
    /// and where a drive may have sent what was not read, nothing passes. Damage that is more than a cable does is no evidence at all.
    pub fn settle(&self, verdict: Verdict) -> (Verdict, Option<String>) {
        let damaged = self.capture.mostly_damaged();
        let why = match verdict {
            Verdict::Failed | Verdict::Passed if damaged.is_some() => damaged,
            Verdict::Failed if self.lost => {
                Some("parts of it are lost, so what differs is no failure of a drive".to_owned())
            }
            Verdict::Passed => self.unread.clone(),
            _ => None,
        };
        match why {
            Some(why) => (Verdict::Inconclusive, Some(why)),
            None => (verdict, None),
        }
    }
}

impl From<Capture> for ImportedCapture {
    fn from(capture: Capture) -> Self {
        Self {
            capture,
            notes: Vec::new(),
            lost: false,
            unread: None,
        }
    }
}

/// Channels, and what is to be told about them.
type Channels = (Vec<ChannelRead>, Vec<String>);

/// How the files of a format are read.
#[derive(Clone, Copy)]
enum Reader {
    /// The file says which links it is of.
    Whole(fn(&[u8], &ReadSettings) -> Result<ImportedCapture, CaptureError>),
    /// The file has channels.
    Channels(fn(&[u8], &ReadSettings) -> Result<Channels, CaptureError>),
}

#[derive(Clone, Copy)]
struct Format {
    name: &'static str,
    recognised: fn(&[u8]) -> bool,
    reader: Reader,
    /// What shows where a file that was cut stops being whole.
    parts: Parts,
}

impl Format {
    /// The same, of files that consist of these parts.
    const fn of(self, parts: Parts) -> Self {
        Self { parts, ..self }
    }
}

const fn whole(
    name: &'static str,
    recognised: fn(&[u8]) -> bool,
    reader: fn(&[u8], &ReadSettings) -> Result<ImportedCapture, CaptureError>,
) -> Format {
    let reader = Reader::Whole(reader);
    Format {
        name,
        recognised,
        reader,
        parts: Parts::Blocks,
    }
}

const fn channels(
    name: &'static str,
    recognised: fn(&[u8]) -> bool,
    reader: fn(&[u8], &ReadSettings) -> Result<Channels, CaptureError>,
) -> Format {
    let reader = Reader::Channels(reader);
    Format {
        name,
        recognised,
        reader,
        parts: Parts::Blocks,
    }
}

/// The first byte that is no white space.
fn first(bytes: &[u8]) -> Option<u8> {
    bytes
        .iter()
        .copied()
        .find(|byte| !byte.is_ascii_whitespace())
}

/// The log of candump, with `-L` or on the screen.
const CANDUMP: &str = "log of candump";

/// A log of frames as text: its name, what recognises it, and what reads a line of it.
macro_rules! log {
    ($name:expr, $recognised:expr, $line:expr) => {
        whole($name, $recognised, |bytes, settings| {
            frames::of_log(logs::read(bytes, $line)?, &settings.links)
        })
        .of(Parts::Lines)
    };
}

/// The formats; a file is of the first one that recognises it.
const FORMATS: &[Format] = &[
    whole(
        "pcapng (Wireshark)",
        |bytes| bytes.starts_with(&[0x0A, 0x0D, 0x0D, 0x0A]),
        |bytes, settings| pcapng::read(bytes, settings.rate, &settings.links),
    ),
    whole(
        "pcap (tcpdump, Wireshark)",
        pcap::recognised,
        |bytes, settings| pcap::read(bytes, settings.rate, &settings.links),
    ),
    whole(
        "frames in JSON",
        |bytes| first(bytes) == Some(b'{') && frames::is_json(bytes),
        |bytes, _| frames::json(bytes),
    )
    .of(Parts::Objects),
    whole(
        "telegrams in JSON",
        |bytes| first(bytes) == Some(b'{') && telegrams::is_json(bytes),
        |bytes, _| Ok(telegrams::json(bytes)?.into()),
    )
    .of(Parts::Objects),
    whole(
        "trace in JSON",
        |bytes| first(bytes) == Some(b'{'),
        |bytes, settings| Ok(json::read(bytes, settings.rate)?.into()),
    ),
    whole("bytes in csv", csv::is_bytes, |bytes, settings| {
        Ok(csv::bytes(bytes, settings.rate)?.into())
    })
    .of(Parts::Lines),
    whole("frames in csv", csv::is_frames, |bytes, _| {
        csv::frames(bytes)
    })
    .of(Parts::Lines),
    whole("telegrams in csv", csv::is_telegrams, csv::telegrams).of(Parts::Lines),
    whole("ASC (Vector)", asc::recognised, |bytes, settings| {
        frames::of_log(asc::read(bytes)?, &settings.links)
    })
    .of(Parts::Lines),
    log!("TRC (PEAK)", forms::is_trc, forms::trc),
    log!(
        "csv of frames (GVRET, SavvyCAN)",
        forms::is_gvret,
        forms::gvret
    ),
    log!("log of BUSMASTER", forms::is_busmaster, forms::busmaster),
    log!(
        "text of frames (python-can)",
        forms::is_printed,
        forms::printed
    ),
    log!("text of frames (Kvaser)", forms::is_kvaser, forms::kvaser),
    log!("trace of CANHacker", forms::is_canhacker, forms::canhacker),
    channels("VCD", vcd::recognised, |bytes, _| vcd::read(bytes)).of(Parts::Words),
    channels(
        "binary levels (Saleae Logic)",
        |bytes| bytes.starts_with(saleae::BINARY),
        |bytes, _| saleae::binary(bytes),
    ),
    channels(
        "csv (DSView)",
        |bytes| bytes.starts_with(dsview::LEVELS),
        |bytes, _| dsview::levels(bytes),
    )
    .of(Parts::Lines),
    channels(
        "table of octets (DSView)",
        dsview::is_decoded,
        |bytes, _| dsview::decoded(bytes),
    )
    .of(Parts::Lines),
    channels("csv (sigrok)", sigrok::recognised, |bytes, settings| {
        sigrok::read(bytes, settings.samples)
    })
    .of(Parts::Lines),
    channels(
        "table of octets (Saleae Logic)",
        saleae::is_data_table,
        |bytes, _| saleae::data_table(bytes),
    )
    .of(Parts::Lines),
    channels(
        "text of octets (Saleae Logic)",
        saleae::is_analyser,
        |bytes, _| saleae::analyser(bytes),
    )
    .of(Parts::Lines),
    channels(
        "csv of levels (Saleae Logic)",
        saleae::is_levels,
        |bytes, _| saleae::levels(bytes),
    )
    .of(Parts::Lines),
    log!("CRTD (OVMS)", forms::is_crtd, forms::crtd),
    log!(CANDUMP, logs::is_candump, logs::candump),
];

/// The formats of which parts follow each other in one text: sections of pcapng, lines of a log.
const JOINED: [&str; 2] = ["pcapng (Wireshark)", CANDUMP];

/// Formats that are not read, by their first bytes, with what to do instead. Each command has been tried.
const FOREIGN: &[(&[u8], &str)] = &[
    (
        b"PK\x03\x04",
        "a zip archive, as .sal and .sr files are; export the levels from Logic as csv or binary, or write a VCD with `sigrok-cli -i \
         FILE.sr -O vcd | grep -v ' V DC$' > FILE.vcd` (grep takes out what sigrok 0.7 writes for analogue channels)",
    ),
    (
        b"\x1F\x8B",
        "compressed with gzip; decompress it with `gunzip FILE.gz`",
    ),
    (
        b"\x28\xB5\x2F\xFD",
        "compressed with zstd; decompress it with `unzstd FILE.zst`",
    ),
    (
        b"BZh",
        "compressed with bzip2; decompress it with `bunzip2 FILE.bz2`",
    ),
    (
        b"LOGG",
        "a BLF log by Vector; convert it with python-can: `can_logconvert FILE.blf FILE.log`",
    ),
    (
        b"MDF     ",
        "an MDF log; convert it with python-can and asammdf (`pip install 'python-can[mf4]'`): `can_logconvert FILE.mf4 FILE.log`",
    ),
    (
        b"timestamp,arbitration_id,",
        "a csv by python-can; convert it with python-can: `can_logconvert FILE.csv FILE.log`",
    ),
    (
        b"# Logger type:",
        "a log by a CLX000; its lines become those of candump without times with `awk -F';' '$2 ~ /^[0-9]+$/ { i = \"00000000\" $3; \
         print \"can0 \" substr(i, length(i) - ($2 % 2 ? 7 : 2)) \"#\" $NF }' FILE.txt > FILE.log`",
    ),
    (b"\xFF\xFE", "text in UTF-16; save it as UTF-8"),
    (b"\xFE\xFF", "text in UTF-16; save it as UTF-8"),
    (
        b"snoop\0\0\0",
        "a snoop file; save it as pcapng in Wireshark",
    ),
    (b"\x89PNG", "a picture; a capture is expected"),
    (
        b"SQLite format 3",
        "a database; one by python-can (.db) is converted by `can_logconvert FILE.db FILE.log`, another one is exported from its program",
    ),
];

/// Without the byte order mark that some programs write before UTF-8.
fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes)
}

/// The format of a file. A compressed one may hold its lines as they are, so that it looks like a log.
fn format(bytes: &[u8]) -> Option<&'static Format> {
    let foreign = FOREIGN.iter().any(|(magic, _)| bytes.starts_with(magic));
    let mut formats = FORMATS.iter().filter(|_| !foreign);
    formats.find(|format| (format.recognised)(bytes))
}

/// Whether a file that begins so is to be read as a capture: it is of a format, or it is no text of a scenario either.
pub(super) fn is_capture(start: &[u8]) -> bool {
    /// Words that begin a line of a scenario's header or a step.
    const SCENARIO: [&str; 12] = [
        "title", "source", "bus", "needs", "strict", "deadline", "ring", "drive", "slave", ">",
        "<", "!",
    ];
    let word = |line: &str| {
        let word = line.split_whitespace().next();
        word.is_some_and(|word| SCENARIO.contains(&word) || word.starts_with('@'))
    };
    let start = without_mark(start);
    format(start).is_some() || !String::from_utf8_lossy(start).lines().any(word)
}

/// Reads the bytes of a file.
///
/// # Errors
/// [`CaptureError`].
pub(super) fn read(bytes: &[u8], settings: &ReadSettings) -> Result<ImportedCapture, CaptureError> {
    let bytes = without_mark(bytes);
    let Some(format) = format(bytes) else {
        return Err(foreign(bytes));
    };
    let (bytes, mut notes) = whole_part(bytes, format.parts)?;
    let imported = match format.reader {
        Reader::Whole(read) => read(&bytes, settings)?,
        Reader::Channels(read) => {
            let (channels, notes) = read(&bytes, settings)?;
            links::settle(channels, settings, notes)?
        }
    };
    notes.extend(imported.notes);
    Ok(ImportedCapture { notes, ..imported })
}

/// Reads the files of one capture, each with its name. Files of a format whose parts follow each other are one text; of files with channels, each
/// gives its own, which may be called by the name of the file.
///
/// # Errors
/// [`CaptureError`]; the files are of several formats, or of one whose parts cannot be joined.
pub(super) fn read_files(
    mut files: Vec<(String, Vec<u8>)>,
    settings: &ReadSettings,
) -> Result<ImportedCapture, CaptureError> {
    if let [(_, bytes)] = files.as_slice() {
        return read(bytes, settings);
    }
    let wrong = |what: String| CaptureError::Link {
        place: "the files".to_owned(),
        what,
    };
    let kinds = files.iter().map(|(name, bytes)| {
        let kind = format(without_mark(bytes));
        kind.ok_or_else(|| wrong(format!("{name} is no capture that can be read")))
    });
    let kinds: Vec<&Format> = kinds.collect::<Result<_, _>>()?;
    let Some(first) = kinds.first() else {
        return Err(wrong("none is given".to_owned()));
    };
    let same = |at: usize| files[..at].iter().any(|(_, bytes)| *bytes == files[at].1);
    let twice = (1..files.len()).find(|at| same(*at));
    let twice = twice.map(|at| format!("{} is given twice", files[at].0));
    let mut notes = Vec::new();
    for ((name, bytes), kind) in files.iter_mut().zip(&kinds) {
        let (whole, cut) = whole_part(without_mark(bytes), kind.parts)?;
        notes.extend(cut.into_iter().map(|note| format!("{name}: {note}")));
        *bytes = whole.into_owned();
    }
    match first.reader {
        Reader::Channels(_) => {
            let mut channels = Vec::new();
            for ((name, bytes), kind) in files.iter().zip(&kinds) {
                let Reader::Channels(read) = kind.reader else {
                    return Err(wrong(format!(
                        "{name} is of another kind than the first one"
                    )));
                };
                let (mut found, said) = read(bytes, settings)?;
                if let [only] = &mut found[..] {
                    only.names.insert(0, name.clone());
                }
                channels.extend(found);
                notes.extend(said);
            }
            links::settle(channels, settings, notes)
        }
        Reader::Whole(read) if JOINED.contains(&first.name) => {
            if let Some(other) = kinds.iter().find(|kind| kind.name != first.name) {
                return Err(wrong(format!(
                    "one is a {} and another a {}; files of one format expected",
                    first.name, other.name
                )));
            }
            if let Some(twice) = twice {
                return Err(wrong(twice));
            }
            let mut all: Vec<_> = files.iter().map(|(_, bytes)| &bytes[..]).collect();
            if first.parts == Parts::Lines {
                frames::in_order_of_time(&mut all);
            }
            let imported = read(&all.concat(), settings)?;
            notes.extend(imported.notes);
            Ok(ImportedCapture { notes, ..imported })
        }
        Reader::Whole(_) => Err(wrong(format!(
            "several files of {} cannot be joined; one expected",
            first.name
        ))),
    }
}

/// The error for a file that is not read: what it looks like.
fn foreign(bytes: &[u8]) -> CaptureError {
    let known = FOREIGN.iter().find(|(magic, _)| bytes.starts_with(magic));
    let line = table::first_line(bytes).trim();
    let text = !line.is_empty() && !line.chars().any(char::is_control);
    let looks = match known {
        Some((_, looks)) => (*looks).to_owned(),
        None if bytes.is_empty() => "nothing: it is empty".to_owned(),
        None if text => {
            let shown: String = line.chars().take(60).collect();
            format!("text that begins with {shown:?}")
        }
        None => {
            let begins = bytes.iter().take(8).map(|byte| format!("{byte:02X}"));
            let begins: Vec<_> = begins.collect();
            format!("unknown: it begins with the bytes {}", begins.join(" "))
        }
    };
    let names: Vec<_> = FORMATS.iter().map(|format| format.name).collect();
    CaptureError::Foreign {
        looks,
        formats: names.join(", "),
    }
}

#[cfg(test)]
mod hostile_tests;
#[cfg(test)]
mod log_tests;
#[cfg(test)]
mod tests;
