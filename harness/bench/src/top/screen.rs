//! The terminal: taken for the view, and restored on every way out, including a panic.
//!
//! There is one screen a process, as there is one terminal.

use super::keys::Key;
use super::{Top, view};
use ratatui_core::terminal::Terminal;
use ratatui_crossterm::CrosstermBackend;
use ratatui_crossterm::crossterm::cursor::Show;
use ratatui_crossterm::crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};
use ratatui_crossterm::crossterm::execute;
use ratatui_crossterm::crossterm::terminal::{
    EnterAlternateScreen, LeaveAlternateScreen, disable_raw_mode, enable_raw_mode,
};
use std::io::{self, Stdout, stdout};
use std::sync::{Mutex, MutexGuard, Once, PoisonError, TryLockError};
use std::time::Duration;

/// Whether the terminal is taken. A thread that writes to it holds the lock, so that nothing is drawn after it was given back.
static TAKEN: Mutex<bool> = Mutex::new(false);

/// How often and how long a panic waits for a thread that draws.
const WAITS: u32 = 200;
const WAIT: Duration = Duration::from_millis(1);

fn taken() -> MutexGuard<'static, bool> {
    TAKEN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The terminal, taken.
pub struct Screen {
    terminal: Terminal<CrosstermBackend<Stdout>>,
    colour: bool,
}

/// Input of the terminal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ScreenInput {
    Key(Key),
    /// Something by which the page changes: another size.
    Redraw,
    /// Nothing that matters.
    Nothing,
}

impl Screen {
    /// Takes the terminal: the other screen, no echo, keys one by one. A panic from now on gives it back before its message.
    ///
    /// # Errors
    /// There is no terminal, or it cannot be set up; it is as it was then.
    pub fn enter(colour: bool) -> io::Result<Self> {
        give_back_before_panics();
        let mut taken = taken();
        enable_raw_mode()?;
        *taken = true;
        let terminal = execute!(stdout(), EnterAlternateScreen)
            .and_then(|()| Terminal::new(CrosstermBackend::new(stdout())));
        match terminal {
            Ok(terminal) => Ok(Self { terminal, colour }),
            Err(error) => {
                give_back(&mut taken);
                Err(error)
            }
        }
    }

    /// Draws the page; nothing where the terminal has been given back.
    ///
    /// # Errors
    /// The terminal takes nothing more.
    pub fn draw(&mut self, top: &mut Top) -> io::Result<()> {
        let taken = taken();
        if *taken {
            let colour = self.colour;
            self.terminal.draw(|frame| view::draw(top, colour, frame))?;
        }
        Ok(())
    }

    /// Waits this long for a key.
    ///
    /// # Errors
    /// The terminal gives nothing more.
    pub fn input(&self, patience: Duration) -> io::Result<ScreenInput> {
        if !event::poll(patience)? {
            return Ok(ScreenInput::Nothing);
        }
        Ok(match event::read()? {
            Event::Key(key) if key.kind != KeyEventKind::Release => {
                let control = key.modifiers.contains(KeyModifiers::CONTROL);
                key_of(key.code, control).map_or(ScreenInput::Nothing, ScreenInput::Key)
            }
            Event::Resize(..) => ScreenInput::Redraw,
            _ => ScreenInput::Nothing,
        })
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        give_back(&mut taken());
    }
}

/// Gives the terminal back if it is taken, before a program ends without unwinding. Waits only briefly for a thread that draws.
pub fn leave() {
    give_back_whoever_draws();
}

fn key_of(code: KeyCode, control: bool) -> Option<Key> {
    Some(match code {
        KeyCode::Char('c') if control => Key::Interrupt,
        KeyCode::Char(_) if control => return None,
        KeyCode::Char(c) => Key::Char(c),
        KeyCode::Enter => Key::Enter,
        KeyCode::Esc => Key::Escape,
        KeyCode::Backspace => Key::Backspace,
        KeyCode::Up => Key::Up,
        KeyCode::Down => Key::Down,
        KeyCode::PageUp => Key::PageUp,
        KeyCode::PageDown => Key::PageDown,
        KeyCode::Home => Key::Home,
        KeyCode::End => Key::End,
        _ => return None,
    })
}

fn give_back(taken: &mut bool) {
    if std::mem::replace(taken, false) {
        // If the terminal is gone, there is nothing to give back.
        let _gone = execute!(stdout(), LeaveAlternateScreen, Show);
        let _gone = disable_raw_mode();
    }
}

/// Gives the terminal back before a panic's message, which would vanish with the alternate screen.
fn give_back_before_panics() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            give_back_whoever_draws();
            before(panic);
        }));
    });
}

fn give_back_whoever_draws() {
    for _ in 0..WAITS {
        match TAKEN.try_lock() {
            Ok(mut taken) => return give_back(&mut taken),
            Err(TryLockError::Poisoned(taken)) => return give_back(&mut taken.into_inner()),
            Err(TryLockError::WouldBlock) => std::thread::sleep(WAIT),
        }
    }
    // This thread itself draws, or a thread that the terminal blocks: the lock will not be released.
    give_back(&mut true);
}
