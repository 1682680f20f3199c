//! The file of a sweep, and the members that it stands for.

// Units stand in plain brackets here: users read these comments as descriptions of the schema.
#![allow(rustdoc::broken_intra_doc_links)]

use crate::case::{self, CaseError, Document};
use crate::error::ProgramError;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// A sweep: a case, and what its members change.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct SweepFile {
    /// Case file, from the folder of this file.
    case: String,
    /// Keys that all members change, as in `"time.end" = 200.0`.
    #[serde(default)]
    #[schemars(schema_with = "values_by_key")]
    set: BTreeMap<String, toml::Value>,
    /// What varies: each table by itself, so that members are all combinations.
    #[serde(default)]
    vary: Vec<Vary>,
    /// How often each combination runs, with other seeds. Default: once, with the seeds of the case.
    #[serde(default)]
    replicates: Option<Replicates>,
    /// What goes into the table.
    results: Results,
}

/// One thing that varies.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Vary {
    /// Name of its column in the table.
    name: String,
    /// Keys of the case that it changes, together.
    #[schemars(length(min = 1))]
    keys: Vec<String>,
    /// Its values one by one; with several keys each is a list of one value a key.
    #[schemars(length(min = 1), schema_with = "values")]
    values: Vec<toml::Value>,
    /// What the values are called in the table. Default: the values themselves, where they are numbers or words.
    #[serde(default)]
    labels: Option<Vec<String>>,
}

/// Runs of one combination that differ by their seeds.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Replicates {
    /// How many.
    #[schemars(range(min = 1, max = 1000))]
    count: u64,
    /// Keys that take the seed.
    #[schemars(length(min = 1))]
    seeds: Vec<String>,
    /// Seed of the first; the others count up.
    #[serde(default = "one")]
    first: u64,
}

fn one() -> u64 {
    1
}

/// What the table has of each member.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Results {
    /// Columns of series, as FILE.COLUMN: `structure.eta_sp` is the column `eta_sp` of `series/structure.csv`.
    #[schemars(length(min = 1))]
    pub columns: Vec<String>,
    /// Means are over lines from this time on [s].
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub from: f64,
    /// And up to this time [s]. Default: to the end.
    #[serde(default)]
    pub to: Option<f64>,
    /// Column, as FILE.COLUMN, that says from when on the member is steady; lines before that do not count either.
    #[serde(default)]
    pub steady: Option<String>,
}

fn any() -> Schema {
    json_schema!({ "description": "a value of the case file" })
}

fn values(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "array", "minItems": 1, "items": any() })
}

fn values_by_key(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "object", "additionalProperties": any() })
}

/// One run.
#[derive(Clone, Debug)]
pub struct Member {
    /// Name of its folder.
    pub name: String,
    /// Its combination: members of the same one are replicates.
    pub point: usize,
    /// Seed; None without replicates.
    pub seed: Option<u64>,
    /// `key=value`, as for `--set`.
    pub overrides: Vec<String>,
    /// The case with these, all defaults filled in.
    pub resolved: String,
}

/// A sweep that is read and checked.
#[derive(Clone, Debug)]
pub struct Sweep {
    /// Case file.
    pub case: PathBuf,
    /// Names of what varies.
    pub names: Vec<String>,
    /// Labels of each combination, in the order of the names.
    pub points: Vec<Vec<String>>,
    /// All runs, replicates of a combination one after the other.
    pub members: Vec<Member>,
    /// What the table has of each.
    pub results: Results,
}

impl Sweep {
    /// Reads a file and checks the case of every member.
    ///
    /// # Errors
    /// What is wrong with the file or, with the values of a member, with the case.
    pub fn load(path: &Path) -> Result<Self, ProgramError> {
        let document = Document::read(path)?;
        let root = schemars::schema_for!(SweepFile).to_value();
        case::check_against(&root, &document)?;
        let file: SweepFile = (document.value().clone())
            .try_into()
            .map_err(|e: toml::de::Error| document.error("", e.message().to_owned()))?;
        file.check(&document)?;
        let case = path.parent().unwrap_or(Path::new("")).join(&file.case);
        let mut sweep = Self {
            case,
            names: file.vary.iter().map(|v| v.name.clone()).collect(),
            points: Vec::new(),
            members: Vec::new(),
            results: file.results.clone(),
        };
        let mut choice = vec![0; file.vary.len()];
        loop {
            sweep.push(&file, &choice, &document)?;
            // Like an odometer: the last one turns fastest.
            let Some(k) = (0..choice.len()).rfind(|&k| choice[k] + 1 < file.vary[k].values.len())
            else {
                break;
            };
            choice[k] += 1;
            choice[k + 1..].fill(0);
        }
        let mut names = BTreeSet::new();
        if let Some(double) = sweep.members.iter().find(|m| !names.insert(&m.name)) {
            let message = format!("two members would have the folder `{}`", double.name);
            let error = document.error("vary", message);
            let help = "labels that differ in letters, digits, `.`, `+` or `-`";
            return Err(error.with_help(help).into());
        }
        Ok(sweep)
    }

    /// Adds the replicates of a combination.
    fn push(
        &mut self,
        file: &SweepFile,
        choice: &[usize],
        document: &Document,
    ) -> Result<(), ProgramError> {
        let mut shared: Vec<String> = (file.set.iter()).map(|(k, v)| setting(k, v)).collect();
        let mut labels = Vec::new();
        for (vary, &at) in file.vary.iter().zip(choice) {
            let value = &vary.values[at];
            match (&vary.keys[..], value) {
                ([key], value) => shared.push(setting(key, value)),
                (keys, toml::Value::Array(values)) => {
                    shared.extend(keys.iter().zip(values).map(|(k, v)| setting(k, v)));
                }
                _ => {}
            }
            labels.push(vary.label(at));
        }
        let named = self.names.iter().zip(&labels);
        let mut name: Vec<String> = named.map(|(n, l)| format!("{n}={l}")).collect();
        let seeds = match &file.replicates {
            Some(r) => (r.first..r.first + r.count).map(Some).collect(),
            None => vec![None],
        };
        for seed in seeds {
            let mut overrides = shared.clone();
            if let (Some(seed), Some(replicates)) = (seed, &file.replicates) {
                overrides.extend(replicates.seeds.iter().map(|key| format!("{key}={seed}")));
                name.truncate(labels.len());
                name.push(format!("seed={seed}"));
            }
            let (case, _) = case::load(&self.case, &overrides)?;
            if self.results.from >= case.time.end {
                let message = format!(
                    "`results.from = {}` is not before the end of the runs, `time.end = {}`",
                    self.results.from, case.time.end
                );
                let error = document.value_error("results.from", message);
                return Err(error.with_help("a time [s] within the runs").into());
            }
            let resolved = toml::to_string(&case);
            self.members.push(Member {
                name: folder(&name),
                point: self.points.len(),
                seed,
                overrides,
                resolved: resolved.map_err(ProgramError::failed)?,
            });
        }
        self.points.push(labels);
        Ok(())
    }
}

impl SweepFile {
    /// Rules that the schema cannot say.
    fn check(&self, document: &Document) -> Result<(), Box<CaseError>> {
        let mut seen = BTreeSet::new();
        for (k, vary) in self.vary.iter().enumerate() {
            let path = |key: &str| format!("vary[{k}].{key}");
            if !seen.insert(&vary.name) || ["seed", "state", "runs"].contains(&vary.name.as_str()) {
                let message = format!("`{} = {:?}` is taken", path("name"), vary.name);
                let error = document.value_error(&path("name"), message);
                return Err(error.with_help("a name that no other column of the table has"));
            }
            let keys = vary.keys.len();
            for (j, value) in vary.values.iter().enumerate() {
                let fits = |list: &Vec<toml::Value>| list.len() == keys;
                if keys > 1 && !value.as_array().is_some_and(fits) {
                    let path = format!("{}[{j}]", path("values"));
                    let message = format!("`{path} = {value}` does not fit {keys} keys");
                    let error = document.value_error(&path, message);
                    return Err(error.with_help(format!("a list of {keys} values")));
                }
            }
            let wanted = vary.values.len();
            match &vary.labels {
                Some(labels) if labels.len() != wanted => {
                    let message = format!(
                        "`{}` has {} entries for {wanted} values",
                        path("labels"),
                        labels.len()
                    );
                    let error = document.value_error(&path("labels"), message);
                    return Err(error.with_help("one label a value"));
                }
                None if vary.values.iter().any(|v| v.is_table() || v.is_array()) => {
                    let message = format!("`vary[{k}]` lacks `labels`");
                    let error = document.error(&path("values"), message);
                    return Err(error.with_help("values that are tables or lists need labels"));
                }
                _ => {}
            }
        }
        if let Some(to) = self.results.to.filter(|&to| to <= self.results.from) {
            let message = format!("`results.to = {to}` is not after `results.from`");
            let error = document.value_error("results.to", message);
            return Err(error.with_help("a later time [s], or none"));
        }
        let columns = self.results.columns.iter().enumerate();
        let mut named: Vec<(String, &String)> = columns
            .map(|(k, column)| (format!("results.columns[{k}]"), column))
            .collect();
        let steady = self.results.steady.iter();
        named.extend(steady.map(|column| ("results.steady".to_owned(), column)));
        for (path, column) in named {
            if !column
                .split_once('.')
                .is_some_and(|(f, c)| !f.is_empty() && !c.is_empty())
            {
                let message = format!("`{path} = {column:?}` is not FILE.COLUMN");
                let error = document.value_error(&path, message);
                return Err(error.with_help(
                    "`structure.eta_sp` is the column `eta_sp` of `series/structure.csv`",
                ));
            }
        }
        Ok(())
    }
}

impl Vary {
    fn label(&self, at: usize) -> String {
        match (&self.labels, &self.values[at]) {
            (Some(labels), _) => labels[at].clone(),
            (None, toml::Value::String(word)) => word.clone(),
            (None, value) => value.to_string(),
        }
    }
}

fn setting(key: &str, value: &toml::Value) -> String {
    format!("{key}={value}")
}

/// A folder's name of parts.
fn folder(parts: &[String]) -> String {
    let plain = |c: char| {
        if c.is_alphanumeric() || "=.+-".contains(c) {
            c
        } else {
            '-'
        }
    };
    if parts.is_empty() {
        return "case".to_owned();
    }
    parts
        .join("_")
        .chars()
        .map(|c| if c == '_' { c } else { plain(c) })
        .collect()
}
