//! What a session exchanges from a request on, as a capture in pcapng.

use super::HeldBench;
use crate::capture::{LiveRecorder, Piece, RecordedPlace, Tape};
use crate::cli::exit::Exit;
use crate::cli::failure::Failure;
use crate::guard::Guarded;
use crate::link::{Line, Link};
use crate::medium::Medium;
use crate::regular;
use crate::rig::Ends;
use harness_proto::line::Rate;
use harness_proto::time::{Instant, Span};
use harness_sim::record::Trace;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// What a held bench has recorded of its bus.
pub(crate) struct HeldRecord {
    /// Everything since its link began, or since it was told to forget.
    pub(crate) traces: Vec<Trace>,
    /// What its ports carry.
    pub(crate) medium: Medium,
    /// How many pieces its link has carried since it began.
    pub(crate) carried: u64,
    /// The link's time.
    pub(crate) now: Instant,
}

impl HeldRecord {
    /// What the `ports` of a link have recorded.
    pub(crate) fn of(link: &Guarded<Ends>, ports: usize) -> Self {
        Self {
            traces: (0..ports).map(|port| link.trace(port)).collect(),
            medium: link.medium(0),
            carried: link.carried(),
            now: link.now(),
        }
    }
}

/// A capture that is under way.
pub(super) struct SessionCapture {
    path: PathBuf,
    places: Vec<RecordedPlace>,
    /// What was taken from the bench so far, each piece with the number of its place.
    pieces: Vec<(usize, Piece)>,
    /// The link's time up to which its record was taken, and how much it had carried then.
    taken: (Instant, u64),
    /// How long the capture lasts until then.
    lasted: Span,
    /// When it began, since 1970; the time of simulated drives counts from 0.
    began: Span,
    /// How many bytes, telegrams or frames a full record of the link has not kept; `None` in virtual time, whose record has no bound.
    lost: Option<u64>,
}

impl SessionCapture {
    /// Begins a capture.
    ///
    /// # Errors
    /// The file is there already, or its folder is not.
    pub(super) fn begin(
        path: &str,
        bench: &mut dyn HeldBench,
        simulated: bool,
    ) -> Result<Self, Failure> {
        let path = PathBuf::from(path);
        refuse_existing(&path)?;
        let folder = path.parent().filter(|own| !own.as_os_str().is_empty());
        if folder.is_some_and(|own| !own.is_dir()) || path.file_name().is_none() {
            return Err(Failure::refused(format!(
                "{}: a file in a folder that is there is expected",
                path.display()
            )));
        }
        let record = bench.record()?;
        bench.forget();
        let wall = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
        let wall = u64::try_from(wall.unwrap_or_default().as_nanos()).unwrap_or_default();
        let mut own = Self {
            path,
            places: Vec::new(),
            pieces: Vec::new(),
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
            own.note_loss(
                "the line's own times are lost: these are of the bench, which sends and reads; a tap accuses drives",
            );
        }
        Ok(own)
    }

    /// Takes what the bench has recorded since the last call. Afterwards its link may begin again.
    ///
    /// # Errors
    /// [`Failure`]: the bench has been given back.
    pub(super) fn collect(&mut self, bench: &mut dyn HeldBench) -> Result<(), Failure> {
        let mut record = bench.record()?;
        bench.forget();
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
        let behind = self.began + self.lasted;
        let new = tape.pieces.iter().filter(|own| own.0 > Instant::START);
        self.pieces
            .extend(new.map(|(_, place, piece)| (*place, piece.later(behind))));
        let mut missing = 0;
        if let Some(lost) = &mut self.lost {
            missing = record
                .carried
                .saturating_sub(carried + recorded(&record.traces));
            *lost += missing;
        }
        // The bit rate of a bus shows in what it carries.
        self.places = tape.places;
        self.lasted = self.lasted + lasts;
        self.taken = (record.now, record.carried);
        if missing > 0 {
            self.note_loss(&format!(
                "{missing} bytes or frames lost: the record was full"
            ));
        }
        Ok(())
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
    /// [`Failure`]: the bench has been given back.
    pub(super) fn leave_out(
        &mut self,
        what: &str,
        bench: &mut dyn HeldBench,
    ) -> Result<(), Failure> {
        let record = bench.record()?;
        bench.forget();
        self.taken = (record.now, record.carried);
        self.note_loss(&format!("{what} is lost: a session captures no scenario"));
        Ok(())
    }

    /// Marks that something is missing here. Words with `lost: ` keep `import` from blaming a drive.
    fn note_loss(&mut self, words: &str) {
        let at = (self.began + self.lasted).as_nanos();
        self.pieces.push((0, Piece::Event(at, words.to_owned())));
    }

    /// Writes the file; returns what it holds.
    ///
    /// # Errors
    /// It cannot be written, or another program has written it meanwhile.
    pub(super) fn write(&self) -> Result<Value, Failure> {
        refuse_existing(&self.path)?;
        let written = regular::write(&self.path, |out| {
            let mut recorder = LiveRecorder::start(out, &self.places)?;
            for (place, piece) in &self.pieces {
                recorder.piece(*place, piece)?;
            }
            recorder.flush()
        });
        written.map_err(|error| {
            Failure::Said(
                Exit::RigError,
                format!("failed to write {}: {error}", self.path.display()),
            )
        })?;
        Ok(json!({
            "path": self.path, "packets": self.pieces.len(), "took_ms": self.lasted.as_millis_f64(), "lost": self.lost.unwrap_or_default(),
        }))
    }
}

/// How many octets or frames these are.
fn recorded(traces: &[Trace]) -> u64 {
    let channels = traces.iter().flat_map(|own| &own.channels);
    let counts = channels.map(|own| own.octets().len() + own.frames().len());
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
