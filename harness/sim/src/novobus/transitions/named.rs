//! Enums of which each variant has a section of the manual and a name in its words.

/// An enum without data, its variants with section and name; `ALL`, `name`, `section`, `from_name`, `index`.
macro_rules! named {
    ($(#[$about:meta])* $name:ident { $($variant:ident = $section:literal, $text:literal;)* }) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        pub enum $name {
            $(#[doc = concat!($text, " (ND21 ", $section, ").")] $variant,)*
        }

        impl $name {
            /// All of them, in order.
            pub const ALL: &'static [Self] = &[$(Self::$variant),*];

            /// The name, in the manual's words.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $(Self::$variant => $text),* }
            }

            /// The section of the ND21 manual with the rule.
            #[must_use]
            pub const fn section(self) -> &'static str {
                match self { $(Self::$variant => $section),* }
            }

            /// The one with this name.
            #[must_use]
            pub fn from_name(name: &str) -> Option<Self> {
                Self::ALL.iter().copied().find(|one| one.name() == name)
            }

            /// Its place in [`Self::ALL`].
            #[must_use]
            pub const fn index(self) -> usize {
                self as usize
            }
        }
    };
}

pub(super) use named;
