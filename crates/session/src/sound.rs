//! Elements of tissue that have lost or gained much of their volume, though tissue hardly gives it away.

use crate::deformation::at;
use core::ops::RangeInclusive;
use monro_geometry::{Point, Structure, TetMesh, tet_signed_volume};

/// Volume over that at rest within which an element is sound.
pub const SOUND: RangeInclusive<f64> = 0.5..=2.0;

/// The elements that keep their volume, which are all but those of ventricles.
#[derive(Debug)]
pub(crate) struct Keeping {
    /// Corners, and volume at rest, mm3.
    elements: Vec<([u32; 4], f64)>,
}

impl Keeping {
    /// Of a mesh at rest.
    pub(crate) fn new(rest: &TetMesh) -> Self {
        let keeps = |label: &u16| !Structure::from_label(*label).is_some_and(Structure::is_ventricle);
        let all = rest.tets.iter().zip(&rest.labels).enumerate().filter(|(_, (_, label))| keeps(label));
        Self { elements: all.map(|(t, (tet, _))| (*tet, rest.volume(t))).collect() }
    }

    /// How many are crushed, or blown up, where the nodes lie there (mm from any one origin).
    pub(crate) fn crushed(&self, nodes: &[[f32; 4]]) -> usize {
        let volume = |tet: [u32; 4]| tet_signed_volume(tet.map(|n| at(&nodes[n as usize], Point::ORIGIN)));
        self.elements.iter().filter(|(tet, rest)| !SOUND.contains(&(volume(*tet) / rest))).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::live::deformation::tests::tets;

    #[test]
    fn an_element_of_brain_squeezed_to_less_than_half_is_counted_and_one_of_a_ventricle_is_not() {
        let rest = tets();
        let keeping = Keeping::new(&rest);
        let squeezed = |below: f64| -> usize {
            let moved = rest.vertices.iter().map(|p| {
                let z = if p.z < below { 0.4 * p.z } else { p.z - 0.6 * below };
                [p.x, p.y, z, 0.0].map(|x| x as f32)
            });
            keeping.crushed(&moved.collect::<Vec<_>>())
        };
        assert_eq!(squeezed(0.0), 0);
        // The lowest two of six layers: 36 cells of six elements each, none of the ventricle.
        assert_eq!(squeezed(20.0), 2 * 36 * 6);
        // Of the next two the ventricle has four cells each.
        assert_eq!(squeezed(40.0), 4 * 36 * 6 - 2 * 4 * 6);
    }
}
