//! A binary DICOM segmentation as labels: the number of a voxel is that of its segment.

use super::super::attributes::Attributes;
use super::super::outline::{Outline, outline};
use super::super::{folder, image};
use crate::error::{Problem, ScanError, header, unsupported};
use crate::hash;
use crate::labels::{self, DrawnOn, Segment};
use crate::raster::grid;
use dicom_core::Tag;
use dicom_dictionary_std::{tags, uids};
use dicom_object::InMemDicomObject;
use monro_geometry::{Affine, Matrix3, Patient, Vector, Volume};
use std::ops::Range;
use std::path::Path;

/// Label Map Segmentation Storage (DICOM PS3.4, table B.5-1), which the dictionary in use does not name.
const LABEL_MAP_STORAGE: &str = "1.2.840.10008.5.1.4.1.1.66.7";
/// Part of the slice distance by which a frame may miss its place.
const OFF_PLACE: f64 = 0.05;
/// Frames nearer than this lie in the same plane, mm.
const SAME_PLANE_MM: f64 = 0.01;
/// Direction cosines (and pixels, mm) of frames differ by less than this where they are the same.
const SAME_FRAME: f64 = 1e-3;
/// Uneven planes come onto slices of the smallest distance between them, but not finer than this, mm.
const FINEST_MM: f64 = 0.5;

/// A segmentation as it is stored.
pub(crate) struct Stored {
    /// The number of a segment, or 0.
    pub(crate) volume: Volume<u16>,
    pub(crate) segments: Vec<Segment>,
    pub(crate) drawn_on: DrawnOn,
    /// Voxels that more than one structure of a case claims.
    pub(crate) contested: usize,
}

/// Reads a segmentation, its segments and what it was drawn on. Where segments overlap, what is no structure of a case gives
/// way to what is, and of two structures the outer one to the inner one.
///
/// # Errors
/// [`ScanError::File`] with what is missing or not supported.
pub(crate) fn read(path: &Path) -> Result<Stored, ScanError> {
    stored(path).map_err(|problem| ScanError::file(path, problem))
}

fn stored(path: &Path) -> Result<Stored, Problem> {
    let other =
        || unsupported("a DICOM file that is no segmentation", "give a DICOM-SEG file, or NIfTI, NRRD or .seg.nrrd");
    let bytes = folder::load(path)?.ok_or_else(other)?;
    let outline = outline(&bytes)?;
    let object = image::open_header(&bytes)?;
    match object.meta().media_storage_sop_class_uid().trim_end_matches(['\0', ' ']) {
        uids::SEGMENTATION_STORAGE => labels(&object, &outline),
        LABEL_MAP_STORAGE => Err(unsupported("a DICOM label map segmentation", "export it as a BINARY segmentation")),
        _ => Err(other()),
    }
}

/// The bits of a segmentation that is not compressed.
fn bits<'a>(outline: &'a Outline<'_>) -> Result<&'a [u8], Problem> {
    let pixels = outline.pixels.as_ref().ok_or_else(|| header("PixelData", "is missing: the file is truncated"))?;
    match pixels.promised {
        Some(_) => Ok(&outline.data[pixels.range.clone()]),
        None => Err(unsupported("a DICOM segmentation that is compressed", "export it without compression")),
    }
}

fn labels(o: &InMemDicomObject, outline: &Outline<'_>) -> Result<Stored, Problem> {
    let root = Attributes::new(o);
    let kind = root.text(tags::SEGMENTATION_TYPE).unwrap_or_default();
    if kind != "BINARY" || root.whole(tags::BITS_ALLOCATED) != Some(1) {
        return Err(unsupported(format!("a DICOM segmentation of type {kind:?}"), "export it as BINARY"));
    }
    let count = |tag: Tag, name: &'static str| {
        let value = root.whole(tag).ok_or_else(|| header(name, "is missing"))?;
        u64::try_from(value).ok().filter(|v| *v > 0).ok_or_else(|| header(name, format!("is {value}")))
    };
    let (columns, rows) = (count(tags::COLUMNS, "Columns")?, count(tags::ROWS, "Rows")?);
    let count = count(tags::NUMBER_OF_FRAMES, "NumberOfFrames")? as usize;
    if root.per_frame_groups() != Some(count) {
        return Err(header("PerFrameFunctionalGroupsSequence", format!("has no {count} items")));
    }
    let frames = (0..count).map(|n| frame(&root.frame(n))).collect::<Result<Vec<_>, _>>()?;
    alike(&root, count)?;
    let stack = Stack::of(&root.frame(0), &frames, images_referred_to(o))?;
    let [wide, tall] = [columns.saturating_add(stack.wider[0]), rows.saturating_add(stack.wider[1])];
    let grid = grid([wide, tall, stack.slices as u64], stack.placement)?;
    let pixels = bits(outline)?;
    let (columns, plane) = (columns as usize, (columns * rows) as usize);
    let (expected, found) = ((count * plane).div_ceil(8) as u64, pixels.len() as u64);
    if found < expected {
        return Err(Problem::Truncated { expected, found });
    }
    let segments = segments(o);
    let rank = |n: usize| labels::rank(&segments, frames[n].segment);
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by_key(|&n| rank(n));
    let (mut data, mut contested) = (vec![0u16; grid.len()], 0);
    for n in order {
        let (own, (corner, slices)) = (frames[n].segment, &stack.places[n]);
        for m in (0..plane).filter(|m| pixels[(n * plane + m) / 8] >> ((n * plane + m) % 8) & 1 == 1) {
            for k in slices.clone() {
                let voxel = &mut data[grid.index(m % columns + corner[0], m / columns + corner[1], k)];
                contested += usize::from(![0, own].contains(voxel) && labels::rank(&segments, *voxel) > 0);
                *voxel = own;
            }
        }
    }
    Ok(Stored { volume: Volume::new(grid, data)?, segments, drawn_on: drawn_on(o), contested })
}

/// Refuses frames that are turned against each other, or of other pixels.
fn alike(root: &Attributes<'_>, count: usize) -> Result<(), Problem> {
    let of = |n: usize| {
        let a = root.frame(n);
        let turn = vectors::<6>(&a, tags::PLANE_ORIENTATION_SEQUENCE, tags::IMAGE_ORIENTATION_PATIENT);
        let pixel = vectors::<2>(&a, tags::PIXEL_MEASURES_SEQUENCE, tags::PIXEL_SPACING);
        turn.into_iter().flatten().chain(pixel.into_iter().flatten()).collect::<Vec<f64>>()
    };
    let first = of(0);
    let unlike = |n: &usize| {
        let other = of(*n);
        other.len() != first.len() || other.iter().zip(&first).any(|(a, b)| (a - b).abs() > SAME_FRAME)
    };
    match (1..count).find(unlike) {
        None => Ok(()),
        Some(n) => Err(unsupported(
            format!("a DICOM segmentation whose frame {} lies otherwise than the first, or has other pixels", n + 1),
            "export it on one series of parallel images",
        )),
    }
}

/// Which segment, where its first pixel is.
struct Frame {
    segment: u16,
    position: Vector<Patient>,
}

fn frame(a: &Attributes<'_>) -> Result<Frame, Problem> {
    let number = a.numbers(tags::SEGMENT_IDENTIFICATION_SEQUENCE, tags::REFERENCED_SEGMENT_NUMBER);
    let number = number.and_then(|v| v.first().copied()).filter(|v| (1.0..=65535.0).contains(v));
    let segment = number.ok_or_else(|| header("ReferencedSegmentNumber", "is missing"))? as u16;
    let position = vectors::<3>(a, tags::PLANE_POSITION_SEQUENCE, tags::IMAGE_POSITION_PATIENT)
        .ok_or_else(|| Problem::NoOrientation("no ImagePositionPatient".into()))?;
    Ok(Frame { segment, position: Vector::from_array(position) })
}

fn vectors<const N: usize>(a: &Attributes<'_>, group: Tag, tag: Tag) -> Option<[f64; N]> {
    let values: [f64; N] = a.numbers(group, tag)?.try_into().ok()?;
    values.iter().all(|v| v.is_finite()).then_some(values)
}

/// The even stack of slices that the frames come into. Planes of a tilted gantry are shifted against each other; they
/// come onto one rectangular grid by whole pixels, the nearest.
struct Stack {
    placement: Affine<Patient, monro_geometry::Voxel>,
    slices: usize,
    /// Columns and rows that the grid has more than a frame.
    wider: [u64; 2],
    /// First column and row, and slices, of each frame in the grid.
    places: Vec<([usize; 2], Range<usize>)>,
}

impl Stack {
    fn of(first: &Attributes<'_>, frames: &[Frame], images: usize) -> Result<Self, Problem> {
        let none = |what: &str| Problem::NoOrientation(what.into());
        let d: [f64; 6] = vectors(first, tags::PLANE_ORIENTATION_SEQUENCE, tags::IMAGE_ORIENTATION_PATIENT)
            .ok_or_else(|| none("no ImageOrientationPatient"))?;
        let [between_rows, between_columns]: [f64; 2] =
            vectors(first, tags::PIXEL_MEASURES_SEQUENCE, tags::PIXEL_SPACING)
                .filter(|s: &[f64; 2]| s.iter().all(|&s| s > 0.0))
                .ok_or_else(|| none("no PixelSpacing"))?;
        let u = Vector::<Patient>::new(d[0], d[1], d[2]);
        let v = Vector::<Patient>::new(d[3], d[4], d[5]);
        let normal = u.cross(v).normalized().ok_or_else(|| none("ImageOrientationPatient spans no plane"))?;
        let along: Vec<f64> = frames.iter().map(|f| f.position.dot(normal)).collect();
        let lowest = (0..along.len()).fold(0, |best, n| if along[n] < along[best] { n } else { best });
        let from_lowest: Vec<f64> = along.iter().map(|s| s - along[lowest]).collect();
        let layers = Layers::of(Self::step(first, &along)?, &from_lowest, images)?;
        let corner = frames[lowest].position;
        let [(left, wider, i), (top, taller, j)] = [(u, between_columns), (v, between_rows)]
            .map(|(axis, pixel)| shifts(frames.iter().map(|f| (f.position - corner).dot(axis) / pixel)));
        let places = layers.slices.into_iter().zip(i).zip(j).map(|((k, i), j)| ([i, j], k)).collect();
        let linear = Matrix3::from_columns(u * between_columns, v * between_rows, normal * layers.step);
        let origin = corner + u * (between_columns * left) + v * (between_rows * top);
        Ok(Self {
            placement: Affine::new(linear, origin.to_array()),
            slices: layers.count,
            wider: [wider, taller],
            places,
        })
    }

    /// Distance of neighbouring planes: as the header says, else the smallest between two frames.
    fn step(first: &Attributes<'_>, along: &[f64]) -> Result<f64, Problem> {
        let said = |tag| first.numbers(tags::PIXEL_MEASURES_SEQUENCE, tag).and_then(|v| v.first().copied());
        let mut sorted = along.to_vec();
        sorted.sort_by(f64::total_cmp);
        let smallest = sorted.windows(2).map(|w| w[1] - w[0]).filter(|d| *d > 1e-3).fold(f64::INFINITY, f64::min);
        let step = said(tags::SPACING_BETWEEN_SLICES).unwrap_or(smallest);
        let step = if step.is_finite() { step } else { said(tags::SLICE_THICKNESS).unwrap_or(f64::NAN) };
        if step > 0.0 { Ok(step) } else { Err(header("SpacingBetweenSlices", format!("is {step}"))) }
    }
}

/// The slices of an even grid that each frame fills.
struct Layers {
    step: f64,
    count: usize,
    slices: Vec<Range<usize>>,
}

impl Layers {
    /// From the places of the frames above the lowest, mm. Frames at multiples of `step` fill a slice each; where there is one
    /// for each of the `images`, what lies between them has no image, and is filled by the nearest. So are slices between frames
    /// at other places, but only if there is one for each image: a plane that was left out for being empty would be filled by its
    /// neighbours.
    fn of(step: f64, places: &[f64], images: usize) -> Result<Self, Problem> {
        let mut planes = places.to_vec();
        planes.sort_by(f64::total_cmp);
        planes.dedup_by(|a, b| *a - *b < SAME_PLANE_MM);
        let even = |s: &f64| ((s / step - (s / step).round()).abs() <= OFF_PLACE).then(|| (s / step).round() as usize);
        if let Some(slices) = places.iter().map(even).collect::<Option<Vec<usize>>>() {
            let count = slices.iter().max().map_or(1, |m| m.saturating_add(1));
            if count == planes.len() || planes.len() != images {
                return Ok(Self { step, count, slices: slices.into_iter().map(|k| k..k.saturating_add(1)).collect() });
            }
        }
        if planes.len() != images {
            let found = format!("frames are not multiples of {step} mm apart, and there is not one for each image");
            return Err(header("ImagePositionPatient", found));
        }
        let least = planes.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min);
        let step = least.max(FINEST_MM);
        let last = planes[planes.len() - 1];
        let count = ((last / step).round() as usize).saturating_add(1);
        let middle = |n: usize| (0.5 * (planes[n - 1] + planes[n]) / step).ceil() as usize;
        let slices = places.iter().map(|s| {
            let n = planes.partition_point(|p| *p <= s - SAME_PLANE_MM).min(planes.len() - 1);
            let end = if n + 1 < planes.len() { middle(n + 1) } else { count };
            (if n > 0 { middle(n) } else { 0 })..end.min(count)
        });
        Ok(Self { step, count, slices: slices.collect() })
    }
}

fn items(o: &InMemDicomObject, tag: Tag) -> &[InMemDicomObject] {
    o.get(tag).and_then(|e| e.items()).unwrap_or_default()
}

/// Number of images that the segmentation says it was drawn on.
fn images_referred_to(o: &InMemDicomObject) -> usize {
    items(o, tags::REFERENCED_SERIES_SEQUENCE).iter().map(|s| items(s, tags::REFERENCED_INSTANCE_SEQUENCE).len()).sum()
}

/// Whose images it says it was drawn on, and of which series.
fn drawn_on(o: &InMemDicomObject) -> DrawnOn {
    let series = items(o, tags::REFERENCED_SERIES_SEQUENCE).iter();
    let uids = series.filter_map(|s| Attributes::new(s).text(tags::SERIES_INSTANCE_UID));
    let series: Vec<String> = uids.map(|uid| hash::series_id(&uid)).collect();
    // Without images the patient is a name for the file, as in the editor's export.
    let id = Attributes::new(o).text(tags::PATIENT_ID).filter(|_| !series.is_empty());
    DrawnOn { patient: hash::patient_id(&id.unwrap_or_default()), series }
}

/// Of shifts in pixels: the least as a whole number, how much wider the grid gets, and each as an index from the least.
fn shifts(exact: impl Iterator<Item = f64>) -> (f64, u64, Vec<usize>) {
    let whole: Vec<f64> = exact.map(f64::round).collect();
    let least = whole.iter().copied().fold(f64::INFINITY, f64::min);
    let from_least: Vec<usize> = whole.iter().map(|s| (s - least) as usize).collect();
    let most = from_least.iter().copied().max().unwrap_or(0);
    (least, most as u64, from_least)
}

fn segments(o: &InMemDicomObject) -> Vec<Segment> {
    items(o, tags::SEGMENT_SEQUENCE).iter().filter_map(segment).collect()
}

fn segment(item: &InMemDicomObject) -> Option<Segment> {
    let a = Attributes::new(item);
    let number = u16::try_from(a.whole(tags::SEGMENT_NUMBER)?).ok()?;
    let first = |o: &InMemDicomObject, tag: Tag| Some(o.get(tag)?.items()?.first()?.clone());
    let kind = first(item, tags::SEGMENTED_PROPERTY_TYPE_CODE_SEQUENCE);
    let side = kind.as_ref().and_then(|k| first(k, tags::SEGMENTED_PROPERTY_TYPE_MODIFIER_CODE_SEQUENCE));
    let code =
        |o: Option<&InMemDicomObject>| o.and_then(|o| Attributes::new(o).text(tags::CODE_VALUE)).unwrap_or_default();
    let codes = [code(kind.as_ref()), code(side.as_ref())];
    Some(Segment { number, name: a.text(tags::SEGMENT_LABEL).unwrap_or_default(), codes })
}
