//! Elements that have lost or gained much of their volume though tissue hardly gives it away, and ventricles that are empty.

use super::Run;
use monro_geometry::{Patient, Point, Structure, TetMesh};
use monro_tissue::Csf;
use serde_json::{Value, json};
use std::ops::RangeInclusive;

/// Volume over that at rest within which an element is sound.
const SOUND: RangeInclusive<f64> = 0.5..=2.0;
/// Below this part of its volume an element of a ventricle is empty.
const EMPTY: f64 = 0.1;
/// Poisson's ratio of the brain from which on its elements are to keep their volumes.
const KEEPS: f64 = 0.45;
/// Share of the brain in crushed elements beyond which nothing is a result. Insertions into three heads have 0.00 to 0.002 %
/// of it, pressures of 10 mmHg either way no more, 50 mmHg 0.04 to 0.2 %, one iteration 0.5 to 5 % and 150 mmHg 3.5 %.
const MOST_CRUSHED: f64 = 5e-3;
/// Share of the ventricles in empty elements from which on walls meet, and beyond which that decides everything: up to 6 % the
/// volume still falls as suction grows, with 18 to 43 % it is larger than before.
const WALLS_MEET: f64 = 0.01;
const MOST_EMPTY: f64 = 0.1;

/// What of a mesh is crushed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Crushed {
    /// Elements of brain that are not sound, and their share of its volume at rest.
    brain: (usize, f64),
    /// Elements of ventricles that are not sound.
    ventricles: usize,
    /// Share of the ventricles' volume at rest in elements that are empty.
    empty: f64,
    /// Of the element with the least share of its volume that share, and its middle now.
    least: (f64, Point<Patient>),
}

impl Crushed {
    /// Of a run at its end, against rest.
    pub(super) fn of(run: &Run) -> Option<Self> {
        Some(Self::between(&run.rest, &run.snapshots.last()?.mesh))
    }

    fn between(rest: &TetMesh, now: &TetMesh) -> Self {
        let mut out = Self { brain: (0, 0.0), ventricles: 0, empty: 0.0, least: (f64::INFINITY, Point::ORIGIN) };
        let mut whole = [0.0f64; 2];
        for (t, &label) in rest.labels.iter().enumerate() {
            let fluid = is_ventricle(label);
            let (volume, ratio) = (rest.volume(t), now.volume(t) / rest.volume(t));
            whole[usize::from(fluid)] += volume;
            if ratio < out.least.0 {
                let [a, b, c, d] = now.corners(t);
                out.least = (ratio, a.lerp(b, 0.5).lerp(c.lerp(d, 0.5), 0.5));
            }
            if fluid && ratio < EMPTY {
                out.empty += volume;
            }
            if !SOUND.contains(&ratio) {
                match fluid {
                    true => out.ventricles += 1,
                    false => out.brain = (out.brain.0 + 1, out.brain.1 + volume),
                }
            }
        }
        out.brain.1 /= whole[0].max(f64::MIN_POSITIVE);
        out.empty /= whole[1].max(f64::MIN_POSITIVE);
        out
    }

    /// What makes the result worthless.
    pub(super) fn broken(self, run: &Run) -> Option<String> {
        if self.empty > MOST_EMPTY {
            return Some(format!(
                "At the end {:.0} % of the ventricles are in tetrahedra that have lost nine tenths of their volume: their walls meet, \
                 which is not modelled, and more suction would not take more out: not a result.",
                100.0 * self.empty
            ));
        }
        let (count, share) = self.brain;
        (keeps_volume(run) && share > MOST_CRUSHED).then(|| {
            format!(
                "At the end {count} tetrahedra of brain ({:.1} % of it) have less than half or more than twice of their volume: \
                 not a result.",
                100.0 * share
            )
        })
    }

    /// What makes it worth less, where it is a result.
    pub(super) fn doubts(self, run: &Run) -> Vec<String> {
        let mut out = Vec::new();
        if self.empty > WALLS_MEET {
            out.push(format!(
                "At the end {:.0} % of the ventricles are in tetrahedra that have lost nine tenths of their volume: their walls begin to \
                 meet, which is not modelled. Ask for less suction.",
                100.0 * self.empty
            ));
        }
        let brain = if keeps_volume(run) { self.brain.0 } else { 0 };
        // Ventricles that are drained or filled change as they should.
        let ventricles = if matches!(run.settings.frame.csf, Csf::AtRest) { self.ventricles } else { 0 };
        if brain + ventricles > 0 {
            let (least, at) = self.least;
            let [x, y, z] = at.to_array();
            out.push(format!(
                "At the end {} of {} tetrahedra ({brain} of brain) have less than half or more than twice of their volume, the least {least:.2} \
                 of it, near ({x:.1}, {y:.1}, {z:.1}) mm: tissue hangs there by elements that are crushed. How far walls have moved \
                 around them is then a matter of chance (of the iterations, the mesh, the speed) by some millimetres.",
                brain + ventricles,
                run.rest.tets.len()
            ));
        }
        out
    }

    /// For programs.
    pub(super) fn json(self) -> Value {
        json!({
            "brain": self.brain.0, "brain_share": self.brain.1, "ventricles": self.ventricles,
            "ventricles_empty_share": self.empty, "least_volume_ratio": self.least.0,
            "least_at_lps_mm": self.least.1.to_array(),
        })
    }
}

fn is_ventricle(label: u16) -> bool {
    u8::try_from(label).ok().and_then(Structure::from_label).is_some_and(Structure::is_ventricle)
}

/// Whether elements of brain are to keep their volumes: in paper mode constraints see to it.
fn keeps_volume(run: &Run) -> bool {
    !run.has_units() || run.settings.model.materials.brain.poisson >= KEEPS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crushed_and_empty_elements_are_counted_by_structure() {
        let corner = |z: f64| [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, z]].map(Point::from_array);
        let mesh = |heights: [f64; 4]| TetMesh {
            vertices: heights.into_iter().flat_map(corner).collect(),
            tets: (0..4).map(|t| [4 * t, 4 * t + 1, 4 * t + 2, 4 * t + 3]).collect(),
            labels: [Structure::Brain, Structure::Brain, Structure::ThirdVentricle, Structure::ThirdVentricle]
                .map(|s| u16::from(s.label()))
                .to_vec(),
        };
        let found = Crushed::between(&mesh([1.0, 3.0, 1.0, 1.0]), &mesh([0.4, 3.0, 0.05, 1.9]));
        assert_eq!((found.brain.0, found.ventricles), (1, 1));
        assert!((found.brain.1 - 0.25).abs() < 1e-12 && (found.empty - 0.5).abs() < 1e-12, "{found:?}");
        assert!((found.least.0 - 0.05).abs() < 1e-12 && found.least.1.z < 0.02, "{found:?}");
        let sound = Crushed::between(&mesh([1.0; 4]), &mesh([0.6, 1.9, 0.5, 2.0]));
        assert_eq!((sound.brain.0, sound.ventricles, sound.empty), (0, 0, 0.0));
    }
}
