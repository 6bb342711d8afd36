//! Labels that were made elsewhere.

use super::Segmentation;
use super::error::SegmentError;
use super::head::fill_slices;
use super::lattice::Lattice;
use super::midplane::midplane;
use super::regrid::onto_grid;
use super::remarks::{share_across, volumes_ml};
use super::size::Size;
use super::working::{AIR, Working, any_in_block, block_mean, working};
use crate::image::{Mask, Raster, distance_to, fill_holes, largest};
use monro_geometry::{Patient, Plane, Point, Structure, Volume};

/// A voxel further than this from the head is outside it, mm; smoothed and coarse labels stand out by less.
const BEYOND_MM: f32 = 3.0;
/// Less than this of a structure outside the head is not worth a word.
const BEYOND_ML: f64 = 0.1;
const BEYOND_PERCENT: f64 = 1.0;
/// A lateral ventricle with more than this beyond the midplane is on the wrong side.
const ACROSS_PERCENT: f64 = 60.0;
/// Planes with nothing within the skull are missing where the next on either side have more than this, mm2: a stray speck has less.
const GAP_MM2: f64 = 100.0;

/// Takes labels from the editor or from another program. On another grid they are resampled (nearest voxel), and a
/// finding says so.
///
/// # Errors
/// [`SegmentError::LabelsElsewhere`], [`SegmentError::UnknownLabel`], [`SegmentError::TooLarge`], [`SegmentError::EmptyPlanes`],
/// [`SegmentError::EmptyStructure`] (brain, skull or a lateral ventricle without a voxel; scalp, fluid and third ventricle may be missing and become findings).
pub fn from_labels(ct: &Volume<i16>, labels: Volume<u8>) -> Result<Segmentation, SegmentError> {
    let (labels, resampled) = onto_grid(ct.grid(), labels)?;
    let mut findings: Vec<String> = resampled.into_iter().collect();
    check_numbers(&labels)?;
    findings.extend(check_structures(&labels)?);
    check_planes(&labels)?;
    let working = working(ct);
    let outside = beyond_the_head(&working, &labels);
    if outside.is_empty() {
        findings.extend(in_air(ct, &labels));
    }
    findings.extend(outside);
    let space = space_of(&working, &labels);
    let size = Size::of(&space, working.lattice.step);
    size.check()?;
    // What is left out of labels may be so on purpose.
    findings.extend(size.finding(false));
    let midsagittal = plane_of(&working, &space)?;
    findings.extend(sides(&labels, &midsagittal));
    // Nothing is known about how they were made.
    Ok(Segmentation { labels, midsagittal, findings, confidence: Vec::new(), doubts: Vec::new() })
}

fn check_numbers(labels: &Volume<u8>) -> Result<(), SegmentError> {
    let mut counts = [0usize; 256];
    labels.data().iter().for_each(|&l| counts[usize::from(l)] += 1);
    match (8..256).find(|&l| counts[l] > 0) {
        Some(l) => Err(SegmentError::UnknownLabel { label: l as u8, voxels: counts[l] }),
        None => Ok(()),
    }
}

fn check_structures(labels: &Volume<u8>) -> Result<Vec<String>, SegmentError> {
    let sizes = volumes_ml(labels);
    let empty = |s: Structure| sizes[usize::from(s.label())] == 0.0;
    let needed =
        [Structure::Skull, Structure::Brain, Structure::LeftLateralVentricle, Structure::RightLateralVentricle];
    if let Some(s) = needed.into_iter().find(|s| empty(*s)) {
        return Err(SegmentError::EmptyStructure { name: s.name(), label: s.label() });
    }
    let wanted = [Structure::Scalp, Structure::Csf, Structure::ThirdVentricle];
    Ok(wanted.into_iter().filter(|s| empty(*s)).map(|s| format!("the labels have no {}", s.name())).collect())
}

/// Refuses labels of which whole planes are missing in the middle of the brain: of a series that lacks slices, or drawn on some
/// of them only.
fn check_planes(labels: &Volume<u8>) -> Result<(), SegmentError> {
    let grid = labels.grid();
    let dims = grid.dims();
    let mut areas = dims.map(|d| vec![0.0; d]);
    let intracranial = |l: u8| Structure::from_label(l).is_some_and(Structure::is_intracranial);
    for (n, _) in labels.data().iter().enumerate().filter(|(_, l)| intracranial(**l)) {
        let voxel = grid.voxel(n);
        (0..3).for_each(|a| areas[a][voxel[a]] += grid.voxel_volume() / grid.spacing()[a]);
    }
    for (axis, areas) in areas.iter().enumerate() {
        let Some((first, last)) = gap(areas) else { continue };
        let mut place = dims.map(|d| d as f64 / 2.0);
        place[axis] = first as f64;
        let place_mm = grid.patient_from_voxel().point(Point::from_array(place)).to_array();
        return Err(SegmentError::EmptyPlanes { axis: ['i', 'j', 'k'][axis], first, last, place_mm });
    }
    Ok(())
}

/// The first run of planes with nothing on them between two of which each has something, from and to.
fn gap(areas: &[f64]) -> Option<(usize, usize)> {
    let filled: Vec<usize> = (0..areas.len()).filter(|&n| areas[n] > 0.0).collect();
    let torn = |w: &&[usize]| w[1] > w[0] + 1 && areas[w[0]].min(areas[w[1]]) > GAP_MM2;
    filled.windows(2).find(torn).map(|w| (w[0] + 1, w[1] - 1))
}

/// Labels of the head where the scan shows air outside every bone: probably shifted or mirrored.
fn in_air(ct: &Volume<i16>, labels: &Volume<u8>) -> Option<String> {
    let intracranial = |l: u8| Structure::from_label(l).is_some_and(Structure::is_intracranial);
    let inside = ct.data().iter().zip(labels.data()).filter(|(_, l)| intracranial(**l));
    let (total, air) = inside.fold((0usize, 0usize), |(t, a), (hu, _)| (t + 1, a + usize::from(*hu < -300)));
    (air * 50 > total).then(|| {
        let ml = air as f64 * labels.grid().voxel_volume() / 1000.0;
        format!(
            "{ml:.1} mL of brain, fluid or ventricle are labelled where the scan shows air: are the labels shifted?"
        )
    })
}

/// Sentences about structures that are labelled beyond the head: in the air around it, or where the scan shows nothing.
pub fn outside_head(ct: &Volume<i16>, labels: &Volume<u8>) -> Vec<String> {
    beyond_the_head(&working(ct), labels)
}

fn beyond_the_head(working: &Working, labels: &Volume<u8>) -> Vec<String> {
    if working.masked_with.is_some() {
        // A masked image does not show where the head ends.
        return Vec::new();
    }
    let mut body = working.hu.zip(&working.nodata, |v, n| v > AIR && !n);
    fill_slices(&mut body);
    let far = distance_to(&largest(&body));
    let (mut all, mut beyond) = ([0usize; 256], [0usize; 256]);
    let grid = labels.grid();
    for (n, &label) in labels.data().iter().enumerate().filter(|(_, l)| **l > 0) {
        let [i, j, k] = grid.voxel(n);
        let at = working.lattice.index(grid.centre(i, j, k));
        all[usize::from(label)] += 1;
        beyond[usize::from(label)] += usize::from(is_far(&far, at));
    }
    let said = |s: &Structure| {
        let [all, beyond] = [all, beyond].map(|counts| counts[usize::from(s.label())]);
        let ml = beyond as f64 * grid.voxel_volume() / 1000.0;
        let share = 100.0 * beyond as f64 / all.max(1) as f64;
        (ml > BEYOND_ML && share > BEYOND_PERCENT)
            .then(|| format!("{ml:.1} mL ({share:.0} %) of {} lie outside the head: are the labels shifted?", s.name()))
    };
    Structure::ALL[1..].iter().filter_map(said).collect()
}

/// Whether a place on the working raster is beyond the head. Below the raster, which ends in the neck, nothing is known.
fn is_far(far: &Raster<f32>, at: [f64; 3]) -> bool {
    let within = (0..3).all(|a| at[a] >= -0.5 && at[a] <= far.dims[a] as f64 - 0.5);
    if within { far.linear(at) > BEYOND_MM } else { at[2] >= -0.5 }
}

/// Sentences about lateral ventricles most of which lie on the other side of the head. A midline shift moves a part of one
/// across, not most of it.
fn sides(labels: &Volume<u8>, midsagittal: &Plane<Patient>) -> Vec<String> {
    let across = |s: Structure, side: f64| {
        let own = (0..labels.data().len()).filter(|&n| labels.data()[n] == s.label());
        let place = |n: usize| {
            let [i, j, k] = labels.grid().voxel(n);
            labels.grid().centre(i, j, k)
        };
        let share = 100.0 * share_across(midsagittal, side, own.map(place));
        (share > ACROSS_PERCENT).then(|| {
            let (name, wrong) = (s.words(), if side > 0.0 { "right" } else { "left" });
            format!("{share:.0} % of the {name} are labelled on the {wrong} side: are left and right exchanged?")
        })
    };
    let pair = [(Structure::LeftLateralVentricle, 1.0), (Structure::RightLateralVentricle, -1.0)];
    pair.into_iter().filter_map(|(s, side)| across(s, side)).collect()
}

/// The labelled space inside the skull on the working raster.
fn space_of(working: &Working, labels: &Volume<u8>) -> Mask {
    let lattice: Lattice = working.lattice;
    let mut space = working.nodata.map(|_| false);
    for n in 0..space.data.len() {
        let l = labels.nearest(lattice.point(space.voxel(n).map(|c| c as f64)));
        space.data[n] = l.and_then(Structure::from_label).is_some_and(Structure::is_intracranial);
    }
    fill_holes(&space)
}

/// The midplane of that space.
fn plane_of(working: &Working, space: &Mask) -> Result<Plane<Patient>, SegmentError> {
    let space = any_in_block(space, 2);
    midplane(&block_mean(&working.hu, 2), &space, working.lattice.coarser(2))
        .ok_or(SegmentError::EmptyStructure { name: Structure::Brain.name(), label: Structure::Brain.label() })
}
