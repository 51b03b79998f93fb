//! Dependencies: their licences, where they come from, and the oldest compiler that they build with.

use std::process::Command;

use serde_json::Value;
use spdx::{Expression, ParseMode};

use crate::support::project;

fn cargo(args: &[&str]) -> Vec<u8> {
    let output = Command::new(env!("CARGO")).args(args).current_dir(project(".")).output().expect("cargo starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output.stdout
}

/// Every package that a build for this machine has, as cargo tells it: those that the build has fetched.
fn packages() -> Vec<Value> {
    let version = String::from_utf8(cargo(&["-vV"])).expect("UTF-8");
    let host = version.lines().find_map(|line| line.strip_prefix("host: ")).expect("cargo tells its host");
    let text = cargo(&["metadata", "--format-version", "1", "--locked", "--offline", "--filter-platform", host]);
    let mut metadata: Value = serde_json::from_slice(&text).expect("cargo writes JSON");
    let Value::Array(packages) = metadata["packages"].take() else { panic!("a list of packages") };
    packages
}

fn name(package: &Value) -> &str {
    package["name"].as_str().expect("a package has a name")
}

#[test]
fn every_dependency_has_a_licence_of_deny_toml() {
    let text = std::fs::read_to_string(project("deny.toml")).expect("deny.toml");
    let policy: toml::Table = text.parse().expect("TOML");
    let allowed: Vec<&str> =
        policy["licenses"]["allow"].as_array().unwrap().iter().filter_map(|l| l.as_str()).collect();
    let packages = packages();
    assert!(packages.len() > 50, "dependencies are found: {}", packages.len());
    let refused: Vec<String> = packages
        .iter()
        .filter(|package| {
            let license = package["license"].as_str().unwrap_or_default();
            let expression = Expression::parse_mode(license, ParseMode::LAX);
            !expression.is_ok_and(|e| e.evaluate(|r| allowed.iter().any(|a| r.license.to_string() == *a)))
        })
        .map(|package| format!("{}: {}", name(package), package["license"]))
        .collect();
    assert!(refused.is_empty(), "{refused:#?}");
    // The test itself can fail.
    let copyleft = Expression::parse("GPL-3.0-only AND MIT").unwrap();
    assert!(!copyleft.evaluate(|r| allowed.iter().any(|a| r.license.to_string() == *a)));
}

#[test]
fn every_dependency_comes_from_the_registry_or_from_here() {
    for package in packages() {
        let source = package["source"].as_str();
        assert!(source.is_none_or(|s| s.starts_with("registry+")), "{}: {source:?}", name(&package));
    }
}

/// What a user with the compiler of `rust-version` meets: a dependency that asks for more stops the build.
#[test]
fn no_dependency_asks_for_a_newer_compiler_than_we_do() {
    let version = |package: &Value| -> Option<Vec<u32>> {
        let text = package["rust_version"].as_str()?;
        Some(text.split('.').map(|part| part.parse().expect("a number")).collect())
    };
    let packages = packages();
    let own = packages.iter().find(|p| name(p) == "yarnray").and_then(version).expect("our own version");
    for package in &packages {
        assert!(version(package).is_none_or(|v| v <= own), "{} asks for {}", name(package), package["rust_version"]);
    }
}
