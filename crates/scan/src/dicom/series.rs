//! From images to stacks of slices: one series may hold several (a localizer, two orientations, two acquisitions).

use super::folder::{load, name, same_patient};
use super::image::{Image, Placement, refused_syntax};
use super::unit::Unit;
use super::{acquisitions, outline, strays};
use crate::error::{ScanError, SeriesProblem};
use crate::hash;
use crate::resample::{Stack, median};
use crate::types::{Format, SeriesSummary, Source, orientation};
use monro_geometry::Vector;
use std::path::Path;

/// Slices nearer than this lie at the same place, mm.
pub(super) const SAME_PLACE_MM: f64 = 0.05;
/// Fewer slices make no volume.
pub(super) const FEWEST: usize = 3;
/// A gap is refused when it is both this many median steps and this many mm wide.
pub(super) const WIDEST_STEPS: f64 = 3.0;
const WIDEST_MM: f64 = 10.0;
/// So many slices beyond a gap may have gone astray.
const STRAYS: usize = 2;

/// Parallel slices of one series, in order along their normal.
#[derive(Debug)]
pub(crate) struct Series {
    /// Short id, unique in its folder.
    pub(crate) id: String,
    pub(crate) uid: String,
    pub(crate) images: Vec<Image>,
    pub(crate) stack: Option<Stack>,
    pub(crate) refusal: Option<SeriesProblem>,
    pub(crate) warnings: Vec<String>,
}

/// Sorts images into series, in the order in which they are met.
pub(crate) fn sort(images: Vec<Image>) -> Vec<Series> {
    let mut groups: Vec<Vec<Image>> = Vec::new();
    for image in images {
        match groups.iter_mut().find(|g| belongs(&g[0], &image)) {
            Some(group) => group.push(image),
            None => groups.push(vec![image]),
        }
    }
    let groups = groups.into_iter().map(in_order).flat_map(apart).flat_map(acquisitions::apart);
    let mut out: Vec<Series> = Vec::new();
    for (group, remark) in groups {
        let uid = group[0].series_uid.clone();
        let before = out.iter().filter(|s| s.uid == uid).count();
        let id = hash::series_id(&uid) + &if before > 0 { format!("-{}", before + 1) } else { String::new() };
        let mut series = Series::new(id, uid, group);
        series.warnings.extend(remark);
        out.push(series);
    }
    strays::note(&mut out);
    out
}

fn belongs(a: &Image, b: &Image) -> bool {
    let near = |p: Vector<_>, q: Vector<_>| (p - q).norm() <= 1e-3 * p.norm();
    let parallel = match (&a.placement, &b.placement) {
        (Ok(p), Ok(q)) => near(p.u, q.u) && near(p.v, q.v),
        // A slice without a placement spoils the series that it claims to be of, rather than being lost.
        _ => true,
    };
    let grey = |i: &Image| (i.stored.samples, i.stored.photometric.clone());
    let map = |i: &Image| match &i.stored.unit {
        Unit::Map(kind) => Some(kind.clone()),
        _ => None,
    };
    // Siemens adds a number to the kernel that may change within a head.
    let kernel = |i: &Image| i.about.kernel.as_ref().map(|k| k.split('\\').next().unwrap_or_default().to_owned());
    let same = |i: &Image| (i.size, i.localizer, i.projection, grey(i), kernel(i), i.modality.clone(), i.captured);
    let one = a.series_uid == b.series_uid && same_patient(&a.identity, &b.identity);
    one && parallel && same(a) == same(b) && map(a) == map(b)
}

/// Place of an image along the normal of the first one.
pub(super) fn along(first: &Placement, image: &Image) -> f64 {
    let n = first.u.cross(first.v).normalized().unwrap_or(Vector::ZERO);
    image.placement.as_ref().map_or(f64::MAX, |p| (p.origin - first.origin).dot(n))
}

pub(super) fn in_order(mut group: Vec<Image>) -> Vec<Image> {
    if let Some(first) = group.iter().find_map(|i| i.placement.clone().ok()) {
        let place = |i: &Image| along(&first, i);
        group.sort_by(|a, b| place(a).total_cmp(&place(b)).then_with(|| (&a.file, a.frame).cmp(&(&b.file, b.frame))));
    }
    group
}

fn same_place(a: &Image, b: &Image) -> bool {
    match (&a.placement, &b.placement) {
        (Ok(p), Ok(_)) => (along(p, b) - along(p, a)).abs() < SAME_PLACE_MM,
        _ => false,
    }
}

/// Splits different slices that lie at the same places by acquisition, or else by image type, when that explains them: each part
/// is a volume with every place once. Acquisitions that share the same few slices go on in each other, and are one volume.
fn apart(group: Vec<Image>) -> Vec<Vec<Image>> {
    let doubled = |g: &[Image]| g.windows(2).any(|w| same_place(&w[0], &w[1]) && !copies(&w[0], &w[1]));
    if !doubled(&group) {
        return vec![group];
    }
    let keys: [fn(&Image) -> String; 2] = [|i| format!("{:?}", i.acquisition), |i| i.kind.clone()];
    let splits = keys.iter().map(|key| split(&group, key));
    let mut explained = splits.filter(|s| s.iter().all(|g| g.len() >= FEWEST && !doubled(g)));
    explained.next().unwrap_or(vec![group])
}

fn split(group: &[Image], key: impl Fn(&Image) -> String) -> Vec<Vec<Image>> {
    let mut parts: Vec<Vec<Image>> = Vec::new();
    for image in group {
        match parts.iter_mut().find(|part| key(&part[0]) == key(image)) {
            Some(part) => part.push(image.clone()),
            None => parts.push(vec![image.clone()]),
        }
    }
    parts
}

impl Series {
    fn new(id: String, uid: String, images: Vec<Image>) -> Self {
        let mut series = Self { id, uid, images, stack: None, refusal: None, warnings: Vec::new() };
        series.refusal = series.examine().err();
        series
    }

    fn examine(&mut self) -> Result<(), SeriesProblem> {
        self.check_kind()?;
        self.drop_copies()?;
        self.place()?;
        self.check_gaps()?;
        self.note_oddities();
        Ok(())
    }

    fn check_kind(&self) -> Result<(), SeriesProblem> {
        let first = &self.images[0];
        if first.modality != "CT" {
            return Err(SeriesProblem::NotCt(first.modality.clone()));
        }
        if first.localizer {
            return Err(SeriesProblem::Localizer);
        }
        if first.projection {
            return Err(SeriesProblem::Projection);
        }
        for image in &self.images {
            let s = &image.stored;
            if s.samples != 1 || s.photometric != "MONOCHROME2" {
                let what = format!("{}: photometric interpretation {:?}", name(&image.file), s.photometric);
                return Err(SeriesProblem::NotGrey(what));
            }
            if let Unit::Map(kind) = &s.unit {
                return Err(SeriesProblem::NotHu(kind.clone()));
            }
            if let Some(what) = refused_syntax(&s.syntax) {
                return Err(SeriesProblem::Encoding(what));
            }
            if !matches!(s.allocated, 8 | 16) {
                return Err(SeriesProblem::Encoding(format!("{} bits per pixel", s.allocated)));
            }
        }
        Ok(())
    }

    /// Drops copies of the same image; two different ones at one place are a conflict.
    fn drop_copies(&mut self) -> Result<(), SeriesProblem> {
        let mut kept: Vec<Image> = Vec::with_capacity(self.images.len());
        let (mut dropped, mut conflict) = (0, None);
        for image in std::mem::take(&mut self.images) {
            match kept.last().filter(|last| same_place(last, &image)) {
                Some(last) if copies(last, &image) => dropped += 1,
                last => {
                    conflict = conflict.or(last.map(|last| [name(&last.file), name(&image.file)]));
                    kept.push(image);
                }
            }
        }
        // A series that is refused is listed still, with what it has.
        self.images = kept;
        if let Some(files) = conflict {
            return Err(SeriesProblem::Conflict { files });
        }
        if dropped > 0 {
            self.warnings.push(match dropped {
                1 => "1 copy of a slice was left out".into(),
                n => format!("{n} copies of slices were left out"),
            });
        }
        Ok(())
    }

    fn place(&mut self) -> Result<(), SeriesProblem> {
        if self.images.len() < FEWEST {
            return Err(SeriesProblem::TooFew { images: self.images.len(), needed: FEWEST });
        }
        let mut origins = Vec::with_capacity(self.images.len());
        for image in &self.images {
            match &image.placement {
                Ok(p) => origins.push(p.origin),
                Err((field, problem)) => {
                    let (file, problem) = (name(&image.file), problem.clone());
                    return Err(SeriesProblem::Attribute { file, field, problem });
                }
            }
        }
        if let Ok(p) = &self.images[0].placement {
            self.stack = Some(Stack { size: self.images[0].size, u: p.u, v: p.v, origins });
        }
        Ok(())
    }

    /// Steps along the normal, and their median.
    fn steps(&self) -> (Vec<f64>, f64) {
        let steps = self.stack.as_ref().map(Stack::steps).unwrap_or_default();
        let median = median(steps.clone());
        (steps, median)
    }

    fn check_gaps(&mut self) -> Result<(), SeriesProblem> {
        let (steps, median) = self.steps();
        let limit_mm = (WIDEST_STEPS * median).max(WIDEST_MM);
        if let Some(after) = steps.iter().position(|&s| s > limit_mm) {
            let (found_mm, stray) = (steps[after], self.beyond(after));
            return Err(SeriesProblem::Gap { after, found_mm, expected_mm: median, limit_mm, stray });
        }
        let wide = |&n: &usize| steps[n] > 1.5 * median;
        let many = (0..steps.len()).filter(wide).count();
        // A few wide steps are missing slices; many are a series of two spacings, whose gaps show beside their like.
        let varies = many > 3 && many > steps.len() / 4;
        if varies {
            let least = steps.iter().copied().fold(f64::MAX, f64::min);
            let most = steps.iter().copied().fold(f64::MIN, f64::max);
            self.warnings.push(format!("the slice spacing varies: steps of {least:.3} to {most:.3} mm"));
        }
        let gap = |&n: &usize| steps[n] > 1.5 * beside(&steps, n) || !varies && wide(&n);
        self.warn_of_gaps((0..steps.len()).filter(gap).map(|n| (n, steps[n], beside(&steps, n).min(median))).collect());
        Ok(())
    }

    /// What to do with the slices on one side of a gap, where these are a few of many.
    fn beyond(&self, after: usize) -> String {
        let (below, above) = self.images.split_at(after + 1);
        let few = if below.len() < above.len() { below } else { above };
        match few {
            [first, ..] if few.len() <= STRAYS && self.images.len() > 10 * few.len() => {
                format!("; {} slice(s) beyond it may be of another scan: move {} away", few.len(), name(&first.file))
            }
            _ => String::new(),
        }
    }

    /// Names the first gaps: the slice before, the step and the one expected there, mm.
    fn warn_of_gaps(&mut self, gaps: Vec<(usize, f64, f64)>) {
        let more = gaps.len().saturating_sub(3);
        self.warnings.extend(gaps.into_iter().take(3).map(|(n, found, expected)| {
            format!("slices {} and {} are {found:.3} mm apart, expected {expected:.3}", n + 1, n + 2)
        }));
        if more > 0 {
            self.warnings.push(format!("{more} more slices are further apart than expected"));
        }
    }

    fn note_oddities(&mut self) {
        let unscaled = self.images.iter().filter(|i| !i.stored.rescaled).count();
        if unscaled > 0 {
            self.warnings.push(format!(
                "{unscaled} of {} slices give no RescaleSlope (1 is taken) or no RescaleIntercept (0 is taken)",
                self.images.len()
            ));
        }
        self.note_unit();
        self.note_contrast();
        let s = &self.images[0].stored;
        if let (Some([low, _]), None) = (s.padding, s.believed_padding()) {
            self.warnings.push(format!(
                "PixelPaddingValue {low} reads as {} HU, which may be tissue: it is not taken as padding",
                low as f64 * s.slope + s.intercept
            ));
        }
    }

    /// The first `RescaleType` that may be another than HU.
    pub(crate) fn doubtful_unit(&self) -> Option<&str> {
        self.images.iter().find_map(|i| match &i.stored.unit {
            Unit::Doubtful(kind) => Some(kind.as_str()),
            _ => None,
        })
    }

    fn note_unit(&mut self) {
        let told = self.doubtful_unit().map(|kind| {
            format!("the header's RescaleType is {kind:?}, not HU: make sure that the values are those of a plain CT")
        });
        self.warnings.extend(told);
    }

    /// Whether the header says that a contrast agent was given.
    pub(crate) fn with_contrast(&self) -> bool {
        self.images.iter().any(|i| i.about.contrast.is_some())
    }

    fn note_contrast(&mut self) {
        let given: Vec<&Image> = self.images.iter().filter(|i| i.about.contrast.is_some()).collect();
        let Some(first) = given.first() else { return };
        let agent = first.about.contrast.as_deref().filter(|c| !reveals(first, c)).unwrap_or("ContrastBolusAgent");
        self.warnings.push(format!(
            "a contrast agent was given, as the header says ({agent}, in {} of {} slices), but scans are to be without: \
             brightened vessels, plexus and membranes are taken for bone, blood or brain. Take a series from before it was \
             given, or look closely at the labels",
            given.len(),
            self.images.len()
        ));
    }

    /// Refuses a series several files of which end before their pixel data do; of a single one, decoding tells by how much.
    pub(crate) fn check_whole(&self) -> Result<(), ScanError> {
        let mut short: Vec<&Path> = self.images.iter().filter(|i| i.cut_short).map(|i| i.file.as_path()).collect();
        short.dedup();
        match short[..] {
            [first, _, ..] => Err(ScanError::CutShort { files: short.len(), first: name(first) }),
            _ => Ok(()),
        }
    }

    /// What may be told about this series.
    pub(crate) fn source(&self) -> Source {
        let first = &self.images[0];
        let steps = self.steps().0;
        let mean = if steps.is_empty() { 0.0 } else { steps.iter().sum::<f64>() / steps.len() as f64 };
        let (mut spacing, mut plane) = ([0.0, 0.0, mean], "unknown");
        if let Ok(p) = &first.placement {
            spacing = [p.u.norm(), p.v.norm(), mean];
            plane = orientation(p.u.cross(p.v));
        }
        let about = &first.about;
        Source {
            format: Format::Dicom,
            series: self.id.clone(),
            description: about.description.clone().filter(|d| !reveals(first, d)),
            modality: Some(first.modality.clone()),
            scanner: about.scanner.clone(),
            kernel: about.kernel.clone(),
            kvp: about.kvp,
            slice_thickness_mm: about.thickness,
            tilt_deg: self.stack.as_ref().map_or(0.0, Stack::tilt_deg),
            native_dims: [first.size[0], first.size[1], self.images.len()],
            native_spacing_mm: spacing,
            orientation: plane,
        }
    }

    /// For lists.
    pub(crate) fn summary(&self) -> SeriesSummary {
        let steps = self.steps().0;
        let least = steps.iter().copied().reduce(f64::min).unwrap_or(0.0);
        let most = steps.iter().copied().reduce(f64::max).unwrap_or(0.0);
        SeriesSummary {
            source: self.source(),
            images: self.images.len(),
            step_mm: [least, most],
            refusal: self.refusal.as_ref().map(ToString::to_string),
        }
    }
}

/// The wider of the steps before and after one, mm: where a series changes its spacing, the new one is no gap.
fn beside(steps: &[f64], at: usize) -> f64 {
    let before = at.checked_sub(1).map(|n| steps[n]);
    let neighbours = before.into_iter().chain(steps.get(at + 1).copied());
    neighbours.reduce(f64::max).unwrap_or(f64::MAX)
}

/// Whether a text contains a part of the patient's name or id.
fn reveals(image: &Image, text: &str) -> bool {
    let text = text.to_uppercase();
    let parts = image.identity.name.split(['^', ' ', ',', '=']).chain([image.identity.id.as_str()]);
    parts.filter(|p| p.chars().count() >= 3).any(|p| text.contains(&p.to_uppercase()))
}

/// Whether two images have the same pixels.
fn copies(a: &Image, b: &Image) -> bool {
    if a.frames > 1 || b.frames > 1 || a.stored != b.stored {
        return false;
    }
    let pixels = |i: &Image| {
        let bytes = load(&i.file).ok().flatten()?;
        let outline = outline::outline(&bytes).ok()?;
        Some(outline.data.get(outline.pixels?.range)?.to_vec())
    };
    !a.instance_uid.is_empty() && a.instance_uid == b.instance_uid && pixels(a) == pixels(b)
        || pixels(a).is_some_and(|p| Some(p) == pixels(b))
}
