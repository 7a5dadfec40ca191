//! A strict reader of our pages, written apart from their writer: what is not exactly in the form that it knows is a failure.

use std::collections::BTreeSet;

/// Elements that a page may have.
const ELEMENTS: [&str; 54] = [
    "html",
    "head",
    "meta",
    "title",
    "style",
    "script",
    "body",
    "header",
    "nav",
    "main",
    "footer",
    "section",
    "h1",
    "h2",
    "h3",
    "p",
    "a",
    "ul",
    "ol",
    "li",
    "dl",
    "dt",
    "dd",
    "table",
    "caption",
    "thead",
    "tbody",
    "tr",
    "th",
    "td",
    "div",
    "i",
    "strong",
    "pre",
    "code",
    "details",
    "summary",
    "figure",
    "figcaption",
    "svg",
    "g",
    "path",
    "text",
    "desc",
    "rect",
    "span",
    "em",
    "br",
    "hr",
    "button",
    "col",
    "label",
    "abbr",
    "small",
];

/// Attributes that they may have: none of them runs anything.
const ATTRIBUTES: [&str; 29] = [
    "preserveAspectRatio",
    "lang",
    "charset",
    "http-equiv",
    "content",
    "name",
    "class",
    "id",
    "href",
    "aria-labelledby",
    "aria-label",
    "aria-hidden",
    "role",
    "tabindex",
    "scope",
    "type",
    "viewBox",
    "width",
    "height",
    "x",
    "y",
    "d",
    "colspan",
    "rowspan",
    "title",
    "for",
    "open",
    "hidden",
    "datetime",
];

/// An element, or a text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Node {
    Element(Element),
    Text(String),
}

/// An element with what stands in it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Element {
    pub(crate) name: String,
    pub(crate) attributes: Vec<(String, String)>,
    pub(crate) inside: Vec<Node>,
}

impl Element {
    pub(crate) fn attribute(&self, name: &str) -> Option<&str> {
        let found = self.attributes.iter().find(|(known, _)| known == name);
        found.map(|(_, value)| value.as_str())
    }

    /// All elements in it, itself first.
    pub(crate) fn all(&self) -> Vec<&Self> {
        let mut all = vec![self];
        for node in &self.inside {
            if let Node::Element(element) = node {
                all.extend(element.all());
            }
        }
        all
    }

    /// Its text and that of all in it.
    pub(crate) fn text(&self) -> String {
        self.inside
            .iter()
            .map(|node| match node {
                Node::Text(text) => text.clone(),
                Node::Element(element) => element.text(),
            })
            .collect()
    }
}

struct Reader<'t> {
    rest: &'t str,
}

/// Reads a page; fails where it is none.
pub(crate) fn parse(page: &str) -> Element {
    let rest = page
        .strip_prefix("<!DOCTYPE html>\n")
        .expect("a document type");
    let mut reader = Reader { rest };
    let Node::Element(html) = reader.node() else {
        panic!("a page begins with an element");
    };
    assert_eq!(html.name, "html");
    assert_eq!(reader.rest.trim(), "", "something behind the page");
    html
}

impl Reader<'_> {
    fn node(&mut self) -> Node {
        if !self.rest.starts_with('<') {
            let end = self.rest.find('<').expect("an end");
            let (text, rest) = self.rest.split_at(end);
            let text = plain(text);
            self.rest = rest;
            return Node::Text(text);
        }
        let (name, rest) = word(&self.rest[1..]);
        let name = name.to_owned();
        assert!(
            ELEMENTS.contains(&name.as_str()),
            "element {name:?} at {:.80}",
            self.rest
        );
        self.rest = rest;
        let mut attributes = Vec::new();
        while let Some(rest) = self.rest.strip_prefix(' ') {
            let (name, rest) = word(rest);
            assert!(
                ATTRIBUTES.contains(&name),
                "attribute {name:?} at {:.80}",
                self.rest
            );
            let rest = rest.strip_prefix("=\"").expect("a quoted value");
            let (value, rest) = rest.split_once('"').expect("an end of a value");
            attributes.push((name.to_owned(), plain(value)));
            self.rest = rest;
        }
        let mut element = Element {
            name,
            attributes,
            inside: Vec::new(),
        };
        if let Some(rest) = self.rest.strip_prefix("/>") {
            self.rest = rest;
            return Node::Element(element);
        }
        self.rest = self.rest.strip_prefix('>').expect("an end of a tag");
        match element.name.as_str() {
            "meta" | "br" | "hr" | "col" => return Node::Element(element),
            "script" | "style" => {
                self.raw(&mut element);
                return Node::Element(element);
            }
            _ => {}
        }
        while !self.rest.starts_with("</") {
            let node = self.node();
            element.inside.push(node);
        }
        let end = format!("</{}>", element.name);
        self.rest = self
            .rest
            .strip_prefix(&end)
            .unwrap_or_else(|| panic!("{end} expected at {:.80}", self.rest));
        Node::Element(element)
    }
}

impl Reader<'_> {
    /// What stands in a script or a style, up to its end.
    fn raw(&mut self, element: &mut Element) {
        let end = format!("</{}", element.name);
        let (raw, rest) = self.rest.split_once(&end).expect("an end");
        let markup = raw.contains("<!--") || raw.contains("<script");
        assert!(!markup, "markup in {}", element.name);
        element.inside.push(Node::Text(raw.to_owned()));
        self.rest = rest.strip_prefix('>').expect("an end of a tag");
    }
}

/// A name, and what is behind it.
fn word(text: &str) -> (&str, &str) {
    let end = text
        .find(|c: char| !c.is_ascii_alphanumeric() && c != '-')
        .expect("an end");
    text.split_at(end)
}

/// Text with its references replaced; nothing in it may be markup, invisible, or a character that controls.
fn plain(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let known = [
            ("&amp;", '&'),
            ("&lt;", '<'),
            ("&gt;", '>'),
            ("&quot;", '"'),
            ("&#39;", '\''),
        ];
        if let Some((name, meant)) = known.iter().find(|(name, _)| rest.starts_with(name)) {
            out.push(*meant);
            rest = &rest[name.len()..];
            continue;
        }
        assert!(!"<>&\"'".contains(c), "{c:?} in the text {text:.80}");
        let controls = c.is_control() && !matches!(c, '\n' | '\t');
        let bidi = matches!(c, '\u{061C}' | '\u{200B}'..='\u{200F}' | '\u{202A}'..='\u{202E}' | '\u{2066}'..='\u{2069}');
        assert!(!controls && !bidi, "{c:?} in the text {text:.80}");
        out.push(c);
        rest = &rest[c.len_utf8()..];
    }
    out
}

/// What every page keeps: headings in order, names that are unique and lead somewhere, no address outside, tables with captions,
/// pictures with words.
pub(crate) fn sound(page: &Element) {
    let all = page.all();
    let mut ids = BTreeSet::new();
    for element in &all {
        if let Some(id) = element.attribute("id") {
            assert!(ids.insert(id), "{id} stands twice");
        }
    }
    addresses(&all, &ids);
    order(&all);
    for name in ["main", "h1", "header", "footer"] {
        assert_eq!(
            all.iter().filter(|element| element.name == name).count(),
            1,
            "{name}"
        );
    }
    let policy = all
        .iter()
        .find(|element| element.attribute("http-equiv") == Some("Content-Security-Policy"));
    let policy = policy
        .and_then(|element| element.attribute("content"))
        .expect("a policy");
    assert!(
        policy.starts_with("default-src 'none';") && policy.contains("script-src 'sha256-"),
        "{policy}"
    );
}

/// Names lead somewhere, and nowhere outside.
fn addresses(all: &[&Element], ids: &BTreeSet<&str>) {
    for element in all {
        for name in element
            .attribute("aria-labelledby")
            .into_iter()
            .flat_map(str::split_whitespace)
        {
            assert!(ids.contains(name), "{name} is nowhere");
        }
        if let Some(place) = element.attribute("href") {
            let name = place
                .strip_prefix('#')
                .unwrap_or_else(|| panic!("an address outside: {place}"));
            assert!(ids.contains(name), "{place} leads nowhere");
        }
    }
}

/// Headings are in order, tables have captions, pictures have words.
fn order(all: &[&Element]) {
    let mut level = 0;
    for element in all {
        if let Some(number) = element
            .name
            .strip_prefix('h')
            .and_then(|n| n.parse::<usize>().ok())
        {
            assert!(
                number <= level + 1,
                "h{number} behind h{level}: {}",
                element.text()
            );
            assert!(!element.text().trim().is_empty(), "an empty heading");
            level = number;
        }
        if element.name == "table" {
            let first = element.all().get(1).map(|first| first.name.clone());
            assert_eq!(
                first.as_deref(),
                Some("caption"),
                "a table without a caption"
            );
        }
        // Parts of a picture, and pictures beside words that say the same, are hidden from readers.
        if element.name == "svg" && element.attribute("aria-hidden") != Some("true") {
            assert_eq!(element.attribute("role"), Some("img"));
            let names: Vec<_> = element.all()[1..3]
                .iter()
                .map(|element| element.name.as_str())
                .collect();
            assert_eq!(names, ["title", "desc"]);
        }
    }
}

/// The page as a reader without pictures has it: a line a heading, a paragraph, a row; of long tables the first rows.
pub(crate) fn outline(page: &Element) -> String {
    let mut out = String::new();
    let mut rows = 0;
    for element in page.all() {
        let line = match element.name.as_str() {
            "h1" | "h2" | "h3" => format!(
                "\n{} {}",
                "#".repeat(usize::from(element.name.as_bytes()[1] - b'0')),
                element.text()
            ),
            "p" | "li" | "dd" | "figcaption" => format!("  {}", element.text()),
            "dt" => format!("  {}:", element.text()),
            "summary" => format!("  > {}", element.text()),
            "caption" => {
                rows = 0;
                format!("  table: {}", element.text())
            }
            "tr" => {
                rows += 1;
                if rows > 12 {
                    continue;
                }
                let cells: Vec<_> = element.all()[1..]
                    .iter()
                    .filter(|c| c.name == "th" || c.name == "td")
                    .map(|c| c.text())
                    .collect();
                format!("    {}", cells.join(" | "))
            }
            "desc" => format!("  picture: {}", element.text()),
            _ => continue,
        };
        let line: Vec<_> = line.split(' ').map(str::trim_end).collect();
        out.push_str(line.join(" ").replace("\n\n", "\n").trim_end());
        out.push('\n');
    }
    out
}
