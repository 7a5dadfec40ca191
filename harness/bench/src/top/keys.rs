//! Keys: what each does to the view.

use super::Top;
use super::state::KeyTarget;

/// The longest text that is typed, in characters.
const MOST: usize = 60;

/// A key, whatever terminal it comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Key {
    Char(char),
    Enter,
    Escape,
    /// The key that takes the last character away.
    Backspace,
    /// Ctrl-C.
    Interrupt,
    Up,
    Down,
    PageUp,
    PageDown,
    /// To the first row.
    Home,
    /// To the last row.
    End,
}

/// What becomes of the view, and what the user orders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Press {
    /// The view continues.
    Stay,
    /// It was asked for its end.
    Quit,
    /// It was interrupted, as by a signal.
    Interrupt,
    /// The view continues, and a drive is to be stopped, by its place on the bench; or all of them.
    Stop(Option<usize>),
}

/// The keys and what they do, as the help shows them.
pub const HELP: [(&str, &str); 10] = [
    ("q, Esc", "quit; the drives stay as they are"),
    (
        "Ctrl-C",
        "quit as by a signal: a bench with ports goes to its safe state",
    ),
    (
        "x",
        "stop a drive: its name and Enter; Enter alone stops all",
    ),
    (
        "/",
        "show only drives with this text in their row; Enter keeps it, Esc takes it away",
    ),
    ("e", "show only drives in error, or all again"),
    ("s", "sort by drive, state, speed or error"),
    ("p", "pause: the page stands still, reading goes on"),
    ("Up, Down, PgUp, PgDn", "scroll; also k and j, Home and End"),
    ("?", "this help; any key closes it"),
    ("c", "clear the messages below the table"),
];

impl Top {
    /// Does what a key says.
    pub fn press(&mut self, key: Key) -> Press {
        if key == Key::Interrupt {
            return Press::Interrupt;
        }
        match self.entry {
            KeyTarget::Filter => {
                self.type_filter(key);
                Press::Stay
            }
            KeyTarget::Stop => self.type_drive(key),
            KeyTarget::Help => {
                self.entry = KeyTarget::None;
                Press::Stay
            }
            KeyTarget::None => self.command(key),
        }
    }

    fn type_filter(&mut self, key: Key) {
        match key {
            Key::Enter => self.entry = KeyTarget::None,
            Key::Escape => {
                self.filter.clear();
                self.entry = KeyTarget::None;
            }
            key => {
                type_into(&mut self.filter, key);
                self.scroll(key);
            }
        }
    }

    fn type_drive(&mut self, key: Key) -> Press {
        match key {
            Key::Enter => {
                if let Some(order) = self.stop_order() {
                    self.entry = KeyTarget::None;
                    // The page goes on, so that it shows what comes of the order.
                    self.resume();
                    return order;
                }
            }
            Key::Escape => self.entry = KeyTarget::None,
            key => {
                type_into(&mut self.to_stop, key);
                self.scroll(key);
            }
        }
        Press::Stay
    }

    /// What Enter orders: all drives where no name has been typed. `None` while no drive has that name.
    pub(crate) fn stop_order(&self) -> Option<Press> {
        if self.to_stop.is_empty() {
            return Some(Press::Stop(None));
        }
        let mut drives = self.reading.drives.iter();
        let named = drives.find(|(_, row)| row.cells.first() == Some(&self.to_stop));
        named.map(|(place, _)| Press::Stop(Some(*place)))
    }

    fn command(&mut self, key: Key) -> Press {
        match key {
            Key::Char('q') | Key::Escape => return Press::Quit,
            Key::Char('x') => {
                self.to_stop.clear();
                self.entry = KeyTarget::Stop;
            }
            Key::Char('/') => self.entry = KeyTarget::Filter,
            Key::Char('?' | 'h') => self.entry = KeyTarget::Help,
            Key::Char('e') => self.only_errors = !self.only_errors,
            Key::Char('s') => self.sort = self.sort.next(),
            Key::Char('p') => self.pause(),
            Key::Char('c') => self.forget_events(),
            Key::Char('k') => self.scroll(Key::Up),
            Key::Char('j') => self.scroll(Key::Down),
            key => self.scroll(key),
        }
        Press::Stay
    }

    fn scroll(&mut self, key: Key) {
        let page = self.page.max(1);
        self.first = match key {
            Key::Up => self.first.saturating_sub(1),
            Key::Down => self.first.saturating_add(1),
            Key::PageUp => self.first.saturating_sub(page),
            Key::PageDown => self.first.saturating_add(page),
            Key::Home => 0,
            Key::End => usize::MAX,
            _ => return,
        };
        self.keep_in_sight();
    }
}

/// Adds a character to a text, or takes the last one away.
fn type_into(text: &mut String, key: Key) {
    match key {
        Key::Char(c) if !c.is_control() && text.chars().count() < MOST => text.push(c),
        Key::Backspace => {
            text.pop();
        }
        _ => {}
    }
}
