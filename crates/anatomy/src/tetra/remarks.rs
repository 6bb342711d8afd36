//! What a user should know of a mesh, in words.

use super::census::blocks;
use super::coarse::Lost;
use super::error::{COARSE, crossing_words, overlap_words};
use super::report::{
    Boundary, LARGEST_DIHEDRAL, LEAST_DIHEDRAL, LEAST_RADIUS_RATIO, MOST_VOLUME_ERROR, Source, SurfaceReport,
};
use super::solid::Solid;
use super::voxels::{Missing, Voxels};
use super::{COUNT, LabelReport, MeshReport, listed, place};
use monro_geometry::Point;
use std::ops::Range;

/// Beyond this mean distance, mm, the surface of a label is.
const SURFACE_ERROR: f64 = 1.5;
/// Where the centres of more than this part of a label's voxels are not in it, it is too thin for smooth surfaces.
const MOST_ABSENT: f64 = 0.1;
const THICKER: &str = "thicken it or resample the labels to voxels of half the size, more elements do not help";
/// What helps the volume of a region.
const REGIONS: &str = "a region is made of whole elements: ask for more";
/// What helps the volume of a label that is fine already.
const MORE: &str = "a label thinner than the elements there needs more of them";
/// Densities over those wanted that are not remarked upon.
const DENSITY: Range<f64> = 0.75..1.33;
/// Places along a path are so far apart, mm.
const ALONG: f64 = 0.5;

/// Of a mesh, given of each label the voxels that are not in its smooth surface.
pub(super) fn remarks<T: Copy + Eq + Into<u16> + Sync>(
    report: &MeshReport,
    source: &Source<'_, T>,
    absences: &[(Vec<usize>, Missing)],
) -> Vec<String> {
    let mut all = of_options(source);
    all.extend(of_path(source));
    all.extend(of_count(report.elements, source.options.elements));
    all.extend(of_density(report, source));
    all.extend(source.regions.map(|lost| of_regions(lost, source)));
    let far = SURFACE_ERROR * source.fields.unit;
    for (i, l) in report.labels.iter().enumerate() {
        all.extend(of_crumbs(source, i));
        let (absent, missing) = &absences[i];
        let thin = absent.len() as f64 > MOST_ABSENT * l.voxels as f64;
        if l.lost_at.is_none() {
            all.extend(of_missing(source, i, missing));
            all.extend(thin.then(|| of_thin(l, absent, &source.voxels)));
        }
        let hopeless = thin || source.fields.specks[i];
        let way_out = helps(hopeless, report.coarse_regions, source.options.fine.contains(&l.label));
        all.extend(of_label(l, report.coarse_regions, way_out, far));
    }
    if has_outer(report) {
        all.extend(of_pinch(Boundary::Outer, &report.outer));
    }
    all.extend(of_shapes(report));
    all
}

/// Why there are regions instead of surfaces, and whose sake they are for.
fn of_regions<T>(lost: Lost, source: &Source<'_, T>) -> String {
    let whose = match lost {
        Lost::Inner if source.options.fine.is_empty() => {
            " (be fine around the smaller ones: so many may then be enough; or ask for more)".into()
        }
        Lost::Inner => " (ask for more)".into(),
        Lost::Label(l) => {
            let label = source.fields.labels[l];
            format!(
                " (label {label} had lost most of its volume; if it is thin or in small pieces, no number of elements helps: merge it with another, or leave it out with --keep)"
            )
        }
    };
    format!(
        "too few elements for the surfaces of the inner labels{whose}: only the outer surface is followed, the labels are coarse regions of about their volume, which may touch themselves in edges and points"
    )
}

/// Where surfaces have other handles and pieces than those of the labels or are far from them, and gaps that they lack.
pub(super) fn topology(report: &MeshReport) -> Vec<String> {
    let of_labels = report.labels.iter().filter(|l| l.lost_at.is_none());
    let mut all: Vec<String> = of_labels.filter_map(|l| of_topology(Boundary::Label(l.label), &l.surface)).collect();
    if has_outer(report) {
        all.extend(of_topology(Boundary::Outer, &report.outer));
    }
    let torn = report.labels.iter().filter_map(|l| Some((l.label, l.torn?)));
    all.extend(torn.map(|(label, torn)| format!("label {label}: {torn}")));
    all.extend(report.far().map(|(label, interface)| format!("label {label}: {interface}")));
    all.extend(report.closed_gaps.map(|gaps| gaps.to_string()));
    let crossing = report.self_crossing.as_ref().filter(|_| report.overlap.is_none());
    all.extend(report.overlap.as_ref().map(overlap_words).or_else(|| crossing.map(crossing_words)));
    all
}

/// Of a single label the outer surface is its own.
fn has_outer(report: &MeshReport) -> bool {
    report.labels.len() > 1
}

fn of_count(found: usize, wanted: usize) -> Option<String> {
    let off = found as f64 / wanted as f64 - 1.0;
    (off.abs() > COUNT).then(|| format!("{found} elements for {wanted} asked for ({:+.1} %)", off * 100.0))
}

/// Labels that were asked for and are not there.
fn of_options<T: Copy + Eq + Into<u16> + Sync>(source: &Source<'_, T>) -> Vec<String> {
    let options = source.options;
    let dense: Vec<u16> = options.density.iter().map(|d| d.0).collect();
    let asked = [("to mesh", &options.keep), ("to be fine around", &options.fine), ("to be dense", &dense)];
    let missing = asked.map(|(what, labels)| {
        let of: Vec<u16> = labels.iter().copied().filter(|l| !source.fields.labels.contains(l)).collect();
        (what, of)
    });
    if missing.iter().all(|m| m.1.is_empty()) {
        return Vec::new();
    }
    let present = source.voxels.present();
    let mut all = Vec::new();
    for (what, labels) in missing {
        for label in labels {
            all.push(match present.contains(&label) {
                true => format!("label {label} was asked {what}, but it is not among the labels to mesh"),
                false => format!("label {label} was asked {what}, but the volume holds only {}", listed(&present)),
            });
        }
    }
    all
}

/// Labels that have not the density wanted, against that of all others, by more than a part.
fn of_density<T>(report: &MeshReport, source: &Source<'_, T>) -> Vec<String> {
    if source.options.density.is_empty() {
        return Vec::new();
    }
    let fields = source.fields;
    // Of each label: elements wanted and volume, both of samples.
    let mut samples = vec![[0.0; 2]; report.labels.len()];
    for (p, cells) in blocks(&fields.union) {
        let Some(sum) = fields.label_at(p).and_then(|l| samples.get_mut(l)) else { continue };
        sum[0] += cells as f64 * source.edge(p).powi(-3);
        sum[1] += cells as f64;
    }
    let found: Vec<[f64; 2]> = report.labels.iter().map(|l| [l.elements as f64, l.volume]).collect();
    let times = |of: &[[f64; 2]], own: usize| {
        let others = |k: usize| of.iter().enumerate().filter(|s| s.0 != own).map(|s| s.1[k]).sum::<f64>();
        of[own][0] / of[own][1] / (others(0) / others(1))
    };
    let told = |&(label, factor): &(u16, f64)| {
        let own = report.labels.iter().position(|l| l.label == label)?;
        let (found, wanted) = (times(&found, own), times(&samples, own));
        let is_off = found.is_finite() && wanted.is_finite() && !DENSITY.contains(&(found / wanted));
        is_off.then(|| {
            format!(
                "label {label}: a volume of it has {found:.2} times as many elements as one of the other labels, for {wanted:.2} wanted (with density {factor}, and edges that grow from label to label): cells of the lattice halve, so densities come near 1, 8 and 64 only; ask for one of these, or for another number of elements"
            )
        })
    };
    source.options.density.iter().filter_map(told).collect()
}

/// A path that passes by all that is meshed.
fn of_path<T: Copy + Eq + Into<u16> + Sync>(source: &Source<'_, T>) -> Option<String> {
    let [from, to] = source.options.path?;
    let steps = (from.distance(to) / (ALONG * source.fields.unit)).ceil().clamp(1.0, 1e4) as usize;
    let union = &source.fields.union;
    if (0..=steps).any(|i| union.at(from.lerp(to, i as f64 / steps as f64).to_array()) >= 0.5) {
        return None;
    }
    let mut nearest = (f64::INFINITY, from);
    for p in blocks(union).into_iter().map(|block| Point::from_array(block.0)) {
        let distance = p.distance(p.nearest_on_segment(from, to));
        if distance < nearest.0 {
            nearest = (distance, p);
        }
    }
    let (distance, at) = (nearest.0, place(nearest.1.to_array()));
    Some(format!(
        "the path passes all labels to mesh by {distance:.0} mm or so (nearest: {at}); check its frame, LPS mm"
    ))
}

fn of_crumbs<T>(source: &Source<'_, T>, label: usize) -> Option<String> {
    let crumbs = || source.crumbs.iter().filter(|c| usize::from(c.label) == label);
    let largest = crumbs().max_by(|a, b| a.volume.total_cmp(&b.volume))?;
    let (pieces, volume) = (crumbs().count(), crumbs().map(|c| c.volume).sum::<f64>());
    let (name, at) = (source.fields.labels[label], place(largest.place));
    Some(format!(
        "label {name}: {pieces} separate piece(s) of {volume:.2} mm3 in all ({:.1} voxels) are too small for elements of their own and are counted to what lies around them; the largest is at {at}",
        volume / source.fields.voxel
    ))
}

/// The voxels of a label that are not in its smooth surface, and what small pieces there are of them.
pub(super) fn missing<T: Copy + Eq + Into<u16> + Sync>(source: &Source<'_, T>, label: usize) -> (Vec<usize>, Missing) {
    let fields = source.fields;
    let solid = Solid::new(fields, label);
    let is_there = |p| solid.holds(p) || fields.label_at(p) == Some(label);
    source.voxels.missing((fields.labels[label], &fields.extents[label]), fields.step, is_there)
}

/// Pieces so small or flat that nothing of them is left in the smooth fields.
fn of_missing<T: Copy + Eq + Into<u16> + Sync>(
    source: &Source<'_, T>,
    label: usize,
    missing: &Missing,
) -> Option<String> {
    let fields = source.fields;
    let spacing = source.voxels.0.grid().spacing();
    let even = spacing.iter().all(|s| (s / fields.step - 1.0).abs() < 0.01);
    let way_out =
        if even { "voxels of half the size" } else { "voxels as long in all directions, or of half the size," };
    (missing.pieces > 0).then(|| {
        format!(
            "label {}: {} separate piece(s) of {} voxel(s) in all, of {}, are lost in smooth fields with cells of {:.2} mm, one at {}; {way_out} would keep them",
            fields.labels[label],
            missing.pieces,
            missing.voxels,
            fields.extents[label].count,
            fields.step,
            place(missing.at),
        )
    })
}

/// A label that is not where its voxels are, although its volume may be theirs: the mesh is made thicker for what it lacks.
fn of_thin<T: Copy + Eq + Into<u16> + Sync>(l: &LabelReport, absent: &[usize], voxels: &Voxels<'_, T>) -> String {
    let share = 100.0 * absent.len() as f64 / l.voxels as f64;
    let why = if voxels.are_thin(absent, l.label) {
        "it is thinner than two voxels there"
    } else {
        "it is so small or rough that they are of its corners and edges"
    };
    format!(
        "label {}: the centres of {share:.0} % of its voxels lie outside of its smooth surface: {why}; {THICKER}",
        l.label
    )
}

/// What brings a label closer to its volume.
const fn helps(is_hopeless: bool, coarse_regions: bool, is_fine: bool) -> &'static str {
    match (is_hopeless, coarse_regions, is_fine) {
        (true, ..) => THICKER,
        (_, true, _) => REGIONS,
        (_, _, true) => MORE,
        (_, _, false) => COARSE,
    }
}

fn of_label(l: &LabelReport, coarse_regions: bool, way_out: &str, far: f64) -> Vec<String> {
    if let Some(at) = l.lost_at {
        return vec![format!(
            "label {} has no element: its {} voxel(s), one at {}, are too thin or too small for this mesh",
            l.label,
            l.voxels,
            place(at)
        )];
    }
    let pinch = of_pinch(Boundary::Label(l.label), &l.surface).filter(|_| !coarse_regions);
    let mut all: Vec<String> = pinch.into_iter().collect();
    if l.volume_error.abs() > MOST_VOLUME_ERROR {
        all.push(format!("label {}: {:+.1} % of its volume; {way_out}", l.label, l.volume_error * 100.0));
    }
    if let Some(d) = l.interface.filter(|d| d.mean > far) {
        let coarse = if coarse_regions { " is a coarse region" } else { "" };
        all.push(format!("label {}{coarse}: its surface is {:.1} mm off on average", l.label, d.mean));
    }
    all
}

fn of_topology(which: Boundary, s: &SurfaceReport) -> Option<String> {
    let at = place(s.differs_at?);
    let other = if s.surfaces == s.surfaces_labels { "other holes or handles" } else { "other pieces" };
    Some(format!(
        "{which}: the surface has Euler number {} in {} piece(s), that of the smoothed voxels {} in {}: it has {other}; look near {at} (parts thinner than two voxels may come apart, and gaps so thin close, at any number of elements)",
        s.euler, s.surfaces, s.euler_labels, s.surfaces_labels
    ))
}

fn of_pinch(which: Boundary, s: &SurfaceReport) -> Option<String> {
    s.pinched_at.map(|at| format!("{which}: the surface is not two-manifold at {}", place(at)))
}

fn of_shapes(report: &MeshReport) -> Option<String> {
    let bad = report.bad_shapes?;
    Some(format!(
        "{} element(s) of bad shape: dihedral angles {:.1} to {:.1} degrees (bad is below {LEAST_DIHEDRAL:.0} or above {LARGEST_DIHEDRAL:.0}), radius ratio {:.3} (bad is below {LEAST_RADIUS_RATIO}); the worst at {}",
        bad.count,
        report.dihedral_min,
        report.dihedral_max,
        report.radius_ratio_min,
        place(bad.worst_at)
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_label_that_is_fine_was_to_be_among_those_to_be_fine_around() {
        assert!(helps(false, false, false).contains("fine around"));
        assert_eq!(helps(false, false, true), MORE);
    }

    #[test]
    fn a_count_off_by_more_than_two_percent_is_told() {
        assert_eq!(of_count(1_019, 1_000), None);
        assert_eq!(of_count(970, 1_000).as_deref(), Some("970 elements for 1000 asked for (-3.0 %)"));
    }
}
