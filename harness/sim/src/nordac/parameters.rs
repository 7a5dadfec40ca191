//! The stored parameters (5.1 to 5.6): one value for each set and element. A change is stored at once and survives power-off (971).

use harness_proto::nordac::pkw::Index;
use harness_proto::nordac::{PARAMETERS, Parameter, Pkw};
use std::sync::Arc;
use std::sync::LazyLock;

/// Where the values of each number begin.
static PLACES: LazyLock<Places> = LazyLock::new(Places::new);

/// A place that no parameter has.
const NOWHERE: u16 = u16::MAX;

/// The layout of the values: all elements of set 1, of set 2, and so on.
struct Places {
    first: Vec<u16>,
    count: usize,
}

impl Places {
    fn new() -> Self {
        let mut first = vec![NOWHERE; usize::from(Pkw::LAST_NUMBER) + 1];
        let mut count = 0;
        for parameter in &PARAMETERS {
            first[usize::from(parameter.number)] = count;
            count += u16::from(parameter.sets()) * u16::from(parameter.count);
        }
        Self {
            first,
            count: usize::from(count),
        }
    }

    fn of(&self, parameter: &Parameter, index: Index) -> Option<usize> {
        let count = u16::from(parameter.count);
        let within = index.element < count && index.set < parameter.sets();
        let place = self.first[usize::from(parameter.number)]
            + u16::from(index.set) * count
            + index.element;
        within.then_some(usize::from(place))
    }
}

/// All values. A copy shares them until one of the two is changed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parameters(Arc<Vec<i32>>);

impl Default for Parameters {
    /// The factory settings.
    fn default() -> Self {
        let mut values = Vec::with_capacity(PLACES.count);
        for parameter in &PARAMETERS {
            let count = usize::from(parameter.sets()) * usize::from(parameter.count);
            values.extend(std::iter::repeat_n(parameter.default, count));
        }
        Self(Arc::new(values))
    }
}

impl Parameters {
    /// A value; 0 for an index that the parameter does not have.
    #[must_use]
    pub fn get(&self, parameter: &Parameter, index: Index) -> i32 {
        PLACES.of(parameter, index).map_or(0, |place| self.0[place])
    }

    /// The first element in a set (0 to 3) of the parameter with this number, which must exist; the set does not count where
    /// the parameter does not depend on it.
    #[must_use]
    pub fn value(&self, number: u16, set: u8) -> i32 {
        let Some(parameter) = Parameter::of(number) else {
            return 0;
        };
        let set = set.min(parameter.sets() - 1);
        self.get(parameter, Index { element: 0, set })
    }

    /// Stores a value; nothing happens for an index that the parameter does not have.
    pub fn store(&mut self, parameter: &Parameter, index: Index, value: i32) {
        if let Some(place) = PLACES.of(parameter, index) {
            Arc::make_mut(&mut self.0)[place] = value;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_has_its_own_place() {
        let mut parameters = Parameters::default();
        let mut all = Vec::new();
        for parameter in &PARAMETERS {
            for set in 0..parameter.sets() {
                for element in 0..u16::from(parameter.count) {
                    let index = Index { element, set };
                    assert_eq!(parameters.get(parameter, index), parameter.default);
                    parameters.store(parameter, index, 20_000 + i32::try_from(all.len()).unwrap());
                    all.push((parameter, index));
                }
            }
        }
        for ((parameter, index), value) in all.iter().zip(20_000..) {
            assert_eq!(
                parameters.get(parameter, *index),
                value,
                "{}",
                parameter.number
            );
        }
        assert_eq!(all.len(), parameters.0.len());
    }

    #[test]
    fn an_index_out_of_range_is_nowhere() {
        let mut parameters = Parameters::default();
        let fmax = Parameter::of(1205).unwrap();
        for index in [Index { element: 1, set: 0 }, Index { element: 0, set: 4 }] {
            parameters.store(fmax, index, 1);
            assert_eq!(parameters.get(fmax, index), 0);
        }
        assert_eq!(parameters, Parameters::default());
        assert_eq!(
            (parameters.value(1205, 3), parameters.value(1621, 3)),
            (700, 0)
        );
    }
}
