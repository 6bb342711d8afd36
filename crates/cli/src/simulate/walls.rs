//! Walls that the catheter has not gone through, or went through too quickly to tell where.

use super::Run;
use monro_geometry::{Structure, TetLocator};
use monro_tissue::Insertion;

/// Part of the dimple at which walls yield that the tip may go in a frame.
const HASTY: f64 = 0.25;

/// A tip that was never in a ventricle, and whether it was meant to be.
pub(super) fn unentered(run: &Run) -> Option<String> {
    if run.csf().is_some() {
        return None;
    }
    let aim = TetLocator::new(&run.rest).ok().and_then(|l| l.locate(run.plan.target()));
    let aim = aim.and_then(|at| Structure::from_label(run.rest.labels[at.tet]));
    Some(never_in(
        aim.filter(|s| s.is_ventricle()),
        run.has_units().then_some(&run.settings.model.materials.ventricles.insertion),
    ))
}

/// In words, by the ventricle that the target lies in and what its wall bears.
fn never_in(aim: Option<Structure>, bears: Option<&Insertion>) -> String {
    match (aim, bears) {
        (Some(aim), Some(bears)) => format!(
            "The tip never entered a ventricle, though the target lies in {} of the mesh: its wall went ahead of the tip and did not yield, as it does \
             at a dimple of {} mm or {} mN. Plan a target that lies deeper in it than that.",
            aim.words(),
            bears.puncture_depth_mm,
            bears.puncture_force_mn
        ),
        _ => "The tip never entered a ventricle: look at the plan and the labels of the case.".into(),
    }
}

/// A catheter that goes so far in a frame that what walls bear is not seen.
pub(super) fn hasty(run: &Run) -> Option<String> {
    let (settings, materials) = (&run.settings, &run.settings.model.materials);
    let walls = [&materials.brain.insertion, &materials.ventricles.insertion];
    let depths = walls.iter().filter(|w| w.puncture_force_mn > 0.0).map(|w| w.puncture_depth_mm);
    let least = depths.fold(f64::INFINITY, f64::min);
    if run.has_units() { too_fast(settings.speed_mm_s, settings.frame.dt_s, least) } else { None }
}

/// In words, by the speed, the time of a frame and the least dimple at which a wall yields.
fn too_fast(mm_s: f64, frame_s: f64, dimple_mm: f64) -> Option<String> {
    let (way, most) = (mm_s * frame_s, HASTY * dimple_mm);
    (way > most).then(|| {
        format!(
            "At {mm_s} mm/s the tip goes {way:.1} mm a frame, and walls yield at a dimple of {dimple_mm} mm: their forces and the depths at \
             which they yield are told to a frame only, and the largest force comes out by a tenth to a half too small. At {:.0} mm/s or slower \
             they are resolved.",
            (most / frame_s).floor()
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forces_of_a_tip_that_goes_eight_mm_a_frame_were_reliable_without_a_remark() {
        let told = too_fast(500.0, 1.0 / 60.0, 4.0).expect("told");
        assert!(told.contains("goes 8.3 mm a frame") && told.contains("At 60 mm/s or slower"), "{told}");
        assert_eq!([10.0, 40.0, 60.0].map(|v| too_fast(v, 1.0 / 60.0, 4.0)), [None, None, None]);
        assert_eq!(too_fast(500.0, 1.0 / 60.0, f64::INFINITY), None);
    }

    #[test]
    fn a_wall_that_went_ahead_of_the_tip_was_told_as_a_wrong_plan() {
        let bears = monro_tissue::Material::VENTRICLE.insertion;
        let told = never_in(Some(Structure::RightLateralVentricle), Some(&bears));
        assert!(told.contains("though the target lies in") && told.contains("did not yield"), "{told}");
        assert!(never_in(None, Some(&bears)).contains("look at the plan"));
    }
}
