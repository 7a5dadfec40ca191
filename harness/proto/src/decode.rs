//! What a decoder answers: it accepts every byte string and never panics.

/// The three answers of a decoder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Decoded<T, E> {
    /// The bytes are the beginning of something whole.
    NeedMore,
    /// A value, and how many bytes it took.
    Value {
        /// The value.
        value: T,
        /// Bytes used, counted from the first.
        used: usize,
    },
    /// The bytes are not, and never become, a value.
    Bad {
        /// Why not.
        reason: E,
        /// The index, from 0, of the byte that settled it.
        offset: usize,
    },
}

impl<T, E> Decoded<T, E> {
    /// The value, if there is one.
    pub fn value(self) -> Option<T> {
        match self {
            Self::Value { value, .. } => Some(value),
            Self::NeedMore | Self::Bad { .. } => None,
        }
    }
}
