//! All files of a folder, described.

use super::bare::{Begin, NEEDED};
use super::image::{Found, Identity, Image, describe};
use crate::error::{Problem, ScanError};
use crate::shelf::is_volume;
use std::collections::{BTreeSet, HashMap};
use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};

const MOST_FILES: usize = 20_000;
const DEEPEST: usize = 8;
/// Larger files are no DICOM images of a head.
const LARGEST_FILE: u64 = 2 << 30;

/// What a folder holds.
#[derive(Debug, Default)]
pub(crate) struct Survey {
    pub(crate) images: Vec<Image>,
    /// DICOM files that cannot be understood.
    pub(crate) broken: Vec<(PathBuf, Problem)>,
    not_dicom: Vec<PathBuf>,
    no_image: Vec<PathBuf>,
    pub(crate) files: usize,
}

impl Survey {
    /// Describes a file, or all files of a folder and its sub-folders, in the order of their paths.
    pub(crate) fn of(path: &Path) -> Result<Self, ScanError> {
        let mut files = vec![path.to_path_buf()];
        if path.is_dir() {
            files = list(path)?;
            if files.is_empty() {
                return Err(ScanError::EmptyFolder(path.to_path_buf()));
            }
            files.sort();
        }
        let mut survey = Self { files: files.len(), ..Self::default() };
        for file in files {
            survey.add(file);
        }
        Ok(survey)
    }

    fn add(&mut self, file: PathBuf) {
        match load(&file).and_then(|bytes| bytes.map_or(Ok(Found::NotDicom), |b| describe(&file, &b))) {
            Ok(Found::Images(images)) => self.images.extend(images),
            Ok(Found::NoImage) => self.no_image.push(file),
            Ok(Found::NotDicom) => self.not_dicom.push(file),
            Err(problem) => self.broken.push((file, problem)),
        }
    }

    /// Sentences about what was left out.
    pub(crate) fn skipped(&self) -> Vec<String> {
        let one = |files: &[PathBuf], what: &str| {
            let first = name(files.first()?);
            Some(format!("{} of {} files {what} and were left out (the first: {first})", files.len(), self.files))
        };
        let not_dicom = one(&self.not_dicom, "are not DICOM");
        // Scans, too, which only the DICOM beside them keeps from being seen.
        let volumes = self.not_dicom.iter().filter(|file| is_volume(&name(file))).count();
        let to_name = format!("; {volumes} of them NIfTI, NRRD or MetaImage: give the path of one to take it");
        let not_dicom = not_dicom.map(|text| if volumes > 0 { text + &to_name } else { text });
        not_dicom.into_iter().chain(one(&self.no_image, "are DICOM objects without an image")).collect()
    }

    /// Number of images of each patient.
    pub(crate) fn patients(&self) -> Vec<usize> {
        let mut known: Vec<(&Identity, usize)> = Vec::new();
        for image in &self.images {
            match known.iter_mut().find(|(p, _)| same_patient(p, &image.identity)) {
                Some((_, count)) => *count += 1,
                None => known.push((&image.identity, 1)),
            }
        }
        known.into_iter().map(|(_, count)| count).collect()
    }

    /// Whether images of one patient's id carry different names, other than in their punctuation.
    pub(crate) fn names_differ(&self) -> bool {
        let bare = |name: &str| name.chars().filter(|c| c.is_alphanumeric()).collect::<String>();
        let mut known: HashMap<&str, String> = HashMap::new();
        let named = self.images.iter().map(|i| (i.identity.id.as_str(), bare(&i.identity.name)));
        named.filter(|(id, name)| !id.is_empty() && !name.is_empty()).any(|(id, name)| match known.get(id) {
            Some(first) => *first != name,
            None => known.insert(id, name).is_some(),
        })
    }
}

/// Two identities that do not contradict each other: an id or a name that is missing proves nothing.
pub(crate) fn same_patient(a: &Identity, b: &Identity) -> bool {
    if !a.id.is_empty() && !b.id.is_empty() {
        return a.id == b.id;
    }
    a.name.is_empty() || b.name.is_empty() || a.name == b.name
}

/// Name of a file, for messages: its folder may carry the patient's name.
pub(crate) fn name(file: &Path) -> String {
    file.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// All files in a folder and below it. Links to folders are followed last and no folder is entered twice, so that files keep
/// the path at which they lie, and a link that leads in a circle ends.
fn list(root: &Path) -> Result<Vec<PathBuf>, ScanError> {
    let (mut files, mut seen) = (Vec::new(), BTreeSet::new());
    let (mut folders, mut links) = (vec![(root.to_path_buf(), 0)], Vec::new());
    while let Some((folder, depth)) = folders.pop().or_else(|| links.pop()) {
        if !seen.insert(fs::canonicalize(&folder).map_err(|e| unreadable(&folder, &e))?) {
            continue;
        }
        if depth > DEEPEST {
            return Err(too_large(root));
        }
        for path in entries(&folder)? {
            if path.is_file() {
                files.push(path);
            } else if path.is_dir() {
                if path.is_symlink() { &mut links } else { &mut folders }.push((path, depth + 1));
            }
        }
        if files.len() > MOST_FILES {
            return Err(too_large(root));
        }
    }
    Ok(files)
}

/// What lies right in a folder, in an order that does not depend on the system.
fn entries(folder: &Path) -> Result<Vec<PathBuf>, ScanError> {
    let listed = fs::read_dir(folder).and_then(|all| all.map(|e| Ok(e?.path())).collect::<Result<Vec<_>, _>>());
    let mut paths = listed.map_err(|e| unreadable(folder, &e))?;
    paths.sort();
    Ok(paths)
}

fn unreadable(folder: &Path, e: &std::io::Error) -> ScanError {
    ScanError::file(folder, Problem::Unreadable(e.to_string()))
}

fn too_large(root: &Path) -> ScanError {
    ScanError::FolderTooLarge { folder: root.to_path_buf(), limit: MOST_FILES, depth: DEEPEST }
}

/// Whether a file that begins like DICOM lies somewhere in a folder.
pub(crate) fn holds_dicom(folder: &Path) -> bool {
    // Too large or partly unreadable: reading it says so.
    list(folder).map_or(true, |files| files.iter().any(|file| is_dicom_file(file)))
}

/// Whether a file begins like DICOM.
pub(crate) fn is_dicom_file(file: &Path) -> bool {
    let mut begin = Vec::new();
    let read = fs::File::open(file).and_then(|f| f.take(NEEDED as u64).read_to_end(&mut begin));
    read.is_ok() && Begin::of(&begin).is_some()
}

/// The bytes of a DICOM file, completed where it begins without preamble; `None` for another file, of which only the beginning
/// is read.
pub(crate) fn load(file: &Path) -> Result<Option<Vec<u8>>, Problem> {
    let unreadable = |e: std::io::Error| Problem::Unreadable(e.to_string());
    let mut open = fs::File::open(file).map_err(unreadable)?;
    let size = open.metadata().map_err(unreadable)?.len();
    let mut begin = Vec::with_capacity(NEEDED);
    open.by_ref().take(NEEDED as u64).read_to_end(&mut begin).map_err(unreadable)?;
    let Some(kind) = Begin::of(&begin) else { return Ok(None) };
    if size > LARGEST_FILE {
        return Err(crate::error::unsupported(format!("a DICOM file of {size} bytes"), "export one file per slice"));
    }
    let mut bytes = kind.before();
    bytes.reserve(size.min(1 << 20) as usize);
    bytes.append(&mut begin);
    open.read_to_end(&mut bytes).map_err(unreadable)?;
    Ok(Some(bytes))
}
