//! The case folder as a whole.

use crate::markups::{self, Kind, MarkupsError, NamedPoint};
use crate::ply::{self, PlyError};
use crate::vtu::{self, UnstructuredGrid, VtuError};
use crate::{FileEntry, Manifest, OutputKind, SCHEMA, Staging, StagingError};
use monro_geometry::{TetMesh, TriangleMesh};
use monro_guidance::{Plan, PlanError, Side};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Files that must be there.
const REQUIRED: [&str; 5] = ["skin.ply", "brain.ply", "ventricles.ply", "tets.vtu", "plan.mrk.json"];
/// Files that may be left out, to share a model without its images, or that a case made earlier has not.
const OPTIONAL: [&str; 4] = ["ct.nii.gz", "labels.nii.gz", "landmarks.mrk.json", "septa.ply"];

/// A case as what a command writes: what `--force` may replace.
pub const CASE: OutputKind = OutputKind {
    name: "a case",
    marks: &["case.toml"],
    files: &[
        "case.toml",
        "skin.ply",
        "brain.ply",
        "ventricles.ply",
        "tets.vtu",
        "plan.mrk.json",
        "ct.nii.gz",
        "labels.nii.gz",
        "landmarks.mrk.json",
        "septa.ply",
        "report.html",
    ],
    parts: &[],
    changed,
};

/// Why a case was refused.
#[derive(Debug, Error)]
pub enum CaseError {
    /// A file cannot be read.
    #[error("{path}: {error}")]
    Io {
        /// The file.
        path: PathBuf,
        /// The reason.
        error: io::Error,
    },
    /// There is no such folder.
    #[error("{0}: no such file or folder")]
    NoFolder(PathBuf),
    /// The folder is not a case.
    #[error("{0} is not a case: it has no case.toml (make one with \"monro prepare SCAN --out CASE\")")]
    NotACase(PathBuf),
    /// The manifest does not parse.
    #[error("{path}: {error}")]
    Manifest {
        /// The manifest.
        path: PathBuf,
        /// The reason, with its line.
        error: Box<toml::de::Error>,
    },
    /// The case was written by a newer program.
    #[error("{path}: schema {found}, but this program reads schema {SCHEMA}; use a newer Monro")]
    Schema {
        /// The manifest.
        path: PathBuf,
        /// Its schema.
        found: u32,
    },
    /// The manifest names a file that no case has.
    #[error("case.toml lists \"{0}\", which is no file of a case")]
    UnknownFile(String),
    /// A required file is not listed or not there.
    #[error("the case has no {0}; prepare it again")]
    Missing(&'static str),
    /// A file is not what the manifest says.
    #[error(
        "{path} was changed since Monro wrote it, or is damaged: {found_bytes} bytes with SHA-256 {found}, but case.toml says {expected_bytes} bytes with {expected}; give changed labels or a changed plan to \"monro prepare SCAN --labels FILE --plan FILE --out NEW\", else restore the file or prepare the case again"
    )]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Size found.
        found_bytes: u64,
        /// Hash found.
        found: String,
        /// Size listed.
        expected_bytes: u64,
        /// Hash listed.
        expected: String,
    },
    /// The side is neither left nor right.
    #[error("case.toml: side \"{0}\" is neither \"left\" nor \"right\"")]
    Side(String),
    /// A surface is faulty.
    #[error("{0}: {1}")]
    Ply(&'static str, PlyError),
    /// The tetrahedra are faulty.
    #[error("tets.vtu: {0}")]
    Vtu(#[from] VtuError),
    /// The plan is faulty.
    #[error("plan.mrk.json: {0}")]
    Markups(#[from] MarkupsError),
    /// The plan has no length.
    #[error("plan.mrk.json: {0}")]
    Plan(#[from] PlanError),
    /// The manifest cannot be written as TOML.
    #[error("case.toml: {0}")]
    Encode(#[from] toml::ser::Error),
    /// The folder cannot be written.
    #[error(transparent)]
    Staging(#[from] StagingError),
}

/// A prepared patient. Positions are LPS mm.
#[derive(Debug, Clone)]
pub struct Case {
    /// The manifest.
    pub manifest: Manifest,
    /// The planned path.
    pub plan: Plan,
    /// Named landmarks (nasion, Kocher's points, foramina of Monro), if the case has them.
    pub landmarks: Vec<NamedPoint>,
    /// Skin surface.
    pub skin: TriangleMesh,
    /// Brain surface.
    pub brain: TriangleMesh,
    /// Surface of the ventricles.
    pub ventricles: TriangleMesh,
    /// Falx and tentorium as one open surface, if the case has them.
    pub septa: Option<TriangleMesh>,
    /// Simulation mesh with the labels of `geometry::Structure`.
    pub tets: TetMesh,
}

/// Encoded image files to store beside the model.
#[derive(Debug, Clone, Default)]
pub struct CaseFiles {
    /// `ct.nii.gz`, if the images are to be kept.
    pub ct: Option<Vec<u8>>,
    /// `labels.nii.gz`.
    pub labels: Option<Vec<u8>>,
}

impl Case {
    /// Writes the case into a folder under construction. The manifest's file list is made here.
    ///
    /// # Errors
    /// When the file system refuses.
    pub fn write(&self, staging: &Staging, images: CaseFiles) -> Result<Manifest, CaseError> {
        let mut files: Vec<(&str, Vec<u8>)> = vec![
            ("skin.ply", ply::encode(&self.skin, None)),
            ("brain.ply", ply::encode(&self.brain, None)),
            ("ventricles.ply", ply::encode(&self.ventricles, None)),
            ("tets.vtu", vtu::encode(&UnstructuredGrid::from_mesh(&self.tets))),
            ("plan.mrk.json", encode_plan(&self.plan).into_bytes()),
        ];
        if !self.landmarks.is_empty() {
            files.push(("landmarks.mrk.json", markups::encode(Kind::Fiducial, &self.landmarks).into_bytes()));
        }
        files.extend(self.septa.as_ref().map(|septa| ("septa.ply", ply::encode(septa, None))));
        files.extend(images.ct.map(|b| ("ct.nii.gz", b)));
        files.extend(images.labels.map(|b| ("labels.nii.gz", b)));
        let mut manifest = self.manifest.clone();
        manifest.files.clear();
        for (name, bytes) in &files {
            staging.write(name, bytes)?;
            let entry = FileEntry { name: (*name).to_owned(), bytes: bytes.len() as u64, sha256: sha256(bytes) };
            manifest.files.push(entry);
        }
        let text = toml::to_string_pretty(&manifest)?;
        staging.write("case.toml", text.as_bytes())?;
        Ok(manifest)
    }

    /// Opens a case and checks every file that is there against its hash.
    ///
    /// # Errors
    /// The first fault found, naming the file.
    pub fn open(dir: &Path) -> Result<Self, CaseError> {
        let manifest = read_manifest(dir)?;
        let files = read_files(dir, &manifest)?;
        let get = |name: &'static str| files.get(name).map(Vec::as_slice).ok_or(CaseError::Missing(name));
        let text = |name| get(name).map(|b| String::from_utf8_lossy(b).into_owned());
        let surface = |name| ply::decode(get(name)?).map_err(|e| CaseError::Ply(name, e));
        let [entry, target] = markups::decode_plan(&text("plan.mrk.json")?)?;
        let side = match manifest.side.as_str() {
            "left" => Side::Left,
            "right" => Side::Right,
            other => return Err(CaseError::Side(other.to_owned())),
        };
        let landmarks = match files.contains_key("landmarks.mrk.json") {
            true => markups::decode(&text("landmarks.mrk.json")?)?,
            false => Vec::new(),
        };
        Ok(Self {
            plan: Plan::new(side, entry, target)?,
            landmarks,
            skin: surface("skin.ply")?,
            brain: surface("brain.ply")?,
            ventricles: surface("ventricles.ply")?,
            septa: files.contains_key("septa.ply").then(|| surface("septa.ply")).transpose()?,
            tets: vtu::decode(get("tets.vtu")?)?.to_mesh()?,
            manifest,
        })
    }
}

/// A plan as a Slicer line markup.
fn encode_plan(plan: &Plan) -> String {
    let at = |label: &str, position| NamedPoint { label: label.into(), position };
    markups::encode(Kind::Line, &[at("entry", plan.entry()), at("target", plan.target())])
}

fn read_manifest(dir: &Path) -> Result<Manifest, CaseError> {
    let path = dir.join("case.toml");
    if !dir.exists() {
        return Err(CaseError::NoFolder(dir.to_owned()));
    }
    if !path.is_file() {
        return Err(CaseError::NotACase(dir.to_owned()));
    }
    let text = fs::read_to_string(&path).map_err(|error| CaseError::Io { path: path.clone(), error })?;
    let fault = |error| CaseError::Manifest { path: path.clone(), error: Box::new(error) };
    // The schema first: a newer manifest may have fields that this program does not know.
    let table: toml::Table = toml::from_str(&text).map_err(fault)?;
    if let Some(found) = table.get("schema").and_then(toml::Value::as_integer)
        && found != i64::from(SCHEMA)
    {
        return Err(CaseError::Schema { path, found: u32::try_from(found).unwrap_or(0) });
    }
    toml::from_str(&text).map_err(fault)
}

/// All listed files that are there, checked; only a missing required one is a fault.
fn read_files(dir: &Path, manifest: &Manifest) -> Result<BTreeMap<&'static str, Vec<u8>>, CaseError> {
    let mut files = BTreeMap::new();
    for entry in &manifest.files {
        let known = REQUIRED.iter().chain(&OPTIONAL).find(|n| **n == entry.name);
        let name: &'static str = known.ok_or_else(|| CaseError::UnknownFile(entry.name.clone()))?;
        let path = dir.join(name);
        match fs::read(&path) {
            Ok(bytes) => {
                check(&path, &bytes, entry)?;
                files.insert(name, bytes);
            }
            // A required one is named below, an optional one may be left out.
            Err(e) if e.kind() == io::ErrorKind::NotFound => {}
            Err(error) => return Err(CaseError::Io { path, error }),
        }
    }
    match REQUIRED.iter().find(|name| !files.contains_key(**name)) {
        Some(name) => Err(CaseError::Missing(name)),
        None => Ok(files),
    }
}

fn check(path: &Path, bytes: &[u8], entry: &FileEntry) -> Result<(), CaseError> {
    let found = sha256(bytes);
    if found == entry.sha256 && bytes.len() as u64 == entry.bytes {
        return Ok(());
    }
    Err(CaseError::Damaged {
        path: path.to_owned(),
        found_bytes: bytes.len() as u64,
        found,
        expected_bytes: entry.bytes,
        expected: entry.sha256.clone(),
    })
}

/// Files of a case that are not as its manifest says: labels corrected in 3D Slicer and saved over them, say.
fn changed(dir: &Path) -> Vec<String> {
    let Ok(manifest) = read_manifest(dir) else { return vec!["case.toml".into()] };
    let as_written = |entry: &FileEntry| match fs::read(dir.join(&entry.name)) {
        Ok(bytes) => check(Path::new(&entry.name), &bytes, entry).is_ok(),
        Err(_) => true,
    };
    manifest.files.into_iter().filter(|entry| !as_written(entry)).map(|entry| entry.name).collect()
}

/// SHA-256, lower-case hexadecimal, as a manifest keeps it.
pub fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|b| format!("{b:02x}")).collect()
}
