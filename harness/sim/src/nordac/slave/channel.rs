//! The parameter channel: when a task is executed and when its answer is there (NORDAC 3.4.1, 4.1.1).

use super::super::inverter::Inverter;
use harness_proto::nordac::properties::TaskNewWhen;
use harness_proto::nordac::{Answer, Pkw, PpoType, Properties};
use harness_proto::time::Instant;

/// A task that was executed, and what the inverter answered then.
#[derive(Clone, Copy, Debug, Hash)]
struct ExecutedTask {
    task: Pkw,
    answer: Answer,
}

/// The parameter channel of a slave.
#[derive(Clone, Debug, Default, Hash)]
pub(super) struct PkwChannel {
    /// What the last exchange has brought.
    last: Pkw,
    /// The task whose answer is shown.
    shown: Option<ExecutedTask>,
    /// The task whose answer is not there yet, and in how many exchanges it will be.
    due: Option<(ExecutedTask, u8)>,
}

impl PkwChannel {
    /// An exchange begins: an answer that is due with it is shown from now on.
    pub(super) fn turn(&mut self) {
        if let Some((executed, exchanges)) = &mut self.due {
            *exchanges = exchanges.saturating_sub(1);
            if *exchanges == 0 {
                self.shown = Some(*executed);
                self.due = None;
            }
        }
    }

    /// The answer that is shown, with the current value of what was asked for.
    pub(super) fn answer(&self, at: Instant, inverter: &Inverter, ppo: PpoType) -> Pkw {
        let Some(ExecutedTask { task, answer }) = self.shown else {
            return Pkw::default();
        };
        let is_fixed = matches!(
            answer,
            Answer::None | Answer::Error(_) | Answer::Elements(_)
        );
        let now = if is_fixed {
            answer
        } else {
            inverter.current(at, task, ppo)
        };
        inverter.encode(now, task)
    }

    /// Takes what an exchange has brought, and executes the task if it is new.
    pub(super) fn take(
        &mut self,
        at: Instant,
        task: Pkw,
        inverter: &mut Inverter,
        ppo: PpoType,
        properties: &Properties,
    ) {
        let former = std::mem::replace(&mut self.last, task);
        let is_new = match properties.task_new_when {
            TaskNewWhen::AnyByte => task != former,
            TaskNewWhen::PkeOrInd => (task.pke, task.ind) != (former.pke, former.ind),
        };
        if is_new {
            let answer = inverter.task(at, task, ppo);
            self.due = Some((ExecutedTask { task, answer }, properties.pkw_latency));
        }
    }
}
