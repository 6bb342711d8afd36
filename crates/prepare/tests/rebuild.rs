//! A case is built again from corrected labels; the observer sees every stage and can stop the work.

use monro_anatomy::phantom::{HeadOptions, Phantom, head};
use monro_geometry::{Grid, Structure, Vector, Volume};
use monro_guidance::Side;
use monro_prepare::{Labels, Observer, PrepareError, Prepared, Request, Silent, Stage, build, confidence, rebuild};
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
    Request { labels: Labels::Given(labels.map(u16::from)), elements: 3000, ..Request::default() }
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
    assert_eq!(first.case.manifest.scan_findings, 0);
    // What is told of a scan is not seen in the CT of the case; what is told of labels, plan and mesh is found anew.
    let told = ["slices 5 and 6 are 9 mm apart", "an artery is drawn as a ventricle"];
    first.case.manifest.findings.splice(0..0, told.map(String::from));
    first.case.manifest.scan_findings = 1;
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
    // "slices 5 and 6 are 9 mm apart" was gone once labels were corrected, and each mesh was to be like the last one.
    let manifest = &second.case.manifest;
    assert_eq!((manifest.findings[0].as_str(), manifest.scan_findings, manifest.elements), (told[0], 1, Some(3000)));
    assert!(!manifest.findings.iter().any(|f| f == told[1]));
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

#[test]
fn a_path_that_was_given_was_replaced_by_the_automatic_one_in_a_rebuilt_case() {
    let (made, scan) = phantom();
    let found = build(scan.clone(), &given(&made.labels), &Silent).expect("case").case;
    // A path that was found is sought again: here the foramina have moved with the labels, up by two voxels.
    let up = |labels: &Volume<u8>| {
        let (grid, mut out) = (*labels.grid(), labels.clone());
        let layer = grid.dims()[0] * grid.dims()[1];
        out.data_mut()[2 * layer..].copy_from_slice(&labels.data()[..labels.data().len() - 2 * layer]);
        out
    };
    let again = rebuild(&found, scan.clone(), up(&made.labels).map(u16::from), &Silent).expect("rebuilt").case;
    assert!(again.plan.target().distance(found.plan.target()) > 2.0, "{:?}", again.plan);
    let own = [found.plan.entry() + Vector::new(4.0, 3.0, 0.0), found.plan.target() + Vector::new(0.0, 1.0, -2.0)];
    let request = Request { path: Some(own), ..given(&made.labels) };
    let first = build(scan.clone(), &request, &Silent).expect("case").case;
    let second = rebuild(&first, scan, made.labels.map(u16::from), &Silent).expect("rebuilt").case;
    assert_eq!((second.plan.entry(), second.plan.target()), (first.plan.entry(), own[1]));
    assert!(first.plan.entry().distance(own[0]) < 3.0);
}

/// Depths were counted from a marker 20 mm above the skin: "CSF at a depth of 88 mm under the skin" for 69.
#[test]
fn a_path_begins_at_the_skin_wherever_on_it_the_entry_was_given() {
    let (made, scan) = phantom();
    let found = build(scan.clone(), &given(&made.labels), &Silent).expect("case").case.plan;
    for (mm, words) in [(-19.8, "above the skin"), (10.0, "under the skin"), (0.4, "")] {
        let path = Some([found.at_depth(mm), found.target()]);
        let case = build(scan.clone(), &Request { path, ..given(&made.labels) }, &Silent).expect("case").case;
        let off = case.plan.entry().distance(found.entry());
        assert!(off < 1.0, "{mm}: {off} mm");
        let told = case.manifest.findings.iter().find(|f| f.contains("depths count from there"));
        assert!(told.map_or(words.is_empty(), |f| f.contains(words)), "{mm}: {:?}", case.manifest.findings);
    }
    // Where the scan ends below the entry, the flat cap is no skin.
    let (grid, dims) = (*made.labels.grid(), made.labels.grid().dims());
    let top = grid.voxel_from_patient().point(found.entry()).z as usize - 3;
    let cut = Grid::new([dims[0], dims[1], top], *grid.patient_from_voxel()).expect("a grid");
    let labels = Volume::new(cut, made.labels.data()[..cut.len()].to_vec()).expect("labels");
    let ct = Volume::new(cut, scan.volume.data()[..cut.len()].to_vec()).expect("a scan");
    let request = Request { path: Some([found.entry(), found.target()]), ..given(&labels) };
    let case = build(Scan { volume: ct, ..scan }, &request, &Silent).expect("case").case;
    assert_eq!(case.plan.entry(), found.entry());
    assert!(
        case.manifest.findings.iter().any(|f| f.contains("scan ends before the skin")),
        "{:?}",
        case.manifest.findings
    );
}

#[test]
fn another_path_on_the_same_labels_lost_what_was_known_of_them() {
    let (_, scan) = phantom();
    let first = build(scan.clone(), &Request { elements: 3000, ..Request::default() }, &Silent).expect("case");
    assert!(!first.case.manifest.confidence.is_empty());
    let mut known = first.segmentation.clone();
    known.findings.push("blood in the right lateral ventricle?".into());
    let path = Some([first.case.plan.entry(), first.case.plan.target() + Vector::new(0.0, 0.0, -1.0)]);
    let request = Request { labels: Labels::Known(known), path, elements: 3000, side: None };
    let second = build(scan, &request, &Silent).expect("case");
    assert_eq!(second.case.manifest.confidence, first.case.manifest.confidence);
    assert_eq!(second.case.manifest.doubts, first.case.manifest.doubts);
    assert!(second.case.manifest.findings.iter().any(|f| f.contains("blood")), "{:?}", second.case.manifest.findings);
    assert_eq!(second.segmentation.labels.data(), first.segmentation.labels.data());
}
