//! Tables of text: rows of columns, with the character between them as the first line has it.

use super::super::CaptureError;
use csv::{ByteRecord, Reader, ReaderBuilder};
use std::borrow::Cow;

/// A table that is being read.
pub(super) struct Table<'b> {
    reader: Reader<&'b [u8]>,
    /// The names of the columns.
    pub(super) columns: Vec<String>,
    /// The row, from [`Table::next`].
    record: ByteRecord,
    /// Number of lines before the table.
    above: u64,
}

/// The first line of a text.
pub(super) fn first_line(bytes: &[u8]) -> &str {
    // A heading is no longer than that.
    let start = &bytes[..bytes.len().min(65_536)];
    let line = start.split(|byte| matches!(byte, b'\n' | b'\r')).next();
    let line = line.unwrap_or_default();
    std::str::from_utf8(line).unwrap_or_default()
}

/// The character between the columns of a line: the most frequent of comma, semicolon and tabulator.
fn separator(line: &str) -> u8 {
    let count = |character: u8| line.bytes().filter(|other| *other == character).count();
    // Of equal counts the last wins.
    let most = b"\t;,".iter().max_by_key(|character| count(**character));
    most.copied().unwrap_or(b',')
}

/// The names of the columns of a line; none where it is no text.
pub(super) fn columns(line: &str) -> Vec<String> {
    let mut reader = ReaderBuilder::new()
        .has_headers(false)
        .delimiter(separator(line))
        .from_reader(line.as_bytes());
    let record = reader.records().next().and_then(Result::ok);
    let names = record.iter().flat_map(|record| record.iter());
    names.map(|name| name.trim().to_owned()).collect()
}

impl<'b> Table<'b> {
    /// A table whose first line has the names.
    pub(super) fn new(bytes: &'b [u8]) -> Self {
        let line = first_line(bytes);
        let reader = ReaderBuilder::new()
            .flexible(true)
            .delimiter(separator(line))
            .from_reader(bytes);
        Self {
            reader,
            columns: columns(line),
            record: ByteRecord::new(),
            above: 0,
        }
    }

    /// A table below lines of comments, which begin with `mark`; and those.
    pub(super) fn below(bytes: &'b [u8], mark: u8) -> (Self, Vec<Cow<'b, str>>) {
        let (mut rest, mut comments) = (bytes, Vec::new());
        while rest.first() == Some(&mark) {
            let end = rest.iter().position(|byte| *byte == b'\n');
            let (line, below) = rest.split_at(end.map_or(rest.len(), |end| end + 1));
            comments.push(String::from_utf8_lossy(line.trim_ascii()));
            rest = below;
        }
        let mut table = Self::new(rest);
        table.above = comments.len() as u64;
        (table, comments)
    }

    /// Where a column is, by its name.
    ///
    /// # Errors
    /// There is no column of that name.
    pub(super) fn column(&self, name: &str) -> Result<usize, CaptureError> {
        self.find(name).ok_or_else(|| CaptureError::Link {
            place: "line 1".to_owned(),
            what: format!("no column is named `{name}`"),
        })
    }

    /// Where a column is, by its name.
    pub(super) fn find(&self, name: &str) -> Option<usize> {
        let mut columns = self.columns.iter();
        columns.position(|column| column.eq_ignore_ascii_case(name))
    }

    /// Goes to the next row; `false` after the last one.
    ///
    /// # Errors
    /// The text cannot be read on.
    pub(super) fn next(&mut self) -> Result<bool, CaptureError> {
        self.reader
            .read_byte_record(&mut self.record)
            .map_err(|error| CaptureError::Link {
                place: format!("line {}", self.reader.position().line()),
                what: error.to_string(),
            })
    }

    /// How many fields the row has.
    pub(super) fn fields(&self) -> usize {
        self.record.len()
    }

    /// A field of the row as it is; empty where the row is shorter.
    pub(super) fn raw(&self, column: usize) -> &[u8] {
        self.record.get(column).unwrap_or_default()
    }

    /// A field of the row as a text.
    pub(super) fn text(&self, column: usize) -> Cow<'_, str> {
        String::from_utf8_lossy(self.raw(column))
    }

    /// The line on which the row begins.
    pub(super) fn line(&self) -> usize {
        let line = self.above + self.record.position().map_or(1, csv::Position::line);
        usize::try_from(line).unwrap_or(usize::MAX)
    }

    /// An error in the row.
    pub(super) fn wrong(&self, what: impl Into<String>) -> CaptureError {
        let line = self.line();
        CaptureError::Link {
            place: format!("line {line}"),
            what: what.into(),
        }
    }

    /// An error in a field of the row, which is shown.
    pub(super) fn wrong_field(&self, column: usize, expected: &str) -> CaptureError {
        let shown: String = self.text(column).chars().take(40).collect();
        let name = self.columns.get(column).map_or("", String::as_str);
        self.wrong(format!("`{name}` is {shown:?}: {expected}"))
    }
}
