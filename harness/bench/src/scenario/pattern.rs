//! Bytes in a scenario: `88 FB`, `1234`, `80*12`, `xx`, `(2-N)`, `[EC 63]*3`.

use super::expression::{self, Expression, Located, Scope};
use super::problem::{Problem, TextSpan};
use super::run::record::from_hex;
use super::scanner::Scanner;
use std::fmt::{self, Display};

/// The most bytes that the lines of one scenario may send, and that they may expect.
pub const MAX_BYTES: usize = 4_000_000;

/// The most cells that one line may speak of: more than a drive has.
pub const MAX_CELLS: usize = 1024;

/// How deep brackets may nest.
const MAX_DEPTH: u32 = 8;

/// One byte of a pattern.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Expected {
    Byte(u8),
    /// `xx`: any byte.
    Any,
    /// The -checksum over this many bytes before it (ND21 9.6).
    MinusChecksum(u8),
}

impl fmt::Display for Expected {
    /// As a scenario and as reports write it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Byte(byte) => write!(f, "{byte:02X}"),
            Self::Any => f.write_str("xx"),
            Self::MinusChecksum(_) => f.write_str("-checksum"),
        }
    }
}

/// An item of a list of bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Item {
    what: ItemKind,
    times: Option<Located>,
    span: TextSpan,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum ItemKind {
    Bytes(Vec<Expected>),
    Number(Located),
    Group(Vec<Item>),
}

/// A list of bytes as written, for a ring of any size.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pattern {
    items: Vec<Item>,
    pub span: TextSpan,
}

impl fmt::Display for Pattern {
    /// As the language writes it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write_items(f, &self.items)
    }
}

fn write_items(f: &mut fmt::Formatter<'_>, items: &[Item]) -> fmt::Result {
    for (index, item) in items.iter().enumerate() {
        if index > 0 {
            f.write_str(" ")?;
        }
        match &item.what {
            ItemKind::Bytes(bytes) => bytes.iter().try_for_each(|byte| byte.fmt(f))?,
            ItemKind::Number(number) => write!(f, "({number})")?,
            ItemKind::Group(items) => {
                f.write_str("[")?;
                write_items(f, items)?;
                f.write_str("]")?;
            }
        }
        match item.times.as_ref().map(|times| &times.expression) {
            None => {}
            Some(times @ (Expression::Number(_) | Expression::Size | Expression::Last)) => {
                write!(f, "*{times}")?;
            }
            Some(times) => write!(f, "*({times})")?,
        }
    }
    Ok(())
}

impl Pattern {
    /// These bytes. A run of at least `run` equal ones becomes one item, such as `80*12`.
    #[must_use]
    pub fn of(bytes: &[Expected], run: usize) -> Self {
        let item = |byte: &Expected, times| Item {
            what: ItemKind::Bytes(vec![*byte]),
            times,
            span: TextSpan::default(),
        };
        let mut items = Vec::new();
        for equal in bytes.chunk_by(|byte, next| byte == next) {
            match (equal, i64::try_from(equal.len())) {
                ([byte, ..], Ok(times)) if equal.len() >= run => {
                    items.push(item(byte, Some(Located::number(times))));
                }
                _ => items.extend(equal.iter().map(|byte| item(byte, None))),
            }
        }
        Self {
            items,
            span: TextSpan::default(),
        }
    }

    /// The same bytes on several lines, with at most `most` items each.
    #[must_use]
    pub fn lines(&self, most: usize) -> Vec<Self> {
        let lines = self.items.chunks(most);
        let line = |items: &[Item]| Self {
            items: items.to_vec(),
            span: self.span,
        };
        lines.map(line).collect()
    }

    /// The bytes in this scope; `most` of them at most.
    ///
    /// # Errors
    /// A number is no byte, or the bytes are too many.
    pub fn expand(&self, scope: Scope, most: usize) -> Result<Vec<Expected>, Problem> {
        let mut bytes = Vec::new();
        expand(&self.items, scope, most, &mut bytes)?;
        Ok(bytes)
    }

    /// The same, where every byte must be known.
    ///
    /// # Errors
    /// As [`Self::expand`], and for `xx`.
    pub fn expand_known(&self, scope: Scope, most: usize) -> Result<Vec<u8>, Problem> {
        self.expand(scope, most)?
            .into_iter()
            .map(|byte| match byte {
                Expected::Byte(byte) => Ok(byte),
                Expected::Any | Expected::MinusChecksum(_) => Err(Problem::new(
                    self.span,
                    "`xx` (any byte) is not allowed where every byte must be known",
                    "`xx` can only be received",
                )),
            })
            .collect()
    }
}

fn expand(
    items: &[Item],
    scope: Scope,
    most: usize,
    bytes: &mut Vec<Expected>,
) -> Result<(), Problem> {
    for item in items {
        let times = match &item.times {
            None => 1,
            Some(times) => {
                let value = times.value(scope)?;
                usize::try_from(value).map_err(|_| {
                    Problem::new(
                        item.span,
                        format!("a repeat count of {value} is not possible"),
                        "0 or more expected here",
                    )
                })?
            }
        };
        if times == 0 {
            continue;
        }
        let before = bytes.len();
        match &item.what {
            ItemKind::Bytes(known) => bytes.extend(known),
            ItemKind::Number(number) => bytes.push(Expected::Byte(low_byte(number, scope)?)),
            ItemKind::Group(items) => expand(items, scope, most, bytes)?,
        }
        let length = bytes.len() - before;
        if length.saturating_mul(times).saturating_add(before) > most {
            return Err(Problem::new(
                item.span,
                format!("more than {most} bytes in one line"),
                "fewer bytes expected here",
            ));
        }
        let more = if length == 0 { 0 } else { times - 1 };
        for _ in 0..more {
            bytes.extend_from_within(before..before + length);
        }
    }
    Ok(())
}

/// `(2-N)` is a byte mod 256, as address bytes are (ND21 9.3).
fn low_byte(number: &Located, scope: Scope) -> Result<u8, Problem> {
    let value = number.value(scope)?;
    if !(-255..=255).contains(&value) {
        return Err(Problem::new(
            number.span,
            format!("{value} is not a byte"),
            "a number between -255 and 255 expected here",
        ));
    }
    let [low, ..] = value.to_le_bytes();
    Ok(low)
}

/// Reads bytes up to the end of the line or to anything else.
pub fn pattern(scanner: &mut Scanner<'_>) -> Result<Pattern, Problem> {
    let here = scanner.here();
    let items = items(scanner, 0)?;
    if items.is_empty() {
        return Err(scanner.unexpected("a byte such as 88"));
    }
    Ok(Pattern {
        items,
        span: scanner.since(here),
    })
}

fn items(scanner: &mut Scanner<'_>, depth: u32) -> Result<Vec<Item>, Problem> {
    let mut items = Vec::new();
    while let Some(next) = scanner.peek() {
        if matches!(next, ']' | ';') {
            break;
        }
        let here = scanner.here();
        let what = if next == '(' {
            scanner.eat("(");
            let number = expression::sum(scanner)?;
            if !scanner.eat(")") {
                return Err(scanner.unexpected("`)`"));
            }
            ItemKind::Number(number)
        } else if next == '[' {
            if depth == MAX_DEPTH {
                return Err(scanner.unexpected("a byte (brackets nest too deep)"));
            }
            scanner.eat("[");
            let inner = self::items(scanner, depth + 1)?;
            if !scanner.eat("]") {
                return Err(scanner.unexpected("`]`"));
            }
            ItemKind::Group(inner)
        } else {
            ItemKind::Bytes(literal(scanner)?)
        };
        let times = if scanner.eat("*") {
            Some(count(scanner)?)
        } else {
            None
        };
        // Brackets that nothing is counted of only say that these are bytes.
        let what = match what {
            ItemKind::Group(inner) if times.is_none() && !inner.is_empty() => {
                items.extend(inner);
                continue;
            }
            what => what,
        };
        items.push(Item {
            what,
            times,
            span: scanner.since(here),
        });
    }
    Ok(items)
}

/// How many times: a plain number, `N`, `last`, or arithmetic in parentheses.
fn count(scanner: &mut Scanner<'_>) -> Result<Located, Problem> {
    let here = scanner.here();
    if scanner.eat("(") {
        let number = expression::sum(scanner)?;
        if !scanner.eat(")") {
            return Err(scanner.unexpected("`)`"));
        }
        return Ok(number);
    }
    let mut ahead = scanner.clone();
    let word = ahead.take_while(|c| c.is_ascii_alphanumeric());
    let expression = match word.map(|word| word.value) {
        Some("N") => Expression::Size,
        Some("last") => Expression::Last,
        Some(digits) => match digits.parse() {
            Ok(number) => Expression::Number(number),
            Err(_) => return Err(scanner.unexpected("a repeat count such as 17")),
        },
        None => return Err(scanner.unexpected("a repeat count such as 17")),
    };
    *scanner = ahead;
    Ok(Located {
        expression,
        span: scanner.since(here),
    })
}

/// `88`, `1234` (two bytes) or `xx`.
fn literal(scanner: &mut Scanner<'_>) -> Result<Vec<Expected>, Problem> {
    let before = scanner.clone();
    let Some(word) = scanner.take_while(|c| c.is_ascii_alphanumeric()) else {
        return Err(scanner.unexpected("a byte of two hexadecimal digits"));
    };
    let text = word.value;
    if text.eq_ignore_ascii_case("xx") {
        return Ok(vec![Expected::Any]);
    }
    if let Some(position) = text.find(|c: char| !c.is_ascii_hexdigit()) {
        *scanner = before;
        let problem = scanner.unexpected("a byte of two hexadecimal digits");
        let hint = if text.starts_with("0x") || text.starts_with("0X") {
            Some("bytes are written without 0x, as in the manual: 88".to_owned())
        } else if text[position..].starts_with(['o', 'O']) {
            Some(format!("did you mean `{}`?", text.replace(['o', 'O'], "0")))
        } else {
            None
        };
        return Err(match hint {
            Some(hint) => problem.help(hint),
            None => problem,
        });
    }
    if text.len() % 2 == 1 {
        return Err(Problem::new(
            word.span,
            format!("`{text}` has an odd number of digits"),
            "two hexadecimal digits a byte expected here",
        )
        .help(format!("did you mean `0{text}`?")));
    }
    let bytes = from_hex(text).unwrap_or_default();
    Ok(bytes.into_iter().map(Expected::Byte).collect())
}
