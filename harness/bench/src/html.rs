//! The writer of a page. Names of elements and attributes are the program's own words, and everything else is text: it goes
//! through [`Html::text`] or into an attribute, and both escape it. There is no other way into a page.

use serde::Serialize;
use sha2::{Digest, Sha256};
use std::fmt::{self, Display, Write as _};

/// A name and the value of an attribute.
pub type Attribute<'a> = (&'static str, &'a dyn Display);

/// A page, or a part of one, that is being written.
#[derive(Clone, Debug, Default)]
pub struct Html {
    out: String,
}

impl Html {
    /// Nothing yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// An element with its content.
    pub fn element(
        &mut self,
        name: &'static str,
        attributes: &[Attribute<'_>],
        inside: impl FnOnce(&mut Self),
    ) {
        self.open(name, attributes, ">");
        inside(self);
        self.out.push_str("</");
        self.out.push_str(name);
        self.out.push_str(">\n");
    }

    /// An element with a text in it.
    pub fn line(&mut self, name: &'static str, attributes: &[Attribute<'_>], text: impl Display) {
        self.element(name, attributes, |html| html.text(text));
    }

    /// An element without content, as HTML writes it (`meta`).
    pub(crate) fn void(&mut self, name: &'static str, attributes: &[Attribute<'_>]) {
        self.open(name, attributes, ">\n");
    }

    /// An element of a picture without content (`<path/>`).
    pub fn shape(&mut self, name: &'static str, attributes: &[Attribute<'_>]) {
        self.open(name, attributes, "/>\n");
    }

    fn open(&mut self, name: &'static str, attributes: &[Attribute<'_>], end: &str) {
        self.out.push('<');
        self.out.push_str(name);
        for (name, value) in attributes {
            self.out.push(' ');
            self.out.push_str(name);
            self.out.push_str("=\"");
            self.text(value);
            self.out.push('"');
        }
        self.out.push_str(end);
    }

    /// Something that may be larger than the window: it scrolls by itself, also by keys.
    pub fn scroll(&mut self, label: &str, inside: impl FnOnce(&mut Self)) {
        let attributes: [Attribute<'_>; 4] = [
            ("class", &"scroll"),
            ("tabindex", &"0"),
            ("role", &"group"),
            ("aria-label", &label),
        ];
        self.element("div", &attributes, inside);
    }

    /// A picture of this size in pixels, with a title and a description for screen readers; their ids begin with `id`.
    pub fn picture(
        &mut self,
        id: &str,
        (width, height): (usize, usize),
        title: &dyn Display,
        description: &str,
        inside: impl FnOnce(&mut Self),
    ) {
        let view = format!("0 0 {width} {height}");
        let (title_id, description_id) = (format!("{id}t"), format!("{id}d"));
        let named = format!("{title_id} {description_id}");
        let attributes: [Attribute<'_>; 6] = [
            ("class", &"nb"),
            ("role", &"img"),
            ("aria-labelledby", &named),
            ("viewBox", &view),
            ("width", &width),
            ("height", &height),
        ];
        self.element("svg", &attributes, |html| {
            html.line("title", &[("id", &title_id)], title);
            html.line("desc", &[("id", &description_id)], description);
            inside(html);
        });
    }

    /// A row of heads of columns.
    pub fn heads(&mut self, names: &[&str]) {
        self.element("tr", &[], |html| {
            for name in names {
                html.line("th", &[("scope", &"col")], name);
            }
        });
    }

    /// Text as text, whatever it holds.
    pub fn text(&mut self, text: impl Display) {
        // Writing to a String cannot fail.
        let _infallible = write!(Escaper(&mut self.out), "{text}");
    }

    /// A part that was written before.
    pub fn part(&mut self, part: &Self) {
        self.out.push_str(&part.out);
    }

    /// A style or a script: an element whose contents are written as they are.
    pub fn raw_text(&mut self, name: &'static str, contents: &'static str) {
        self.element(name, &[], |html| html.out.push_str(contents));
    }

    /// Data for the script, as JSON in which no markup can begin.
    pub fn data(&mut self, value: &impl Serialize) {
        let json = serde_json::to_string(value).unwrap_or_else(|_| "null".to_owned());
        self.open("script", &[("type", &"application/json")], ">");
        for c in json.chars() {
            // Inside JSON these occur in strings only.
            if matches!(c, '<' | '>' | '&' | '\u{2028}' | '\u{2029}') || is_invisible(c) {
                let _infallible = write!(self.out, "\\u{:04x}", u32::from(c));
            } else {
                self.out.push(c);
            }
        }
        self.out.push_str("</script>\n");
    }

    /// How long it is, in bytes.
    #[must_use]
    pub fn len(&self) -> usize {
        self.out.len()
    }

    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.out.is_empty()
    }

    /// What was written, as a file of its own: a picture.
    #[must_use]
    pub fn into_text(self) -> String {
        self.out
    }

    #[must_use]
    pub fn finish(self) -> String {
        format!("<!DOCTYPE html>\n{}", self.out)
    }
}

/// How the policy of a page names a script or a style in it: `'sha256-...'`.
pub(crate) fn hash_source(text: &str) -> String {
    format!("'sha256-{}'", base64(&Sha256::digest(text.as_bytes())))
}

/// RFC 4648, as a policy writes a sum.
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::new();
    for three in bytes.chunks(3) {
        let byte = |place: usize| u32::from(three.get(place).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        for place in 0..4 {
            let digit = bits >> (18 - 6 * place) & 63;
            if place <= three.len() {
                out.push(char::from(DIGITS[digit as usize]));
            } else {
                out.push('=');
            }
        }
    }
    out
}

/// Characters that change how the text around them is read, and cannot be seen: U+202E turns `exe.txt` round.
const fn is_invisible(c: char) -> bool {
    matches!(c, '\u{061C}' | '\u{200B}'..='\u{200F}' | '\u{202A}'..='\u{202E}' | '\u{2060}'..='\u{2069}' | '\u{FEFF}')
}

struct Escaper<'o>(&'o mut String);

impl fmt::Write for Escaper<'_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let mut plain = 0;
        for (at, c) in text.char_indices() {
            let written = match c {
                '&' => "&amp;",
                '<' => "&lt;",
                '>' => "&gt;",
                '"' => "&quot;",
                '\'' => "&#39;",
                '\t' | '\n' | ' '..='~' => continue,
                c if c.is_control() || is_invisible(c) => "\u{FFFD}",
                '\u{FFFE}' | '\u{FFFF}' => "\u{FFFD}",
                _ => continue,
            };
            self.0.push_str(&text[plain..at]);
            self.0.push_str(written);
            plain = at + c.len_utf8();
        }
        self.0.push_str(&text[plain..]);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// RFC 4648, section 10.
    #[test]
    fn sums_are_written_as_policies_want_them() {
        let vectors = [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foobar", "Zm9vYmFy"),
        ];
        for (text, expected) in vectors {
            assert_eq!(base64(text.as_bytes()), expected);
        }
    }

    #[test]
    fn text_is_text() {
        let mut html = Html::new();
        let hostile = "</p><script>\u{0}\u{202E}\" onload='x' ]]>&amp;";
        html.element("p", &[("title", &hostile)], |html| html.text(hostile));
        html.data(&hostile);
        let escaped =
            "&lt;/p&gt;&lt;script&gt;\u{FFFD}\u{FFFD}&quot; onload=&#39;x&#39; ]]&gt;&amp;amp;";
        assert_eq!(
            html.out,
            format!(
                "<p title=\"{escaped}\">{escaped}</p>\n<script type=\"application/json\">\
                 \"\\u003c/p\\u003e\\u003cscript\\u003e\\u0000\\u202e\\\" onload='x' ]]\\u003e\\u0026amp;\"</script>\n"
            )
        );
    }
}
