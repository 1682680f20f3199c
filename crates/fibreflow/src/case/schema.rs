//! Checks a document against the JSON schema of [`Case`](super::Case), with a place for every complaint.

use super::{Case, CaseError, Document};
use serde_json::Value as Json;

/// The JSON schema of a case file, for editors and for the check.
pub fn json_schema() -> Json {
    schemars::schema_for!(Case).to_value()
}

/// Refuses unknown keys, wrong types, missing keys and values out of bounds.
pub(super) fn check(document: &Document) -> Result<(), Box<CaseError>> {
    check_against(&json_schema(), document)
}

/// The same for a document of another schema.
///
/// # Errors
/// The first thing that does not fit.
pub fn check_against(root: &Json, document: &Document) -> Result<(), Box<CaseError>> {
    let checker = Checker { root, document };
    checker.check(root, document.value(), "")
}

/// The same for a table that has to be in order before the rest.
pub(super) fn check_part<T: schemars::JsonSchema>(
    document: &Document,
    table: &toml::Value,
    path: &str,
) -> Result<(), Box<CaseError>> {
    let root = &schemars::schema_for!(T).to_value();
    Checker { root, document }.check(root, table, path)
}

struct Checker<'a> {
    root: &'a Json,
    document: &'a Document,
}

impl<'a> Checker<'a> {
    fn check(
        &self,
        schema: &'a Json,
        value: &toml::Value,
        path: &str,
    ) -> Result<(), Box<CaseError>> {
        let schema = self.resolve(schema);
        if let Some(branches) = branches(schema) {
            return self.check_branches(branches, value, path);
        }
        if let Some(expected) = schema.get("const")
            && !same(expected, value)
        {
            return Err(self.not_one_of(path, value, &[expected]));
        }
        if let Some(Json::Array(allowed)) = schema.get("enum")
            && !allowed.iter().any(|a| same(a, value))
        {
            return Err(self.not_one_of(path, value, &allowed.iter().collect::<Vec<_>>()));
        }
        self.check_type(schema, value, path)?;
        match value {
            // What a schema says nothing of can be anything.
            toml::Value::Table(_) if is_open(schema) => Ok(()),
            toml::Value::Table(table) => self.check_table(schema, table, path),
            toml::Value::Array(array) => self.check_array(schema, array, path),
            toml::Value::Integer(i) => self.check_bounds(schema, *i as f64, value, path),
            toml::Value::Float(f) => self.check_bounds(schema, *f, value, path),
            _ => Ok(()),
        }
    }

    fn resolve(&self, schema: &'a Json) -> &'a Json {
        match schema.get("$ref").and_then(Json::as_str) {
            Some(reference) => self
                .root
                .pointer(reference.trim_start_matches('#'))
                .map_or(schema, |s| self.resolve(s)),
            None => schema,
        }
    }

    /// One alternative must fit; the complaint comes from the alternative that was meant.
    fn check_branches(
        &self,
        branches: &'a [Json],
        value: &toml::Value,
        path: &str,
    ) -> Result<(), Box<CaseError>> {
        let branches: Vec<&Json> = branches.iter().map(|b| self.resolve(b)).collect();
        let branches: Vec<&Json> = branches
            .into_iter()
            .filter(|b| b.get("type") != Some(&Json::from("null")))
            .collect();
        if let [only] = branches[..] {
            return self.check(only, value, path);
        }
        if branches.iter().any(|b| self.check(b, value, path).is_ok()) {
            return Ok(());
        }
        let table = value.as_table();
        if let Some(table) = table
            && branches.iter().any(|b| tag(b).is_some())
        {
            let Some(kind) = table.get("kind") else {
                let error = self.document.error(path, format!("`{path}` has no `kind`"));
                return Err(error.with_help(format!(
                    "kinds: {}",
                    listed(branches.iter().filter_map(|b| tag(b)))
                )));
            };
            return match branches
                .iter()
                .find(|b| tag(b).is_some_and(|t| same(t, kind)))
            {
                Some(meant) => self.check(meant, value, path),
                None => {
                    let kinds: Vec<&Json> = branches.iter().filter_map(|b| tag(b)).collect();
                    Err(self.not_one_of(&joined(path, "kind"), kind, &kinds))
                }
            };
        }
        let names: Vec<&Json> = branches
            .iter()
            .filter_map(|b| literals(b))
            .flatten()
            .collect();
        if value.is_str() && !names.is_empty() {
            return Err(self.not_one_of(path, value, &names));
        }
        let meant = branches.iter().find(|b| {
            table.is_some_and(|t| {
                let known = b.get("properties").and_then(Json::as_object);
                known.is_some_and(|k| t.keys().any(|key| k.contains_key(key)))
            })
        });
        if let Some(meant) = meant {
            return self.check(meant, value, path);
        }
        let message = format!("`{path} = {value}` is not valid here");
        let forms = branches
            .iter()
            .map(|b| describe(b))
            .collect::<Vec<_>>()
            .join(" or ");
        Err(self
            .document
            .value_error(path, message)
            .with_help(format!("valid: {forms}")))
    }

    fn check_type(
        &self,
        schema: &Json,
        value: &toml::Value,
        path: &str,
    ) -> Result<(), Box<CaseError>> {
        let types: Vec<&str> = match schema.get("type") {
            Some(Json::String(t)) => vec![t],
            Some(Json::Array(list)) => list.iter().filter_map(Json::as_str).collect(),
            _ => return Ok(()),
        };
        let fits = |t: &&str| match *t {
            "number" => value.is_float() || value.is_integer(),
            "integer" => value.is_integer(),
            "string" => value.is_str(),
            "boolean" => value.is_bool(),
            "array" => value.is_array(),
            "object" => value.is_table(),
            _ => false,
        };
        if types.iter().any(fits) {
            return Ok(());
        }
        let shown = match value {
            toml::Value::Table(_) => "a table".to_owned(),
            other => other.to_string(),
        };
        let message = format!("`{path} = {shown}` has the wrong type");
        Err(self
            .document
            .value_error(path, message)
            .with_help(format!("valid: {}", describe(schema))))
    }

    fn check_table(
        &self,
        schema: &'a Json,
        table: &toml::Table,
        path: &str,
    ) -> Result<(), Box<CaseError>> {
        let empty = serde_json::Map::new();
        let properties = schema
            .get("properties")
            .and_then(Json::as_object)
            .unwrap_or(&empty);
        for (key, value) in table {
            let inner = joined(path, key);
            match (properties.get(key), schema.get("additionalProperties")) {
                (Some(property), _) => self.check(property, value, &inner)?,
                (None, Some(Json::Object(_))) => {
                    self.check(&schema["additionalProperties"], value, &inner)?;
                }
                (None, _) => return Err(self.unknown(&inner, key, properties.keys())),
            }
        }
        let required = schema.get("required").and_then(Json::as_array);
        for key in required.into_iter().flatten().filter_map(Json::as_str) {
            if !table.contains_key(key) {
                let place = if path.is_empty() {
                    "the file".to_owned()
                } else {
                    format!("`{path}`")
                };
                let error = self
                    .document
                    .error(path, format!("{place} lacks the key `{key}`"));
                let about = properties.get(key).and_then(|p| {
                    let p = p
                        .get("description")
                        .or_else(|| self.resolve(p).get("description"));
                    p.and_then(Json::as_str)
                });
                return Err(error.with_help(format!("`{key}`: {}", about.unwrap_or("required"))));
            }
        }
        Ok(())
    }

    fn check_array(
        &self,
        schema: &'a Json,
        array: &[toml::Value],
        path: &str,
    ) -> Result<(), Box<CaseError>> {
        let bound = |name| schema.get(name).and_then(Json::as_u64).map(|n| n as usize);
        let (least, most) = (
            bound("minItems").unwrap_or(0),
            bound("maxItems").unwrap_or(usize::MAX),
        );
        if !(least..=most).contains(&array.len()) {
            let wanted = if least == most {
                format!("{least}")
            } else {
                format!("at least {least}")
            };
            let message = format!("`{path}` has {} entries, not {wanted}", array.len());
            return Err(self.document.value_error(path, message));
        }
        let Some(items) = schema.get("items") else {
            return Ok(());
        };
        for (k, value) in array.iter().enumerate() {
            self.check(items, value, &format!("{path}[{k}]"))?;
        }
        Ok(())
    }

    fn check_bounds(
        &self,
        schema: &Json,
        number: f64,
        value: &toml::Value,
        path: &str,
    ) -> Result<(), Box<CaseError>> {
        let bound = |name| schema.get(name).and_then(Json::as_f64);
        let broken = if !number.is_finite() {
            Some("finite".to_owned())
        } else if let Some(b) = bound("exclusiveMinimum").filter(|&b| number <= b) {
            Some(format!("greater than {b}"))
        } else if let Some(b) = bound("minimum").filter(|&b| number < b) {
            Some(format!("at least {b}"))
        } else if let Some(b) = bound("exclusiveMaximum").filter(|&b| number >= b) {
            Some(format!("less than {b}"))
        } else {
            bound("maximum")
                .filter(|&b| number > b)
                .map(|b| format!("at most {b}"))
        };
        match broken {
            None => Ok(()),
            Some(rule) => {
                let message = format!("`{path} = {value}` is out of bounds: it must be {rule}");
                let about = schema
                    .get("description")
                    .and_then(Json::as_str)
                    .unwrap_or("a number");
                Err(self
                    .document
                    .value_error(path, message)
                    .with_help(about.to_owned()))
            }
        }
    }

    fn unknown<'k>(
        &self,
        path: &str,
        key: &str,
        known: impl Iterator<Item = &'k String>,
    ) -> Box<CaseError> {
        let known: Vec<&str> = known.map(String::as_str).collect();
        let error = self.document.error(path, format!("unknown key `{path}`"));
        let all = listed_names(&known);
        error.with_help(match nearest(key, &known) {
            Some(name) => format!("did you mean `{name}`? Known keys here: {all}"),
            None => format!("known keys here: {all}"),
        })
    }

    fn not_one_of(&self, path: &str, value: &toml::Value, allowed: &[&Json]) -> Box<CaseError> {
        let names: Vec<&str> = allowed.iter().filter_map(|a| a.as_str()).collect();
        let error = self
            .document
            .value_error(path, format!("`{path} = {value}` is not valid"));
        let all = listed(allowed.iter().copied());
        error.with_help(match value.as_str().and_then(|v| nearest(v, &names)) {
            Some(name) => format!("did you mean `{name}`? Valid: {all}"),
            None => format!("valid: {all}"),
        })
    }
}

fn branches(schema: &Json) -> Option<&[Json]> {
    let list = schema.get("oneOf").or_else(|| schema.get("anyOf"))?;
    list.as_array().map(Vec::as_slice)
}

/// Whether a schema leaves a table's keys open.
fn is_open(schema: &Json) -> bool {
    let closed = ["type", "properties", "additionalProperties"];
    closed.iter().all(|rule| schema.get(*rule).is_none())
}

/// The value of `kind` that selects this alternative.
fn tag(branch: &Json) -> Option<&Json> {
    branch.pointer("/properties/kind/const")
}

/// The strings that this alternative accepts.
fn literals(branch: &Json) -> Option<Vec<&Json>> {
    match (branch.get("const"), branch.get("enum")) {
        (Some(one), _) => Some(vec![one]),
        (_, Some(Json::Array(list))) => Some(list.iter().collect()),
        _ => None,
    }
}

fn same(expected: &Json, value: &toml::Value) -> bool {
    let words = expected.as_str().is_some() && expected.as_str() == value.as_str();
    words || (expected.as_i64().is_some() && expected.as_i64() == value.as_integer())
}

fn joined(path: &str, key: &str) -> String {
    if path.is_empty() {
        key.to_owned()
    } else {
        format!("{path}.{key}")
    }
}

fn listed<'a>(values: impl Iterator<Item = &'a Json>) -> String {
    let quoted: Vec<String> = values
        .map(|v| match v.as_str() {
            Some(word) => format!("`{word}`"),
            None => v.to_string(),
        })
        .collect();
    quoted.join(", ")
}

fn listed_names(names: &[&str]) -> String {
    let quoted: Vec<String> = names.iter().map(|n| format!("`{n}`")).collect();
    quoted.join(", ")
}

fn describe(schema: &Json) -> String {
    if let Some(names) = literals(schema) {
        return listed(names.into_iter());
    }
    let kind = match schema.get("type") {
        Some(Json::String(t)) => t.as_str(),
        Some(Json::Array(list)) => list.first().and_then(Json::as_str).unwrap_or("value"),
        _ => "value",
    };
    let kind = match (kind, schema.get("minItems")) {
        ("object", _) => "a table".to_owned(),
        ("array", Some(n)) => format!("a list of {n}"),
        ("array", None) => "a list".to_owned(),
        ("integer", _) => "an integer".to_owned(),
        (other, _) => format!("a {other}"),
    };
    match schema.get("description").and_then(Json::as_str) {
        Some(about) => format!("{kind} ({about})"),
        None => kind,
    }
}

/// The nearest name by edit distance, if it is near enough to be a typing error.
pub(super) fn nearest<'a>(word: &str, names: &[&'a str]) -> Option<&'a str> {
    let distances = names.iter().map(|n| (distance(word, n), *n));
    let (d, name) = distances.min()?;
    (d <= 1 + word.len() / 4).then_some(name)
}

fn distance(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for i in 0..a.len() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for j in 0..b.len() {
            let substituted = diagonal + usize::from(a[i] != b[j]);
            diagonal = row[j + 1];
            row[j + 1] = substituted.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}
