//! What the parameter channel can answer to the tasks that were sent (3.4).

use harness_proto::nordac::parameter::Flag;
use harness_proto::nordac::{Parameter, Pkw};

/// The tasks of an exchange, as far as they were heard. A slave shows the answer to a task of the time before until it has answered another
/// one (3.4).
#[derive(Clone, Debug)]
pub(super) struct Tasks {
    sent: Vec<Pkw>,
    /// The last answer that no task which was heard explains.
    before: Option<Pkw>,
    /// How many more of these may come.
    earlier: u8,
    answered: Option<u16>,
}

impl Default for Tasks {
    /// The tasks of an exchange that was under way before: one answer is shown, and another may be due.
    fn default() -> Self {
        Self::after(2)
    }
}

/// Tasks that are kept at most; beyond them nothing is compared.
const MOST: usize = 2_000;

/// Errors that the manual prints, and those that later manuals add (3.4.1).
const ERRORS: [u32; 11] = [0, 1, 2, 3, 4, 5, 7, 9, 17, 201, 202];

/// Numbers whose value need not be what was written: the control word, and what loads or stores settings or holds a password.
const OTHERS: [u16; 6] = [CONTROL_WORD, 970, 971, 1602, 1603, 1604];

/// The control word, which may be written or not (`967-write`).
const CONTROL_WORD: u16 = 967;

impl Tasks {
    const fn after(earlier: u8) -> Self {
        Self {
            sent: Vec::new(),
            before: None,
            earlier,
            answered: None,
        }
    }

    /// The tasks of an exchange that begins: nothing is due.
    pub(super) const fn begun() -> Self {
        Self::after(1)
    }

    /// The number of the task that was answered last.
    pub(super) const fn answered(&self) -> Option<u16> {
        self.answered
    }

    /// A task goes out.
    pub(super) fn push(&mut self, task: Pkw) {
        if self.sent.last() != Some(&task) && self.sent.len() <= MOST {
            self.sent.push(task);
        }
    }

    /// What is wrong with an answer, and the section; `None` if a right inverter can send it.
    pub(super) fn wrong(&mut self, answer: Pkw) -> Option<(&'static str, String)> {
        let found = self.unlike_all(answer);
        let same = |pkw: Pkw| (pkw.pke, pkw.ind) == (answer.pke, answer.ind);
        if found.is_none() {
            (self.before, self.earlier) = (None, 0);
            self.answered = Some(answer.number()).filter(|_| answer.ak() != 0);
        } else if !matches!(answer.ak(), 1 | 2 | 4..=7) {
            return found;
        } else if self.before.is_some_and(same) {
            return None;
        } else if let Some(left) = self.earlier.checked_sub(1) {
            (self.before, self.earlier) = (Some(answer), left);
            return None;
        }
        found
    }

    fn unlike_all(&self, answer: Pkw) -> Option<(&'static str, String)> {
        if self.sent.len() > MOST {
            return None;
        }
        if answer.ak() == 0 {
            let zero = answer == Pkw::default();
            return (!zero).then(|| ("3.4.1", format!("{answer} is no answer, and is not zero")));
        }
        let of_number = |pkw: &&Pkw| pkw.number() == answer.number() && pkw.ak() != 0;
        let mut asked = self.sent.iter().filter(of_number).peekable();
        if asked.peek().is_none() {
            return Some(("3.4.1", format!("{answer} answers no task that was sent")));
        }
        let asked: Vec<_> = asked.filter(|task| task.ind == answer.ind).collect();
        if asked.is_empty() {
            return Some(("3.4.2", format!("{answer} carries an IND that no task had")));
        }
        let reasons: Vec<_> = asked
            .iter()
            .map(|task| self.unlike(**task, answer))
            .collect();
        match reasons.iter().all(Option::is_some) {
            true => reasons.into_iter().flatten().next(),
            false => None,
        }
    }

    /// Why an answer is none to a task with the same number and index.
    fn unlike(&self, task: Pkw, answer: Pkw) -> Option<(&'static str, String)> {
        let wrong = |why: &str| Some(("3.4.1", format!("{answer} answers the task {task}: {why}")));
        let parameter = Parameter::of(task.number());
        let (is_long, is_array) =
            parameter.map_or((false, false), |row| (row.has(Flag::Long), row.is_array()));
        let kind = match answer.ak() {
            1 => !is_long && matches!(task.ak(), 1..=3),
            2 => is_long && matches!(task.ak(), 1..=3),
            4 => !is_long && is_array && matches!(task.ak(), 6..=8),
            5 => is_long && is_array && matches!(task.ak(), 6..=8),
            6 => is_array && task.ak() == 9,
            7 => true,
            _ => false,
        };
        if !kind || answer.ak() != 7 && parameter.is_none() {
            return wrong("an answer of another kind is expected");
        }
        let (high, low) = (answer.high_word(), answer.low_word());
        if answer.ak() == 7 {
            return self
                .unlike_error(task, answer.pwe, parameter)
                .and_then(|why| wrong(&why));
        }
        let extended = high == 0xFFFF && low & 0x8000 != 0;
        if !is_long && high != 0 && !extended {
            return wrong("a word stands in PWE2, and PWE1 is 0");
        }
        let kind = task.task();
        if !kind.is_change() {
            return None;
        }
        let read_only = parameter.is_some_and(|parameter| parameter.has(Flag::ReadOnly));
        if read_only && task.number() != CONTROL_WORD {
            return wrong("the parameter can only be read");
        }
        let mask = if is_long { u32::MAX } else { 0xFFFF };
        let alone = self.changes(task.number()) == 1 && !OTHERS.contains(&task.number());
        let differs = (task.pwe ^ answer.pwe) & mask != 0;
        (alone && differs).then(|| {
            (
                "3.4.3",
                format!("{answer} answers the task {task}: the value written is expected"),
            )
        })
    }

    /// Why an error is none of a task.
    fn unlike_error(&self, task: Pkw, error: u32, parameter: Option<&Parameter>) -> Option<String> {
        let possible: &[u32] = match (task.ak(), parameter) {
            // What bit 11 leads to is open (`spm`).
            _ if task.spm() => &ERRORS,
            (10.., _) => &[201],
            (4, None) => &[0, 9],
            (5, None) => &[0, 7],
            (_, None) => &[0],
            (_, Some(parameter)) if parameter.needs_posicon() => &ERRORS,
            (4, _) => &[9],
            (5, _) => &[7],
            _ => &ERRORS[1..],
        };
        let words = || {
            possible
                .iter()
                .map(u32::to_string)
                .collect::<Vec<_>>()
                .join(" or ")
        };
        (!possible.contains(&error)).then(|| format!("error {} is expected", words()))
    }

    /// How many different tasks may change a parameter.
    fn changes(&self, number: u16) -> usize {
        let loads = |task: &&Pkw| [970, 1602].contains(&task.number());
        let of_number = |task: &&Pkw| task.number() == number && task.task().is_change();
        self.sent
            .iter()
            .filter(|task| of_number(task) || loads(task))
            .count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// NORDAC 3.4: a slave shows the answer to a task of the exchange before until it has answered one of this; no other task explains an
    /// answer, and an earlier one does not come back.
    #[test]
    fn an_answer_to_an_earlier_task() {
        let (earlier, later) = (Pkw::of(1, 1801, 0, 7), Pkw::of(1, 1800, 0, 9));
        let mut tasks = Tasks::begun();
        tasks.push(Pkw::of(1, 1800, 0, 0));
        for answer in [earlier, earlier, later, later] {
            assert_eq!(tasks.wrong(answer), None, "{answer}");
        }
        let again = tasks.wrong(earlier).expect("a difference");
        assert_eq!(again.0, "3.4.1");
        let mut tasks = Tasks::begun();
        assert_eq!(tasks.wrong(earlier), None);
        let other = tasks.wrong(Pkw::of(1, 1202, 0, 7)).expect("a difference");
        assert!(other.1.contains("answers no task"), "{}", other.1);
    }
}
