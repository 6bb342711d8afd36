//! Elements that have lost or gained much of their volume though tissue hardly gives it away, and ventricles that are empty.

use super::Run;
use super::run::Snapshot;
use crate::soft_body::LEAST_POISSON;
use monro_geometry::{Patient, Point, Structure, TetMesh};
use monro_session::SOUND;
use monro_tissue::Csf;
use serde_json::{Value, json};

/// Below this part of its volume an element of a ventricle is empty.
const EMPTY: f64 = 0.1;
/// Share of the brain in crushed elements beyond which nothing is a result. Insertions into three heads have 0.00 to 0.002 %
/// of it, pressures of 10 mmHg either way no more, 50 mmHg 0.04 to 0.2 %, one iteration 0.5 to 5 % and 150 mmHg 3.5 %.
const MOST_CRUSHED: f64 = 5e-3;
/// Share of the ventricles in empty elements from which on walls meet, and beyond which that decides everything: up to 6 % the
/// volume still falls as suction grows, with 18 to 43 % it is larger than before.
const WALLS_MEET: f64 = 0.01;
const MOST_EMPTY: f64 = 0.1;

/// Fewer elements that have grown are not told: beside a shaft the tissue that makes room for it grows by a quarter in the mean.
const TOLD: usize = 3;

/// What of a mesh is crushed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Crushed {
    /// Elements of brain, and of ventricles, that are not sound.
    brain: Unsound,
    ventricles: Unsound,
    /// Share of the ventricles' volume at rest in elements that are empty.
    empty: f64,
}

/// Elements of a structure that are not sound.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Unsound {
    count: usize,
    /// How many of them have grown.
    grown: usize,
    /// Their share of the structure's volume at rest.
    share: f64,
    /// Of the worst of them the volume over that at rest, and its middle now.
    worst: Option<(f64, Point<Patient>)>,
}

impl Unsound {
    const NONE: Self = Self { count: 0, grown: 0, share: 0.0, worst: None };

    /// Counts one, with its volume at rest, the ratio to that and its middle.
    fn count(&mut self, volume: f64, ratio: f64, middle: Point<Patient>) {
        (self.count, self.share) = (self.count + 1, self.share + volume);
        self.grown += usize::from(ratio > 1.0);
        // What is turned is worse than what is flat.
        let bad = |ratio: f64| if ratio > 1.0 { ratio } else { 1.0 / ratio.max(1e-9) };
        if self.worst.is_none_or(|(worst, _)| bad(ratio) > bad(worst)) {
            self.worst = Some((ratio, middle));
        }
    }
}

impl Crushed {
    /// Of a run at the last of these meshes, against rest.
    pub(super) fn of(run: &Run, snapshots: &[Snapshot]) -> Option<Self> {
        Some(Self::between(&run.rest, &snapshots.last()?.mesh))
    }

    fn between(rest: &TetMesh, now: &TetMesh) -> Self {
        let mut out = Self { brain: Unsound::NONE, ventricles: Unsound::NONE, empty: 0.0 };
        let mut whole = [0.0f64; 2];
        for (t, &label) in rest.labels.iter().enumerate() {
            let fluid = is_ventricle(label);
            let (volume, ratio) = (rest.volume(t), now.volume(t) / rest.volume(t));
            whole[usize::from(fluid)] += volume;
            if fluid && ratio < EMPTY {
                out.empty += volume;
            }
            if !SOUND.contains(&ratio) {
                let [a, b, c, d] = now.corners(t);
                let of = if fluid { &mut out.ventricles } else { &mut out.brain };
                of.count(volume, ratio, a.lerp(b, 0.5).lerp(c.lerp(d, 0.5), 0.5));
            }
        }
        let [brain, ventricles] = whole.map(|v| v.max(f64::MIN_POSITIVE));
        out.brain.share /= brain;
        (out.ventricles.share, out.empty) = (out.ventricles.share / ventricles, out.empty / ventricles);
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
        let Unsound { count, share, .. } = self.brain;
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
        // What is left of a tenth is crushed whatever it is made of.
        let is_crushed = |(ratio, _): (f64, Point<Patient>)| ratio < EMPTY;
        let told = keeps_volume(run) || self.brain.worst.is_some_and(is_crushed);
        let brain = if told { self.brain } else { Unsound::NONE };
        // Ventricles that are drained or filled change as they should.
        let ventricles = if matches!(run.settings.frame.csf, Csf::AtRest) { self.ventricles } else { Unsound::NONE };
        let count = brain.count + ventricles.count;
        let is_told = |(ratio, _): &(f64, Point<Patient>)| *ratio < 1.0 || count >= TOLD;
        if let Some((ratio, at)) = brain.worst.or(ventricles.worst).filter(is_told) {
            let [x, y, z] = at.to_array();
            let meaning = match count - brain.grown - ventricles.grown {
                0 => {
                    "they have grown, as elements do that make room for a shaft or hang on it: what is told of tissue within two \
                     radii of it is rough."
                }
                _ => {
                    "tissue hangs there by elements that are crushed. How far walls have moved around them is then a matter of \
                     chance (of the iterations, the mesh, the speed) by some millimetres."
                }
            };
            out.push(format!(
                "At the end {} of {} tetrahedra ({} of brain) have less than half or more than twice of their volume, the worst {ratio:.2} \
                 of it, near ({x:.1}, {y:.1}, {z:.1}) mm: {meaning}",
                count,
                run.rest.tets.len(),
                brain.count
            ));
        }
        out
    }

    /// For programs.
    pub(super) fn json(self) -> Value {
        let of = |of: Unsound| {
            let worst = of.worst.map(|(ratio, at)| json!({ "volume_ratio": ratio, "at_lps_mm": at.to_array() }));
            json!({ "count": of.count, "share": of.share, "worst": worst })
        };
        json!({
            "brain": of(self.brain), "ventricles": of(self.ventricles), "ventricles_empty_share": self.empty,
        })
    }
}

fn is_ventricle(label: u16) -> bool {
    Structure::from_label(label).is_some_and(Structure::is_ventricle)
}

/// Whether elements of brain are to keep their volumes: in paper mode constraints see to it.
fn keeps_volume(run: &Run) -> bool {
    !run.has_units() || run.settings.model.materials.brain.poisson >= LEAST_POISSON
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
        assert_eq!((found.brain.count, found.ventricles.count), (1, 1));
        assert!((found.brain.share - 0.25).abs() < 1e-12 && (found.empty - 0.5).abs() < 1e-12, "{found:?}");
        let worst = |of: Unsound| of.worst.expect("one");
        assert!((worst(found.brain).0 - 0.4).abs() < 1e-12, "{found:?}");
        assert!((worst(found.ventricles).0 - 0.05).abs() < 1e-12 && worst(found.ventricles).1.z < 0.02, "{found:?}");
        // One turned inside out is worse than any that has grown.
        let turned = Crushed::between(&mesh([1.0; 4]), &mesh([90.0, -0.1, 1.0, 1.0])).brain;
        assert_eq!((turned.count, turned.grown, worst(turned).0 < 0.0), (2, 1, true), "{turned:?}");
        let sound = Crushed::between(&mesh([1.0; 4]), &mesh([0.6, 1.9, 0.5, 2.0]));
        assert_eq!(sound, Crushed { brain: Unsound::NONE, ventricles: Unsound::NONE, empty: 0.0 });
    }
}
