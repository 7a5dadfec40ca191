//! Reads one line from left to right and remembers the place of everything.

use super::problem::{Problem, Spanned, TextSpan};

/// A line without its comment.
#[derive(Clone, Debug)]
pub struct Scanner<'a> {
    text: &'a str,
    /// Where the line starts in the file.
    offset: usize,
    at: usize,
}

impl<'a> Scanner<'a> {
    /// A scanner for the line that starts at `offset`; a `#` begins a comment.
    pub fn new(line: &'a str, offset: usize) -> Self {
        Self::up_to(line, line.find('#'), offset)
    }

    /// A scanner for the line that starts at `offset`, with a comment from a place in it on.
    pub fn up_to(line: &'a str, comment: Option<usize>, offset: usize) -> Self {
        let text = comment.map_or(line, |at| &line[..at]);
        Self {
            text: text.trim_end(),
            offset,
            at: 0,
        }
    }

    pub(crate) fn skip_space(&mut self) {
        let rest = &self.text[self.at..];
        // Most places have none.
        if !rest.as_bytes().first().is_some_and(u8::is_ascii_graphic) {
            self.at += rest.len() - rest.trim_start().len();
        }
    }

    /// Whether nothing but white space is left.
    pub fn at_end(&mut self) -> bool {
        self.skip_space();
        self.at == self.text.len()
    }

    /// The rest of the line without leading white space.
    pub fn rest(&mut self) -> &'a str {
        self.skip_space();
        &self.text[self.at..]
    }

    /// The rest of the line with leading white space.
    pub fn tight(&self) -> &'a str {
        &self.text[self.at..]
    }

    pub fn peek(&mut self) -> Option<char> {
        self.rest().chars().next()
    }

    /// The position of the scanner; one character wide, or empty at the end.
    pub fn here(&mut self) -> TextSpan {
        let width = self.peek().map_or(0, char::len_utf8);
        let start = self.offset + self.at;
        TextSpan {
            start,
            end: start + width,
        }
    }

    /// The span from `from` to the position of the scanner.
    pub fn since(&self, from: TextSpan) -> TextSpan {
        TextSpan {
            start: from.start,
            end: self.offset + self.text[..self.at].trim_end().len(),
        }
    }

    /// A scanner at the same position of a line that ends before the first of these tokens; [`Self::go_on`] returns from it.
    pub fn before(&self, tokens: &[&str]) -> Self {
        let rest = &self.text[self.at..];
        let ends = tokens.iter().filter_map(|token| rest.find(token));
        let end = ends.min().unwrap_or(rest.len());
        Self {
            text: &self.text[..self.at + rest[..end].trim_end().len()],
            ..self.clone()
        }
    }

    /// Continues at the position of a scanner from [`Self::before`].
    pub fn go_on(&mut self, from: &Self) {
        self.at = from.at;
    }

    /// Takes `token` if it comes next.
    pub fn eat(&mut self, token: &str) -> bool {
        if self.rest().starts_with(token) {
            self.at += token.len();
            true
        } else {
            false
        }
    }

    /// Takes the word `word` if it comes next as a whole word.
    pub fn eat_word(&mut self, word: &str) -> bool {
        let before = self.clone();
        if self
            .word()
            .is_some_and(|found| found.value.eq_ignore_ascii_case(word))
        {
            return true;
        }
        *self = before;
        false
    }

    /// Takes the next characters as long as `wanted` accepts them; `None` if there are none.
    pub fn take_while(&mut self, wanted: impl Fn(char) -> bool) -> Option<Spanned<&'a str>> {
        let rest = self.rest();
        let length = rest.find(|c| !wanted(c)).unwrap_or(rest.len());
        if length == 0 {
            return None;
        }
        let start = self.offset + self.at;
        self.at += length;
        Some(Spanned {
            value: &rest[..length],
            span: TextSpan {
                start,
                end: start + length,
            },
        })
    }

    /// Takes a word: letters, with digits, `-` and `_` in it.
    pub fn word(&mut self) -> Option<Spanned<&'a str>> {
        if !self.peek().is_some_and(|c| c.is_ascii_alphabetic()) {
            return None;
        }
        self.take_while(|c| c.is_ascii_alphanumeric() || c == '-' || c == '_')
    }

    /// Takes everything up to the next white space, for a message.
    pub fn chunk(&mut self) -> Spanned<&'a str> {
        let here = self.here();
        self.take_while(|c| !c.is_whitespace()).unwrap_or(Spanned {
            value: "",
            span: here,
        })
    }

    /// A mistake at this position, where `expected` should be.
    pub fn unexpected(&mut self, expected: &str) -> Problem {
        let mut ahead = self.clone();
        let found = ahead.chunk();
        let message = if found.value.is_empty() {
            format!("{expected} is missing at the end of the line")
        } else {
            format!("`{}` is not valid here", found.value)
        };
        Problem::new(found.span, message, format!("{expected} expected here"))
    }

    /// Nothing more may follow.
    pub fn expect_end(&mut self) -> Result<(), Problem> {
        if self.at_end() {
            return Ok(());
        }
        let here = self.here();
        let rest = self.rest();
        let span = TextSpan {
            start: here.start,
            end: here.start + rest.len(),
        };
        Err(Problem::new(
            span,
            format!("`{rest}` follows a line that is complete"),
            "the end of the line expected here",
        ))
    }
}
