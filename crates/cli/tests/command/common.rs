//! Running the command as a user does.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Runs `monro` with arguments.
pub(crate) fn monro(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_monro")).args(args).output().expect("the command starts")
}

/// Runs `monro ... --json`, expects success and returns the object.
pub(crate) fn json(args: &[&str]) -> Value {
    let out = monro(&[args, &["--json"]].concat());
    let stderr = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success(), "monro {args:?} failed:\n{stderr}");
    serde_json::from_slice(&out.stdout).unwrap_or_else(|e| panic!("stdout is no JSON object ({e}): {:?}", out.stdout))
}

/// Runs `monro`, expects failure and returns what it said.
pub(crate) fn refusal(args: &[&str]) -> String {
    let out = monro(args);
    let stderr = String::from_utf8_lossy(&out.stderr).into_owned();
    assert!(!out.status.success(), "monro {args:?} should have failed");
    assert!(!stderr.contains("panicked"), "monro {args:?} panicked:\n{stderr}");
    stderr
}

/// A path as text.
pub(crate) fn text(path: &Path) -> &str {
    path.to_str().expect("a UTF-8 path")
}

/// The folder of real scans, where it exists.
pub(crate) fn data() -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    path.is_dir().then_some(path)
}

/// Three numbers of a JSON array.
pub(crate) fn point(value: &Value) -> [f64; 3] {
    let a = value.as_array().expect("an array");
    [0, 1, 2].map(|i| a[i].as_f64().expect("a number"))
}

/// Distance of two points.
pub(crate) fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}
