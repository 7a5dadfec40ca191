//! The files of a running capture: a new one by size, by time or on demand; the oldest is removed.

use super::recorder::{LiveRecorder, RecordedPlace};
use std::collections::VecDeque;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

/// When a new file is begun, and how many are kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rotation {
    /// Bytes of a file.
    pub size: Option<u64>,
    /// Nanoseconds of a file.
    pub every: Option<u64>,
    /// The most files; older ones are removed.
    pub files: Option<usize>,
}

/// The files of a capture.
pub struct Files {
    path: PathBuf,
    places: Vec<RecordedPlace>,
    rotation: Rotation,
    /// The number of the present file.
    number: usize,
    began: u64,
    written: VecDeque<PathBuf>,
    recorder: LiveRecorder<File>,
}

/// The name of a file by its number: `ring_00001.pcapng`.
fn numbered(path: &Path, number: usize) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let ending = path.extension().map(|ending| ending.to_string_lossy());
    let ending = ending.map_or(String::new(), |ending| format!(".{ending}"));
    path.with_file_name(format!("{stem}_{number:05}{ending}"))
}

impl Files {
    /// Begins the first file; where files are rotated its name has a number.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn begin(
        path: &Path,
        places: &[RecordedPlace],
        rotation: Rotation,
        now: u64,
    ) -> io::Result<Self> {
        let first = match rotation == Rotation::default() {
            true => path.to_owned(),
            false => numbered(path, 1),
        };
        let recorder = LiveRecorder::start(File::create(&first)?, places)?;
        Ok(Self {
            path: path.to_owned(),
            places: places.to_vec(),
            rotation,
            number: 1,
            began: now,
            written: VecDeque::from([first]),
            recorder,
        })
    }

    pub const fn recorder(&mut self) -> &mut LiveRecorder<File> {
        &mut self.recorder
    }

    /// The paths of the files that are kept, the present one last.
    pub fn paths(&self) -> impl Iterator<Item = &Path> {
        self.written.iter().map(PathBuf::as_path)
    }

    /// Whether files were removed.
    pub fn removed(&self) -> bool {
        self.written.len() < self.number
    }

    /// Writes what waits, and begins a new file where the present one is full or old enough.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn flush(&mut self, now: u64) -> io::Result<()> {
        self.recorder.flush()?;
        let Rotation { size, every, .. } = self.rotation;
        let full = size.is_some_and(|size| self.recorder.written() >= size);
        let old = every.is_some_and(|every| now.saturating_sub(self.began) >= every);
        match full || old {
            true => self.rotate(now),
            false => Ok(()),
        }
    }

    /// What the present file holds begins at this time.
    pub const fn begins(&mut self, at: u64) {
        self.began = at;
    }

    /// Ends the present file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn end(&mut self, now: u64) -> io::Result<()> {
        self.recorder.statistics(self.began, now)?;
        self.recorder.flush()
    }

    /// Begins a new file.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn rotate(&mut self, now: u64) -> io::Result<()> {
        self.end(now)?;
        self.number += 1;
        let next = numbered(&self.path, self.number);
        self.recorder = LiveRecorder::start(File::create(&next)?, &self.places)?;
        self.began = now;
        self.written.push_back(next);
        let most = self.rotation.files.unwrap_or(usize::MAX).max(1);
        while self.written.len() > most {
            if let Some(oldest) = self.written.pop_front() {
                // Another program may have moved it.
                let _gone = std::fs::remove_file(oldest);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::recorder::{Carries, Piece};
    use crate::capture::{CaptureSpan, read};
    use harness_proto::line::Rate;
    use harness_proto::time::{Instant, Span};
    use harness_sim::record::LineByte;

    /// Each file opens by itself, and the oldest ones are removed.
    #[test]
    fn files_rotate() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("ring.pcapng");
        let rotation = Rotation {
            size: Some(400),
            every: Some(1_000_000_000),
            files: Some(2),
        };
        let places = ["1->0", "0->master"].map(|name| RecordedPlace {
            name: name.to_owned(),
            carries: Carries::Link,
            bits_per_second: 38_400,
        });
        let mut files = Files::begin(&path, &places, rotation, 0).expect("a file");
        let mut now = 1_700_000_000_000_000_000;
        for number in 0..40_u8 {
            now += 300_000;
            let at = Instant::START + Span::from_nanos(now);
            let byte = LineByte::seen(at, Some(number), Some(number), None);
            let event = Piece::Event(now, "the adapter was pulled out".to_owned());
            for (place, piece) in [Piece::Octet(byte), event].iter().enumerate() {
                files.recorder().piece(place, piece).expect("kept");
            }
            files.flush(0).expect("written");
        }
        let kept: Vec<_> = files.paths().map(Path::to_owned).collect();
        assert_eq!(kept.len(), 2);
        let there = std::fs::read_dir(folder.path()).expect("a folder").count();
        assert_eq!(there, 2);
        for path in &kept {
            let capture = read(&std::fs::read(path).expect("a file"), None).expect("a capture");
            assert_eq!(capture.traces[0].channels.len(), 2);
            // The present one is not at its end.
            assert_eq!(capture.listened.is_some(), path == &kept[0]);
        }
        let before = files.paths().count();
        files.rotate(1).expect("a new file");
        files.flush(2_000_000_000).expect("written");
        assert_eq!(files.paths().count(), before);
        assert!(files.paths().last().is_some_and(|path| path != kept[1]));
    }
    /// A file says for how long the line was listened to in front of its first byte and after its last.
    #[test]
    fn a_file_says_when_it_began_and_ended() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("ring.pcapng");
        let places = [RecordedPlace {
            name: "0->master".to_owned(),
            carries: Carries::Link,
            bits_per_second: 38_400,
        }];
        let began = 1_700_000_000_000_000_000;
        let mut files = Files::begin(&path, &places, Rotation::default(), began).expect("a file");
        let at = Instant::START + Span::from_nanos(began + 80_000_000);
        let byte = Piece::Octet(LineByte::seen(at, Some(1), Some(1), None));
        files.recorder().piece(0, &byte).expect("kept");
        files.flush(began + 100_000_000).expect("written");
        let read = || read(&std::fs::read(&path).expect("a file"), None).expect("a capture");
        assert_eq!(read().listened, None);
        files.end(began + 200_000_000).expect("written");
        let octet = Rate::Baud38400.byte_time();
        let until = Instant::START + Span::from_nanos(octet.as_nanos() + 120_000_000);
        assert_eq!(
            read().listened,
            Some(CaptureSpan {
                before: Span::from_millis(80),
                until
            })
        );
    }
}
