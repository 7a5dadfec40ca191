//! What a session exchanges from a request on, as a capture in pcapng.

use crate::capture::{LiveRecorder, Piece, Tape};
use crate::command::exit::Exit;
use crate::command::failure::Failure;
use crate::command::held::HeldBench;
use crate::regular::is_wrong_path;
use harness_proto::line::Rate;
use harness_proto::time::{Instant, Span};
use harness_sim::record::Trace;
use serde_json::{Value, json};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// How many bytes or frames of simulated drives a capture holds of one request at most: about as many as the record of a port.
const MOST: u64 = 4_000_000;

/// How many packets are written at a time.
const AT_ONCE: usize = 1_000;

/// A capture that is under way. Its file grows with it.
pub(super) struct SessionCapture {
    path: PathBuf,
    file: File,
    recorder: LiveRecorder<File>,
    /// How many packets the file holds.
    packets: u64,
    /// Why nothing more is written.
    broken: Option<String>,
    /// The link's time up to which its record was taken, and how much it had carried then.
    taken: (Instant, u64),
    /// How long the capture lasts until then.
    lasted: Span,
    /// When it began, since 1970; the time of simulated drives counts from 0.
    began: Span,
    /// How many bytes, telegrams or frames a full record of the link has not kept; `None` in virtual time, where a request ends before.
    lost: Option<u64>,
}

impl SessionCapture {
    /// Begins a capture.
    ///
    /// # Errors
    /// The file is there already, its folder is not, or it cannot be written.
    pub(super) fn begin(
        path: &str,
        bench: &mut dyn HeldBench,
        simulated: bool,
    ) -> Result<Self, Failure> {
        let path = PathBuf::from(path);
        refuse_existing(&path)?;
        let folder = path.parent();
        let folder = folder.filter(|folder| !folder.as_os_str().is_empty());
        if folder.is_some_and(|folder| !folder.is_dir()) || path.file_name().is_none() {
            return Err(Failure::refused(format!(
                "{}: a file in a folder that is there is expected",
                path.display()
            )));
        }
        bench.record_from_now(Some(MOST));
        let record = bench.record()?;
        let places = Tape::of_ports(&record.traces, record.medium, record.now).places;
        let opened = File::create_new(&path).and_then(|file| {
            let recorder = LiveRecorder::start(file.try_clone()?, &places)?;
            Ok((file, recorder))
        });
        let (file, recorder) = opened.map_err(|error| unwritten(&path, &error))?;
        let wall = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
        let wall = u64::try_from(wall.unwrap_or_default().as_nanos()).unwrap_or_default();
        let mut capture = Self {
            path,
            file,
            recorder,
            packets: 0,
            broken: None,
            taken: (record.now, record.carried),
            lasted: Span::ZERO,
            began: match simulated {
                true => Span::ZERO,
                false => Span::from_nanos(wall),
            },
            lost: (!simulated).then_some(0),
        };
        if !simulated {
            // A computer that stands still reads late and repeats requests, which no line would show.
            capture.note_loss(
                "the line's capture times are lost: these are of the bench, which sends and reads; a tap accuses drives",
            )?;
        }
        Ok(capture)
    }

    /// Writes what the bench has recorded since the last call. Afterwards its link may begin again.
    ///
    /// # Errors
    /// [`Failure`]: the bench has been given back, or the file cannot be written; it stays as it is then.
    pub(super) fn collect(&mut self, bench: &mut dyn HeldBench) -> Result<(), Failure> {
        let mut record = bench.record()?;
        bench.record_from_now(Some(MOST));
        let (from, carried) = self.taken;
        for trace in &mut record.traces {
            trace.count_from(from.since_start());
        }
        let lasts = record.now.since(from);
        let tape = match self.lost {
            Some(_) => Tape::of_ports(&record.traces, record.medium, Instant::START + lasts),
            None => {
                let bits = record.medium.bits_per_second();
                let rate = Rate::from_bits_per_second(bits).unwrap_or_default();
                Tape::of(&record.traces, rate)
            }
        };
        let mut missing = 0;
        if let Some(lost) = &mut self.lost {
            missing = record
                .carried
                .saturating_sub(carried + recorded(&record.traces));
            *lost += missing;
        }
        drop(record.traces);
        let behind = self.began + self.lasted;
        let new = tape.pieces.iter().filter(|piece| piece.0 > Instant::START);
        let written = self.write(new.map(|(_, place, piece)| (*place, piece.later(behind))));
        self.lasted = self.lasted + lasts;
        self.taken = (record.now, record.carried);
        written?;
        if missing > 0 {
            self.note_loss(&format!(
                "the record was full; bytes or frames lost: {missing}"
            ))?;
        }
        Ok(())
    }

    /// Whether the file takes nothing more.
    pub(super) const fn is_broken(&self) -> bool {
        self.broken.is_some()
    }

    /// Takes notice that the bench's link has perhaps restarted since [`collect`](Self::collect): its time is `now`.
    pub(super) fn goes_on(&mut self, now: Instant) {
        if now < self.taken.0 {
            self.taken = (Instant::START, 0);
        }
    }

    /// Leaves out what the bench has exchanged since [`collect`](Self::collect), and marks the place.
    ///
    /// # Errors
    /// As of [`collect`](Self::collect).
    pub(super) fn leave_out(
        &mut self,
        what: &str,
        bench: &mut dyn HeldBench,
    ) -> Result<(), Failure> {
        bench.record_from_now(Some(MOST));
        let record = bench.record()?;
        self.taken = (record.now, record.carried);
        self.note_loss(&format!("{what} is lost: a session captures no scenario"))
    }

    /// Marks that something is missing here. Words with `lost: ` keep `import` from blaming a drive.
    fn note_loss(&mut self, words: &str) -> Result<(), Failure> {
        let at = (self.began + self.lasted).as_nanos();
        self.write(std::iter::once((0, Piece::Event(at, words.to_owned()))))
    }

    /// Writes pieces. After the first failure nothing more is written: what stands in the file is whole.
    fn write(&mut self, pieces: impl Iterator<Item = (usize, Piece)>) -> Result<(), Failure> {
        if let Some(why) = &self.broken {
            return Err(Failure::Said(Exit::RigError, why.clone()));
        }
        let recorder = &mut self.recorder;
        let mut count = 0;
        let mut put = |(place, piece): (usize, Piece)| {
            recorder.piece(place, &piece)?;
            count += 1;
            match count % AT_ONCE {
                0 => recorder.flush(),
                _ => Ok(()),
            }
        };
        let mut pieces = pieces;
        let written = pieces.try_for_each(&mut put);
        let written = written.and_then(|()| recorder.flush());
        if let Err(error) = written {
            let _as_it_is = self.file.set_len(recorder.written());
            let failure = unwritten(&self.path, &error);
            self.broken = Some(format!("failed to write {}: {error}", self.path.display()));
            return Err(failure);
        }
        self.packets += count as u64;
        Ok(())
    }

    /// What the file holds.
    ///
    /// # Errors
    /// Something could not be written.
    pub(super) fn end(self) -> Result<Value, Failure> {
        match self.broken {
            Some(why) => Err(Failure::Said(Exit::RigError, why)),
            None => Ok(json!({
                "path": self.path, "packets": self.packets, "took_ms": self.lasted.as_millis_f64(), "lost": self.lost.unwrap_or_default(),
            })),
        }
    }
}

fn unwritten(path: &Path, error: &std::io::Error) -> Failure {
    let exit = match is_wrong_path(error) {
        true => Exit::Usage,
        false => Exit::RigError,
    };
    Failure::Said(exit, format!("failed to write {}: {error}", path.display()))
}

/// How many octets or frames these are.
fn recorded(traces: &[Trace]) -> u64 {
    let channels = traces.iter().flat_map(|trace| &trace.channels);
    let counts = channels.map(|channel| channel.octets().len() + channel.frames().len());
    counts.sum::<usize>() as u64
}

fn refuse_existing(path: &Path) -> Result<(), Failure> {
    match path.symlink_metadata() {
        Ok(_) => Err(Failure::refused(format!(
            "{} is there already: remove it, or choose another name",
            path.display()
        ))),
        Err(_) => Ok(()),
    }
}
