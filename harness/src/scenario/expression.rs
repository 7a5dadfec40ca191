//! Arithmetic over the ring's size, so that one file serves rings of any size: `N-1`, `last`, `N/2+1`.

use super::problem::{Problem, Span};
use super::scanner::Scanner;

/// How deep parentheses may nest.
const MAX_DEPTH: u32 = 32;
/// How many terms a sum, or factors a product, may have.
const MAX_TERMS: usize = 32;

/// A number that may depend on N, the number of drives in the ring.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Expression {
    /// A number.
    Number(i64),
    /// `N`: how many drives the ring has.
    Size,
    /// `last`: N-1, the highest drive number.
    Last,
    /// Two numbers and what is done with them.
    Operation(Box<Expression>, Operator, Box<Expression>),
}

/// What can be done with two numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operator {
    /// `+`
    Add,
    /// `-`
    Subtract,
    /// `*`
    Multiply,
    /// `/`, the rest thrown away
    Divide,
    /// `%`, the rest
    Remainder,
}

/// An expression with its place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Located {
    /// The number.
    pub expression: Expression,
    /// Where it stands.
    pub span: Span,
}

impl Located {
    /// The value in a ring of `size` drives.
    ///
    /// # Errors
    /// The number has no value: a division by zero, or too large.
    pub fn value(&self, size: i64) -> Result<i64, Problem> {
        self.expression.value(size).ok_or_else(|| {
            Problem::new(
                self.span,
                "the number has no value: a division by zero, or too large",
                "this number",
            )
        })
    }

    /// A number that stands nowhere.
    #[must_use]
    pub const fn number(value: i64) -> Self {
        Self {
            expression: Expression::Number(value),
            span: Span { start: 0, end: 0 },
        }
    }
}

impl Expression {
    fn value(&self, size: i64) -> Option<i64> {
        match self {
            Self::Number(number) => Some(*number),
            Self::Size => Some(size),
            Self::Last => size.checked_sub(1),
            Self::Operation(left, operator, right) => {
                let (left, right) = (left.value(size)?, right.value(size)?);
                match operator {
                    Operator::Add => left.checked_add(right),
                    Operator::Subtract => left.checked_sub(right),
                    Operator::Multiply => left.checked_mul(right),
                    Operator::Divide => left.checked_div(right),
                    Operator::Remainder => left.checked_rem(right),
                }
            }
        }
    }
}

/// Reads a number without arithmetic.
pub(super) fn plain(scanner: &mut Scanner<'_>) -> Result<i64, Problem> {
    let mut ahead = scanner.clone();
    let digits = ahead.take_while(|c| c.is_ascii_digit());
    match digits.and_then(|digits| digits.value.parse().ok()) {
        Some(number) => {
            *scanner = ahead;
            Ok(number)
        }
        None => Err(scanner.unexpected("a number such as 1024")),
    }
}

/// Reads a sum.
pub(super) fn sum(scanner: &mut Scanner<'_>) -> Result<Located, Problem> {
    let here = scanner.here();
    let expression = sum_at(scanner, 0)?;
    Ok(Located {
        expression,
        span: scanner.since(here),
    })
}

fn sum_at(scanner: &mut Scanner<'_>, depth: u32) -> Result<Expression, Problem> {
    let mut left = product_at(scanner, depth)?;
    for _ in 0..MAX_TERMS {
        // `98->97` is a link, not a subtraction.
        let operator = if scanner.rest().starts_with("->") {
            return Ok(left);
        } else if scanner.eat("+") {
            Operator::Add
        } else if scanner.eat("-") {
            Operator::Subtract
        } else {
            return Ok(left);
        };
        let right = product_at(scanner, depth)?;
        left = Expression::Operation(Box::new(left), operator, Box::new(right));
    }
    Err(scanner.unexpected("a sum of fewer terms"))
}

fn product_at(scanner: &mut Scanner<'_>, depth: u32) -> Result<Expression, Problem> {
    let mut left = factor_at(scanner, depth)?;
    for _ in 0..MAX_TERMS {
        let operator = if scanner.eat("*") {
            Operator::Multiply
        } else if scanner.eat("/") {
            Operator::Divide
        } else if scanner.eat("%") {
            Operator::Remainder
        } else {
            return Ok(left);
        };
        let right = factor_at(scanner, depth)?;
        left = Expression::Operation(Box::new(left), operator, Box::new(right));
    }
    Err(scanner.unexpected("a product of fewer factors"))
}

fn factor_at(scanner: &mut Scanner<'_>, depth: u32) -> Result<Expression, Problem> {
    if depth > MAX_DEPTH {
        return Err(scanner.unexpected("a number with fewer parentheses"));
    }
    if scanner.eat("(") {
        let inner = sum_at(scanner, depth + 1)?;
        if !scanner.eat(")") {
            return Err(scanner.unexpected("`)`"));
        }
        return Ok(inner);
    }
    let before = scanner.clone();
    if let Some(digits) = scanner.take_while(|c| c.is_ascii_digit()) {
        return match digits.value.parse() {
            Ok(number) => Ok(Expression::Number(number)),
            Err(_) => Err(Problem::new(
                digits.span,
                format!("{} is too large", digits.value),
                "a smaller number expected here",
            )),
        };
    }
    if let Some(name) = scanner.take_while(|c| c.is_ascii_alphabetic()) {
        return match name.value {
            "N" => Ok(Expression::Size),
            "last" => Ok(Expression::Last),
            other => {
                *scanner = before;
                Err(scanner
                    .unexpected("a number, `N` or `last`")
                    .did_you_mean(other, &["N", "last"]))
            }
        };
    }
    Err(scanner.unexpected("a number, `N` or `last`"))
}
