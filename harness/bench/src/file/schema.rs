//! The check of a TOML text against a JSON schema: unknown keys, missing keys, wrong types, numbers out of their range. All mistakes at once, each with its place.

use super::values::check_format;
use crate::scenario::problem::{Problem, TextSpan};
use serde_json::Value;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Maximum depth of a schema; ours has a quarter of it.
const MAX_DEPTH: usize = 32;

/// A place of a TOML value.
pub(crate) fn span_of<T>(value: &Spanned<T>) -> TextSpan {
    let range = value.span();
    TextSpan {
        start: range.start,
        end: range.end,
    }
}

/// Compares a document with the schema of such a file, which messages call `whole`.
pub fn compare(root: &Value, whole: &str, table: &Spanned<DeTable<'_>>) -> Vec<Problem> {
    let mut walk = SchemaWalk {
        root,
        whole,
        problems: Vec::new(),
    };
    walk.table(root, table.get_ref(), span_of(table), "", 0);
    walk.problems
}

/// A step on the way to a value: a key or a number in a list.
#[derive(Clone, Copy)]
pub enum PathStep<'a> {
    Key(&'a str),
    Index(usize),
}

impl<'a> From<&'a str> for PathStep<'a> {
    fn from(key: &'a str) -> Self {
        Self::Key(key)
    }
}

impl From<usize> for PathStep<'_> {
    fn from(index: usize) -> Self {
        Self::Index(index)
    }
}

/// The place of a value, or of the nearest table around it that is there.
pub fn place(table: &Spanned<DeTable<'_>>, path: &[PathStep<'_>]) -> TextSpan {
    let mut span = span_of(table);
    let mut value: Option<&Spanned<DeValue<'_>>> = None;
    for step in path {
        let next = match (step, value.map(Spanned::get_ref)) {
            (PathStep::Key(key), None) => table.get_ref().get(*key),
            (PathStep::Key(key), Some(DeValue::Table(table))) => table.get(*key),
            (PathStep::Index(index), Some(DeValue::Array(array))) => array.get(*index),
            _ => None,
        };
        let Some(next) = next else { break };
        span = span_of(next);
        value = Some(next);
    }
    span
}

/// What is no TOML at all.
pub fn syntax(error: &toml::de::Error) -> Problem {
    let span = error.span().unwrap_or_default();
    let span = TextSpan {
        start: span.start,
        end: span.end,
    };
    Problem::new(
        span,
        error.message().replace('\n', ", "),
        "TOML expected here",
    )
}

struct SchemaWalk<'a> {
    root: &'a Value,
    whole: &'a str,
    problems: Vec<Problem>,
}

impl<'a> SchemaWalk<'a> {
    /// Follows a reference, and the branch that is not null.
    fn resolve(&self, schema: &'a Value) -> &'a Value {
        let mut schema = schema;
        for _ in 0..MAX_DEPTH {
            let reference = schema["$ref"]
                .as_str()
                .and_then(|path| path.strip_prefix('#'));
            let branch = schema["anyOf"]
                .as_array()
                .and_then(|all| all.iter().find(|branch| branch["type"] != "null"));
            schema = match reference
                .and_then(|path| self.root.pointer(path))
                .or(branch)
            {
                Some(inner) => inner,
                None => return schema,
            };
        }
        schema
    }

    fn table(
        &mut self,
        schema: &'a Value,
        table: &DeTable<'_>,
        place: TextSpan,
        path: &str,
        depth: usize,
    ) {
        let what = match path {
            "" => self.whole.to_owned(),
            path => format!("[{path}]"),
        };
        let properties = schema["properties"].as_object();
        let known: Vec<&str> = properties
            .into_iter()
            .flatten()
            .map(|(name, _)| name.as_str())
            .collect();
        let mut entries: Vec<_> = table.iter().collect();
        entries.sort_by_key(|(key, _)| key.span().start);
        for (key, value) in entries {
            let name = key.get_ref().as_ref();
            let inner = properties.and_then(|all| all.get(name)).or_else(|| {
                schema["additionalProperties"]
                    .as_object()
                    .map(|_| &schema["additionalProperties"])
            });
            match inner {
                Some(inner) => {
                    let path = format!("{path}.{name}");
                    self.value(inner, value, path.trim_start_matches('.'), depth + 1);
                }
                None => self.problems.push(
                    Problem::new(
                        span_of(key),
                        format!("`{name}` is not a key of {what}"),
                        format!("one of {} expected here", known.join(", ")),
                    )
                    .did_you_mean(name, &known),
                ),
            }
        }
        for name in schema["required"].as_array().into_iter().flatten() {
            let name = name.as_str().unwrap_or_default();
            if !table.contains_key(name) {
                self.problems.push(
                    Problem::new(
                        place,
                        format!("{what} needs the key `{name}`"),
                        format!("`{name}` expected in here"),
                    )
                    .help(self.about(&schema["properties"][name], name)),
                );
            }
        }
    }

    /// What the schema says of a key.
    fn about(&self, schema: &'a Value, name: &str) -> String {
        let about = [schema, self.resolve(schema)]
            .into_iter()
            .find_map(|schema| schema["description"].as_str())
            .unwrap_or_default();
        format!("`{name}`: {}", about.replace('\n', " "))
    }

    fn value(&mut self, schema: &'a Value, value: &Spanned<DeValue<'_>>, path: &str, depth: usize) {
        let name = path.rsplit('.').next().unwrap_or(path);
        let outer = schema;
        let schema = self.resolve(schema);
        if depth > MAX_DEPTH {
            return;
        }
        let place = span_of(value);
        let words = words(schema);
        let wanted = wanted(schema);
        match (value.get_ref(), wanted) {
            (DeValue::Table(table), "object") => {
                self.table(schema, table, place, path, depth);
            }
            (DeValue::Array(array), "array") => {
                let (least, most) = (&schema["minItems"], &schema["maxItems"]);
                self.range(
                    array.len() as f64,
                    least,
                    most,
                    place,
                    &format!("as the number of entries of `{name}`"),
                );
                for entry in array.iter().take(most.as_u64().unwrap_or(1000) as usize) {
                    self.value(&schema["items"], entry, path, depth + 1);
                }
            }
            (DeValue::Float(number), "number") => {
                let parsed: Option<f64> = number.as_str().replace('_', "").parse().ok();
                let (least, most) = (&schema["minimum"], &schema["maximum"]);
                let number = parsed.unwrap_or(f64::MAX);
                self.range(number, least, most, place, &format!("for `{name}`"));
            }
            (DeValue::Integer(number), "integer" | "number") => {
                let parsed = i64::from_str_radix(&number.as_str().replace('_', ""), number.radix());
                // The bounds of the key itself before those of its type.
                let bound = |key: &str| {
                    [outer, schema]
                        .into_iter()
                        .map(|s| &s[key])
                        .find(|v| !v.is_null())
                };
                let (least, most) = (bound("minimum"), bound("maximum"));
                let null = Value::Null;
                self.range(
                    parsed.unwrap_or(i64::MAX) as f64,
                    least.unwrap_or(&null),
                    most.unwrap_or(&null),
                    place,
                    &format!("for `{name}`"),
                );
            }
            (DeValue::Boolean(_), "boolean") => {}
            (DeValue::String(text), "string") if words.is_empty() => {
                let format = schema["format"].as_str().unwrap_or_default();
                if let Err(error) = check_format(format, text) {
                    self.problems
                        .push(Problem::new(place, error.message, error.expected));
                }
            }
            (DeValue::String(text), _) if !words.is_empty() => {
                if !words.contains(&text.as_ref()) {
                    let problem = Problem::new(
                        place,
                        format!("`{text}` is not a value of `{name}`"),
                        format!("one of \"{}\" expected here", words.join("\", \"")),
                    );
                    self.problems.push(problem.did_you_mean(text, &words));
                }
            }
            (other, wanted) => {
                let found = article(match other.type_str() {
                    "string" => "text",
                    other => other,
                });
                let expected = match wanted {
                    "object" => "a table expected here",
                    "array" => "a list in [ ] expected here",
                    "integer" => "a whole number expected here",
                    "number" => "a number expected here",
                    "boolean" => "true or false expected here",
                    _ => "a text in quotes expected here",
                };
                let message = format!("`{name}` cannot be {found}");
                let problem = Problem::new(place, message, expected);
                self.problems.push(problem.help(self.about(outer, name)));
            }
        }
    }

    fn range(&mut self, number: f64, least: &Value, most: &Value, place: TextSpan, what: &str) {
        let (least, most) = (least.as_f64(), most.as_f64());
        if least.is_some_and(|least| number < least) || most.is_some_and(|most| number > most) {
            let bounds = match (least, most) {
                (Some(least), Some(most)) if least < most => format!("{least} to {most}"),
                (Some(least), Some(_)) => least.to_string(),
                (Some(least), None) => format!("{least} or more"),
                (None, most) => format!("up to {}", most.unwrap_or_default()),
            };
            self.problems.push(Problem::new(
                place,
                format!("{number} is not possible {what}"),
                format!("{bounds} expected here"),
            ));
        }
    }
}

/// The type that a schema demands.
fn wanted(schema: &Value) -> &str {
    let listed = schema["type"]
        .as_array()
        .and_then(|all| all.iter().find(|name| *name != "null"));
    listed
        .unwrap_or(&schema["type"])
        .as_str()
        .unwrap_or("string")
}

/// The words that a schema allows; none where any text will do.
fn words(schema: &Value) -> Vec<&str> {
    let listed = schema["enum"].as_array().into_iter().flatten();
    let constants = schema["oneOf"].as_array().into_iter().flatten();
    let constants = constants.flat_map(|branch| {
        let several = branch["enum"].as_array().into_iter().flatten();
        std::iter::once(&branch["const"]).chain(several)
    });
    listed.chain(constants).filter_map(Value::as_str).collect()
}

fn article(noun: &str) -> String {
    let an = noun.starts_with(['a', 'e', 'i', 'o', 'u']);
    format!("{} {noun}", if an { "an" } else { "a" })
}
