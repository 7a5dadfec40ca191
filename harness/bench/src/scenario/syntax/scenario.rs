//! The scenario, its header and its steps.

use crate::bus_name::BusName;
use crate::link::Capability;
use crate::scenario::expression::{Counter, Located};
use crate::scenario::language::Language;
use crate::scenario::problem::TextSpan;
use crate::scenario::times::{Duration, Window};

/// A scenario: what it is, the bench that it needs, and its steps.
#[derive(Clone, Debug)]
pub struct Scenario<L: Language> {
    /// What the conversation shows, in a line.
    pub title: String,
    /// The tables of which manuals it pins.
    pub sources: Vec<Citation>,
    pub bus: BusName,
    /// The header lines of the bus.
    pub header: L::Header,
    /// What it says that it needs of a rig.
    pub needs: Vec<Capability>,
    /// Whether bytes that no line asked for are a failure.
    pub strict: bool,
    /// How long a line without a time waits.
    pub deadline: Option<Duration>,
    pub steps: Vec<Step<L>>,
}

impl<L: Language> Scenario<L> {
    /// A scenario without steps.
    #[must_use]
    pub fn new(title: &str, header: L::Header) -> Self {
        Self {
            title: title.to_owned(),
            sources: Vec::new(),
            bus: L::BUS,
            header,
            needs: Vec::new(),
            strict: false,
            deadline: None,
            steps: Vec::new(),
        }
    }
}

impl<L: Language> Scenario<L> {
    /// What it says in words that every bus has.
    pub fn head(self) -> ScenarioHead {
        ScenarioHead {
            title: self.title,
            sources: self.sources,
            bus: self.bus,
            steps: self.steps.len(),
            rings: L::rings(&self.header),
        }
    }
}

/// What a scenario says of itself in words that every bus has.
#[derive(Clone, Debug)]
pub struct ScenarioHead {
    /// What the conversation shows, in a line.
    pub title: String,
    /// The tables of which manuals it pins.
    pub sources: Vec<Citation>,
    pub bus: BusName,
    /// How many steps are written.
    pub steps: usize,
    /// The numbers of drives for which it is written, such as `1..250`, a ring each; none on another bus.
    pub rings: Vec<String>,
}

/// A reference to a manual: `nd21 9.7`, `nd21 8.2 exchange-6`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Citation {
    /// The whole reference, single spaces between its words.
    pub text: String,
    pub span: TextSpan,
}

#[derive(Clone, Debug)]
pub struct Step<L: Language> {
    /// The time in front.
    pub when: When,
    /// What happens.
    pub action: Action<L>,
    pub span: TextSpan,
}

impl<L: Language> From<Action<L>> for Step<L> {
    /// A step without a time in front.
    fn from(action: Action<L>) -> Self {
        Self {
            when: When::Now,
            action,
            span: TextSpan::default(),
        }
    }
}

/// The time of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum When {
    /// None: as soon as the line before is done.
    Now,
    /// `+`: after the line before.
    After(Window),
    /// `@`: since the start.
    At(Window),
}

/// What a step does.
#[derive(Clone, Debug)]
pub enum Action<L: Language> {
    /// `>`: the master sends.
    Send {
        /// On which port of the bench, counted from 0.
        port: usize,
        message: L::Message,
    },
    /// `<`: the master receives.
    Receive {
        /// On which port of the bench, counted from 0.
        port: usize,
        message: L::Message,
    },
    /// `wait`: time passes.
    Wait(Duration),
    /// `for k in 0..last`: the steps up to its `end` are played for each number, in this order.
    For(Counter, Located, Located),
    /// `end`: of the loop that began last.
    End,
    /// A step of the bus.
    Own(L::Step),
}
