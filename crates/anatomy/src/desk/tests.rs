use super::*;
use crate::edit::Editor;
use monro_geometry::Grid;

const LEFT: u8 = 5;
const RIGHT: u8 = 6;
const BRAIN: u8 = 4;

/// A fluid ball of 12 mm radius in brain, and its true labels; voxels of 1 x 1 x 2 mm.
fn ball(centre: [f64; 3]) -> (Volume<i16>, Volume<u8>) {
    let grid = Grid::axis_aligned([64, 60, 30], [1.0, 1.0, 2.0], [0.0; 3]).expect("grid");
    let inside = |n: usize| {
        let [i, j, k] = grid.voxel(n);
        grid.centre(i, j, k).distance(Point::from_array(centre)) < 12.0
    };
    let truth: Vec<u8> = (0..grid.len()).map(|n| if inside(n) { LEFT } else { BRAIN }).collect();
    let ct = truth.iter().enumerate().map(|(n, &l)| if l == LEFT { 5 } else { 32 } + (n % 3) as i16).collect();
    (Volume::new(grid, ct).expect("ct"), Volume::new(grid, truth).expect("labels"))
}

fn desk() -> (Desk, Volume<u8>) {
    let (ct, truth) = ball([31.0, 29.0, 30.0]);
    let start = truth.map(|_| BRAIN);
    (Desk::new(ct, Editor::new(start)).expect("desk"), truth)
}

fn dice(a: &Volume<u8>, b: &Volume<u8>) -> f64 {
    let both = a.data().iter().zip(b.data()).filter(|(x, y)| **x == LEFT && **y == LEFT).count();
    let each = [a, b].map(|v| v.data().iter().filter(|l| **l == LEFT).count());
    2.0 * both as f64 / (each[0] + each[1]).max(1) as f64
}

/// Clicks around the ball on an axial slice.
fn clicks(desk: &mut Desk, index: usize, radius: f64) {
    for turn in 0..4 {
        let (sin, cos) = (f64::from(turn) * core::f64::consts::FRAC_PI_2).sin_cos();
        desk.click(Axis::K, index, [31.0 + radius * cos, 29.0 + radius * sin]).expect("click");
    }
}

/// Clicks around the ball on an axial slice and closes.
fn draw(desk: &mut Desk, index: usize, radius: f64, interpolate: bool) -> Closed {
    clicks(desk, index, radius);
    desk.close(&Target::of(LEFT), Fill::Replace, interpolate).expect("closed")
}

/// Radius of the ball on a slice.
fn radius(index: usize) -> f64 {
    (144.0 - (2.0 * index as f64 - 30.0).powi(2)).sqrt()
}

#[test]
fn contours_on_five_slices_and_interpolation_give_the_ball() {
    let (mut desk, truth) = desk();
    for index in [10, 12, 15, 18, 20] {
        let closed = draw(&mut desk, index, radius(index), true);
        assert_eq!(closed.anchors, 4);
        assert!(closed.changed > 20);
    }
    assert_eq!(desk.drawn_slices(Axis::K, LEFT), [10, 12, 15, 18, 20]);
    assert!(dice(desk.labels(), &truth) > 0.95, "{}", dice(desk.labels(), &truth));
    assert_eq!(desk.steps(), (5, 0));
    // A correction on a slice between, by brush, is one of the drawn slices from then on.
    let dab = desk.brush(&Target::of(LEFT), (Axis::K, 16), &[[31.0, 29.0], [33.0, 29.0]], (14.0, true, false));
    assert!(dab.expect("dab") > 0);
    desk.end_stroke();
    let before = desk.mask(Axis::K, 17, LEFT).expect("mask").count();
    desk.interpolate(Axis::K, &Target::of(LEFT)).expect("again");
    assert!(desk.mask(Axis::K, 17, LEFT).expect("mask").count() > before);
}

#[test]
fn undo_takes_back_clicks_then_contours_and_the_journal_brings_everything_back() {
    let (mut desk, _) = desk();
    let base = desk.labels().clone();
    let mut journal = desk.take_journal();
    draw(&mut desk, 12, radius(12), false);
    draw(&mut desk, 18, radius(18), true);
    let drawn = desk.labels().clone();
    desk.click(Axis::K, 15, [43.0, 29.0]).expect("click");
    assert!(desk.open_wire().is_some());
    assert!(desk.undo() && desk.open_wire().is_none());
    assert_eq!(*desk.labels(), drawn);
    assert!(desk.undo());
    assert_eq!(desk.drawn_slices(Axis::K, LEFT), [12]);
    assert!(desk.redo() && *desk.labels() == drawn);
    assert_eq!(desk.drawn_slices(Axis::K, LEFT), [12, 18]);
    journal.extend(desk.take_journal());
    let (editor, recovery) = Editor::replay(base, &journal).expect("replayed");
    assert_eq!(recovery.torn_bytes, 0);
    let mut again = Desk::new(ball([31.0, 29.0, 30.0]).0, editor).expect("desk");
    assert_eq!(*again.labels(), drawn);
    // After a killed server the slices drawn before it are still filled between.
    assert_eq!(again.drawn_slices(Axis::K, LEFT), [12, 18]);
    assert_eq!(again.interpolate(Axis::K, &Target::of(LEFT)).expect("two slices"), 0, "filled before");
    assert!(again.undo() && again.drawn_slices(Axis::K, LEFT) == [12]);
    assert!(again.undo() && !again.undo() && again.drawn_slices(Axis::K, LEFT).is_empty());
}

#[test]
fn hovering_shows_where_a_click_goes_and_when_it_closes() {
    let (mut desk, _) = desk();
    let first = desk.hover(Axis::K, 15, [44.0, 29.0], 0.0).expect("hover");
    assert!(first.path.is_empty() && first.snapped[0].abs_diff(43) <= 1, "{first:?}");
    desk.click(Axis::K, 15, [43.0, 29.0]).expect("click");
    desk.click(Axis::K, 15, [19.0, 29.0]).expect("click");
    let path = desk.hover(Axis::K, 15, [31.0, 17.0], 0.1).expect("hover").path;
    // The wire runs along the circle, not across it.
    assert!(path.iter().all(|p| ((p[0] as f64 - 31.0).hypot(p[1] as f64 - 29.0) - 12.0).abs() < 2.0), "{path:?}");
    assert!(desk.hover(Axis::K, 15, [43.0, 28.0], 0.2).expect("hover").closes);
    assert!(desk.hover(Axis::K, 99, [1.0, 1.0], 0.3).is_err());
}

#[test]
fn the_mouse_over_another_pane_or_tab_does_not_take_the_open_wire_away() {
    let (mut desk, _) = desk();
    draw(&mut desk, 12, radius(12), false);
    let drawn = desk.labels().clone();
    for at in [[43.0, 29.0], [31.0, 41.0], [19.0, 29.0]] {
        desk.click(Axis::K, 15, at).expect("click");
    }
    let open = desk.open_wire().expect("open");
    let other = desk.hover(Axis::J, 29, [31.0, 9.0], 0.1).expect("hover");
    assert!(other.path.is_empty() && !other.closes && other.anchors == 0, "{other:?}");
    desk.hover(Axis::K, 16, [31.0, 17.0], 0.2).expect("hover");
    assert_eq!(desk.open_wire(), Some(open));
    let said = desk.click(Axis::J, 29, [31.0, 9.0]).expect_err("one wire at a time").to_string();
    assert!(said.contains("axial slice 15") && said.contains("Enter"), "{said}");
    // Taking a click back does so, and leaves the contour before alone.
    assert!(desk.undo());
    assert_eq!(desk.open_wire().map(|w| w.anchors.len()), Some(2));
    assert_eq!(*desk.labels(), drawn);
}

#[test]
fn a_brush_stroke_on_a_slice_goes_on_to_its_neighbours_when_asked_and_is_undone_with_them() {
    let (mut desk, _) = desk();
    for index in [12, 18] {
        draw(&mut desk, index, radius(12), true);
    }
    let pixels = |desk: &Desk, index| desk.mask(Axis::K, index, LEFT).expect("mask").count();
    let (before, labels) = ([13, 14, 16, 17].map(|i| pixels(&desk, i)), desk.labels().clone());
    desk.brush(&Target::of(LEFT), (Axis::K, 15), &[[31.0, 29.0]], (20.0, true, false)).expect("dab");
    assert!(desk.end_stroke_between().expect("filled") > 0);
    let after = [13, 14, 16, 17].map(|i| pixels(&desk, i));
    assert!(after.iter().zip(before).all(|(a, b)| *a > b), "{before:?} to {after:?}");
    assert!(desk.undo() && *desk.labels() == labels && desk.drawn_slices(Axis::K, LEFT) == [12, 18]);
}

#[test]
fn a_correction_changes_the_slices_up_to_its_neighbours_only() {
    let (mut desk, _) = desk();
    let target = Target::of(LEFT);
    for index in [12, 15, 18] {
        draw(&mut desk, index, radius(index), true);
    }
    // A ball spoils a slice beyond, and draws none.
    desk.brush(&target, (Axis::K, 17), &[[31.0, 29.0]], (1.5, false, true)).expect("dab");
    desk.end_stroke();
    let far = |desk: &Desk| desk.mask(Axis::K, 17, LEFT).expect("mask");
    let spoilt = far(&desk);
    desk.brush(&target, (Axis::K, 13), &[[31.0, 29.0]], (14.0, true, false)).expect("dab");
    assert!(desk.end_stroke_between().expect("filled") > 0);
    assert_eq!(far(&desk), spoilt);
    desk.interpolate(Axis::K, &target).expect("all");
    assert_ne!(far(&desk), spoilt);
}

#[test]
fn a_stroke_that_changes_nothing_draws_no_slice_and_one_beyond_the_scan_is_refused() {
    let (mut desk, _) = desk();
    draw(&mut desk, 12, radius(12), false);
    let erase = desk.brush(&Target::of(LEFT), (Axis::K, 20), &[[31.0, 29.0]], (5.0, true, true));
    assert_eq!(erase.expect("nothing there"), 0);
    desk.end_stroke();
    assert_eq!(desk.drawn_slices(Axis::K, LEFT), [12]);
    let beyond = desk.brush(&Target::of(LEFT), (Axis::K, 500), &[[31.0, 29.0]], (5.0, true, false));
    assert!(beyond.expect_err("no such slice").to_string().contains("slice 500"));
}

#[test]
fn the_preview_of_another_page_was_applied_for_the_own_one() {
    let (mut desk, _) = desk();
    let (left, right) = (Target::of(LEFT), Target::of(RIGHT));
    let own = desk.preview(&Tool::Threshold { range: 0..=15 }, &left).expect("threshold").number;
    let other = desk.preview(&Tool::Threshold { range: 0..=20 }, &right).expect("threshold").number;
    let before = desk.labels().clone();
    for (target, number) in [(&left, Some(own)), (&left, None), (&right, Some(own)), (&left, Some(other))] {
        let refused = desk.apply(target, number);
        assert!(matches!(refused, Err(DeskError::OtherPreview { .. })), "{refused:?}");
    }
    assert_eq!(*desk.labels(), before);
    assert!(desk.apply(&right, Some(other)).expect("the one that is shown") > 0);
}

#[test]
fn a_preview_older_than_the_labels_is_not_applied() {
    let (mut desk, truth) = desk();
    let target = Target::of(LEFT);
    desk.preview(&Tool::Threshold { range: 0..=15 }, &target).expect("threshold");
    desk.apply(&target, None).expect("applied");
    desk.preview(&Tool::Margin { mm: 1.0 }, &target).expect("margin");
    assert!(desk.brush(&target, (Axis::K, 2), &[[5.0, 5.0]], (3.0, false, false)).expect("dab") > 0);
    desk.end_stroke();
    assert_eq!(desk.apply(&target, None), Err(DeskError::NoPreview));
    let inside = desk.labels().data().iter().zip(truth.data()).filter(|(a, b)| a != b && **a == LEFT).count();
    assert!(inside > 0, "the dab is still there");
}

#[test]
fn previews_of_new_shapes_promise_what_the_limits_allow() {
    let (mut desk, _) = desk();
    // A shell of another label around the ball, on one side only.
    desk.preview(&Tool::Threshold { range: 0..=15 }, &Target::of(LEFT)).expect("threshold");
    desk.apply(&Target::of(LEFT), None).expect("applied");
    desk.brush(
        &Target { over: Some(vec![BRAIN]), ..Target::of(3) },
        (Axis::K, 15),
        &[[45.0, 29.0]],
        (8.0, false, false),
    )
    .expect("shell");
    desk.end_stroke();
    for (tool, limit) in [
        (Tool::Margin { mm: 3.0 }, Target { over: Some(vec![3]), ..Target::of(LEFT) }),
        (Tool::Margin { mm: -3.0 }, Target { range: Some(6..=100), ..Target::of(LEFT) }),
        (Tool::Smooth { sigma_mm: 2.0 }, Target { range: Some(6..=100), ..Target::of(LEFT) }),
    ] {
        let shown = desk.preview(&tool, &limit).expect("shown").selection.clone();
        desk.apply(&limit, None).expect("applied");
        assert_eq!(Selection::of_label(desk.labels(), LEFT), shown, "{tool:?}");
        assert!(desk.undo());
    }
    let said = desk.preview(&Tool::Margin { mm: -15.0 }, &Target::of(LEFT)).expect_err("nothing left").to_string();
    assert!(said.contains("left_lateral_ventricle") && said.contains("nothing"), "{said}");
}

#[test]
fn limits_hold_for_every_way_of_drawing() {
    let (mut desk, truth) = desk();
    let dry = Target { range: Some(0..=15), ..Target::of(LEFT) };
    desk.brush(&dry, (Axis::K, 15), &[[31.0, 29.0]], (20.0, false, false)).expect("ball");
    desk.end_stroke();
    assert!(dice(desk.labels(), &truth) > 0.999);
    let never = Target { over: Some(vec![7]), ..Target::of(6) };
    assert_eq!(desk.brush(&never, (Axis::K, 15), &[[31.0, 29.0]], (20.0, false, false)).expect("none"), 0);
    desk.end_stroke();
    // Erased voxels become what is around them.
    desk.brush(&Target::of(LEFT), (Axis::K, 15), &[[31.0, 29.0]], (20.0, false, true)).expect("erased");
    assert_eq!(desk.volumes_ml()[5], 0.0);
    assert!(matches!(desk.preview(&Tool::LargestIsland, &Target::of(LEFT)), Err(DeskError::Edit(_))));
    assert!(matches!(desk.apply(&Target::of(LEFT), None), Err(DeskError::NoPreview)));
    assert!(desk.interpolate(Axis::I, &Target::of(LEFT)).is_err());
}

#[test]
fn tools_show_first_and_change_then() {
    let (mut desk, truth) = desk();
    let target = Target::of(LEFT);
    let shown = desk.preview(&Tool::Threshold { range: 0..=15 }, &target).expect("threshold").selection.count();
    let wanted = truth.data().iter().filter(|l| **l == LEFT).count();
    assert_eq!(shown, wanted);
    let slice = desk.slice_labels(Axis::K, 15).expect("slice");
    assert!(slice.contains(&(BRAIN | 0x80)) && desk.volumes_ml()[5] == 0.0);
    assert_eq!(desk.apply(&target, None).expect("applied"), wanted);
    assert_eq!(*desk.labels(), truth);
    desk.brush(&target, (Axis::K, 2), &[[5.0, 5.0]], (3.0, false, false)).expect("island");
    desk.end_stroke();
    for (tool, volume) in [
        (Tool::Split { into: 6 }, wanted),
        (Tool::Margin { mm: 2.0 }, 0),
        (Tool::Smooth { sigma_mm: 1.5 }, 0),
        (Tool::FillHoles { axis: None }, 0),
        (Tool::Combine { operation: SetOperation::Union, with: 6, margin_mm: 0.0 }, 0),
        (Tool::SmallIslands { least_ml: 0.5 }, 0),
        (Tool::Grow { seed: [31, 29, 15], range: 0..=15, neck_mm: 2.0, most_ml: 20.0 }, 0),
    ] {
        desk.preview(&tool, &target).unwrap_or_else(|e| panic!("{tool:?}: {e}"));
        desk.apply(&target, None).expect("applied");
        let now = desk.labels().data().iter().filter(|l| **l == LEFT).count();
        assert!(volume == 0 || now == volume, "{tool:?}: {now}");
    }
    while desk.undo() {}
    assert!(desk.labels().data().iter().all(|l| *l == BRAIN));
    let leak = Tool::Grow { seed: [5, 5, 5], range: 25..=60, neck_mm: 0.0, most_ml: 1.0 };
    assert!(desk.preview(&leak, &target).expect("leak").stopped);
    assert!(desk.discard() && !desk.discard());
}

#[test]
fn a_contour_that_changed_nothing_was_undone_with_the_step_before_or_never() {
    let (mut desk, _) = desk();
    let mut journal = desk.take_journal();
    let base = desk.labels().clone();
    let nowhere = Target { range: Some(3000..=3000), ..Target::of(LEFT) };
    let close_in_vain = |desk: &mut Desk, index: usize| {
        clicks(desk, index, radius(index));
        assert_eq!(desk.close(&nowhere, Fill::Add, false).expect("closed").changed, 0);
    };
    close_in_vain(&mut desk, 10);
    assert_eq!((desk.drawn_slices(Axis::K, LEFT), desk.steps()), (vec![10], (1, 0)));
    draw(&mut desk, 12, radius(12), false);
    let drawn = desk.labels().clone();
    close_in_vain(&mut desk, 18);
    assert!(desk.undo());
    assert_eq!((desk.drawn_slices(Axis::K, LEFT), desk.labels() == &drawn), (vec![10, 12], true));
    assert!(desk.redo());
    assert_eq!(desk.drawn_slices(Axis::K, LEFT), [10, 12, 18]);
    assert!(desk.undo() && desk.undo() && desk.undo() && !desk.undo());
    assert_eq!(desk.drawn_slices(Axis::K, LEFT), [0; 0]);
    assert!(desk.redo());
    journal.extend(desk.take_journal());
    let (back, _) = Editor::replay(base, &journal).expect("replayed");
    assert_eq!((back.drawn_slices(2, LEFT), back.steps()), (vec![10], (1, 2)));
}

#[test]
fn a_wire_whose_closing_was_refused_for_its_label_took_no_click_and_no_closing_any_more() {
    let (mut desk, _) = desk();
    clicks(&mut desk, 12, radius(12));
    let before = desk.open_wire();
    let refused = desk.close(&Target::of(9), Fill::Replace, true);
    assert!(matches!(refused, Err(DeskError::Label(9))), "{refused:?}");
    assert_eq!(desk.open_wire(), before);
    assert!(!desk.redo(), "the refused closing is nothing to be done again");
    desk.click(Axis::K, 12, [31.0, 20.0]).expect("another click");
    assert!(desk.undo());
    assert!(desk.close(&Target::of(LEFT), Fill::Replace, false).expect("closed").changed > 20);
}
