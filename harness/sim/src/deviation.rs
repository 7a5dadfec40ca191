//! Named ways to break a manual, for tests that must find them, and the tables of them.

use std::fmt;

/// A way in which a drive or a master breaks the manual or the standard of its bus.
pub struct Deviation<Injection: 'static> {
    /// Its name in files: `sends-16-zeros`.
    pub name: &'static str,
    /// The section, example or appendix item that it breaks: `9.7`.
    pub section: &'static str,
    /// What such a drive or master does.
    pub about: &'static str,
    /// How a right drive or master is made to deviate.
    pub(crate) injection: Injection,
}

impl<Injection> Deviation<Injection> {
    /// A row of a table.
    #[must_use]
    pub const fn new(
        name: &'static str,
        section: &'static str,
        about: &'static str,
        injection: Injection,
    ) -> Self {
        Self {
            name,
            section,
            about,
            injection,
        }
    }

    /// Its name, section and effect in a sentence; `manual` is the document of the section.
    #[must_use]
    pub fn sentence(&self, manual: &str) -> String {
        format!("{} ({manual} {}): {}", self.name, self.section, self.about)
    }
}

impl<Injection> fmt::Debug for Deviation<Injection> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Deviation").field(&self.name).finish()
    }
}

impl<Injection> PartialEq for Deviation<Injection> {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl<Injection> Eq for Deviation<Injection> {}

/// The deviations of the drives or of the masters of a bus, in parts.
pub struct DeviationTable<Injection: 'static>(
    pub(crate) &'static [&'static [Deviation<Injection>]],
);

impl<Injection> DeviationTable<Injection> {
    /// All deviations, in the table's order.
    pub fn all(&self) -> impl Iterator<Item = &'static Deviation<Injection>> + use<Injection> {
        self.0.iter().copied().flatten()
    }

    /// The names of all deviations.
    #[must_use]
    pub fn names(&self) -> Vec<&'static str> {
        self.all().map(|deviation| deviation.name).collect()
    }

    /// The deviation with this name.
    #[must_use]
    pub fn named(&self, name: &str) -> Option<&'static Deviation<Injection>> {
        self.all().find(|deviation| deviation.name == name)
    }
}

/// Rows of a table, each with its variant of `How`, or one variant for all of them.
#[cfg(any(feature = "unitek", feature = "nordac"))]
macro_rules! rows {
    ($injection:ident($way:ident): $($name:literal $section:literal $about:literal $how:expr;)+) => {
        rows! { $injection: $($name $section $about $way $how;)+ }
    };
    ($injection:ident: $($name:literal $section:literal $about:literal $way:ident $($how:expr),+;)+) => {
        &[$(Deviation::new($name, $section, $about, $injection(How::$way($($how),+))),)+]
    };
}
#[cfg(any(feature = "unitek", feature = "nordac"))]
pub(crate) use rows;
