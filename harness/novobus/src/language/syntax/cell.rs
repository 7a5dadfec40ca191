//! Cells as a scenario names them, and the values that it gives them.

use harness_bench::scenario::expression::Located;
use harness_bench::scenario::pattern::Pattern;
use harness_bench::scenario::problem::TextSpan;
use harness_bench::scenario::quantity::{Quantity, Tolerance};
use harness_proto::nd21::cells::{self, Cell};
use harness_proto::nd21::units::Scale;

/// A place in a drive's RAM, its registers or its EEPROM.
#[derive(Clone, Debug)]
pub struct CellPlace {
    /// The name or the address as written.
    pub name: String,
    pub address: u16,
    /// How much higher the address is, as in `FE10+i`.
    pub offset: Option<Box<Located>>,
    /// The cell that begins there, if one does.
    pub cell: Option<&'static Cell>,
    /// Whether it was written by its name.
    pub named: bool,
    /// Where it stands.
    pub span: TextSpan,
}

impl CellPlace {
    /// The place at an address of the RAM, without a name.
    #[must_use]
    pub fn at(address: u16) -> Self {
        Self {
            name: format!("{address:04X}"),
            address,
            offset: None,
            cell: cells::cell_at(address).filter(|cell| cell.address == address),
            named: false,
            span: TextSpan::default(),
        }
    }

    /// The place at an address of the EEPROM, without a name.
    #[must_use]
    pub(crate) fn in_eeprom(address: u8) -> Self {
        Self {
            name: format!("{address:02X}"),
            address: u16::from(address),
            offset: None,
            cell: None,
            named: false,
            span: TextSpan::default(),
        }
    }

    /// The scale of the number that begins there.
    #[must_use]
    pub fn scale(&self) -> Option<Scale> {
        self.cell?.number()
    }
}

/// A value as written.
#[derive(Clone, Debug)]
pub enum Written {
    Bytes(Pattern),
    /// A number with a unit.
    Number(Quantity),
    /// `off`: a limit that is switched off.
    Off(TextSpan),
}

impl Written {
    /// Where it stands.
    #[must_use]
    pub fn span(&self) -> TextSpan {
        match self {
            Self::Bytes(pattern) => pattern.span,
            Self::Number(number) => number.span,
            Self::Off(span) => *span,
        }
    }
}

/// How a value is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Relation {
    /// `=`
    Equal,
    /// `<`
    Less,
    /// `>`
    Greater,
    /// `<=`
    AtMost,
    /// `>=`
    AtLeast,
}

impl Relation {
    /// As written; what begins as another does comes first.
    pub(crate) const NAMES: [(&'static str, Self); 5] = [
        ("<=", Self::AtMost),
        (">=", Self::AtLeast),
        ("<", Self::Less),
        (">", Self::Greater),
        ("=", Self::Equal),
    ];

    /// Whether it holds between what was found and what is expected.
    #[must_use]
    pub(crate) fn holds<T: PartialOrd>(self, found: T, expected: T) -> bool {
        match self {
            Self::Equal => found == expected,
            Self::Less => found < expected,
            Self::Greater => found > expected,
            Self::AtMost => found <= expected,
            Self::AtLeast => found >= expected,
        }
    }
}

/// What must hold of a cell: `nist = 1500rpm +-1%`, `Flags2 & E0 = 00`, `nist < 100rpm`.
#[derive(Clone, Debug)]
pub struct CellCheck {
    pub place: CellPlace,
    /// The bits that count; all where `None`.
    pub mask: Option<Pattern>,
    /// How it is compared.
    pub relation: Relation,
    pub value: Written,
    /// How far it may be off.
    pub tolerance: Option<Tolerance>,
}
