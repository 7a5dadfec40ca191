//! Calls of generic lines that are compiled with this crate, which is optimised, and not with the bench, which is not: most of the time of a
//! simulated conversation passes in them.

/// Gives lines with these stations `run_to` and `next_due`, which do what `run_until` and `next_event` do.
macro_rules! compiled_here {
    ($($line:ty),+) => {$(
        impl $line {
            /// Runs until `to`, as `run_until` does.
            #[inline(never)]
            pub fn run_to(&mut self, to: harness_proto::time::Instant) {
                self.run_until(to);
            }

            /// When something happens next, as `next_event` says.
            #[inline(never)]
            #[must_use]
            pub fn next_due(&self) -> Option<harness_proto::time::Instant> {
                self.next_event()
            }
        }
    )+};
}

pub(crate) use compiled_here;
