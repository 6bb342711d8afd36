//! Tools against closed forms; random histories against bit-identical volumes; journals cut and damaged anywhere.

use super::*;
use crate::livewire::Axis;
use monro_geometry::{Affine, Grid, Matrix3, Point, Volume};
use proptest::prelude::*;

fn grid(dims: [usize; 3], spacing: [f64; 3]) -> Grid {
    Grid::axis_aligned(dims, spacing, [-3.0, 2.0, 5.0]).expect("grid")
}

fn ball_in(grid: &Grid, voxel: [usize; 3], radius: f64) -> Selection {
    stroke(grid, &[grid.centre(voxel[0], voxel[1], voxel[2])], radius, None).expect("ball")
}

fn boxed(grid: &Grid, low: [usize; 3], high: [usize; 3]) -> Selection {
    Selection::where_(*grid, |n| (0..3).all(|a| (low[a]..=high[a]).contains(&grid.voxel(n)[a])))
}

#[test]
fn a_ball_has_its_voxels_on_a_turned_anisotropic_grid() {
    // A quarter turn about z with 0.5 x 0.8 x 2 mm voxels, and a slant of the slices.
    let linear = Matrix3 { rows: [[0.0, -0.8, 0.2], [0.5, 0.0, 0.0], [0.0, 0.0, 2.0]] };
    let grid = Grid::new([40, 30, 14], Affine::new(linear, [4.0, -9.0, 1.0])).expect("grid");
    let centre = Point::new(-6.3, 1.2, 14.9);
    let found = stroke(&grid, &[centre], 5.0, None).expect("ball");
    let brute = Selection::where_(grid, |n| {
        let [i, j, k] = grid.voxel(n);
        (grid.centre(i, j, k) - centre).norm() <= 5.0
    });
    assert_eq!(found, brute);
    let exact = 4.0 / 3.0 * core::f64::consts::PI * 125.0;
    assert!((found.volume_mm3() / exact - 1.0).abs() < 0.05, "{}", found.volume_mm3());
}

#[test]
fn a_stroke_has_no_gaps_and_a_disc_stays_on_its_slice() {
    let g = grid([60, 20, 9], [0.5, 0.5, 3.0]);
    let ends = [g.centre(5, 10, 4), g.centre(50, 10, 4)];
    let line = stroke(&g, &ends, 1.0, Some(Axis::K)).expect("stroke");
    assert_eq!(line.bounds(), Some([[3, 8, 4], [52, 12, 4]]));
    assert!((5..=50).all(|i| line.contains(g.index(i, 10, 4))));
    // The second position is off the slice; a flat stroke projects it.
    let tilted = [ends[0], g.centre(50, 10, 7)];
    assert_eq!(stroke(&g, &tilted, 1.0, Some(Axis::K)).expect("stroke"), line);
    let disc = stroke(&g, &[g.centre(30, 10, 4)], 4.0, Some(Axis::K)).expect("disc");
    assert!((disc.count() as f64 * 0.25 / (core::f64::consts::PI * 16.0) - 1.0).abs() < 0.05);
    assert!(stroke(&g, &[Point::new(500.0, 0.0, 0.0)], 3.0, None).expect("beside").is_empty());
    assert!(matches!(stroke(&g, &[Point::new(f64::NAN, 0.0, 0.0)], 3.0, None), Err(EditError::Option { .. })));
    assert!(matches!(stroke(&g, &ends[..1], 0.0, None), Err(EditError::Option { .. })));
    assert!(matches!(stroke(&g, &[], 1.0, None), Err(EditError::Empty { .. })));
}

#[test]
fn a_threshold_is_what_lies_in_its_range_within_a_selection() {
    let g = grid([5, 4, 3], [1.0; 3]);
    let ct = Volume::new(g, (0..60).map(|n| (n * 7 % 60) as i16).collect()).expect("ct");
    let all = threshold(&ct, 10..=30, None).expect("threshold");
    assert!((0..60).all(|n| all.contains(n) == (10..=30).contains(&(n * 7 % 60))));
    let half = boxed(&g, [0, 0, 0], [4, 3, 0]);
    let inside = threshold(&ct, 10..=30, Some(&half)).expect("within");
    assert_eq!(inside, all.intersection(&half).expect("grids"));
    #[allow(clippy::reversed_empty_ranges, reason = "the empty range is what is tested")]
    let empty = threshold(&ct, 30..=10, None);
    assert!(matches!(empty, Err(EditError::Option { .. })));
}

#[test]
fn margins_are_exact_in_millimetres() {
    let g = grid([41, 41, 21], [0.5, 0.5, 1.0]);
    let point = boxed(&g, [20, 20, 10], [20, 20, 10]);
    assert_eq!(grown(&point, 4.0).expect("grown"), ball_in(&g, [20, 20, 10], 4.0));
    let cube = boxed(&g, [10, 10, 5], [30, 30, 15]);
    assert_eq!(shrunk(&cube, 1.0).expect("shrunk"), boxed(&g, [12, 12, 6], [28, 28, 14]));
    assert!(shrunk(&point, 1.0).expect("nothing left").is_empty());
    assert!(grown(&Selection::empty(g), 1.0).expect("empty").is_empty());
}

#[test]
fn islands_holes_and_cups_are_told_apart() {
    let g = grid([20, 20, 20], [1.0; 3]);
    let shell = boxed(&g, [3, 3, 3], [9, 9, 9]).difference(&boxed(&g, [5, 5, 5], [7, 7, 7])).expect("grids");
    let dot = boxed(&g, [10, 10, 10], [10, 10, 10]);
    let both = shell.union(&dot).expect("grids");
    // The dot touches the shell by a corner only.
    assert_eq!(islands(&both), vec![shell.clone(), dot.clone()]);
    assert_eq!(largest_island(&both).expect("one"), shell);
    assert_eq!(without_small_islands(&both, 1.5).expect("kept"), shell);
    assert_eq!(without_small_islands(&both, 0.0).expect("kept"), both);
    assert_eq!(fill_holes(&shell), boxed(&g, [3, 3, 3], [9, 9, 9]));
    let cup = shell.difference(&boxed(&g, [5, 5, 8], [7, 7, 9])).expect("grids");
    assert_eq!(fill_holes(&cup), cup);
    assert_eq!(fill_holes_in_slices(&cup, Axis::K), boxed(&g, [3, 3, 3], [9, 9, 9]));
    assert!(matches!(largest_island(&Selection::empty(g)), Err(EditError::Empty { .. })));
    assert!(islands(&Selection::empty(g)).is_empty());
}

#[test]
fn growing_stops_at_necks_and_at_a_volume() {
    // Two chambers of 15 x 15 x 15 joined by a pipe three voxels wide.
    let g = grid([41, 17, 17], [1.0; 3]);
    let (left, right) = (boxed(&g, [1, 1, 1], [15, 15, 15]), boxed(&g, [25, 1, 1], [39, 15, 15]));
    let pipe = boxed(&g, [16, 7, 7], [24, 9, 9]);
    let all = left.union(&right).and_then(|u| u.union(&pipe)).expect("grids");
    let ct = Volume::new(g, (0..g.len()).map(|n| if all.contains(n) { 10i16 } else { 40 }).collect()).expect("ct");
    let open = GrowthOptions { range: 0..=20, within: None, neck_mm: 0.0, most_mm3: f64::INFINITY };
    let whole = grow(&ct, &[[3, 3, 3]], &open).expect("grow");
    assert_eq!((whole.selection, whole.stopped_at), (all, None));
    let guarded = grow(&ct, &[[3, 3, 3]], &GrowthOptions { neck_mm: 6.0, ..open.clone() }).expect("grow").selection;
    assert!(guarded.intersection(&right).expect("grids").is_empty());
    let kept = guarded.intersection(&left).expect("grids").count() as f64 / left.count() as f64;
    // Opening a cube of 15 voxels by a ball of radius 3 leaves a core of 9 and takes 5 of the 9 voxels of each section
    // of the 12 edges (a^2 + b^2 > 9 for a, b in 1..=3) and 20 of 27 at each corner, a little less at the pipe's mouth.
    let exact = 1.0 - (12.0 * 9.0 * 5.0 + 8.0 * 20.0) / 3375.0;
    assert!((kept - exact).abs() < 0.01, "{kept} {exact}");
    let limited = grow(&ct, &[[8, 8, 8]], &GrowthOptions { most_mm3: 1000.0, ..open.clone() }).expect("grow");
    assert_eq!(limited.selection.count(), 1000);
    assert!(limited.stopped_at.is_some());
    // A leak came back whole where the neck guard was on.
    let stopped = GrowthOptions { most_mm3: 1000.0, neck_mm: 2.0, ..open.clone() };
    let stopped = grow(&ct, &[[8, 8, 8]], &stopped).expect("grow");
    assert_eq!((stopped.selection.count(), stopped.stopped_at.is_some()), (1000, true));
    let masked = GrowthOptions { within: Some(left.clone()), ..open.clone() };
    assert_eq!(grow(&ct, &[[3, 3, 3]], &masked).expect("grow").selection, left);
    assert!(matches!(grow(&ct, &[[0, 0, 0]], &open), Err(EditError::Seed { value: 40, .. })));
    assert!(matches!(grow(&ct, &[[99, 0, 0]], &open), Err(EditError::Outside { .. })));
    assert!(matches!(grow(&ct, &[], &open), Err(EditError::Empty { .. })));
    let narrow = GrowthOptions { neck_mm: 100.0, ..open };
    assert!(matches!(grow(&ct, &[[3, 3, 3]], &narrow), Err(EditError::Empty { .. })));
}

#[test]
fn smoothing_keeps_the_volume_and_takes_spikes() {
    let g = grid([40, 40, 24], [0.8, 0.8, 1.6]);
    let ball = ball_in(&g, [20, 20, 12], 8.0);
    let spike = boxed(&g, [20, 30, 12], [20, 37, 12]);
    let spiky = ball.union(&spike).expect("grids");
    let smooth = smoothed(&spiky, 1.5).expect("smooth");
    assert_eq!(smooth.count(), spiky.count());
    assert!(!smooth.contains(g.index(20, 36, 12)));
    let overlap =
        2.0 * smooth.intersection(&ball).expect("grids").count() as f64 / (smooth.count() + ball.count()) as f64;
    assert!(overlap > 0.97, "{overlap}");
    let everything = Selection::empty(g).complement();
    assert_eq!(smoothed(&everything, 2.0).expect("full"), everything);
    assert!(matches!(smoothed(&Selection::empty(g), 1.0), Err(EditError::Empty { .. })));
}

#[test]
fn rules_protect_labels_and_masks_limit() {
    let g = grid([10, 10, 10], [1.0; 3]);
    let mut editor = Editor::new(Volume::filled(g, 4u8));
    let (a, b) = (boxed(&g, [0, 0, 0], [4, 9, 9]), boxed(&g, [3, 0, 0], [9, 9, 9]));
    assert_eq!(editor.paint(&a, 5, &Rule::anything()).expect("paint").count(), 500);
    assert_eq!(editor.paint(&b, 6, &Rule::only_over(&[0, 1, 2, 3, 4])).expect("paint").count(), 500);
    let mask = boxed(&g, [0, 0, 0], [9, 9, 0]);
    let rule = Rule::only_over(&[6]).within(mask);
    assert_eq!(editor.paint(&b, 7, &rule).expect("paint").count(), 50);
    // Erasing gives voxels to their neighbours.
    let speck = boxed(&g, [2, 5, 5], [2, 5, 5]);
    editor.paint(&speck, 9, &Rule::anything()).expect("paint");
    editor.erase(&speck, 9, 0, &Rule::anything()).expect("erase");
    assert_eq!(editor.labels().at(2, 5, 5), 5);
    let other = Selection::empty(grid([3, 3, 3], [1.0; 3]));
    assert!(matches!(editor.paint(&other, 1, &Rule::anything()), Err(EditError::Grid { .. })));
}

#[test]
fn a_stroke_is_one_step_and_survives_replay_as_one() {
    let g = grid([20, 20, 6], [1.0; 3]);
    let base = Volume::filled(g, 0u8);
    let mut editor = Editor::new(base.clone());
    editor.begin_stroke();
    for i in [4, 8, 12] {
        editor.paint(&ball_in(&g, [i, 9, 3], 2.5), 5, &Rule::anything()).expect("dab");
    }
    editor.end_stroke();
    let shape = smoothed(&Selection::of_label(editor.labels(), 5), 1.0).expect("smooth");
    editor.begin_stroke();
    reshape(&mut editor, 5, &shape);
    editor.end_stroke();
    assert_eq!(editor.steps(), (2, 0));
    assert_eq!(Selection::of_label(editor.labels(), 5), shape);
    let (mut again, recovery) = Editor::replay(base.clone(), &editor.take_journal()).expect("replay");
    assert_eq!((again.labels(), again.steps(), recovery.torn_bytes), (editor.labels(), (2, 0), 0));
    assert!(again.undo() && again.undo() && !again.undo());
    assert_eq!(again.labels(), &base);
}

/// A random edit.
#[derive(Debug, Clone)]
enum Act {
    Paint { at: [usize; 3], radius: f64, label: u8, protect: bool },
    Reshape { label: u8, tool: u8 },
    Note { label: u8, slice: u32 },
    Undo,
    Redo,
    Stroke(bool),
}

fn act() -> impl Strategy<Value = Act> {
    let place = (0..12usize, 0..10usize, 0..7usize).prop_map(|(i, j, k)| [i, j, k]);
    prop_oneof![
        4 => (place, 0.4..5.0f64, 0..4u8, any::<bool>())
            .prop_map(|(at, radius, label, protect)| Act::Paint { at, radius, label, protect }),
        2 => (0..4u8, 0..5u8).prop_map(|(label, tool)| Act::Reshape { label, tool }),
        1 => (0..4u8, 0..7u32).prop_map(|(label, slice)| Act::Note { label, slice }),
        2 => Just(Act::Undo),
        1 => Just(Act::Redo),
        1 => any::<bool>().prop_map(Act::Stroke),
    ]
}

/// Gives a label a new shape, as the desk does.
fn reshape(editor: &mut Editor, label: u8, shape: &Selection) {
    let now = Selection::of_label(editor.labels(), label);
    let [lost, gained] = [now.difference(shape), shape.difference(&now)].map(|s| s.expect("one grid"));
    editor.erase(&lost, label, 0, &Rule::anything()).expect("erase");
    editor.paint(&gained, label, &Rule::anything()).expect("paint");
}

fn perform(editor: &mut Editor, act: &Act) {
    let g = *editor.labels().grid();
    match *act {
        Act::Paint { at, radius, label, protect } => {
            let rule = if protect { Rule::only_over(&[0, 1, 3]) } else { Rule::anything() };
            editor.paint(&ball_in(&g, at, radius), label, &rule).expect("paint");
        }
        Act::Reshape { label, tool } => {
            let now = Selection::of_label(editor.labels(), label);
            let shape = match tool {
                0 => smoothed(&now, 1.2),
                1 => largest_island(&now),
                2 => Ok(fill_holes(&now)),
                3 => grown(&now, 1.0),
                _ => without_small_islands(&now, 5.0),
            };
            // An absent label is refused by name; that must not leave a trace.
            if let Ok(shape) = shape {
                reshape(editor, label, &shape);
            }
        }
        Act::Note { label, slice } => editor.note(Drawn { axis: 2, label, slice }),
        Act::Undo => drop(editor.undo()),
        Act::Redo => drop(editor.redo()),
        Act::Stroke(true) => editor.begin_stroke(),
        Act::Stroke(false) => editor.end_stroke(),
    }
}

fn noise_labels() -> Volume<u8> {
    let g = grid([12, 10, 7], [0.9, 1.1, 1.7]);
    Volume::new(g, (0..g.len()).map(|n| (n * n / 37 % 4) as u8).collect()).expect("labels")
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn undo_and_redo_give_back_every_volume_bit_for_bit(acts in proptest::collection::vec(act(), 1..25)) {
        let base = noise_labels();
        let mut editor = Editor::new(base.clone());
        for a in &acts {
            perform(&mut editor, a);
        }
        editor.end_stroke();
        while editor.redo() {}
        let mut seen = vec![editor.labels().clone()];
        while editor.undo() {
            seen.push(editor.labels().clone());
        }
        prop_assert_eq!(editor.labels(), &base);
        for expected in seen.iter().rev().skip(1) {
            prop_assert!(editor.redo());
            prop_assert_eq!(editor.labels(), expected);
        }
        prop_assert!(!editor.redo());
    }

    #[test]
    fn a_journal_cut_anywhere_restores_the_last_whole_event(
        acts in proptest::collection::vec(act(), 1..15), cut in any::<proptest::sample::Index>(),
    ) {
        let base = noise_labels();
        let mut editor = Editor::new(base.clone());
        let mut file = editor.take_journal();
        let header = file.len();
        // Bytes of the file and the labels after each call that wrote something.
        let mut marks = vec![(0, base.clone()), (header, base.clone())];
        for a in &acts {
            perform(&mut editor, a);
            file.extend(editor.take_journal());
            marks.push((file.len(), editor.labels().clone()));
        }
        let (mut whole, all) = Editor::replay(base.clone(), &file).expect("whole");
        prop_assert_eq!((whole.labels(), whole.steps(), all.torn_bytes), (editor.labels(), editor.steps(), 0));
        prop_assert!(whole.take_journal().is_empty());
        prop_assert!((0..4).all(|label| whole.drawn_slices(2, label) == editor.drawn_slices(2, label)));
        let cut = cut.index(file.len() + 1);
        let (mut back, recovery) = Editor::replay(base.clone(), &file[..cut]).expect("cut");
        prop_assert_eq!(recovery.valid_bytes + recovery.torn_bytes, cut);
        if let Some((_, labels)) = marks.iter().find(|m| m.0 == recovery.valid_bytes) {
            prop_assert_eq!(back.labels(), labels);
        }
        // Going on after the cut gives a whole journal again.
        let mut file = file[..recovery.valid_bytes].to_vec();
        back.paint(&ball_in(base.grid(), [5, 5, 3], 3.0), 3, &Rule::anything()).expect("paint");
        file.extend(back.take_journal());
        let (again, _) = Editor::replay(base, &file).expect("continued");
        prop_assert_eq!((again.labels(), again.steps()), (back.labels(), back.steps()));
    }

    #[test]
    fn damage_is_never_taken_for_an_edit(place in any::<proptest::sample::Index>(), flip in 1..=255u8) {
        let base = noise_labels();
        let mut editor = Editor::new(base.clone());
        for i in 2..8 {
            editor.paint(&ball_in(base.grid(), [i, 4, 3], 2.0), i as u8, &Rule::anything()).expect("paint");
        }
        editor.undo();
        let mut file = editor.take_journal();
        let at = place.index(file.len());
        file[at] ^= flip;
        if let Ok((back, recovery)) = Editor::replay(base.clone(), &file) {
            // Only the record that was hit, and what follows a damaged length, may be missing; the rest is a prefix.
            let (clean, _) = Editor::replay(base, &file[..recovery.valid_bytes]).expect("prefix");
            prop_assert!(recovery.valid_bytes <= at);
            prop_assert_eq!(back.labels(), clean.labels());
        }
    }

    #[test]
    fn set_operations_are_those_of_flags(
        a in proptest::collection::vec(any::<bool>(), 60), b in proptest::collection::vec(any::<bool>(), 60),
    ) {
        let g = grid([5, 4, 3], [1.0; 3]);
        let (sa, sb) = (Selection::where_(g, |n| a[n]), Selection::where_(g, |n| b[n]));
        let flags = |f: &dyn Fn(bool, bool) -> bool| Selection::where_(g, |n| f(a[n], b[n]));
        prop_assert_eq!(sa.union(&sb).expect("grids"), flags(&|a, b| a || b));
        prop_assert_eq!(sa.intersection(&sb).expect("grids"), flags(&|a, b| a && b));
        prop_assert_eq!(sa.difference(&sb).expect("grids"), flags(&|a, b| a && !b));
        prop_assert_eq!(sa.symmetric_difference(&sb).expect("grids"), flags(&|a, b| a != b));
        prop_assert_eq!(sa.complement(), flags(&|a, _| !a));
        prop_assert_eq!(sa.to_flags(), a.clone());
        prop_assert!((0..60).all(|n| sa.contains(n) == a[n]));
        let parts = islands(&sa);
        prop_assert_eq!(parts.iter().map(Selection::count).sum::<usize>(), sa.count());
        prop_assert_eq!(parts.len(), brute_parts(&g, &a));
    }
}

/// Number of face-connected parts by repeated flooding.
fn brute_parts(g: &Grid, flags: &[bool]) -> usize {
    let mut left = flags.to_vec();
    let mut parts = 0;
    while let Some(start) = left.iter().position(|&f| f) {
        parts += 1;
        let mut waiting = vec![start];
        while let Some(n) = waiting.pop() {
            if !core::mem::replace(&mut left[n], false) {
                continue;
            }
            let near = |m: &usize| (0..3).map(|a| g.voxel(n)[a].abs_diff(g.voxel(*m)[a])).sum::<usize>() == 1;
            waiting.extend((0..flags.len()).filter(near).filter(|&m| left[m]));
        }
    }
    parts
}

#[test]
fn foreign_journals_and_other_labels_are_refused() {
    let base = noise_labels();
    let mut editor = Editor::new(base.clone());
    editor.paint(&ball_in(base.grid(), [5, 5, 3], 3.0), 3, &Rule::anything()).expect("paint");
    let file = editor.take_journal();
    assert_eq!(Editor::replay(base.clone(), b"not a journal at all, but long enough").err(), Some(ReplayError::Header));
    let other = base.map(|l| l ^ 1);
    assert!(matches!(Editor::replay(other, &file), Err(ReplayError::Base { .. })));
    let (_, nothing) = Editor::replay(base.clone(), &[]).expect("an empty file is a journal torn at once");
    assert_eq!(nothing, Recovery { events: 0, valid_bytes: 0, torn_bytes: 0 });
    // What a file system may leave after a crash: the length grew, the contents did not.
    let mut zeros = file.clone();
    zeros.extend([0; 64]);
    let (_, recovery) = Editor::replay(base, &zeros).expect("zeros at the end");
    assert_eq!((recovery.events, recovery.valid_bytes, recovery.torn_bytes), (1, file.len(), 64));
}
