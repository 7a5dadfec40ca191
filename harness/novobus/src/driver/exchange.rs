//! The exchange of process data, a round at a time (ND21 9.4, 14.10.3).

use super::{Axis, Error, OpenRings};
use harness_proto::novobus::master::{CyclePace, Refused};

impl OpenRings<'_> {
    /// Gives these drives their nominal values in one round, and takes their actual values: in the order given. All axes are of one ring.
    ///
    /// # Errors
    /// [`Error::Value`] for axes of two rings or of none, [`Error::Refused`] for one that the ring has not got, [`Error::TimeOut`] and whatever
    /// ends the work of the bus.
    pub(crate) fn exchange(&self, values: &[(Axis, u16)]) -> Result<Vec<u16>, Error> {
        let ring = values.first().map_or(0, |(axis, _)| axis.ring());
        let drives: Vec<u8> = values.iter().map(|(axis, _)| axis.drive()).collect();
        if values.is_empty() || values.iter().any(|(axis, _)| axis.ring() != ring) {
            let text = "process data are exchanged with drives of one ring";
            return Err(Error::Value(text.to_owned()));
        }
        let refused = |refused: Refused| match refused {
            Refused::Stopped(stop) => Error::Stopped(stop),
            other => Error::Refused(other),
        };
        let mut pump = self.lock();
        let end = pump.now() + self.options.patience;
        let no_ring = || Error::Value(format!("the bus has no ring {}", ring + 1));
        let master = pump.master(ring).ok_or_else(no_ring)?;
        let before = master.counters().rounds;
        for (axis, value) in values {
            master.set_nominal(axis.drive(), *value).map_err(refused)?;
        }
        let set = master.set_exchange(&drives, CyclePace::OnRequest);
        set.map_err(refused)?;
        master.start_round();
        pump.speak(ring);
        loop {
            if let Some(halt) = pump.halt() {
                return Err(halt);
            }
            let now = pump.now();
            let master = pump.master(ring).ok_or_else(no_ring)?;
            let done = master.counters().rounds > before;
            if done || now >= end {
                let actual = drives.iter().filter_map(|drive| master.actual(*drive));
                let actual: Vec<u16> = actual.collect();
                master
                    .set_exchange(&[], CyclePace::OnRequest)
                    .map_err(refused)?;
                if done && actual.len() == drives.len() {
                    return Ok(actual);
                }
                return Err(Error::TimeOut {
                    waited: self.options.patience,
                    what: "a round of process data".to_owned(),
                });
            }
            pump.step(end);
        }
    }
}
