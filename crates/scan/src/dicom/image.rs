//! One image (one slice) as its header describes it.

use super::attributes::Attributes;
use super::outline::{self, Outline};
use super::unit::Unit;
use crate::error::{Problem, header, unsupported};
use crate::raster::MAX_VOXELS;
use dicom_core::Tag;
use dicom_dictionary_std::{tags, uids};
use dicom_object::{FileDicomObject, InMemDicomObject, OpenFileOptions};
use monro_geometry::{Patient, Point, Vector};
use std::path::{Path, PathBuf};

/// Words of the image type that mark renderings.
const PROJECTIONS: [&str; 7] = ["MIP", "MINIP", "AIP", "VRT", "SSD", "PROJECTION IMAGE", "VOLUME RENDERING"];

/// What stands in the place of a contrast agent where none was given.
const NO_AGENT: [&str; 8] = ["NONE", "NO", "N", "NO CONTRAST", "WITHOUT", "NATIVE", "-", "0"];

/// One slice, not decoded.
#[derive(Debug, Clone)]
pub(crate) struct Image {
    pub(crate) file: PathBuf,
    /// Index of the frame within its file.
    pub(crate) frame: usize,
    /// Frames in the file.
    pub(crate) frames: usize,
    pub(crate) identity: Identity,
    pub(crate) series_uid: String,
    pub(crate) instance_uid: String,
    pub(crate) modality: String,
    pub(crate) localizer: bool,
    /// A rendering or projection (MIP and the like), whose values are not those of the tissue.
    pub(crate) projection: bool,
    pub(crate) acquisition: Option<i64>,
    /// All words of the image type.
    pub(crate) kind: String,
    /// Whether it is a picture of a screen or the like (secondary capture).
    pub(crate) captured: bool,
    pub(crate) about: About,
    /// Columns and rows.
    pub(crate) size: [usize; 2],
    pub(crate) stored: Stored,
    /// Whether the file ends before its pixel data do.
    pub(crate) cut_short: bool,
    /// Where the slice lies; or what its header lacks.
    pub(crate) placement: Result<Placement, (&'static str, String)>,
}

/// Who is shown. Only compared, never passed on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Identity {
    pub(crate) id: String,
    pub(crate) name: String,
}

/// What a series tells about itself.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct About {
    pub(crate) description: Option<String>,
    pub(crate) kernel: Option<String>,
    pub(crate) scanner: Option<String>,
    pub(crate) kvp: Option<f64>,
    pub(crate) thickness: Option<f64>,
    /// The contrast agent that was given, as far as the header says.
    pub(crate) contrast: Option<String>,
}

/// Position and axes of a slice, LPS mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Placement {
    /// From one column to the next.
    pub(crate) u: Vector<Patient>,
    /// From one row to the next.
    pub(crate) v: Vector<Patient>,
    /// Centre of the first pixel.
    pub(crate) origin: Point<Patient>,
}

/// How pixels are stored.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Stored {
    pub(crate) syntax: String,
    pub(crate) photometric: String,
    pub(crate) samples: u32,
    pub(crate) allocated: u32,
    pub(crate) bits: u32,
    pub(crate) high_bit: u32,
    pub(crate) signed: bool,
    pub(crate) slope: f64,
    pub(crate) intercept: f64,
    /// What slope and intercept lead to.
    pub(crate) unit: Unit,
    /// Whether the header gives both slope and intercept.
    pub(crate) rescaled: bool,
    /// Stored values that mean "no data", lowest and highest.
    pub(crate) padding: Option<[i64; 2]>,
}

/// What a file turned out to be.
#[derive(Debug)]
pub(crate) enum Found {
    /// Slices.
    Images(Vec<Image>),
    /// A DICOM object that shows nothing.
    NoImage,
    /// Not a DICOM file.
    NotDicom,
}

/// Describes the images of one DICOM file (as `folder::load` gives it) from its header.
///
/// # Errors
/// A DICOM file whose elements are damaged, or an image without the attributes that every image has.
pub(crate) fn describe(path: &Path, bytes: &[u8]) -> Result<Found, Problem> {
    let outline = outline::outline(bytes)?;
    let object = parse_header(bytes)?;
    let root = Attributes::new(&object);
    if root.whole(tags::ROWS).is_none() {
        return Ok(Found::NoImage);
    }
    let Some(_) = outline.pixels else {
        // Presentation states and the like have rows but show no pixels; a CT without pixels is cut short.
        let ct = root.text(tags::MODALITY).as_deref() == Some("CT");
        let missing = || header("PixelData", "is missing: the file is truncated");
        return if ct { Err(missing()) } else { Ok(Found::NoImage) };
    };
    images(path, &outline, &root).map(Found::Images)
}

/// All elements before the pixel data of a file that [`outline::outline`] has walked.
pub(crate) fn parse_header(bytes: &[u8]) -> Result<InMemDicomObject, Problem> {
    open_header(bytes).map(FileDicomObject::into_inner)
}

/// The same with what the file says of itself.
pub(crate) fn open_header(bytes: &[u8]) -> Result<FileDicomObject<InMemDicomObject>, Problem> {
    let options = OpenFileOptions::new().read_until(tags::PIXEL_DATA);
    options.from_reader(&bytes[128..]).map_err(|e| header("DICOM elements", chain(&e)))
}

/// An error with its causes in one line.
pub(crate) fn chain(error: &dyn std::error::Error) -> String {
    let mut out = error.to_string();
    let mut source = error.source();
    while let Some(e) = source {
        out = format!("{out}: {e}");
        source = e.source();
    }
    out
}

fn images(path: &Path, outline: &Outline<'_>, root: &Attributes<'_>) -> Result<Vec<Image>, Problem> {
    let need = |field: &'static str, tag| root.whole(tag).filter(|&n| n > 0).ok_or_else(|| header(field, "is missing"));
    let (rows, columns) = (need("Rows", tags::ROWS)? as u64, need("Columns", tags::COLUMNS)? as u64);
    let frames = root.whole(tags::NUMBER_OF_FRAMES).unwrap_or(1).max(1) as u64;
    if rows.checked_mul(columns).and_then(|n| n.checked_mul(frames)).is_none_or(|n| n > MAX_VOXELS) {
        return Err(Problem::TooLarge { dims: [columns, rows, frames], limit: MAX_VOXELS });
    }
    let enhanced = root.per_frame_groups();
    if frames > 1 && enhanced != Some(frames as usize) {
        let what = match enhanced {
            None => format!("an image of {frames} frames without functional groups"),
            Some(n) => format!("an image of {frames} frames with functional groups for {n}"),
        };
        return Err(unsupported(what, "export the series as one file per slice"));
    }
    let frames = frames as usize;
    (0..frames).map(|f| image(path, outline, &root.frame(f), f, frames, [columns as usize, rows as usize])).collect()
}

fn image(
    path: &Path,
    outline: &Outline<'_>,
    a: &Attributes<'_>,
    frame: usize,
    frames: usize,
    size: [usize; 2],
) -> Result<Image, Problem> {
    let text = |tag| a.text(tag).unwrap_or_default();
    let stored = stored(outline, a)?;
    Ok(Image {
        file: path.to_path_buf(),
        frame,
        frames,
        identity: Identity { id: text(tags::PATIENT_ID), name: text(tags::PATIENT_NAME).to_uppercase() },
        series_uid: text(tags::SERIES_INSTANCE_UID),
        instance_uid: text(tags::SOP_INSTANCE_UID),
        modality: text(tags::MODALITY),
        projection: a.image_type().iter().any(|t| PROJECTIONS.contains(&t.to_uppercase().as_str())),
        localizer: a.image_type().iter().any(|t| t.eq_ignore_ascii_case("LOCALIZER")),
        acquisition: a.whole(tags::ACQUISITION_NUMBER),
        kind: a.image_type().join(" "),
        captured: text(tags::SOP_CLASS_UID).starts_with(uids::SECONDARY_CAPTURE_IMAGE_STORAGE),
        about: about(a),
        size,
        cut_short: cut_short(outline, &stored, size[0] * size[1] * frames),
        stored,
        placement: placement(a),
    })
}

/// Uncompressed pixels are counted; compressed ones must reach their end mark.
fn cut_short(outline: &Outline<'_>, stored: &Stored, pixels: usize) -> bool {
    outline.pixels.as_ref().is_some_and(|found| match found.promised {
        Some(_) => found.range.len() < pixels * (stored.allocated as usize / 8),
        None => !found.complete,
    })
}

fn about(a: &Attributes<'_>) -> About {
    let words = [a.text(tags::MANUFACTURER), a.text(tags::MANUFACTURER_MODEL_NAME)];
    let scanner = words.into_iter().flatten().collect::<Vec<_>>().join(" ");
    About {
        description: a.text(tags::SERIES_DESCRIPTION),
        kernel: a.in_group(tags::CT_RECONSTRUCTION_SEQUENCE, tags::CONVOLUTION_KERNEL),
        scanner: (!scanner.is_empty()).then_some(scanner),
        kvp: a.number(tags::CTX_RAY_DETAILS_SEQUENCE, tags::KVP),
        thickness: a.number(tags::PIXEL_MEASURES_SEQUENCE, tags::SLICE_THICKNESS),
        contrast: contrast(a),
    }
}

/// The contrast agent: its name, or else the first attribute that is there only when one was given.
fn contrast(a: &Attributes<'_>) -> Option<String> {
    const GIVEN: [(&str, Tag); 5] = [
        ("ContrastBolusIngredient", tags::CONTRAST_BOLUS_INGREDIENT),
        ("ContrastBolusRoute", tags::CONTRAST_BOLUS_ROUTE),
        ("ContrastBolusStartTime", tags::CONTRAST_BOLUS_START_TIME),
        ("ContrastBolusVolume", tags::CONTRAST_BOLUS_VOLUME),
        ("ContrastBolusTotalDose", tags::CONTRAST_BOLUS_TOTAL_DOSE),
    ];
    if let Some(agent) = a.text(tags::CONTRAST_BOLUS_AGENT) {
        let denied = NO_AGENT.contains(&agent.to_uppercase().as_str());
        return (!denied).then(|| format!("ContrastBolusAgent \"{agent}\""));
    }
    if let Some(agent) = a.in_sequence(tags::CONTRAST_BOLUS_AGENT_SEQUENCE, tags::CODE_MEANING) {
        return Some(format!("ContrastBolusAgentSequence \"{agent}\""));
    }
    let given = |(name, tag): &(&str, Tag)| {
        let text = a.text(*tag).filter(|text| text.parse::<f64>() != Ok(0.0))?;
        Some(format!("{name} \"{text}\""))
    };
    GIVEN.iter().find_map(given)
}

fn stored(outline: &Outline<'_>, a: &Attributes<'_>) -> Result<Stored, Problem> {
    let allocated = a.whole(tags::BITS_ALLOCATED).unwrap_or(16);
    let bits = a.whole(tags::BITS_STORED).unwrap_or(allocated);
    let high = a.whole(tags::HIGH_BIT).unwrap_or(bits - 1);
    if !(1..=64).contains(&allocated) || !(1..=allocated).contains(&bits) || !(bits - 1..allocated).contains(&high) {
        return Err(header("BitsStored", format!("{bits} bits up to bit {high} of {allocated} allocated")));
    }
    let signed = a.whole(tags::PIXEL_REPRESENTATION).unwrap_or(0) == 1;
    let scale = |field, tag| match a.not_numbers(tags::PIXEL_VALUE_TRANSFORMATION_SEQUENCE, tag) {
        Some(text) => Err(header(field, format!("{text:?} is no number"))),
        None => Ok(a.number(tags::PIXEL_VALUE_TRANSFORMATION_SEQUENCE, tag)),
    };
    let slope = scale("RescaleSlope", tags::RESCALE_SLOPE)?;
    let intercept = scale("RescaleIntercept", tags::RESCALE_INTERCEPT)?;
    let rescaled = slope.is_some() && intercept.is_some();
    let (slope, intercept) = (slope.unwrap_or(1.0), intercept.unwrap_or(0.0));
    if !slope.is_finite() || !intercept.is_finite() || slope == 0.0 {
        return Err(header("RescaleSlope", format!("slope {slope} and intercept {intercept} give no HU")));
    }
    Ok(Stored {
        syntax: outline.syntax.clone(),
        photometric: a.text(tags::PHOTOMETRIC_INTERPRETATION).unwrap_or_default(),
        samples: a.whole(tags::SAMPLES_PER_PIXEL).unwrap_or(1).clamp(0, 255) as u32,
        allocated: allocated as u32,
        bits: bits as u32,
        high_bit: high as u32,
        signed,
        slope,
        intercept,
        unit: Unit::of(a.in_group(tags::PIXEL_VALUE_TRANSFORMATION_SEQUENCE, tags::RESCALE_TYPE)),
        rescaled,
        padding: padding(a, allocated as u32, signed),
    })
}

/// Padding values as the stored type reads them: some writers give the bits of a negative number as unsigned.
fn padding(a: &Attributes<'_>, allocated: u32, signed: bool) -> Option<[i64; 2]> {
    let reinterpret = |v: i64| match (allocated, signed) {
        (16, true) => i64::from(v as u16 as i16),
        (16, false) => i64::from(v as u16),
        _ => v,
    };
    let first = reinterpret(a.whole(tags::PIXEL_PADDING_VALUE)?);
    let last = a.whole(tags::PIXEL_PADDING_RANGE_LIMIT).map_or(first, reinterpret);
    Some([first.min(last), first.max(last)])
}

fn placement(a: &Attributes<'_>) -> Result<Placement, (&'static str, String)> {
    let numbers = |field: &'static str, group, tag, count: usize| {
        let unread = || a.not_numbers(group, tag).map(|text| format!("{text:?} is not {count} numbers"));
        let values = a.numbers(group, tag).ok_or_else(|| (field, unread().unwrap_or_else(|| "is missing".into())))?;
        let fine = values.len() == count && values.iter().all(|v| v.is_finite());
        fine.then_some(values.clone()).ok_or((field, format!("{values:?} is not {count} numbers")))
    };
    const ORIENTATION: &str = "ImageOrientationPatient";
    let p = numbers("ImagePositionPatient", tags::PLANE_POSITION_SEQUENCE, tags::IMAGE_POSITION_PATIENT, 3)?;
    let o = numbers(ORIENTATION, tags::PLANE_ORIENTATION_SEQUENCE, tags::IMAGE_ORIENTATION_PATIENT, 6)?;
    let s = numbers("PixelSpacing", tags::PIXEL_MEASURES_SEQUENCE, tags::PIXEL_SPACING, 2)?;
    let (u, v) = (Vector::new(o[0], o[1], o[2]), Vector::new(o[3], o[4], o[5]));
    let unit = |v: Vector<Patient>| (v.norm() - 1.0).abs() < 1e-2;
    if !unit(u) || !unit(v) || u.dot(v).abs() > 1e-2 {
        return Err((ORIENTATION, format!("{o:?} is not two perpendicular unit vectors")));
    }
    if s.iter().any(|&s| s <= 0.0) {
        return Err(("PixelSpacing", format!("{s:?} mm is not positive")));
    }
    let (row_spacing, column_spacing) = (s[0], s[1]);
    let along = |v: Vector<Patient>, mm: f64| v * (mm / v.norm());
    Ok(Placement { u: along(u, column_spacing), v: along(v, row_spacing), origin: Point::new(p[0], p[1], p[2]) })
}

/// Names of transfer syntaxes that are refused, with the reason.
pub(crate) fn refused_syntax(uid: &str) -> Option<String> {
    let known = [
        uids::IMPLICIT_VR_LITTLE_ENDIAN,
        uids::EXPLICIT_VR_LITTLE_ENDIAN,
        uids::DEFLATED_EXPLICIT_VR_LITTLE_ENDIAN,
        "1.2.840.10008.1.2.2",
        uids::RLE_LOSSLESS,
        uids::JPEG_BASELINE8_BIT,
        uids::JPEG_EXTENDED12_BIT,
        uids::JPEG_LOSSLESS,
        uids::JPEG_LOSSLESS_SV1,
        uids::JPEG2000_LOSSLESS,
        uids::JPEG2000,
    ];
    if known.contains(&uid) {
        return None;
    }
    Some(match uid {
        uids::JPEGLS_LOSSLESS | uids::JPEGLS_NEAR_LOSSLESS => format!("JPEG-LS compression ({uid})"),
        other => format!("transfer syntax {other}"),
    })
}
