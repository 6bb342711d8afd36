//! A program killed while it writes a case leaves the old case or the new one, and never neither.
#![cfg(target_os = "linux")]

mod common;

use common::case;
use monro_case::{CASE, Case, CaseFiles, Staging};
use monro_geometry::Point;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

const KILLS: u64 = 40;

/// The case with surfaces that take a while to write.
fn large() -> Case {
    let mut case = case();
    for surface in [&mut case.skin, &mut case.brain, &mut case.ventricles] {
        surface.vertices.extend((4..3000).map(|i| Point::new((i % 7) as f64, (i % 11) as f64, i as f64)));
    }
    case
}

fn write(dir: &Path, force: bool) {
    let staging = Staging::begin(dir, force, &CASE, &[]).expect("begin");
    let images = CaseFiles { ct: Some(vec![7; 1 << 16]), labels: None };
    large().write(&staging, images).expect("write");
    staging.finish().expect("finish");
}

/// Run by the test below in a process of its own.
#[test]
#[ignore = "a helper: rewrites the case in MONRO_TEST_CASE until it is killed"]
fn a_writer_to_be_killed() {
    let Ok(dir) = std::env::var("MONRO_TEST_CASE") else { return };
    loop {
        write(Path::new(&dir), true);
    }
}

struct Killed(Child);

impl Drop for Killed {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn a_case_is_whole_whenever_its_writer_is_killed() {
    let dir = tempfile::tempdir().expect("temp");
    let out = dir.path().join("case");
    write(&out, false);
    for n in 0..KILLS {
        let mut writer = Command::new(std::env::current_exe().expect("this test"));
        writer.args(["--exact", "a_writer_to_be_killed", "--ignored"]).env("MONRO_TEST_CASE", &out);
        let writer = Killed(writer.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("spawn"));
        // Moments that do not fall into step with the writing.
        sleep(Duration::from_micros(20_000 + n * 1_733 % 30_000));
        drop(writer);
        assert!(Case::open(&out).is_ok(), "kill {n}: {:?}", Case::open(&out).map(|_| ()));
    }
    // The next writer clears away what the killed ones have left.
    write(&out, true);
    let left: Vec<_> = std::fs::read_dir(dir.path()).expect("list").flatten().map(|e| e.file_name()).collect();
    assert_eq!(left, ["case"]);
}
