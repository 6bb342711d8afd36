//! What a mesh is told of, or refused for: labels that are lost, surfaces that meet themselves, other topologies.

use super::test_head::head;
use super::*;
use monro_geometry::{Affine, Grid, Matrix3, TriangleMesh, Vector, tet_signed_volume};

/// Labels of voxels by their indices, in a volume of 44 x 44 x 44 around the origin.
fn labelled(spacing: [f64; 3], label: impl Fn([usize; 3]) -> u8) -> Volume<u8> {
    let grid = Grid::axis_aligned([44; 3], spacing, spacing.map(|s| -21.5 * s)).expect("grid");
    Volume::new(grid, (0..grid.len()).map(|at| label(grid.voxel(at))).collect()).expect("count")
}

/// Label 4, and 5 in the given voxels; a ball of voxels.
fn ball_with(spacing: [f64; 3], inner: &[[usize; 3]]) -> Volume<u8> {
    labelled(spacing, |v| match v.iter().map(|&i| (i as f64 - 21.5).powi(2)).sum::<f64>() < 18.0f64.powi(2) {
        true if inner.contains(&v) => 5,
        inside => 4 * u8::from(inside),
    })
}

fn strict(keep: &[u16], elements: usize) -> MeshOptions {
    MeshOptions { strict: true, ..MeshOptions::new(keep, keep, elements) }
}

fn told(report: &MeshReport, words: &[&str]) -> bool {
    report.all_remarks().iter().any(|r| words.iter().all(|w| r.contains(w)))
}

/// Labels 1 and 2 in two cubes of 12 voxels, the second one's lowest voxel at `high`.
fn two_cubes(high: [usize; 3]) -> Volume<u8> {
    let cube = |v: [usize; 3], low: [usize; 3]| (0..3).all(|a| (low[a]..low[a] + 12).contains(&v[a]));
    labelled([1.0; 3], |v| u8::from(cube(v, [10; 3])) + 2 * u8::from(cube(v, high)))
}

/// With more elements, a voxel that fields cannot hold made all labels coarse regions for "too few elements".
#[test]
fn a_single_stray_voxel_is_no_reason_for_coarse_regions() {
    let labels = labelled([1.0; 3], |v| match v {
        [2, 2, 2] => 7,
        _ => u8::from((0..3).all(|a| (12..30).contains(&v[a]))),
    });
    let (_, report) = mesh(&labels, &MeshOptions::new(&[1, 7], &[1, 7], 30_000)).expect("a mesh");
    assert!(!report.coarse_regions && told(&report, &["label 7 has no element"]), "{:?}", report.remarks);
}

/// A density of 2 did nothing, without a word.
#[test]
fn a_density_that_is_missed_is_told_with_what_came_of_it() {
    let halves = labelled([1.0; 3], |v| match v.iter().all(|i| (4..40).contains(i)) {
        true => 1 + u8::from(v[2] >= 22),
        false => 0,
    });
    let with = |factor: f64| {
        let options = MeshOptions { density: vec![(2, factor)], ..MeshOptions::new(&[1, 2], &[1, 2], 60_000) };
        let (mesh, report) = mesh(&halves, &options).expect("a mesh");
        let count = |l: u16| mesh.labels.iter().filter(|&&m| m == l).count() as f64;
        (count(2) / count(1), report.remarks)
    };
    let (ratio, remarks) = with(2.0);
    let words = format!("label 2: a volume of it has {ratio:.2} times");
    assert!(ratio < 1.3 && remarks.iter().any(|r| r.contains(&words)), "{ratio}: {remarks:?}");
    let (ratio, remarks) = with(8.0);
    assert!(ratio > 4.0 && !remarks.iter().any(|r| r.contains("a volume of it")), "{ratio}: {remarks:?}");
}

/// Those that share an edge, which are joined as voxels, were not two-manifold together.
#[test]
fn two_cubes_of_two_labels_that_share_an_edge_or_a_corner_come_apart() {
    for (high, joined) in [([22, 22, 10], true), ([22; 3], false)] {
        let (_, report) = mesh(&two_cubes(high), &MeshOptions::new(&[1, 2], &[1, 2], 5_000)).expect("a mesh");
        let SurfaceReport { euler, surfaces, closed, manifold, pinched_at, .. } = report.outer;
        assert_eq!((euler, surfaces, closed, manifold, pinched_at), (4, 2, true, true, None), "{high:?}");
        assert_eq!(
            told(&report, &["all labels together", "it has other pieces"]),
            joined,
            "{:?}",
            report.all_remarks()
        );
    }
}

/// Discs with gaps of two voxels, and a ball far larger; the gaps were spanned by elements that were cut in two, left crumbs
/// (111 pieces of one disc) and a surface that met itself in 78 edges and 160 points, 3 to 6 mm off.
#[test]
fn bodies_of_different_labels_two_voxels_apart_were_joined_across_the_gap() {
    let grid = Grid::axis_aligned([60, 60, 148], [1.5; 3], [0.0; 3]).expect("grid");
    let label = |[i, j, k]: [usize; 3]| {
        let (x, y, z) = (i as f64 - 30.0, j as f64 - 30.0, k as f64);
        let (disc, height) = (k.saturating_sub(8) / 17, k.saturating_sub(8) % 17);
        let is_disc = k >= 8 && disc < 4 && height < 15 && (x / 14.0).powi(2) + (y / 11.0).powi(2) < 1.0;
        let is_ball = x * x + y * y + (z - 118.0).powi(2) < 26.0f64.powi(2);
        if is_ball { 11 } else { (12 + disc as u8) * u8::from(is_disc) }
    };
    let labels = Volume::new(grid, (0..grid.len()).map(|at| label(grid.voxel(at))).collect()).expect("count");
    let keep = [11, 12, 13, 14, 15];
    for (elements, most) in [(10_000, 2.5), (30_000, 1.7)] {
        let (_, report) = mesh(&labels, &MeshOptions::new(&keep, &keep, elements)).expect("a mesh");
        let SurfaceReport { euler, surfaces, closed, manifold, .. } = report.outer;
        assert_eq!((euler, surfaces, closed, manifold), (10, 5, true, true), "{elements}");
        assert!(report.all_remarks().is_empty(), "{:?}", report.all_remarks());
        let far = report.labels.iter().filter_map(|l| l.interface).map(|i| i.max).fold(0.0, f64::max);
        assert!(far < most, "{far} mm at {elements}");
    }
}

/// Small pieces take so many cells that all others were made large to meet the count, until no cell was small enough to show
/// the pieces: all labels became coarse regions.
#[test]
fn small_pieces_of_a_label_were_given_up_though_there_were_elements_enough() {
    let grid = Grid::axis_aligned([80; 3], [1.0; 3], [0.0; 3]).expect("grid");
    let distance = |a: [f64; 3], b: [f64; 3]| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt();
    let balls: Vec<([f64; 3], f64)> = (0..24)
        .map(|i| {
            let (z, turn) = (1.0 - (2.0 * f64::from(i) + 1.0) / 24.0, 2.399963 * f64::from(i));
            let (out, r) = ([16.0, 26.0][i as usize % 2], (1.0 - z * z).sqrt());
            ([r * turn.cos(), r * turn.sin(), z].map(|x| 40.0 + out * x), 2.2 + 0.6 * f64::from(i % 3))
        })
        .collect();
    let label = |v: [usize; 3]| {
        let p = v.map(|i| i as f64);
        let in_ball = balls.iter().any(|&(c, radius)| distance(p, c) < radius);
        if in_ball { 2 } else { u8::from(distance(p, [40.0; 3]) < 36.0) }
    };
    let labels = Volume::new(grid, (0..grid.len()).map(|at| label(grid.voxel(at))).collect()).expect("count");
    let (_, report) = mesh(&labels, &MeshOptions::new(&[1, 2], &[2], 10_000)).expect("a mesh");
    assert!(report.all_remarks().is_empty(), "{:?}", report.all_remarks());
    let of_two = report.labels.iter().find(|l| l.label == 2).expect("there");
    assert_eq!((report.coarse_regions, of_two.surface.surfaces, of_two.surface.euler), (false, 24, 48));
    assert!(of_two.volume_error.abs() < 1e-3, "{}", of_two.volume_error);
}

#[test]
fn single_voxels_count_in_the_topology_that_the_mesh_is_held_against() {
    let labels = ball_with([1.0; 3], &[[16, 21, 21], [27, 21, 21]]);
    let (_, report) = mesh(&labels, &MeshOptions::new(&[4, 5], &[], 20_000)).expect("a mesh");
    let of = |label| report.labels.iter().find(|l| l.label == label).expect("there").surface;
    assert_eq!((of(5).euler_labels, of(5).surfaces_labels), (4, 2));
    // The ball and two cavities.
    assert_eq!((of(4).euler_labels, of(4).surfaces_labels), (6, 3));
    assert_eq!((report.outer.euler_labels, report.outer.surfaces_labels), (2, 1));
}

#[test]
fn a_tunnel_of_one_voxel_was_filled_without_a_word_strict_or_not() {
    let mut labels = ball_with([1.0; 3], &[]);
    let dims = labels.grid().dims();
    for k in 0..dims[2] {
        let at = labels.grid().index(21, 20, k);
        labels.data_mut()[at] = 0;
    }
    let options = MeshOptions::new(&[4], &[], 20_000);
    let (_, report) = mesh(&labels, &options).expect("a mesh");
    let gaps = report.closed_gaps.expect("told");
    // Through the ball of 18 mm, but for its mouths.
    assert!((30..=36).contains(&gaps.voxels), "{gaps:?}");
    let words = format!("{} voxel(s) of none of the labels", gaps.voxels);
    assert!(report.topology.iter().any(|r| r.contains(&words)), "{:?}", report.topology);
    let refused = mesh(&labels, &MeshOptions { strict: true, ..options.clone() }).expect_err("refused");
    assert!(matches!(refused, MeshError::ClosedGaps(_)), "{refused}");
    // Dents of a voxel are no gaps.
    let mut rough = ball_with([1.0; 3], &[]);
    for at in (0..rough.grid().len()).step_by(7) {
        let [i, j, k] = rough.grid().voxel(at);
        if (rough.grid().centre(i, j, k) - Point::ORIGIN).norm() > 17.2 {
            rough.data_mut()[at] = 0;
        }
    }
    assert_eq!(mesh(&rough, &options).expect("a mesh").1.closed_gaps, None);
}

#[test]
fn walls_of_a_slit_passed_through_each_other_without_a_word_strict_or_not() {
    let labels = labelled([1.0; 3], |v| {
        let inside = v.iter().map(|&i| (i as f64 - 21.5).powi(2)).sum::<f64>() < 18.0f64.powi(2);
        let slit = (22..24).contains(&v[0]) && v[2] > 14;
        4 * u8::from(inside && !slit)
    });
    let (_, report) = mesh(&labels, &MeshOptions::new(&[4], &[], 2200)).expect("a mesh");
    let found = report.overlap.expect("overlapping");
    assert!(found.elements > 2 && found.at.x.abs() < 3.0 && found.at.z > -8.0, "{found:?}");
    assert!(told(&report, &["lie in others", "narrow gap"]), "{:?}", report.all_remarks());
    assert!(matches!(mesh(&labels, &strict(&[4], 2200)).expect_err("refused"), MeshError::Overlap(_)));
}

#[test]
fn a_slit_of_one_voxel_was_bridged_without_a_word_strict_or_not() {
    let mut labels = ball_with([1.0; 3], &[]);
    let grid = *labels.grid();
    for (at, label) in labels.data_mut().iter_mut().enumerate() {
        let [i, _, k] = grid.voxel(at);
        if i == 21 && k >= 15 {
            *label = 0;
        }
    }
    let options = MeshOptions::new(&[4], &[], 20_000);
    let (_, report) = mesh(&labels, &options).expect("a mesh");
    assert_eq!((report.closed_gaps, report.outer.euler), (None, report.outer.euler_labels), "the fields keep it open");
    let far = report.labels[0].interface.expect("there");
    assert!(far.is_far() && far.max > 8.0, "{far:?}");
    let words = format!("{:.1} mm apart", far.max);
    assert!(report.topology.iter().any(|r| r.contains(&words)), "{:?}", report.topology);
    let refused = mesh(&labels, &MeshOptions { strict: true, ..options }).expect_err("refused");
    assert!(matches!(refused, MeshError::Far { label: 4, .. }), "{refused}");
}

#[test]
fn too_few_elements_for_a_slab_were_told_as_voxels_that_are_too_thin() {
    let slab = labelled([1.0; 3], |v| {
        u8::from((2..42).contains(&v[0]) && (2..42).contains(&v[1]) && (20..22).contains(&v[2]))
    });
    let refused = mesh(&slab, &MeshOptions::new(&[1], &[], 500)).expect_err("refused");
    assert!(matches!(refused, MeshError::TooFew { wanted: 500, voxels: 3200, .. }), "{refused}");
    assert!(refused.to_string().contains("500 elements are too few"), "{refused}");
}

#[test]
fn corners_of_a_small_cube_are_not_told_as_thinner_than_two_voxels() {
    let cube = labelled([1.0; 3], |v| u8::from(v.iter().all(|i| (20..24).contains(i))));
    let (_, report) = mesh(&cube, &MeshOptions::new(&[1], &[1], 5_000)).expect("a mesh");
    assert!(!told(&report, &["thinner than two voxels"]), "{:?}", report.remarks);
}

#[test]
fn a_lone_voxel_is_refused_with_its_place_and_a_way_out() {
    let labels = labelled([1.0; 3], |v| u8::from(v == [30, 20, 22]) * 5);
    let refused = mesh(&labels, &MeshOptions::new(&[5], &[], 5_000)).expect_err("refused");
    assert_eq!(refused, MeshError::TooThin { voxels: 1, at: [8.5, -1.5, 0.5], step: 1.0 });
    assert!(refused.to_string().contains("half the size"), "{refused}");
}

#[test]
fn a_label_without_an_element_is_told_and_refused_with_its_place() {
    // A flat voxel is less than half a cell of the even grid.
    let labels = ball_with([0.5, 0.5, 2.0], &[[20, 24, 22]]);
    let (_, report) = mesh(&labels, &MeshOptions::new(&[4, 5], &[], 5_000)).expect("a mesh");
    assert!(told(&report, &["label 5 has no element", "1 voxel(s)", "(-0.8, 1.2, 1.0) mm"]), "{:?}", report.remarks);
    let refused = mesh(&labels, &strict(&[4, 5], 5_000)).expect_err("refused");
    assert_eq!(refused, MeshError::Lost { label: 5, voxels: 1, at: [-0.75, 1.25, 1.0] });
}

#[test]
fn a_flat_island_that_smoothing_loses_is_told_with_its_place() {
    let mut inner: Vec<[usize; 3]> = Vec::new();
    (24..32).for_each(|i| (14..22).for_each(|j| (20..23).for_each(|k| inner.push([i, j, k]))));
    inner.push([16, 24, 22]);
    let (_, report) =
        mesh(&ball_with([0.5, 0.5, 2.0], &inner), &MeshOptions::new(&[4, 5], &[5], 8_000)).expect("a mesh");
    let words = ["label 5: 1 separate piece(s) of 1 voxel(s)", "(-2.8, 1.2, 1.0) mm", "half the size"];
    assert!(told(&report, &words), "{:?}", report.remarks);
    inner.pop();
    let (_, report) =
        mesh(&ball_with([0.5, 0.5, 2.0], &inner), &MeshOptions::new(&[4, 5], &[5], 8_000)).expect("a mesh");
    assert!(!told(&report, &["separate piece(s)"]), "{:?}", report.remarks);
}

/// A shell of two voxels, label 5, around a ball.
fn shell() -> Volume<u8> {
    labelled([1.0; 3], |v| {
        let r = v.iter().map(|&i| (i as f64 - 21.5).powi(2)).sum::<f64>().sqrt();
        if r < 16.0 { 4 } else { 5 * u8::from(r < 18.0) }
    })
}

/// The skull and the CSF of whole heads, which had a quarter and a half of their volumes.
#[test]
fn a_large_label_whose_volume_cannot_be_restored_is_not_represented_by_its_surface() {
    let fields = LabelFields::new(&shell(), &[4, 5]).expect("fields");
    let half: Vec<f64> = (0..2).map(|l| fields.volumes[l] * if fields.labels[l] == 5 { 0.5 } else { 1.1 }).collect();
    let shell = fields.labels.iter().position(|&l| l == 5).map(Lost::Label);
    assert_eq!(coarse::off(&fields.volumes, 5_000, &fields), None);
    assert_eq!(coarse::off(&half, 5_000, &fields), shell);
    // A label of few elements may have any volume.
    assert_eq!(coarse::off(&[fields.volumes[0], half[1]], 10, &fields), None);
    // Half of it is gone before any improvement, a fifth less may be made good.
    assert_eq!([coarse::gone(&half, 5_000, &fields), coarse::gone(&half, 10, &fields)], [shell, None]);
    let fifth: Vec<f64> = fields.volumes.iter().map(|v| 0.8 * v).collect();
    assert_eq!(coarse::gone(&fifth, 5_000, &fields), None);
}

/// One label of 128, of 731 voxels in a million and 15 % off, made coarse regions of all.
#[test]
fn a_small_label_whose_volume_cannot_be_restored_took_the_surfaces_of_all_others() {
    let mut labels = shell();
    let at = |n: usize| labels.grid().index(19 + n % 6, 19 + n / 6 % 6, 19 + n / 36);
    let cube: Vec<usize> = (0..216).map(at).collect();
    cube.into_iter().for_each(|at| labels.data_mut()[at] = 6);
    let fields = LabelFields::new(&labels, &[4, 5, 6]).expect("fields");
    let with = |label: u16, part: f64| -> Vec<f64> {
        (0..3).map(|l| fields.volumes[l] * if fields.labels[l] == label { part } else { 1.0 }).collect()
    };
    let of = |label| fields.labels.iter().position(|&l| l == label).map(Lost::Label);
    assert_eq!(coarse::off(&with(6, 0.85), 20_000, &fields), None);
    assert_eq!(coarse::off(&with(5, 0.85), 20_000, &fields), of(5));
    assert_eq!(coarse::gone(&with(6, 0.5), 20_000, &fields), of(6), "nothing makes so much good again");
}

/// A thick shell had its volume to 1e-5, its cavity 9 % too little and the ball of both 0.9 %: what chords took outside they gave within.
#[test]
fn a_cavity_that_no_label_fills_lost_a_tenth_of_its_volume_to_the_shell_around_it() {
    let radius = |v: [usize; 3]| v.iter().map(|&i| (i as f64 - 21.5).powi(2)).sum::<f64>().sqrt();
    let labels = labelled([1.0; 3], |v| u8::from((8.0..19.0).contains(&radius(v))));
    let cavity = (0..labels.grid().len()).filter(|&at| radius(labels.grid().voxel(at)) < 8.0).count() as f64;
    for elements in [1_500, 5_000, 20_000] {
        let (tets, report) = mesh(&labels, &MeshOptions::new(&[1], &[1], elements)).expect("a mesh");
        assert!(report.all_remarks().is_empty(), "{:?}", report.all_remarks());
        let surface = tets.surface(|_| true);
        let (pieces, count) = surface.components();
        assert_eq!(count, 2);
        let volumes = [0, 1].map(|piece| {
            let triangles = surface.triangles.iter().zip(&pieces).filter(|(_, p)| **p == piece).map(|(t, _)| *t);
            TriangleMesh { vertices: surface.vertices.clone(), triangles: triangles.collect() }.signed_volume()
        });
        let found = -volumes[0].min(volumes[1]);
        assert!((found / cavity - 1.0).abs() < 0.005, "{elements}: {found} of {cavity} mm3");
        assert!(report.labels[0].volume_error.abs() < 1e-3, "{elements}: {:?}", report.labels[0]);
    }
}

/// From 50 elements a label on, as many were asked for, specks of 45 voxels in all had the ball within become a coarse region, for
/// "too few elements".
#[test]
fn specks_of_one_label_took_the_surfaces_of_all_others_where_more_elements_were_asked_for() {
    let specks: Vec<[usize; 3]> = (0..15).map(|i| [7 + 11 * i % 31, 8 + 7 * i % 29, 9 + 13 * i % 27]).collect();
    let is_speck = |v: [usize; 3]| specks.iter().any(|s| v[1..] == s[1..] && (s[0]..s[0] + 3).contains(&v[0]));
    let labels = labelled([1.0; 3], |v| {
        let r = v.iter().map(|&i| (i as f64 - 21.5).powi(2)).sum::<f64>().sqrt();
        match r {
            7.0..15.0 if is_speck(v) => 9,
            ..7.0 => 7,
            ..16.0 => 3,
            _ => 0,
        }
    });
    let (_, report) = mesh(&labels, &MeshOptions::new(&[3, 7, 9], &[7], 20_000)).expect("a mesh");
    assert!(!report.coarse_regions, "{:?}", report.all_remarks());
    let inner = report.labels.iter().find(|l| l.label == 7).expect("there");
    assert!(inner.interface.is_some_and(|i| i.mean < 0.15) && inner.volume_error.abs() < 5e-3, "{inner:?}");
}

#[test]
fn a_label_of_a_wrong_volume_is_told_and_refused_with_what_helps() {
    let labels = shell();
    let (_, mut report) = mesh(&labels, &MeshOptions::new(&[4, 5], &[], 1_500)).expect("a mesh");
    let off = report.labels.iter().find(|l| l.label == 5).expect("there").volume_error;
    assert!(off.abs() > MOST_VOLUME_ERROR, "{off}");
    assert!(told(&report, &["label 5:", "of its volume", "to be fine around"]), "{:?}", report.remarks);
    // All else being well:
    for l in &mut report.labels {
        l.surface = SurfaceReport { pinched_at: None, differs_at: None, ..l.surface };
    }
    report.outer = SurfaceReport { pinched_at: None, differs_at: None, ..report.outer };
    let first = report.labels.iter().find(|l| l.volume_error.abs() > 0.01).map(|l| (l.label, l.volume_error));
    let (label, error) = first.expect("one of them");
    let refused = strictly(&report).expect_err("refused");
    assert_eq!(refused, MeshError::Volume { label, error });
    assert!(refused.to_string().contains("(1 % allowed)"), "{refused}");
}

#[test]
fn labels_asked_for_that_are_not_there_are_told_with_those_that_are() {
    let labels = head([4.0; 3]);
    let options = MeshOptions { density: vec![(8, 2.0)], ..MeshOptions::new(&[4, 5, 9], &[5, 6], 5_000) };
    let (_, report) = mesh(&labels, &options).expect("a mesh");
    let present = "the volume holds only the labels 4, 5, 6, 7";
    assert!(told(&report, &["label 9 was asked to mesh", present]), "{:?}", report.remarks);
    assert!(told(&report, &["label 6 was asked to be fine around", "not among the labels to mesh"]));
    assert!(told(&report, &["label 8 was asked to be dense", present]), "{:?}", report.remarks);
    let none = mesh(&labels, &MeshOptions::new(&[9], &[], 5_000)).expect_err("nothing");
    assert!(none.to_string().contains("the labels 4, 5, 6, 7"), "{none}");
}

#[test]
fn a_path_beside_everything_is_told_with_its_distance() {
    let labels = head([4.0; 3]);
    let with = |path| {
        let options = MeshOptions { path: Some(path), ..MeshOptions::new(&[4, 5, 6, 7], &[5, 6, 7], 5_000) };
        mesh(&labels, &options).expect("a mesh").1
    };
    // The half-axis is 60 mm; blocks of three cells of 4 mm are looked at.
    let far = with([Point::new(500.0, 0.0, 0.0), Point::new(520.0, 0.0, 0.0)]);
    let remark = far.remarks.iter().find(|r| r.contains("the path passes")).expect("told");
    let distance: f64 = remark.split(' ').find_map(|w| w.parse().ok()).expect("a number");
    assert!((distance - 440.0).abs() < 8.0, "{remark}");
    let near = with([Point::new(100.0, 0.0, 0.0), Point::new(7.0, 15.0, 10.0)]);
    assert!(!told(&near, &["the path passes"]), "{:?}", near.remarks);
}

#[test]
fn a_rod_one_voxel_thick_is_refused_with_what_helps_and_that_helps() {
    let rod: Vec<[usize; 3]> = (6..37).map(|k| [20, 24, k]).collect();
    let refused = mesh(&ball_with([1.0; 3], &rod), &strict(&[4, 5], 8_000)).expect_err("refused");
    let said = refused.to_string();
    assert!(said.contains("thinner than two voxels") && said.contains("half the size"), "{said}");
    let thick: Vec<[usize; 3]> =
        rod.iter().flat_map(|&[i, j, k]| [[i, j, k], [i + 1, j, k], [i, j + 1, k], [i + 1, j + 1, k]]).collect();
    mesh(&ball_with([1.0; 3], &thick), &strict(&[4, 5], 8_000)).expect("two voxels are enough");
}

#[test]
fn what_is_left_of_a_label_is_not_blown_up_for_pieces_that_are_lost() {
    // A ball, and beside it single voxels that smoothing does not keep: the ball used to get their volume too, at a volume
    // error of nothing.
    let speck = |[i, j, k]: [usize; 3]| i > 26 && i % 3 == 0 && j % 3 == 1 && k % 3 == 0;
    let in_ball = |v: [usize; 3]| {
        let off = [0, 1, 2].map(|a| (v[a] as f64 - [14.0, 21.5, 21.5][a]).powi(2));
        off.iter().sum::<f64>().sqrt() < 7.0
    };
    let labels = labelled([1.0; 3], |v| 5 * u8::from(in_ball(v) || speck(v)));
    let (mesh, report) = mesh(&labels, &MeshOptions::new(&[5], &[5], 5_000)).expect("a mesh");
    let lost = report.remarks.iter().find(|r| r.contains("are lost")).expect("told");
    assert!(lost.contains("voxels of half the size would keep them"), "{lost}");
    assert!(report.labels[0].volume_error < -0.1, "{report:?}");
    let ball = (0..labels.grid().len()).filter(|&at| in_ball(labels.grid().voxel(at))).count() as f64;
    assert!((mesh.label_volume(5) / ball - 1.0).abs() < 0.01, "{} for {ball}", mesh.label_volume(5));
    let refused = super::mesh(&labels, &strict(&[5], 5_000)).expect_err("refused");
    assert!(matches!(refused, MeshError::Volume { label: 5, .. }), "{refused:?}");
}

#[test]
fn a_ball_was_blown_up_by_a_seventh_for_a_plate_beside_it_that_was_lost() {
    let in_ball = |v: [usize; 3]| [0, 1, 2].iter().map(|&a| (v[a] as f64 - 14.0).powi(2)).sum::<f64>() < 64.0;
    let in_plate = |v: [usize; 3]| v[2] == 36 && v[..2].iter().all(|i| (8..26).contains(i));
    // Voxels half as long along the plate's thickness: fields with cells of a voxel's length do not keep it.
    let labels = labelled([1.0, 1.0, 0.5], |v| 5 * u8::from(in_ball(v) || in_plate(v)));
    let (mesh, report) = mesh(&labels, &MeshOptions::new(&[5], &[5], 5_000)).expect("a mesh");
    let torn = report.labels[0].torn.expect("told");
    assert_eq!((torn.places, torn.voxels), (1, 18 * 18));
    let ball = 0.5 * (0..labels.grid().len()).filter(|&at| in_ball(labels.grid().voxel(at))).count() as f64;
    assert!((mesh.label_volume(5) / ball - 1.0).abs() < 0.01, "{} for {ball}", mesh.label_volume(5));
    assert!(report.labels[0].volume_error < -0.1, "{report:?}");
}

#[test]
fn a_path_that_is_no_number_passed_the_labels_by_inf_mm_and_a_mesh_was_made() {
    let grid = Grid::axis_aligned([12; 3], [1.0; 3], [0.0; 3]).expect("a grid");
    let path = Some([Point::new(6.0, 6.0, f64::NAN), Point::new(6.0, 6.0, 6.0)]);
    let options = MeshOptions { path, ..MeshOptions::new(&[1], &[], 1000) };
    let refused = mesh(&Volume::filled(grid, 1u16), &options).expect_err("refused");
    assert_eq!(refused.to_string(), "a coordinate of the path is NaN; it must be a finite number of mm (LPS)");
}

#[test]
fn a_skin_of_one_voxel_had_its_volume_and_a_quarter_of_its_voxels_outside_without_a_word() {
    let radius = |v: [usize; 3]| v.iter().map(|&i| (i as f64 - 21.5).powi(2)).sum::<f64>().sqrt();
    let skin = |from: f64| labelled([1.0; 3], move |v| 2 * u8::from((from..18.0).contains(&radius(v))));
    let of = |labels: &Volume<u8>| mesh(labels, &MeshOptions::new(&[2], &[2], 30_000)).expect("a mesh").1;
    let thin = of(&skin(17.0));
    assert!(thin.labels[0].volume_error.abs() < 0.01, "{:?}", thin.labels);
    let words = ["of its voxels lie outside of its smooth surface", "more elements do not help"];
    assert!(told(&thin, &words), "{:?}", thin.remarks);
    assert!(!told(&of(&skin(16.0)), &words[..1]), "two voxels are enough");
    // A fin beside a ball: its missing volume has the same cause, and no other advice is given for it.
    let fin = labelled([1.0; 3], |v| if radius(v) < 10.0 { 1 } else { 2 * u8::from(v[0] == 21 && radius(v) < 18.0) });
    let (_, report) = mesh(&fin, &MeshOptions::new(&[1, 2], &[2], 30_000)).expect("a mesh");
    assert!(told(&report, &["label 2", "% of its volume", "more elements do not help"]), "{:?}", report.remarks);
    assert!(!told(&report, &["label 1", words[0]]), "{:?}", report.remarks);
}

#[test]
fn furrows_whose_walls_only_graze_each_other_passed_strict_without_a_word() {
    let along = |x, y, z| Vector::<Patient>::new(x, y, z);
    let flipped = Matrix3::from_columns(along(-1.0, 0.0, 0.0), along(0.0, -1.0, 0.0), along(0.0, 0.0, 1.0));
    let grid = Grid::new([60; 3], Affine::new(flipped, [0.0; 3])).expect("grid");
    let labels = (0..grid.len()).map(|at| {
        let [x, y, z] = grid.voxel(at).map(|i| i as f64 - 30.0);
        let far = (x * x + y * y + z * z).sqrt();
        let furrow = (0..6).any(|k| ((0.52 * f64::from(k)).cos() * x + (0.52 * f64::from(k)).sin() * y).abs() < 1.2);
        if far >= 26.0 || (furrow && far > 14.0) { 0 } else { 1 + u8::from(far < 12.0) }
    });
    let labels = Volume::new(grid, labels.collect()).expect("count");
    let (_, report) = mesh(&labels, &MeshOptions::new(&[1, 2], &[1, 2], 14_000)).expect("a mesh");
    let found = report.self_crossing.expect("crossing");
    assert!(report.overlap.is_none() && found.pairs > 0, "{found:?}");
    assert!(told(&report, &["passes through itself", "narrow gap"]), "{:?}", report.all_remarks());
    assert!(matches!(mesh(&labels, &strict(&[1, 2], 14_000)).expect_err("refused"), MeshError::SelfCrossing(_)));
}

#[test]
fn bodies_parted_at_a_neck_of_one_voxel_and_a_spike_lost_passed_strict_without_a_word() {
    let within = |v: [usize; 3], low: [usize; 3], high: [usize; 3]| (0..3).all(|a| (low[a]..high[a]).contains(&v[a]));
    let neck = |v| within(v, [19, 15, 15], [22, 16, 16]);
    let bodies = move |v| within(v, [5; 3], [19, 25, 25]) || within(v, [22, 8, 8], [38, 22, 22]);
    let labels = labelled([1.0; 3], |v| u8::from(bodies(v) || neck(v)));
    let (_, report) = mesh(&labels, &MeshOptions::new(&[1], &[1], 5_000)).expect("a mesh");
    let torn = report.labels[0].torn.expect("told");
    assert_eq!((torn.places, torn.voxels, report.outer.surfaces), (1, 3, 2), "{torn:?}");
    assert!(told(&report, &["label 1: 1 thin part(s) of 3 voxel(s)", "thicken them"]), "{:?}", report.all_remarks());
    let refused = mesh(&labels, &strict(&[1], 5_000)).expect_err("refused");
    assert_eq!(refused, MeshError::Torn { label: 1, torn });
    // A spike of 20 voxels, and one that is no longer than the roughness of a surface.
    let spike = |end: usize| labelled([1.0; 3], move |v| u8::from(bodies(v) || within(v, [19, 24, 24], [end, 25, 25])));
    let of = |labels: &Volume<u8>| mesh(labels, &MeshOptions::new(&[1], &[1], 5_000)).expect("a mesh").1.labels[0].torn;
    let torn = of(&spike(39)).expect("told");
    assert!(torn.places == 1 && torn.at[0] > 0.0 && (18..=20).contains(&torn.voxels), "{torn:?}");
    assert_eq!(of(&spike(21)), None);
}

#[test]
fn a_hole_through_a_plate_of_two_voxels_closed_without_a_word_strict_or_not() {
    let within =
        |v: [usize; 3], z: std::ops::Range<usize>| v[..2].iter().all(|i| (6..38).contains(i)) && z.contains(&v[2]);
    let hole = |v: [usize; 3]| v[..2] == [20, 20];
    let plate = labelled([1.0; 3], |v| u8::from(within(v, 20..22) && !hole(v)));
    let (_, report) = mesh(&plate, &MeshOptions::new(&[1], &[1], 5_000)).expect("a mesh");
    assert_eq!(report.closed_gaps.map(|g| g.voxels), Some(2), "{:?}", report.all_remarks());
    assert!(matches!(mesh(&plate, &strict(&[1], 5_000)).expect_err("refused"), MeshError::ClosedGaps(_)));
    // Between two labels the hole is a neck of the other one.
    let inside = labelled([1.0; 3], |v| match within(v, 8..36) {
        true => 1 + u8::from(within(v, 20..22) && (10..34).contains(&v[0]) && !hole(v)),
        false => 0,
    });
    let (_, report) = mesh(&inside, &MeshOptions::new(&[1, 2], &[1, 2], 8_000)).expect("a mesh");
    let torn = report.labels[0].torn.expect("told");
    assert_eq!((torn.places, torn.voxels, report.labels[1].torn), (1, 2, None), "{torn:?}");
}

#[test]
fn a_label_lost_in_the_fields_was_to_be_looked_for_at_the_origin() {
    let labels = labelled([1.0; 3], |v| match v {
        [15..35, 30, 30] => 2,
        _ => u8::from((0..3).all(|a| (4..[15, 34, 34][a]).contains(&v[a]))),
    });
    let (_, report) = mesh(&labels, &MeshOptions::new(&[1, 2], &[1], 8_000)).expect("a mesh");
    let found = &report.labels[1];
    let at = found.surface.differs_at.or(found.lost_at).expect("told");
    assert!(at[0] > -9.5 && at[0] < 14.0 && (at[1] - 8.5).abs() < 4.0 && (at[2] - 8.5).abs() < 4.0, "{found:?}");
}

/// A ball: its middle in voxels of 1 mm, and its radius.
type Ball = ([f64; 3], f64);

fn within(v: [usize; 3], (c, r): &Ball) -> bool {
    (0..3).map(|a| (v[a] as f64 - c[a]).powi(2)).sum::<f64>() < r * r
}

/// What a mesh of labels 1 and 2 has of label 2 in each of some balls has the volume of the voxels there.
fn balls_are_met(labels: &Volume<u8>, balls: &[Ball], options: &MeshOptions) {
    let (mesh, report) = mesh(labels, options).expect("a mesh");
    let first = labels.grid().centre(0, 0, 0);
    for ball in balls {
        let own = |at: &usize| labels.data()[*at] == 2 && within(labels.grid().voxel(*at), ball);
        let voxels = (0..labels.data().len()).filter(own).count() as f64;
        let of = mesh.tets.iter().zip(&mesh.labels).filter(|(t, l)| {
            let place =
                (t.iter().fold(Vector::ZERO, |s, &v| s + (mesh.vertices[v as usize] - first)) * 0.25).to_array();
            **l == 2 && (0..3).map(|a| (place[a] - ball.0[a]).powi(2)).sum::<f64>() < (ball.1 + 1.5).powi(2)
        });
        let volume: f64 = of.map(|(t, _)| tet_signed_volume(t.map(|v| mesh.vertices[v as usize]))).sum();
        let (elements, fine) = (options.elements, &options.fine);
        assert!((volume / voxels - 1.0).abs() < 0.005, "{elements}, fine around {fine:?}: {volume} of {voxels} mm3");
    }
    assert!(report.all_remarks().is_empty(), "{:?}", report.all_remarks());
}

/// Small pieces lost up to a third of their volumes, and the largest had it: of the label nothing was missing.
#[test]
fn the_largest_piece_of_a_label_swelled_by_what_the_small_ones_lost() {
    let balls: [Ball; 5] = [
        ([13., 17., 20.], 5.6),
        ([28., 14., 24.], 2.6),
        ([30., 28., 20.], 3.6),
        ([16., 30., 24.], 4.6),
        ([22., 22., 33.], 3.1),
    ];
    let labels = labelled([1.0; 3], |v| match within(v, &([21.5; 3], 19.0)) {
        true => 1 + u8::from(balls.iter().any(|b| within(v, b))),
        false => 0,
    });
    for (elements, fine) in [(3000, &[1, 2][..]), (9000, &[1, 2]), (9000, &[2])] {
        balls_are_met(&labels, &balls, &MeshOptions::new(&[1, 2], fine, elements));
    }
}

/// So they did where theirs was the label with most voxels, and another was there.
#[test]
fn a_piece_of_the_label_with_most_voxels_lost_a_third_of_its_volume() {
    let balls: [Ball; 2] = [([15., 20., 20.], 12.0), ([36., 20., 20.], 4.5)];
    let inner: Ball = ([15., 20., 20.], 5.0);
    let labels = labelled([1.0; 3], |v| match balls.iter().any(|b| within(v, b)) {
        true => 2 - u8::from(within(v, &inner)),
        false => 0,
    });
    for elements in [1500, 6000] {
        balls_are_met(&labels, &balls, &MeshOptions::new(&[1, 2], &[1], elements));
    }
}
