//! One scan on its way to a case, on a thread of its own.

use super::Beside;
use crate::case_data;
use crate::lock::lock;
use axum::body::Bytes;
use monro_case::{CASE, Staging};
use monro_geometry::{Bvh, Patient, Point};
use monro_guidance::Side;
use monro_prepare::{Labels, Observer, Prepared, Request, Stage};
use monro_scan::{ReadOptions, Scan};
use serde_json::{Value, json};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, TryLockError};
use std::time::Instant;

/// What is to be done.
pub(super) enum Task {
    /// Read and prepare a scan.
    Scan { path: PathBuf, side: Option<Side> },
    /// Prepare the same labels along another path: its entry is moved to the skin nearest to the first point.
    Path([Point<Patient>; 2]),
}

/// How far it is.
#[derive(Debug, Clone, Default)]
struct Progress {
    running: Option<(&'static str, Instant)>,
    /// Stages done, with their time, s.
    done: Vec<(&'static str, f64)>,
    remarks: Vec<String>,
    error: Option<String>,
}

/// A case in memory, as displays get it.
struct Made {
    prepared: Prepared,
    scene: Bytes,
    ct: Bytes,
    /// Counts what was made.
    version: u32,
}

struct Inner {
    /// Where scans lie.
    scans: PathBuf,
    case_dir: PathBuf,
    beside: Beside,
    progress: Mutex<Progress>,
    /// Shared with those who look at it or write it, so that nobody waits for them.
    made: Mutex<Option<Arc<Made>>>,
    /// How many were made.
    versions: AtomicU32,
    busy: AtomicBool,
    /// What was written last.
    written: Mutex<Option<u32>>,
}

/// The job; clones share it.
#[derive(Clone)]
pub(super) struct Job(Arc<Inner>);

impl Observer for Job {
    fn begin(&self, stage: Stage) {
        self.enter(stage.name());
    }

    fn end(&self, _: Stage) {
        self.leave();
    }

    fn remark(&self, text: &str) {
        lock(&self.0.progress).remarks.push(text.to_owned());
    }
}

impl Job {
    pub(super) fn new(scans: PathBuf, case_dir: PathBuf, beside: Beside) -> Self {
        let (progress, made, written) = (Mutex::default(), Mutex::default(), Mutex::default());
        let (versions, busy) = (AtomicU32::new(0), AtomicBool::new(false));
        Self(Arc::new(Inner { scans, case_dir, beside, progress, made, versions, busy, written }))
    }

    fn enter(&self, stage: &'static str) {
        lock(&self.0.progress).running = Some((stage, Instant::now()));
    }

    fn leave(&self) {
        let mut progress = lock(&self.0.progress);
        if let Some((stage, since)) = progress.running.take() {
            progress.done.push((stage, since.elapsed().as_secs_f64()));
        }
    }

    /// Starts a task; false while another runs, or when there is nothing to go on with.
    pub(super) fn start(&self, task: Task) -> bool {
        let is_new = matches!(task, Task::Scan { .. });
        let fits = is_new || self.made().is_some();
        // While one is being written it is about to be opened.
        let is_written = matches!(self.0.written.try_lock(), Err(TryLockError::WouldBlock));
        if !fits || is_written || self.0.busy.swap(true, Ordering::AcqRel) {
            return false;
        }
        if is_new {
            // Of another scan: nobody is to open it for this one, which may turn out to be none.
            *lock(&self.0.made) = None;
        }
        *lock(&self.0.progress) = Progress::default();
        let job = self.clone();
        // The thread ends by itself; what it made or why not is in the job.
        std::thread::spawn(move || {
            let error = job.run(task).err();
            let mut progress = lock(&job.0.progress);
            (progress.running, progress.error) = (None, error);
            drop(progress);
            job.0.busy.store(false, Ordering::Release);
        });
        true
    }

    fn run(&self, task: Task) -> Result<(), String> {
        let (scan, request) = self.request(task)?;
        let prepared = monro_prepare::build(scan, &request, self).map_err(|e| e.to_string())?;
        self.enter("views");
        let scene = case_data::scene(&prepared.case).map_err(|e| e.to_string())?.0.into();
        let ct = case_data::ct_for_displays(&prepared.scan.volume).into();
        self.leave();
        let version = self.0.versions.fetch_add(1, Ordering::Relaxed) + 1;
        *lock(&self.0.made) = Some(Arc::new(Made { prepared, scene, ct, version }));
        Ok(())
    }

    fn made(&self) -> Option<Arc<Made>> {
        lock(&self.0.made).clone()
    }

    fn request(&self, task: Task) -> Result<(Scan, Request), String> {
        match task {
            Task::Scan { path, side } => {
                self.enter("read");
                let scan = monro_scan::read(&path, &ReadOptions::default()).map_err(|e| e.to_string())?;
                self.leave();
                Ok((scan, Request { side, ..Request::default() }))
            }
            Task::Path([near_entry, target]) => {
                let made = self.made().ok_or("nothing is prepared yet")?;
                let prepared = &made.prepared;
                let skin = Bvh::new(&prepared.case.skin);
                let entry = skin.nearest(near_entry).ok_or("the entry is not a place")?.point;
                let labels = Labels::Known(prepared.segmentation.clone());
                let request = Request { labels, path: Some([entry, target]), ..Request::default() };
                Ok((prepared.scan.clone(), request))
            }
        }
    }

    /// Writes the case, unless it is there already as it is now; in place of one that was written and then changed.
    pub(super) fn write(&self) -> Result<(), String> {
        if self.0.busy.load(Ordering::Acquire) {
            return Err("wait until the case is prepared".into());
        }
        let made = self.made().ok_or("nothing is prepared yet")?;
        let Made { prepared, version, .. } = &*made;
        let mut written = lock(&self.0.written);
        if *written == Some(*version) {
            return Ok(());
        }
        let inputs = [self.0.scans.as_path()];
        let staging = Staging::begin(&self.0.case_dir, written.is_some(), &CASE, &inputs).map_err(|e| e.to_string())?;
        monro_prepare::write(prepared, &staging, self).map_err(|e| e.to_string())?;
        let stages: Vec<_> = lock(&self.0.progress).done.iter().map(|(name, s)| ((*name).to_owned(), *s)).collect();
        (self.0.beside)(prepared, &stages, &staging)?;
        staging.finish().map_err(|e| e.to_string())?;
        *written = Some(*version);
        Ok(())
    }

    /// Surfaces, plan and mesh for displays.
    pub(super) fn scene(&self) -> Option<Bytes> {
        self.made().map(|m| m.scene.clone())
    }

    /// The CT for displays.
    pub(super) fn ct(&self) -> Option<Bytes> {
        self.made().map(|m| m.ct.clone())
    }

    /// Progress and result as JSON.
    pub(super) fn describe(&self) -> Value {
        // In this order: what is made has all of its stages behind it.
        let made = self.made().map(|made| made.describe());
        let progress = lock(&self.0.progress).clone();
        let stage = |(name, seconds): &(&str, f64)| json!({ "stage": name, "seconds": seconds });
        json!({
            "case_dir": self.0.case_dir,
            "running": self.0.busy.load(Ordering::Acquire),
            "stage": progress.running.map(|(stage, _)| stage),
            "stage_seconds": progress.running.map(|(_, since)| since.elapsed().as_secs_f64()),
            "done": progress.done.iter().map(stage).collect::<Vec<_>>(),
            "remarks": progress.remarks,
            "error": progress.error,
            "made": made,
        })
    }
}

impl Made {
    fn describe(&self) -> Value {
        let (case, mesh) = (&self.prepared.case, &self.prepared.case.tets);
        let volume = |(structure, ml): &(monro_geometry::Structure, f64)| json!([structure.name(), ml]);
        json!({
            "version": self.version,
            "pseudonym": case.manifest.pseudonym,
            "side": case.manifest.side,
            "findings": case.manifest.findings,
            "plan": case_data::plan(case),
            "volumes_ml": self.prepared.volumes_ml.iter().map(volume).collect::<Vec<_>>(),
            "elements": mesh.tets.len(),
        })
    }
}
