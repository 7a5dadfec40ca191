//! Named properties for what a manual leaves open: their values and words.

/// One row an open point with words for values: the enum with its values (the default first) and their words.
macro_rules! words {
    ($($(#[$meta:meta])* $name:ident { $($(#[$value_meta:meta])* $value:ident $word:literal,)+ })+) => {
        $(
            $(#[$meta])*
            #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
            pub enum $name {
                $(
                    #[doc = concat!("`", $word, "`.")]
                    $(#[$value_meta])*
                    $value,
                )+
            }

            impl $name {
                /// The words of all values, in the order of the values.
                pub const WORDS: &'static [&'static str] = &[$($word),+];

                /// The value with this word.
                #[must_use]
                pub fn from_word(word: &str) -> Option<Self> {
                    match word {
                        $($word => Some(Self::$value),)+
                        _ => None,
                    }
                }

                /// The word of this value.
                #[must_use]
                pub const fn word(self) -> &'static str {
                    match self {
                        $(Self::$value => $word,)+
                    }
                }
            }
        )+
    };
}

pub(crate) use words;
