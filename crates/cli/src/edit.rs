//! `monro edit`: correct the labels of a scan or a case in the browser, and build the case again.

use crate::args::EditArgs;
use crate::console::{Console, tell};
use crate::interrupt::{self, Guard};
use crate::{NOTICE, prepare};
use anyhow::{Context, Result, bail, ensure};
use monro_anatomy::segment::{self, SegmentError};
use monro_case::{CASE, Case, Manifest, OutputError, Staging, check_output};
use monro_geometry::Volume;
use monro_prepare::{Labels, Observer, Prepared, Request};
use monro_scan::{ReadOptions, Scan, Source};
use monro_server::Ready;
use monro_server::edit::{EditOptions, Known, Rebuilt, Start, StartLabels, Subject, serve_edit};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Begins the findings of the automatic segmentation in a case that was made from corrected labels.
const BEFORE: &str = "automatic segmentation, before corrections: ";

/// Runs the command until it is interrupted.
pub(crate) fn run(args: &EditArgs, console: &Console) -> Result<()> {
    ensure!(args.path.exists(), "{}: no such file or folder", args.path.display());
    let (inputs, is_case) = (inputs(args), is_case(args));
    ensure!(!is_case || args.out.is_none(), "--out is for scans; a case is rebuilt in its own folder");
    let out = args.out.as_deref().unwrap_or(&args.path);
    match check_output(out, true, &CASE, &inputs.iter().map(PathBuf::as_path).collect::<Vec<_>>()) {
        // There is time to move it away; the rebuilding looks again.
        Err(e @ OutputError::Strangers { .. }) if is_case => {
            console.warn(&format!("the case cannot be rebuilt as it is: {e}"));
        }
        Err(e @ OutputError::Input { .. }) => return Err(e.into()),
        // What else there is to say of it is said by those who open it.
        _ => {}
    }
    let opened = if is_case { of_case(args, console)? } else { of_scan(args, console)? };
    opened.scan.warnings.iter().for_each(|w| console.warn(w));
    let Opened { scan, subject, start, out, findings, basis } = opened;
    let mut folder = out.clone().into_os_string();
    folder.push(".edit");
    let kept = scan.clone();
    let options = EditOptions {
        ct: scan.volume,
        subject,
        folder: folder.into(),
        start,
        findings,
        rebuild: Box::new(move |labels, known, observer| {
            rebuild((&basis, known), &kept, &labels, (&out, &inputs), observer).map_err(|e| format!("{e:#}"))
        }),
        listen: args.listen,
    };
    console.note(if is_case {
        "opening the editor ..."
    } else {
        "opening the editor, which segments the scan first ..."
    });
    serve_edit(options, |ready| announce(ready, console))?;
    Ok(())
}

fn is_case(args: &EditArgs) -> bool {
    args.path.join("case.toml").is_file()
}

/// What is read beside the case that is rebuilt.
fn inputs(args: &EditArgs) -> Vec<PathBuf> {
    let scan = args.out.is_some().then(|| args.path.clone());
    scan.into_iter().chain(args.labels.clone()).collect()
}

/// What is edited.
struct Opened {
    scan: Scan,
    subject: Subject,
    start: StartLabels,
    out: PathBuf,
    findings: Vec<String>,
    basis: Basis,
}

/// What the case is built from.
enum Basis {
    Case(Box<Case>),
    Scan,
}

fn of_case(args: &EditArgs, console: &Console) -> Result<Opened> {
    let case = console.stage("open case", || Case::open(&args.path))?;
    let [ct, labels] = ["ct.nii.gz", "labels.nii.gz"].map(|n| args.path.join(n));
    if !ct.is_file() || !labels.is_file() {
        bail!("{} has no images or labels (it was shared without them), so it cannot be edited", args.path.display());
    }
    let options = ReadOptions { any_size: true, ..ReadOptions::default() };
    let scan = console.stage("read", || monro_scan::read(&ct, &options))?;
    let (origin, start) = match &args.labels {
        Some(file) => given(file, &scan)?,
        None => {
            let (volume, source) = (scan.volume.clone(), scan.source.clone());
            let (confidence, doubts) = (case.manifest.confidence.clone(), case.manifest.doubts.clone());
            let earlier = case.manifest.findings.iter().filter_map(|f| f.strip_prefix(BEFORE));
            let known = Known { confidence, doubts, findings: earlier.map(str::to_owned).collect() };
            let start = move || Ok(Start { labels: read_labels(&labels, (&volume, &source))?, known });
            (origin(&case.manifest), Box::new(start) as StartLabels)
        }
    };
    let subject = Subject { scan: case.manifest.pseudonym.clone(), origin, known: Known::default() };
    let findings = case.manifest.findings.iter().filter(|f| !f.starts_with(BEFORE)).cloned().collect();
    Ok(Opened { scan, subject, start, out: args.path.clone(), findings, basis: Basis::Case(Box::new(case)) })
}

fn of_scan(args: &EditArgs, console: &Console) -> Result<Opened> {
    let out = args.out.clone().context("a scan needs --out CASE, the folder of the case that will be built")?;
    if out.join("case.toml").is_file() {
        bail!("{} is a case already; edit it with \"monro edit {0}\"", out.display());
    }
    if out.exists() {
        bail!("{} exists already and is no case; give another --out", out.display());
    }
    let options = ReadOptions { series_uid: args.series.clone(), ..ReadOptions::default() };
    let scan = console.stage("read", || monro_scan::read(&args.path, &options))?;
    let (origin, start) = match &args.labels {
        Some(file) => given(file, &scan)?,
        None => ("segmented automatically".to_owned(), automatic(&scan)),
    };
    let findings = scan.warnings.iter().chain(&scan.resampled).cloned().collect();
    let subject = Subject { scan: scan.pseudonym.clone(), origin, known: Known::default() };
    Ok(Opened { scan, subject, start, out, findings, basis: Basis::Scan })
}

/// Starts with the automatic segmentation.
fn automatic(scan: &Scan) -> StartLabels {
    let volume = scan.volume.clone();
    Box::new(move || {
        let found = segment::segment(&volume).map_err(|e| e.to_string())?;
        let (confidence, doubts) = (monro_prepare::confidence(&found.confidence), monro_prepare::spots(&found));
        Ok(Start { known: Known { confidence, doubts, findings: found.findings }, labels: found.labels })
    })
}

/// Starts with the labels of a file.
fn given(file: &Path, scan: &Scan) -> Result<(String, StartLabels)> {
    let bytes = std::fs::read(file).with_context(|| format!("cannot read {}", file.display()))?;
    let (path, volume, source) = (file.to_owned(), scan.volume.clone(), scan.source.clone());
    let start = move || Ok(Start { labels: read_labels(&path, (&volume, &source))?, known: Known::default() });
    // By content: a file that was saved again often keeps its name and its size.
    Ok((monro_case::sha256(&bytes), Box::new(start)))
}

/// Labels of a file on the scan's grid, checked.
fn read_labels(file: &Path, (scan, source): (&Volume<i16>, &Source)) -> Result<Volume<u8>, String> {
    let warn = |w: &String| tell(&format!("warning: {}: {w}", file.display()));
    let found = monro_scan::labels::read(file).map_err(|e| e.to_string())?;
    found.warnings.iter().for_each(warn);
    found.drawn_on.iter().filter_map(|d| d.unlike(source)).for_each(|w| warn(&w));
    let labels = found.volume;
    if let Some(bad) = labels.data().iter().find(|l| **l > 7) {
        return Err(format!(
            "{}: label {bad} is unknown; known are 0 (outside) to 7 (third ventricle)",
            file.display()
        ));
    }
    let labels = labels.map(|l| u8::try_from(l).unwrap_or(0));
    let named = |e: SegmentError| format!("{}: {e}", file.display());
    match segment::from_labels(scan, labels.clone()) {
        Ok(checked) => {
            checked.findings.iter().for_each(warn);
            Ok(checked.labels)
        }
        // What is missing can be drawn here.
        Err(e @ (SegmentError::EmptyPlanes { .. } | SegmentError::EmptyStructure { .. })) => {
            warn(&e.to_string());
            segment::onto_grid(scan.grid(), labels).map(|(labels, _)| labels).map_err(named)
        }
        Err(e) => Err(named(e)),
    }
}

fn rebuild(
    (basis, known): (&Basis, &Known),
    scan: &Scan,
    labels: &Volume<u8>,
    (out, inputs): (&Path, &[PathBuf]),
    observer: &dyn Observer,
) -> Result<Rebuilt> {
    let wide = labels.map(u16::from);
    let mut prepared = match basis {
        Basis::Case(case) => monro_prepare::rebuild(case, scan.clone(), wide, observer)?,
        Basis::Scan => monro_prepare::build(
            scan.clone(),
            &Request { labels: Labels::Given(wide), ..Request::default() },
            observer,
        )?,
    };
    let manifest = &mut prepared.case.manifest;
    manifest.confidence.clone_from(&known.confidence);
    manifest.doubts.clone_from(&known.doubts);
    manifest.findings.extend(known.findings.iter().map(|f| format!("{BEFORE}{f}")));
    write(&prepared, (out, inputs), observer)
}

/// Writes the case over the earlier one, whole or not at all.
fn write(prepared: &Prepared, (out, inputs): (&Path, &[PathBuf]), observer: &dyn Observer) -> Result<Rebuilt> {
    let staging = Staging::begin(out, true, &CASE, &inputs.iter().map(PathBuf::as_path).collect::<Vec<_>>())?;
    let guard = Guard::new(&staging);
    monro_prepare::write(prepared, &staging, observer)?;
    staging.write("report.html", prepare::report(prepared, &[])?.as_bytes())?;
    let case = guard.finish(staging)?;
    let manifest = Case::open(&case)?.manifest;
    Ok(Rebuilt { origin: origin(&manifest), findings: manifest.findings, case })
}

/// The labels of a case, by their hash.
fn origin(manifest: &Manifest) -> String {
    let labels = manifest.files.iter().find(|f| f.name == "labels.nii.gz");
    labels.map(|f| f.sha256.clone()).unwrap_or_default()
}

fn announce(ready: &Ready, console: &Console) {
    interrupt::ends_the_command();
    ready.notes.iter().for_each(|note| console.note(note));
    let line = json!({ "url": ready.url, "token": ready.token, "open": ready.browser_url() });
    let text = format!("Open {} in a browser on this machine (Ctrl-C ends it).\n{NOTICE}", ready.browser_url());
    console.result(&line, &text);
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::Grid;
    use monro_scan::nifti;

    /// They were refused, with the advice to draw what is missing in the editor.
    #[test]
    fn labels_that_lack_something_open_in_the_editor() {
        let dir = tempfile::tempdir().expect("temp");
        let grid = Grid::axis_aligned([12, 10, 8], [1.0; 3], [0.0; 3]).expect("grid");
        let [ct, file] = ["ct.nii.gz", "labels.nii.gz"].map(|name| dir.path().join(name));
        let values = (0..grid.len()).map(|n| (n % 90) as i16).collect();
        std::fs::write(&ct, nifti::encode_i16(&Volume::new(grid, values).expect("values"))).expect("write");
        let labels =
            Volume::new(grid, (0..grid.len()).map(|n| [0, 4][usize::from(n > 300)]).collect()).expect("values");
        std::fs::write(&file, nifti::encode_u8(&labels)).expect("write");
        let scan = monro_scan::read(&ct, &ReadOptions { any_size: true, ..ReadOptions::default() }).expect("scan");
        assert_eq!(read_labels(&file, (&scan.volume, &scan.source)).expect("opened").data(), labels.data());
        let strange = labels.map(|l| 2 * l);
        std::fs::write(&file, nifti::encode_u8(&strange)).expect("write");
        assert!(read_labels(&file, (&scan.volume, &scan.source)).expect_err("label 8").contains("label 8 is unknown"));
    }
}
