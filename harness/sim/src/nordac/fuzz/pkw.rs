//! Tasks of the parameter channel, one after the other: the answer to each keeps the rules of 3.4.

use crate::fuzz::{Feature, LONGEST, Notebook};
use crate::nordac::{Inverter, InverterSetup};
use arbitrary::Unstructured;
use harness_proto::nordac::parameter::Flag;
use harness_proto::nordac::pkw::Index;
use harness_proto::nordac::properties::{PROPERTIES, Properties};
use harness_proto::nordac::{Answer, PARAMETERS, Parameter, Pkw, PpoType, Task};
use harness_proto::time::Instant;

/// The first byte chooses PPO type (bit 0), PosiCon (bit 1) and an open point (the others). The others are tasks of nine bytes: how the number is meant,
/// and the task; a number that is meant as a place of the table is one that exists.
///
/// # Panics
/// An answer breaks a rule, or a task that only reads changes something.
pub fn pkw(data: &[u8]) {
    noted(data, &mut Notebook::none());
}

/// The same, and tasks with their answers are noted.
///
/// # Panics
/// As [`pkw`].
pub(super) fn noted(data: &[u8], notes: &mut Notebook<'_>) {
    let Some((&head, data)) = data.split_first() else {
        return;
    };
    let ppo = if head & 1 == 0 {
        PpoType::Two
    } else {
        PpoType::One
    };
    let setup = InverterSetup {
        properties: properties(head >> 2),
        posicon: head & 2 != 0,
        ..InverterSetup::default()
    };
    let mut inverter = Inverter::new(&setup, Instant::START);
    let mut input = Unstructured::new(&data[..data.len().min(LONGEST)]);
    let mut bytes = [0; 9];
    while !input.is_empty() && input.fill_buffer(&mut bytes).is_ok() {
        let [how, task @ ..] = bytes;
        let mut task = Pkw::decode(task);
        if how & 1 == 0 {
            let row = &PARAMETERS[usize::from(task.number()) % PARAMETERS.len()];
            task.pke = task.pke & 0xF800 | row.number;
        }
        play(&mut inverter, task, ppo, notes);
    }
}

/// An open point with its last word; a number out of range leaves all defaults.
fn properties(number: u8) -> Properties {
    use harness_proto::nordac::properties::Choices;
    let mut properties = Properties::default();
    if let Some(property) = PROPERTIES.get(usize::from(number))
        && let Choices::Words(words) = property.accepts
        && let Some(word) = words.last()
    {
        assert!(property.set(&mut properties, word), "{}", property.name);
    }
    properties
}

fn play(inverter: &mut Inverter, task: Pkw, ppo: PpoType, notes: &mut Notebook<'_>) {
    let before = values(inverter);
    let state = inverter.state();
    let answer = inverter.task(Instant::START, task, ppo);
    let sent = inverter.encode(answer, task);
    check_form(task, answer, sent);
    assert_eq!(inverter.state(), state, "a task changes the state");
    if !task.task().is_change() || matches!(answer, Answer::Error(_)) {
        assert!(values(inverter) == before, "{task} changes a value");
    }
    if !matches!(answer, Answer::Error(_)) {
        let again = inverter.current(Instant::START, task, ppo);
        assert_eq!(again, answer, "{task} reads something else");
    }
    notes.note(|| {
        let kind = Parameter::of(task.number()).map_or("no parameter", kind);
        let what = match answer {
            Answer::Error(error) => error.to_string(),
            _ => format!("answer {}", answer.ak()),
        };
        Feature::new("3.4", format!("{}, {kind}", task.task().name()), what)
    });
}

/// AK, PNU, IND and PWE of an answer (3.4.1 to 3.4.3).
fn check_form(task: Pkw, answer: Answer, sent: Pkw) {
    if answer == Answer::None {
        assert_eq!(task.task(), Task::None, "{task} has no answer");
        assert_eq!(sent, Pkw::default(), "no answer is 0");
        return;
    }
    assert_eq!(
        (sent.number(), sent.ind, sent.spm()),
        (task.number(), task.ind, false),
        "{task}: {sent}"
    );
    let allowed: &[u8] = match task.ak() {
        1 => &[1, 2, 7],
        2 => &[1, 7],
        3 => &[2, 7],
        6 => &[4, 5, 7],
        7 => &[4, 7],
        8 => &[5, 7],
        9 => &[6, 7],
        _ => &[7],
    };
    assert!(allowed.contains(&sent.ak()), "{task}: {sent}");
    let word = !matches!(sent.ak(), 2 | 5);
    assert!(
        !word || matches!(sent.pwe >> 16, 0 | 0xFFFF),
        "{task}: {sent}"
    );
    assert_eq!(Answer::of(sent), Some(answer), "{task}: {sent}");
}

/// The values of all parameters in set 1.
fn values(inverter: &Inverter) -> Vec<Option<i64>> {
    let all = PARAMETERS.iter();
    all.map(|parameter| inverter.parameter(parameter, Index::default()))
        .collect()
}

/// What a parameter is, by its flags.
fn kind(parameter: &'static Parameter) -> &'static str {
    match (
        parameter.has(Flag::ReadOnly),
        parameter.has(Flag::Long),
        parameter.is_array(),
    ) {
        (true, true, _) => "a double word that is read only",
        (true, false, true) => "an array that is read only",
        (true, false, false) => "a word that is read only",
        (false, true, true) => "an array of double words",
        (false, true, false) => "a double word",
        (false, false, true) => "an array of words",
        (false, false, false) => "a word",
    }
}
