//! A program killed while it writes a case leaves the old case or the new one, and never neither.
#![cfg(target_os = "linux")]

use monro_case::markups::NamedPoint;
use monro_case::{Case, CaseFiles, Manifest, SCHEMA, Source, Staging};
use monro_geometry::{Point, TetMesh, TriangleMesh};
use monro_guidance::{Plan, Side};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

const KILLS: u64 = 40;

fn case(vertices: usize) -> Case {
    let at = |i: usize| Point::new((i % 7) as f64, (i % 11) as f64, i as f64);
    let corners = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0.25, 0.25, 1.5]].map(Point::from_array);
    let surface = || {
        let triangles = vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        TriangleMesh { vertices: corners.into_iter().chain((4..vertices).map(at)).collect(), triangles }
    };
    let source = Source { format: "NIfTI".into(), series: "test".into(), dims: [2, 2, 2], spacing_mm: [1.0; 3] };
    let manifest = Manifest {
        schema: SCHEMA,
        generator: "test".into(),
        notice: "research".into(),
        pseudonym: "P-1".into(),
        side: "left".into(),
        skull_angle_deg: None,
        source,
        findings: Vec::new(),
        confidence: Vec::new(),
        doubts: Vec::new(),
        files: Vec::new(),
    };
    Case {
        manifest,
        plan: Plan::new(Side::Left, Point::new(30.0, -70.0, 100.0), Point::new(5.0, -20.0, 40.0)).expect("plan"),
        landmarks: vec![NamedPoint { label: "nasion".into(), position: Point::new(0.0, -95.0, 0.0) }],
        skin: surface(),
        brain: surface(),
        ventricles: surface(),
        tets: TetMesh { vertices: corners.to_vec(), tets: vec![[0, 1, 2, 3]], labels: vec![4] },
    }
}

fn write(dir: &Path, force: bool) {
    let staging = Staging::begin(dir, force).expect("begin");
    let images = CaseFiles { ct: Some(vec![7; 1 << 16]), labels: None };
    case(3000).write(&staging, images).expect("write");
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
