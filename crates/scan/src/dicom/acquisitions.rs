//! Acquisitions of one series whose slices lie between each other's: a scan that was repeated, mostly because the head moved. In
//! one volume two positions of it would alternate from slice to slice.

use super::image::{Image, Placement};
use super::series::{SAME_PLACE_MM, WIDEST_STEPS, along, in_order};
use crate::resample::median;
use std::collections::BTreeMap;

/// So many slices of each lie within the range of the other where a scan was repeated; table positions of a sequential scan
/// have few slices, and those that follow one another overlap by fewer.
const SHARED: usize = 5;
/// Slices of a whole scan are no further apart than this many thicknesses: else others belong between them.
const LOOSE: f64 = 1.5;
/// So many acquisitions are named.
const NAMED: usize = 5;

/// Slices of one acquisition, or of several that do not lie between each other.
#[derive(Clone)]
struct Part {
    numbers: Vec<Option<i64>>,
    images: Vec<Image>,
    /// Along the normal, ascending, mm.
    places: Vec<f64>,
}

/// Takes a stack apart where acquisitions lie between each other, with a remark on each part; or says on the whole one why not.
pub(super) fn apart(group: Vec<Image>) -> Vec<(Vec<Image>, Option<String>)> {
    let parts = parts(&group);
    if parts.len() < 2 {
        return vec![(group, None)];
    }
    let others = |n: usize| parts.iter().enumerate().filter(move |(m, _)| *m != n).map(|(_, part)| part);
    if parts.iter().any(Part::is_torn) || parts.iter().all(Part::is_loose) {
        return vec![(group, Some(taken_as_one(&parts)))];
    }
    let remarks: Vec<String> = (0..parts.len()).map(|n| taken_alone(&parts[n], others(n))).collect();
    parts.into_iter().zip(remarks).map(|(part, remark)| (in_order(part.images), Some(remark))).collect()
}

/// Acquisitions, joined to as few parts as can be.
fn parts(group: &[Image]) -> Vec<Part> {
    let Some(first) = group.iter().find_map(|i| i.placement.clone().ok()) else { return Vec::new() };
    let mut acquisitions: BTreeMap<Option<i64>, Vec<Image>> = BTreeMap::new();
    for image in group {
        acquisitions.entry(image.acquisition).or_default().push(image.clone());
    }
    let all: Vec<Part> = acquisitions.into_iter().map(|(number, images)| Part::new(number, images, &first)).collect();
    let mut joined: Vec<Vec<&Part>> = Vec::new();
    for one in &all {
        match joined.iter_mut().find(|part| part.iter().all(|other| !interleave(one, other))) {
            Some(part) => part.push(one),
            None => joined.push(vec![one]),
        }
    }
    joined.into_iter().filter_map(|part| part.into_iter().cloned().reduce(Part::with)).collect()
}

/// Whether two acquisitions show the same part of the body at different places.
fn interleave(a: &Part, b: &Part) -> bool {
    a.between(b) >= SHARED && b.between(a) >= SHARED
}

impl Part {
    fn new(number: Option<i64>, images: Vec<Image>, first: &Placement) -> Self {
        let placed = images.iter().filter(|i| i.placement.is_ok());
        let places = placed.map(|i| along(first, i)).collect();
        Self { numbers: vec![number], images, places }
    }

    fn with(mut self, other: Self) -> Self {
        self.numbers.extend(other.numbers);
        self.images.extend(other.images);
        self.places.extend(other.places);
        self.places.sort_by(f64::total_cmp);
        self
    }

    /// How many of its slices lie between those of another part and at none of their places, where they would be copies.
    fn between(&self, other: &Self) -> usize {
        let [Some(&low), Some(&high)] = [other.places.first(), other.places.last()] else { return 0 };
        let apart = |p: f64| other.places.iter().all(|q| (p - q).abs() >= SAME_PLACE_MM);
        self.places.iter().filter(|&&p| low < p && p < high && apart(p)).count()
    }

    /// The median and the widest step, mm.
    fn steps(&self) -> [f64; 2] {
        let steps: Vec<f64> = self.places.windows(2).map(|w| w[1] - w[0]).collect();
        let widest = steps.iter().copied().fold(0.0, f64::max);
        [median(steps), widest]
    }

    /// Whether acquisitions that should go on in each other leave a gap: overlapping table positions, not a repeated scan.
    fn is_torn(&self) -> bool {
        let [median, widest] = self.steps();
        self.numbers.len() > 1 && widest > WIDEST_STEPS * median
    }

    /// Whether there is room for other slices between all of its own: one of two rounds over a head.
    fn is_loose(&self) -> bool {
        let thickness = self.images.first().and_then(|i| i.about.thickness).filter(|mm| *mm > 0.0);
        thickness.is_some_and(|mm| self.steps()[0] > LOOSE * mm)
    }

    fn name(&self) -> String {
        let number = |n: &Option<i64>| n.map_or_else(|| "without a number".to_owned(), |n| n.to_string());
        let named: Vec<String> = self.numbers.iter().take(NAMED).map(number).collect();
        let more = if self.numbers.len() > NAMED { " and more" } else { "" };
        format!("AcquisitionNumber {}{more} ({} slices)", named.join(", "), self.images.len())
    }
}

fn names<'a>(parts: impl Iterator<Item = &'a Part>) -> String {
    parts.map(Part::name).collect::<Vec<_>>().join("; ")
}

fn taken_alone<'a>(part: &Part, others: impl Iterator<Item = &'a Part>) -> String {
    format!(
        "the slices of {} lie between others of the same series, as where a scan is repeated because the head moved: they make \
         a series of their own, and what only the others show is missing ({})",
        part.name(),
        names(others)
    )
}

fn taken_as_one(parts: &[Part]) -> String {
    format!(
        "slices of several acquisitions of the series lie between each other, and no one is whole without the others: they are \
         taken as one scan, in which each second slice is wrong if the head moved in between; look at it from the side ({})",
        names(parts.iter())
    )
}
