//! A TOML document that remembers where every key stands.

use super::CaseError;
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Where a key and its value stand.
#[derive(Clone, Debug)]
pub struct Place {
    source: usize,
    key: Range<usize>,
    value: Range<usize>,
}

/// The case file with its overrides: plain values, and the place of every path such as `fibres[0].length`.
#[derive(Clone, Debug)]
pub struct Document {
    sources: Vec<(String, String)>,
    value: toml::Value,
    places: BTreeMap<String, Place>,
}

impl Document {
    /// Reads a file.
    ///
    /// # Errors
    /// [`CaseError`] when the file cannot be read or is not TOML.
    pub fn read(path: &Path) -> Result<Self, Box<CaseError>> {
        let name = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|e| {
            CaseError::new(
                format!("the case file {name} cannot be read: {e}"),
                &name,
                "",
                None,
            )
        })?;
        Self::parse(&name, &text)
    }

    /// From text; `name` is what messages call it.
    ///
    /// # Errors
    /// [`CaseError`] when the text is not TOML.
    pub fn parse(name: &str, text: &str) -> Result<Self, Box<CaseError>> {
        let table = DeTable::parse(text)
            .map_err(|e| CaseError::new(e.message().to_owned(), name, text, e.span()))?;
        let mut document = Self {
            sources: vec![(name.to_owned(), text.to_owned())],
            value: toml::Value::Table(toml::Table::new()),
            places: BTreeMap::new(),
        };
        let span = table.span();
        let value = DeValue::Table(table.into_inner());
        document.value = document.take(0, "", span.clone(), &Spanned::new(span, value));
        Ok(document)
    }

    /// Applies `key=value`.
    ///
    /// # Errors
    /// [`CaseError`] when the text has no `=`, or the key leads through something that is not a table or list.
    pub fn set(&mut self, text: &str) -> Result<(), Box<CaseError>> {
        let name = format!("--set {text}");
        let bad = |message: String| CaseError::new(message, &name, text, Some(0..text.len()));
        let Some((key, raw)) = text.split_once('=') else {
            return Err(bad(format!(
                "`--set {text}` is not `key=value`, as in `--set fluid.viscosity=1e-3`"
            )));
        };
        // Anything that is no TOML value on its own is meant as a string.
        let line = format!("value = {raw}");
        let quoted = format!("value = {raw:?}");
        let table = DeTable::parse(&line)
            .or_else(|_| DeTable::parse(&quoted))
            .map_err(|e| bad(format!("`{raw}` is not a value: {}", e.message())))?;
        let source = self.sources.len();
        self.sources.push((name.clone(), text.to_owned()));
        let entry = table.get_ref().get("value");
        let value = entry.map_or(toml::Value::Boolean(false), |v| plain(v.get_ref()));

        let (target, path) = reach(&mut self.value, key.trim())
            .map_err(|part| bad(format!("`{key}` leads nowhere: `{part}` is not there")))?;
        *target = value;
        let inside = |p: &str| {
            p == path || p.starts_with(&format!("{path}.")) || p.starts_with(&format!("{path}["))
        };
        self.places.retain(|p, _| !inside(p));
        let place = Place {
            source,
            key: 0..key.len(),
            value: key.len() + 1..text.len(),
        };
        self.places.insert(path, place);
        Ok(())
    }

    /// Adds a value that follows from the one at `from`, which is where complaints about it point to.
    ///
    /// # Errors
    /// [`CaseError`] when it is there already, or the table that it belongs to is not.
    pub fn derive(&mut self, key: &str, number: f64, from: &str) -> Result<(), Box<CaseError>> {
        let (table, name) = key.rsplit_once('.').unwrap_or(("", key));
        let twice = format!("`{from}` gives `{key}`, which is given too");
        let nowhere = format!("`{from}` gives `{key}`, but there is no `{table}`");
        let Some(target) = self.get(table).and_then(toml::Value::as_table) else {
            return Err(self.error(from, nowhere));
        };
        if target.contains_key(name) {
            let error = self.error(from, twice);
            return Err(error.with_help("leave one of them out"));
        }
        let Ok((value, path)) = reach(&mut self.value, key) else {
            return Err(self.error(from, nowhere));
        };
        *value = toml::Value::Float(number);
        if let Some(place) = self.places.get(from).cloned() {
            self.places.insert(path, place);
        }
        Ok(())
    }

    /// The number at a dotted key, if there is one.
    pub fn number(&self, key: &str) -> Option<f64> {
        let value = self.get(key)?;
        value
            .as_float()
            .or_else(|| value.as_integer().map(|i| i as f64))
    }

    fn get(&self, key: &str) -> Option<&toml::Value> {
        let parts = key.split('.');
        parts
            .filter(|part| !part.is_empty())
            .try_fold(&self.value, |value, part| match value {
                toml::Value::Array(entries) => entries.get(part.parse::<usize>().ok()?),
                table => table.get(part),
            })
    }

    /// The values, without places.
    pub fn value(&self) -> &toml::Value {
        &self.value
    }

    /// A complaint about the key at `path` (`""`: the whole file). Falls back to the nearest table that is there.
    pub fn error(&self, path: &str, message: impl Into<String>) -> Box<CaseError> {
        self.complain(path, message.into(), |place| place.key.clone())
    }

    /// A complaint about the value at `path`.
    pub fn value_error(&self, path: &str, message: impl Into<String>) -> Box<CaseError> {
        self.complain(path, message.into(), |place| place.value.clone())
    }

    fn complain(
        &self,
        path: &str,
        message: String,
        span: impl Fn(&Place) -> Range<usize>,
    ) -> Box<CaseError> {
        let mut at = path;
        let place = loop {
            if let Some(place) = self.places.get(at) {
                break Some(place);
            }
            match at.rfind(['.', '[']) {
                Some(cut) => at = &at[..cut],
                None => break None,
            }
        };
        let (name, text) = &self.sources[place.map_or(0, |p| p.source)];
        CaseError::new(message, name, text, place.map(span))
    }

    fn take(
        &mut self,
        source: usize,
        path: &str,
        key: Range<usize>,
        value: &Spanned<DeValue<'_>>,
    ) -> toml::Value {
        let place = Place {
            source,
            key,
            value: value.span(),
        };
        if !path.is_empty() {
            self.places.insert(path.to_owned(), place);
        }
        match value.get_ref() {
            DeValue::Table(table) => {
                let mut plain = toml::Table::new();
                for (key, entry) in table {
                    let name = key.get_ref();
                    let inner = if path.is_empty() {
                        name.to_string()
                    } else {
                        format!("{path}.{name}")
                    };
                    let taken = self.take(source, &inner, key.span(), entry);
                    plain.insert(name.to_string(), taken);
                }
                toml::Value::Table(plain)
            }
            DeValue::Array(array) => {
                let entries = array.iter().enumerate();
                let taken = entries
                    .map(|(k, e)| self.take(source, &format!("{path}[{k}]"), e.span(), e))
                    .collect();
                toml::Value::Array(taken)
            }
            other => plain(other),
        }
    }
}

/// The value at a dotted key, with tables made on the way, and its path; or the part of the key that leads nowhere.
fn reach<'a, 'k>(
    mut target: &'a mut toml::Value,
    key: &'k str,
) -> Result<(&'a mut toml::Value, String), &'k str> {
    let mut path = String::new();
    for part in key.split('.') {
        let (next, step) = descend(target, part).ok_or(part)?;
        if !step.starts_with('[') && !path.is_empty() {
            path.push('.');
        }
        path.push_str(&step);
        target = next;
    }
    Ok((target, path))
}

fn descend<'a>(target: &'a mut toml::Value, part: &str) -> Option<(&'a mut toml::Value, String)> {
    match target {
        toml::Value::Table(table) => {
            let empty = || toml::Value::Table(toml::Table::new());
            Some((table.entry(part).or_insert_with(empty), part.to_owned()))
        }
        toml::Value::Array(array) => {
            let index: usize = part.parse().ok()?;
            array.get_mut(index).map(|v| (v, format!("[{index}]")))
        }
        _ => None,
    }
}

fn plain(value: &DeValue<'_>) -> toml::Value {
    match value {
        DeValue::String(s) => toml::Value::String(s.to_string()),
        DeValue::Integer(i) => i64::from_str_radix(i.as_str(), i.radix())
            .map_or_else(|_| toml::Value::String(i.to_string()), toml::Value::Integer),
        DeValue::Float(f) => f
            .as_str()
            .parse()
            .map_or_else(|_| toml::Value::String(f.to_string()), toml::Value::Float),
        DeValue::Boolean(b) => toml::Value::Boolean(*b),
        DeValue::Datetime(d) => toml::Value::Datetime(*d),
        DeValue::Array(a) => toml::Value::Array(a.iter().map(|v| plain(v.get_ref())).collect()),
        DeValue::Table(t) => {
            let entries = t.iter();
            toml::Value::Table(
                entries
                    .map(|(k, v)| (k.get_ref().to_string(), plain(v.get_ref())))
                    .collect(),
            )
        }
    }
}
