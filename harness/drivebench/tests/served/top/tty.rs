//! A pseudo terminal with a program in it, and what a person would see there.

use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{LocalModes, Termios, Winsize, tcgetattr, tcsetwinsize};
use std::fs::File;
use std::io::Read;
use std::os::fd::OwnedFd;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Rows and columns.
const SIZE: (usize, usize) = (24, 80);
/// Nothing takes longer, however busy the machine is.
const PATIENCE: Duration = Duration::from_secs(90);

/// A program in a terminal.
pub(crate) struct Tty {
    pub(crate) child: Child,
    master: Option<OwnedFd>,
    slave: File,
    before: Termios,
    output: Arc<Mutex<Vec<u8>>>,
}

impl Tty {
    /// Starts a program in a terminal of its own.
    pub(crate) fn start(mut command: Command) -> Self {
        let master =
            openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).expect("a pty");
        grantpt(&master)
            .and_then(|()| unlockpt(&master))
            .expect("a pty");
        let name = ptsname(&master, Vec::new()).expect("a name");
        let slave = File::options()
            .read(true)
            .write(true)
            .open(name.to_str().expect("text"))
            .expect("its other end");
        let size = Winsize {
            ws_row: SIZE.0 as u16,
            ws_col: SIZE.1 as u16,
            ws_xpixel: 0,
            ws_ypixel: 0,
        };
        tcsetwinsize(&master, size).expect("a size");
        let before = tcgetattr(&slave).expect("a terminal");
        let end = || Stdio::from(slave.try_clone().expect("another"));
        command
            .stdin(end())
            .stdout(end())
            .stderr(end())
            .env("TERM", "xterm");
        command.env_remove("NO_COLOR");
        let child = command.spawn().expect("the program");
        let output = Arc::new(Mutex::new(Vec::new()));
        let (sink, mut source) = (
            Arc::clone(&output),
            File::from(master.try_clone().expect("another")),
        );
        std::thread::spawn(move || {
            let mut some = [0; 4096];
            while let Ok(count @ 1..) = source.read(&mut some) {
                sink.lock().expect("a lock").extend(&some[..count]);
            }
        });
        Self {
            child,
            master: Some(master),
            slave,
            before,
            output,
        }
    }

    /// Types something.
    pub(crate) fn keys(&self, keys: &str) {
        let master = self.master.as_ref().expect("there");
        assert_eq!(rustix::io::write(master, keys.as_bytes()), Ok(keys.len()));
    }

    /// All that was written so far.
    pub(crate) fn written(&self) -> String {
        String::from_utf8_lossy(&self.output.lock().expect("a lock")).into_owned()
    }

    /// Waits until what a person sees is as wanted.
    #[track_caller]
    pub(crate) fn see(&self, what: &str, wanted: impl Fn(&Seen) -> bool) -> Seen {
        let end = Instant::now() + PATIENCE;
        loop {
            let seen = Seen::of(&self.written());
            if wanted(&seen) {
                return seen;
            }
            assert!(
                Instant::now() < end,
                "{what} is not seen:\n{}\n{}",
                seen.first,
                seen.text()
            );
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Waits for its end.
    #[track_caller]
    pub(crate) fn ended(&mut self) -> ExitStatus {
        let end = Instant::now() + PATIENCE;
        loop {
            if let Some(status) = self.child.try_wait().expect("a process") {
                return status;
            }
            assert!(
                Instant::now() < end,
                "it does not end:\n{}",
                Seen::of(&self.written()).text()
            );
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Whether keys are given one by one and without echo.
    pub(crate) fn is_raw(&self) -> bool {
        let now = tcgetattr(&self.slave).expect("a terminal");
        !now.local_modes
            .intersects(LocalModes::ICANON | LocalModes::ECHO)
    }

    /// The terminal is as it was: its modes, its screen and its cursor.
    #[track_caller]
    pub(crate) fn is_as_before(&self) -> Seen {
        let seen = self.see("the first screen", |seen| !seen.other_screen && seen.cursor);
        self.has_its_modes();
        assert!(
            self.written().contains("\x1b[?1049h"),
            "it was never on the other screen"
        );
        seen
    }

    /// The modes of the terminal are as they were.
    #[track_caller]
    pub(crate) fn has_its_modes(&self) {
        let now = tcgetattr(&self.slave).expect("a terminal");
        assert_eq!(format!("{now:?}"), format!("{:?}", self.before));
    }

    /// Closes the terminal, as when its window is closed.
    pub(crate) fn close(&mut self) {
        self.master = None;
    }
}

impl Drop for Tty {
    fn drop(&mut self) {
        let _gone = self.child.kill();
        let _gone = self.child.wait();
    }
}

/// What a person sees: so much of a terminal as the program uses.
pub(crate) struct Seen {
    lines: Vec<Vec<char>>,
    /// Whether it is the other screen.
    pub(crate) other_screen: bool,
    /// Whether the cursor is shown.
    pub(crate) cursor: bool,
    /// What was written to the first screen.
    pub(crate) first: String,
}

impl Seen {
    fn of(written: &str) -> Self {
        let mut seen = Self {
            lines: vec![vec![' '; SIZE.1]; SIZE.0],
            other_screen: false,
            cursor: true,
            first: String::new(),
        };
        let (mut row, mut column) = (0, 0);
        let mut rest = written.chars();
        while let Some(c) = rest.next() {
            match c {
                '\x1b' if rest.clone().next() == Some('[') => {
                    rest.next();
                    let parameters: String = rest
                        .clone()
                        .take_while(|c| !c.is_ascii_alphabetic())
                        .collect();
                    let last = rest.nth(parameters.chars().count());
                    if let Some(place) = seen.control(&parameters, last.unwrap_or(' ')) {
                        (row, column) = place;
                    }
                }
                c if !seen.other_screen => seen.first.push(c),
                '\r' => column = 0,
                '\n' => row += 1,
                c => {
                    if let Some(cell) = seen
                        .lines
                        .get_mut(row)
                        .and_then(|line| line.get_mut(column))
                    {
                        *cell = c;
                    }
                    column += 1;
                }
            }
        }
        seen
    }

    /// A control sequence; gives the place to which the cursor goes.
    fn control(&mut self, parameters: &str, last: char) -> Option<(usize, usize)> {
        match (parameters, last) {
            ("?1049", 'h') => {
                self.other_screen = true;
                self.lines = vec![vec![' '; SIZE.1]; SIZE.0];
            }
            ("?1049", 'l') => self.other_screen = false,
            ("?25", 'h') => self.cursor = true,
            ("?25", 'l') => self.cursor = false,
            ("2", 'J') => self.lines = vec![vec![' '; SIZE.1]; SIZE.0],
            (place, 'H') => {
                let (row, column) = place.split_once(';').unwrap_or(("1", "1"));
                let number = |text: &str| text.parse::<usize>().unwrap_or(1) - 1;
                return Some((number(row), number(column)));
            }
            _ => {}
        }
        None
    }

    /// The lines.
    pub(crate) fn text(&self) -> String {
        let lines = self
            .lines
            .iter()
            .map(|line| line.iter().collect::<String>());
        lines
            .map(|line| line.trim_end().to_owned() + "\n")
            .collect()
    }

    /// Whether this stands somewhere.
    pub(crate) fn has(&self, words: &str) -> bool {
        self.text().contains(words)
    }
}
