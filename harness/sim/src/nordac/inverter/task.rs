//! Tasks of the parameter channel: the checks in their order, and what a change does (3.4, 4.1.3; section 8 of the reading).

use super::super::parameters::Parameters;
use super::Inverter;
use harness_proto::nordac::parameter::Flag;
use harness_proto::nordac::pkw::Index;
use harness_proto::nordac::properties::{
    AddressRange, ControlWrite, DescriptionErrorOrder, IndLowByte, LoadDefaultValue, NegativePwe1,
    OnlineError, PlainTaskSubindex, PositionLimitWrite, Ppo1DoubleWords, Pwe1OfWordTask, Spm,
    SubindexBits, WidthError,
};
use harness_proto::nordac::{Answer, Parameter, Pkw, PkwError, PpoType, Task};
use harness_proto::time::Instant;

/// What a task is about.
#[derive(Clone, Copy)]
struct TaskTarget {
    parameter: &'static Parameter,
    index: Index,
}

impl Inverter {
    /// Executes a task, once, and gives its answer. The module decides when the answer is sent (3.4.1).
    pub fn task(&mut self, at: Instant, task: Pkw, ppo: PpoType) -> Answer {
        self.advance(at);
        self.attempt(task, ppo).unwrap_or_else(Answer::Error)
    }

    /// The answer to a task that was executed, with the value as it is at `at`. Nothing is changed.
    #[must_use]
    pub fn current(&self, at: Instant, task: Pkw, _ppo: PpoType) -> Answer {
        match self.place(task) {
            Ok(Some(place)) => self.value_of(at, task, place),
            Ok(None) if task.task() == Task::None => Answer::None,
            Ok(None) => self.count_of(task).unwrap_or_else(Answer::Error),
            Err(error) => Answer::Error(error),
        }
    }

    fn attempt(&mut self, task: Pkw, ppo: PpoType) -> Result<Answer, PkwError> {
        let place = match self.place(task)? {
            Some(place) => place,
            None if task.task() == Task::None => return Ok(Answer::None),
            None => return self.count_of(task),
        };
        let value = self.check(task, place, ppo)?;
        if let Some(value) = value {
            self.change(place, value);
        }
        Ok(self.value_of(self.now, task, place))
    }

    /// The parameter and the index of a task; `None` for one that needs no index: no task, number of elements.
    fn place(&self, task: Pkw) -> Result<Option<TaskTarget>, PkwError> {
        let kind = task.task();
        if kind == Task::None {
            return Ok(None);
        }
        let described = match kind {
            Task::Invalid(_) => return Err(PkwError::Task),
            Task::RequestDescription => Err(PkwError::NoDescription),
            Task::ChangeDescription => Err(PkwError::Description),
            _ => Ok(()),
        };
        if self.properties.description_error_order == DescriptionErrorOrder::TaskFirst {
            described?;
        }
        if task.spm() && self.properties.spm == Spm::Error {
            return Err(PkwError::Task);
        }
        let parameter = self.known(task.number())?;
        described?;
        if kind.is_array() && !parameter.is_array() {
            return Err(PkwError::NoArray);
        }
        if kind == Task::Elements {
            return Ok(None);
        }
        let index = self.index(task, parameter)?;
        Ok(Some(TaskTarget { parameter, index }))
    }

    fn known(&self, number: u16) -> Result<&'static Parameter, PkwError> {
        let found = Parameter::of(number).filter(|parameter| self.has(parameter));
        found.ok_or(PkwError::Number)
    }

    /// Whether this inverter has the parameter: those of 5.6 need the PosiCon option.
    pub(super) const fn has(&self, parameter: &Parameter) -> bool {
        self.posicon || !parameter.needs_posicon()
    }

    /// The number of elements.
    pub(super) const fn elements(&self, parameter: &Parameter) -> u16 {
        match parameter.number {
            1716 | 1717 => self.properties.position_count as u16,
            _ => parameter.count as u16,
        }
    }

    fn count_of(&self, task: Pkw) -> Result<Answer, PkwError> {
        let parameter = self.known(task.number())?;
        Ok(Answer::Elements(self.elements(parameter)))
    }

    fn index(&self, task: Pkw, parameter: &Parameter) -> Result<Index, PkwError> {
        let bits = self.properties.subindex_bits;
        let mut index = Index::of(parameter, task.ind, bits);
        let unused = if bits == SubindexBits::From7 && !parameter.has(Flag::Set) {
            0x7F
        } else {
            0xFF
        };
        if self.properties.ind_low_byte == IndLowByte::Error3 && task.ind & unused != 0 {
            return Err(PkwError::Index);
        }
        if self.properties.plain_task_subindex == PlainTaskSubindex::Ignored
            && !task.task().is_array()
        {
            index.element = 0;
        }
        if index.element < self.elements(parameter) {
            Ok(index)
        } else {
            Err(PkwError::Index)
        }
    }

    /// The checks after the index; gives the value that a change task is to store.
    fn check(&self, task: Pkw, place: TaskTarget, ppo: PpoType) -> Result<Option<i64>, PkwError> {
        let TaskTarget { parameter, .. } = place;
        let (kind, long) = (task.task(), parameter.has(Flag::Long));
        let changes = kind.is_change();
        if changes && !self.is_writable(parameter) {
            return Err(PkwError::ReadOnly);
        }
        if changes && kind.is_double() != long {
            return Err(match self.properties.width_error {
                WidthError::Task => PkwError::Task,
                WidthError::DataType => PkwError::Other(5),
            });
        }
        let carried = ppo.carries_double_words()
            || self.properties.ppo1_double_words == Ppo1DoubleWords::Allowed;
        if long && !carried {
            return Err(if changes {
                PkwError::Task
            } else {
                PkwError::Reply
            });
        }
        if !changes {
            return Ok(None);
        }
        if self.state.output_on() && !parameter.has(Flag::Online) && parameter.number != 967 {
            return Err(match self.properties.online_error {
                OnlineError::ReadOnly => PkwError::ReadOnly,
                OnlineError::Running => PkwError::Other(17),
            });
        }
        let value = self.carried_value(task, parameter);
        if self.is_within_limits(place, value) {
            Ok(Some(value))
        } else {
            Err(PkwError::Limit)
        }
    }

    fn is_writable(&self, parameter: &Parameter) -> bool {
        match parameter.number {
            967 => self.properties.control_write == ControlWrite::Taken,
            1732 | 1733 => self.properties.position_limit_write == PositionLimitWrite::Taken,
            _ => !parameter.has(Flag::ReadOnly),
        }
    }

    /// The value in PWE of a change task.
    fn carried_value(&self, task: Pkw, parameter: &Parameter) -> i64 {
        let checked = self.properties.pwe1_of_word_task == Pwe1OfWordTask::Checked;
        if checked && !task.task().is_double() {
            i64::from(task.pwe.cast_signed())
        } else {
            parameter.number_of(task.pwe)
        }
    }

    fn is_within_limits(&self, place: TaskTarget, value: i64) -> bool {
        let TaskTarget { parameter, index } = place;
        let limit = |number| i64::from(self.parameters.value(number, index.set));
        let least = match (parameter.number, self.properties.address_range) {
            (1624, AddressRange::From2) => 2,
            _ => parameter.least.resolve(limit),
        };
        (least..=parameter.most.resolve(limit)).contains(&value)
    }

    /// The value, in the form that the task asks for.
    fn value_of(&self, at: Instant, task: Pkw, place: TaskTarget) -> Answer {
        let TaskTarget { parameter, index } = place;
        let raw = parameter
            .raw_of(self.shown(at, parameter, index))
            .unwrap_or(0);
        Answer::value(parameter, task.task().is_array(), raw)
    }

    /// The eight octets of the answer to a task.
    #[must_use]
    pub fn encode(&self, answer: Answer, task: Pkw) -> Pkw {
        let mut pkw = answer.to(task);
        let word = match answer {
            Answer::Word(word) | Answer::ArrayWord(word) => word.cast_signed(),
            _ => 0,
        };
        let signed = Parameter::of(task.number()).is_some_and(Parameter::is_signed);
        if signed && word < 0 && self.properties.negative_pwe1 == NegativePwe1::Extended {
            pkw.pwe |= 0xFFFF_0000;
        }
        pkw
    }

    /// Stores a value, and does what it demands.
    fn change(&mut self, place: TaskTarget, value: i64) {
        let TaskTarget { parameter, index } = place;
        let value = i32::try_from(value).unwrap_or(i32::MAX);
        let before = self.parameters.get(parameter, index);
        let loads = match (parameter.number, self.properties.load_default_value) {
            (970, LoadDefaultValue::Zero) => value == 0,
            (970, LoadDefaultValue::One) | (1602, _) => value == 1,
            (967, _) => {
                self.obey(u16::try_from(value).unwrap_or(0));
                return self.settle();
            }
            _ => false,
        };
        self.parameters.store(parameter, index, value);
        if loads {
            self.parameters = Parameters::default();
        }
        let concerns_module = matches!(parameter.number, 1619 | 1622 | 1624) && value != before;
        self.changed(loads || concerns_module);
    }
}
