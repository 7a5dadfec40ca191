//! The ways out of a session.

use super::super::sim;
use super::{Session, come_round};
use crate::gate::guard_rings;
use crate::guard::safe_state;
use crate::rig::sim::RigOfRings;
use crate::simulate::warm;
use harness_bench::guard::Safe;
use harness_bench::link::{Line as _, Link as _};
use harness_bench::rig::{End, Ends, file, standing, state};
use std::io::Write as _;

impl Session {
    /// Takes the rig to its safe state and gives it back.
    #[must_use]
    pub(crate) fn close(mut self) -> End {
        self.end(false)
    }

    /// The same after a rig error or an interlock.
    #[must_use]
    pub(crate) fn close_with_error(mut self) -> End {
        self.end(true)
    }

    /// Gives the rig back with its drives as they are: after what has only looked, or was asked to let motors turn. Where trouble has ended
    /// that, they are taken to their safe state all the same.
    #[must_use]
    pub(crate) fn release(mut self) -> End {
        if let Some(trouble) = self.link.trouble().filter(|_| !self.ended) {
            let error = trouble.is_of_the_bench();
            return self.end(error);
        }
        self.ended = true;
        let mut end = End {
            safe: None,
            power: Vec::new(),
            remarks: Vec::new(),
        };
        self.come_home();
        self.watchdog = None;
        end.remarks = self.around.end(false);
        end
    }

    pub(in super::super) fn end(&mut self, error: bool) -> End {
        let mut end = End {
            safe: None,
            power: Vec::new(),
            remarks: Vec::new(),
        };
        if std::mem::replace(&mut self.ended, true) && !self.rig.is_simulated() {
            return end;
        }
        self.link.clear_the_way();
        if !self.rig.is_simulated() {
            if let Some(ports) = self.link.inner_mut().ports_mut() {
                ports.resume();
            }
            self.link.begin();
            self.link.reset_after_denial();
            let wanted = self.rig.file.safe_state.clone();
            let standing = standing(&wanted);
            if !standing.order.is_empty() {
                end.safe = Some(safe_state(&mut self.link, &self.rings, &standing).into());
            }
            let safe = end.safe.as_ref().is_some_and(|safe| safe.confirmed);
            end.remarks = self.put_back(safe);
            self.come_home();
            self.watchdog = None;
            if wanted.order.contains(&file::SafeStep::PowerOff) {
                end.power = self.around.power_off();
            }
        } else {
            end.safe = self.disobeys();
        }
        end.remarks.extend(self.around.end(error));
        end
    }

    /// How simulated drives with deviations are not brought to their safe state. They have just been switched on: a scenario may
    /// have left the ring cut.
    fn disobeys(&self) -> Option<Safe> {
        let setup = sim::setup(&self.rig);
        if setup.without_deviations() == setup {
            return None;
        }
        let ends = Ends::Simulated(Box::new(warm(&self.rig.plan().ok()?)));
        let mut fresh = guard_rings(ends, self.limits());
        let standing = standing(&self.rig.file.safe_state);
        let safe = Safe::from(safe_state(&mut fresh, &self.rings, &standing));
        (!safe.confirmed).then_some(safe)
    }

    /// Waits until what was sent has come round, and keeps that the rig is left at rest where it is.
    fn come_home(&mut self) {
        come_round(&mut self.link);
        if self.lock.is_none() || !self.link.at_rest() || self.link.busy() {
            return;
        }
        if let Ok(folder) = state::folder() {
            // Where it cannot be kept, the next one sends the check sequence.
            let _unkept = state::left_at_rest(&folder, self.rig.id());
        }
    }
}

impl Drop for Session {
    /// A panic unwinds through here.
    fn drop(&mut self) {
        if !self.ended {
            let end = self.end(true);
            if std::thread::panicking() {
                let _nobody_reads = writeln!(std::io::stderr(), "{end}");
            }
        }
    }
}
