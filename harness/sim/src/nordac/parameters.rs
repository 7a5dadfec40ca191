//! The stored parameters (5.1 to 5.6): one value for each set and element. A change is stored at once and survives power-off (971).

use harness_proto::nordac::pkw::Index;
use harness_proto::nordac::{PARAMETERS, Parameter, Pkw};
use std::hash::{Hash, Hasher};
use std::sync::Arc;
use std::sync::LazyLock;

/// Where the values of each parameter stand, by its number.
static PLACES: LazyLock<Places> = LazyLock::new(Places::new);

/// The values of one parameter: all elements of set 1, of set 2, and so on.
#[derive(Clone, Copy, Default)]
struct Extent {
    first: u16,
    /// Number of elements; 0 where no parameter has the number.
    elements: u16,
    sets: u8,
}

/// The layout of the values.
struct Places {
    of: Vec<Extent>,
    count: usize,
}

impl Places {
    fn new() -> Self {
        let mut of = vec![Extent::default(); usize::from(Pkw::LAST_NUMBER) + 1];
        let mut count = 0;
        for parameter in &PARAMETERS {
            let place = Extent {
                first: count,
                elements: parameter.count.into(),
                sets: parameter.sets(),
            };
            count += u16::from(place.sets) * place.elements;
            of[usize::from(parameter.number)] = place;
        }
        Self {
            of,
            count: usize::from(count),
        }
    }

    /// The values of a number; none where no parameter has it.
    fn of(number: u16) -> Extent {
        let place = PLACES.of.get(usize::from(number));
        place.copied().unwrap_or_default()
    }
}

impl Extent {
    fn at(self, index: Index) -> Option<usize> {
        let within = index.element < self.elements && index.set < self.sets;
        within.then(|| {
            let place = self.first + u16::from(index.set) * self.elements + index.element;
            usize::from(place)
        })
    }
}

/// All values. A copy shares them until one of the two is changed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parameters {
    values: Arc<[i32]>,
    /// A checksum of what differs from the factory settings.
    sum: u64,
}

impl Hash for Parameters {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.sum.hash(state);
    }
}

impl Default for Parameters {
    /// The factory settings.
    fn default() -> Self {
        let mut values = Vec::with_capacity(PLACES.count);
        for parameter in &PARAMETERS {
            let count = usize::from(parameter.sets()) * usize::from(parameter.count);
            values.extend(std::iter::repeat_n(parameter.default, count));
        }
        Self {
            values: values.into(),
            sum: 0,
        }
    }
}

impl Parameters {
    /// A value; 0 for an index that the parameter does not have.
    #[must_use]
    pub fn get(&self, parameter: &Parameter, index: Index) -> i32 {
        let place = Places::of(parameter.number).at(index);
        place.map_or(0, |place| self.values[place])
    }

    /// The first element in a set (0 to 3) of the parameter with this number; the set does not count where the parameter does not depend
    /// on it. 0 where there is no such parameter.
    #[must_use]
    pub fn value(&self, number: u16, set: u8) -> i32 {
        let place = Places::of(number);
        let set = set.min(place.sets.saturating_sub(1));
        let place = place.at(Index { element: 0, set });
        place.map_or(0, |place| self.values[place])
    }

    /// Stores a value; nothing happens for an index that the parameter does not have.
    pub fn store(&mut self, parameter: &Parameter, index: Index, value: i32) {
        if let Some(place) = Places::of(parameter.number).at(index) {
            let cell = &mut Arc::make_mut(&mut self.values)[place];
            self.sum ^= mixed(place, *cell) ^ mixed(place, value);
            *cell = value;
        }
    }
}

/// A number that stands for a value at its place.
fn mixed(place: usize, value: i32) -> u64 {
    let both = (place as u64) << 32 | u64::from(value.cast_unsigned());
    let mixed = (both ^ both >> 29).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    (mixed ^ mixed >> 32).wrapping_mul(0x94D0_49BB_1331_11EB)
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
        assert_eq!(all.len(), parameters.values.len());
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
