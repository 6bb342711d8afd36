//! Pictures of the digital phantom, where the truth is known.

use super::*;
use monro_anatomy::phantom::{HeadModel, HeadOptions, Phantom, head};

fn phantom() -> (Phantom, HeadModel) {
    let options = HeadOptions { spacing_mm: [2.0; 3], turn_deg: Some([0.0; 3]), ..HeadOptions::default() };
    (head(&options).unwrap(), HeadModel::new(&options))
}

#[test]
fn outlines_of_the_ventricles_lie_on_their_true_surface_and_on_the_viewers_other_side() {
    let (p, model) = phantom();
    let centre = p.landmarks.monro_left.lerp(p.landmarks.monro_right, 0.5);
    let centre = monro_geometry::Point::new(centre.x, centre.y, centre.z + 8.0);
    let view = SliceView::standard(Orientation::Axial, centre, 160.0, 320);
    let middle = view.project(centre)[0];
    let (mut sum, mut count) = (0.0, 0.0);
    for (label, on_the_right) in [(5, true), (6, false)] {
        let contours = contours_of_labels(&p.labels, |l| l == label, &view);
        assert!(!contours.is_empty());
        for q in contours.iter().flat_map(|c| &c.points) {
            assert_eq!(q[0] > middle, on_the_right, "label {label} at {q:?}");
            sum += model.ventricle_distance(view.unproject(*q)).abs();
            count += 1.0;
        }
    }
    // Labels of 2 mm voxels cannot place a surface better than about a quarter of a voxel.
    assert!(sum / count < 0.6, "{} mm off on average", sum / count);
}

#[test]
fn bone_is_white_and_air_black_in_the_brain_window() {
    let (p, _) = phantom();
    let view = SliceView::standard(Orientation::Coronal, p.landmarks.monro_left, 240.0, 240);
    let image = slice_image(&view, &sampler(&p.ct), Window::BRAIN);
    assert_eq!(image.at(2, 2), Colour::BLACK);
    let column: Vec<u8> = (0..120).map(|y| image.at(120, y).0[0]).collect();
    // Going down from above the vertex: air, scalp, bone, brain.
    let bone = column.iter().position(|v| *v == 255).unwrap();
    assert!(column[..bone.saturating_sub(12)].iter().all(|v| *v < 40));
    let brain = &column[bone + 20..];
    assert!(brain.iter().all(|v| (20..250).contains(v)), "{brain:?}");
}
