//! The arrows between crates run one way: `fluid` and `fibre` never import each other, only `coupling` knows both.

use std::collections::BTreeMap;
use std::process::Command;

/// What each crate may import (docs/architecture.md, section 1).
const ALLOWED: [(&str, &[&str]); 7] = [
    ("fibreflow-parallel", &[]),
    ("fibreflow-mesh", &["fibreflow-parallel"]),
    ("fibreflow-solve", &["fibreflow-mesh", "fibreflow-parallel"]),
    (
        "fibreflow-fluid",
        &["fibreflow-solve", "fibreflow-mesh", "fibreflow-parallel"],
    ),
    ("fibreflow-fibre", &["fibreflow-parallel"]),
    (
        "fibreflow-coupling",
        &[
            "fibreflow-fluid",
            "fibreflow-fibre",
            "fibreflow-mesh",
            "fibreflow-parallel",
        ],
    ),
    (
        "fibreflow",
        &[
            "fibreflow-coupling",
            "fibreflow-fluid",
            "fibreflow-fibre",
            "fibreflow-solve",
            "fibreflow-mesh",
            "fibreflow-parallel",
        ],
    ),
];

#[test]
fn crates_import_only_what_the_plan_allows() {
    let output = Command::new(env!("CARGO"))
        .args([
            "metadata",
            "--no-deps",
            "--format-version",
            "1",
            "--offline",
        ])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .expect("cargo metadata runs");
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let allowed: BTreeMap<_, _> = ALLOWED.into_iter().collect();
    let mut seen = 0;
    for package in metadata["packages"].as_array().expect("packages") {
        let name = package["name"].as_str().expect("name");
        if name == "fibreflow-tests" {
            continue;
        }
        let may = allowed
            .get(name)
            .unwrap_or_else(|| panic!("{name} is not in the plan of the house"));
        seen += 1;
        for dependency in package["dependencies"].as_array().expect("dependencies") {
            let used = dependency["name"].as_str().expect("name");
            let is_test_only = dependency["kind"] == "dev";
            if used.starts_with("fibreflow") && !is_test_only {
                assert!(may.contains(&used), "{name} must not import {used}");
            }
        }
    }
    assert_eq!(seen, ALLOWED.len());
}
