//! Lines of control: they act on the rings beside the client, in the words of the scenario language.

use super::server::Server;
use super::state::state_of;
use crate::language::argument;
use crate::language::run::now::{Now, now};
use harness_bench::scenario::parse::parse_step;
use harness_bench::scenario::plan::plan_step;
use harness_bench::scenario::source::Source;
use harness_bench::serve::{ControlAnswer, first};

impl Server {
    /// Does a line of control at once: a fault (`! 98->97: flip 0`), something that happens to drives from outside the bus
    /// (`drive 3 input GPIN5 high`), or a check that looks at drives (`? drive 3 nist = 0rpm +-5rpm`). `state 3` asks what a drive
    /// shows outside the bus, `state 2:3 nist FF08:2` for cells of it, in hexadecimal digits. `None` for an empty line or a comment. Bytes and times in a fault are counted from the server's start.
    pub(crate) fn control(&mut self, line: &str) -> Option<ControlAnswer> {
        let said = line.split('#').next().unwrap_or_default().trim();
        if said.is_empty() {
            return None;
        }
        let source = match Source::from_bytes("control".to_owned(), line.trim_end().into()) {
            Ok(source) => source,
            Err(error) => return Some(ControlAnswer::Error(error.to_string())),
        };
        let mut words = said.split_whitespace().map(str::to_owned);
        if words.next().as_deref() == Some("state") {
            let state = self.state(words.next().as_deref(), &words.collect::<Vec<_>>());
            return Some(state.map_or_else(ControlAnswer::Error, ControlAnswer::State));
        }
        let step = parse_step(&source).and_then(|step| plan_step(&self.plan, &step, &source));
        Some(match step {
            Err(problems) => ControlAnswer::Error(first(&source.text, &problems)),
            Ok(step) => match now(&self.plan, &mut self.link, &step) {
                Now::Done => ControlAnswer::Ok,
                Now::Otherwise(found) => ControlAnswer::No(found),
                Now::Refused(why) => ControlAnswer::Error(why.to_owned()),
            },
        })
    }

    /// What a drive shows, or what these of its cells hold.
    fn state(&self, drive: Option<&str>, cells: &[String]) -> Result<String, String> {
        let (ring, number) = match drive.and_then(|drive| drive.split_once(':')) {
            Some(("1", number)) => (0, Some(number)),
            Some(("2", number)) => (1, Some(number)),
            Some(_) => (usize::MAX, None),
            None => (0, drive),
        };
        let drive = number
            .and_then(|number| number.parse::<u8>().ok())
            .filter(|drive| *drive < self.drives(ring))
            .ok_or("`state` and a drive of the bench expected: `state 3`, `state 2:3` in the second ring")?;
        let cells = argument::cells(cells).map_err(|problems| first("", &problems))?;
        state_of(&self.link, ring, drive, &cells)
    }
}
