//! A case is built again from corrected labels; the observer sees every stage and can stop the work.

use monro_anatomy::phantom::{HeadOptions, Phantom, head};
use monro_geometry::{Structure, Volume};
use monro_guidance::Side;
use monro_prepare::{Observer, PrepareError, Prepared, Request, Silent, Stage, build, confidence, rebuild};
use monro_scan::{ReadOptions, Scan, nifti};
use std::cell::RefCell;

fn phantom() -> (Phantom, Scan) {
    let made = head(&HeadOptions { spacing_mm: [2.0; 3], ..HeadOptions::default() }).expect("phantom");
    let dir = tempfile::tempdir().expect("temp");
    let file = dir.path().join("head.nii.gz");
    std::fs::write(&file, nifti::encode_i16(&made.ct)).expect("write");
    let scan = monro_scan::read(&file, &ReadOptions::default()).expect("scan");
    (made, scan)
}

fn given(labels: &Volume<u8>) -> Request {
    Request { labels: Some(labels.map(u16::from)), elements: 3000, ..Request::default() }
}

fn ml(prepared: &Prepared, structure: Structure) -> f64 {
    prepared.volumes_ml.iter().find(|(s, _)| *s == structure).expect("listed").1
}

/// Writes down the stages and stops before one of them.
#[derive(Default)]
struct Diary {
    begun: RefCell<Vec<Stage>>,
    ended: RefCell<Vec<Stage>>,
    stop_after: Option<Stage>,
}

impl Observer for Diary {
    fn begin(&self, stage: Stage) {
        self.begun.borrow_mut().push(stage);
    }

    fn end(&self, stage: Stage) {
        self.ended.borrow_mut().push(stage);
    }

    fn cancelled(&self) -> bool {
        self.stop_after.is_some_and(|s| self.ended.borrow().contains(&s))
    }
}

#[test]
fn a_corrected_ventricle_is_in_the_rebuilt_case_and_its_identity_stays() {
    let (made, scan) = phantom();
    let diary = Diary::default();
    let request = Request { side: Some(Side::Left), ..given(&made.labels) };
    let mut first = build(scan.clone(), &request, &diary).expect("case");
    assert_eq!(*diary.begun.borrow(), &Stage::ALL[..4]);
    assert_eq!(*diary.begun.borrow(), *diary.ended.borrow());
    first.case.manifest.pseudonym = "kept".into();
    assert!(first.case.manifest.confidence.is_empty(), "nothing is known of labels made elsewhere");
    first.case.manifest.confidence = confidence(&[(Structure::Brain, 0.91)]);
    // The part of the left ventricle that lies behind its middle is taken for brain.
    let left = Structure::LeftLateralVentricle.label();
    let rows: Vec<usize> = (0..made.labels.data().len()).filter(|&n| made.labels.data()[n] == left).collect();
    let grid = *made.labels.grid();
    let middle = rows.iter().map(|&n| grid.voxel(n)[1]).sum::<usize>() / rows.len();
    let mut corrected = made.labels.clone();
    for n in rows.into_iter().filter(|&n| grid.voxel(n)[1] > middle) {
        corrected.data_mut()[n] = Structure::Brain.label();
    }
    let second = rebuild(&first.case, scan, corrected.map(u16::from), &Silent).expect("rebuilt");
    let (before, after) = (ml(&first, Structure::LeftLateralVentricle), ml(&second, Structure::LeftLateralVentricle));
    assert!(after < 0.75 * before, "{after} of {before} ml");
    assert_eq!(second.case.manifest.pseudonym, "kept");
    assert_eq!(second.case.plan.side().name(), "left");
    let known = second.case.manifest.confidence.iter().map(|c| (c.structure.as_str(), c.expected_dice));
    assert_eq!(known.collect::<Vec<_>>(), [("brain", 0.91)]);
    let surface = |p: &Prepared| p.case.ventricles.signed_volume() / 1000.0;
    assert!(surface(&second) < surface(&first) - 0.2 * before);
}

#[test]
fn the_work_stops_between_stages_when_asked() {
    let (made, scan) = phantom();
    let diary = Diary { stop_after: Some(Stage::Segment), ..Diary::default() };
    let stopped = build(scan, &given(&made.labels), &diary);
    assert!(matches!(stopped, Err(PrepareError::Cancelled)));
    assert_eq!(*diary.begun.borrow(), [Stage::Segment]);
}

#[test]
fn an_emptied_structure_is_an_error_that_names_it() {
    let (made, scan) = phantom();
    let none = made.labels.map(|l| if l == Structure::RightLateralVentricle.label() { 4 } else { l });
    let said = build(scan, &given(&none), &Silent).expect_err("refused").to_string();
    assert!(said.contains("right_lateral_ventricle"), "{said}");
}
