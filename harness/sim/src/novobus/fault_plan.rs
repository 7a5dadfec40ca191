//! The faults of a link or of a drive that wait for their byte.

/// Faults waiting for their byte: a list in order of bytes that is used up from the front.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct FaultPlan<F> {
    /// In order of byte numbers, the last one first, so that taking one costs nothing.
    waiting: Vec<(u64, F)>,
}

impl<F> Default for FaultPlan<F> {
    fn default() -> Self {
        Self {
            waiting: Vec::new(),
        }
    }
}

impl<F: Copy> FaultPlan<F> {
    /// Adds a fault at byte `byte`, behind those already there for the same byte.
    pub(crate) fn add(&mut self, byte: u64, fault: F) {
        let place = self.waiting.partition_point(|(at, _)| *at > byte);
        self.waiting.insert(place, (byte, fault));
    }

    /// Forgets all of them.
    pub(crate) fn clear(&mut self) {
        self.waiting.clear();
    }

    /// The next fault at or before byte `byte`.
    #[inline]
    pub(crate) fn take(&mut self, byte: u64) -> Option<F> {
        if self.waiting.last()?.0 > byte {
            return None;
        }
        self.waiting.pop().map(|(_, fault)| fault)
    }

    /// Faults whose byte has not come yet.
    pub(crate) fn waiting(&self) -> impl Iterator<Item = (u64, F)> + '_ {
        self.waiting.iter().rev().copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plan_gives_faults_in_order_of_bytes_and_of_lines() {
        let mut plan = FaultPlan::default();
        for (byte, fault) in [(5, 'c'), (2, 'a'), (9, 'e'), (2, 'b'), (5, 'd')] {
            plan.add(byte, fault);
        }
        let mut taken = String::new();
        for byte in 1..10 {
            while let Some(fault) = plan.take(byte) {
                taken.push(fault);
            }
        }
        assert_eq!(taken, "abcde");
    }
}
