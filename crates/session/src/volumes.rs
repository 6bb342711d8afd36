//! Volumes of the brain's tissue and of each ventricle: what the sum over all, held by the skull, cannot show.

use monro_geometry::{Structure, TetMesh};

/// Volumes of the structures of a mesh, against rest.
#[derive(Debug, Clone)]
pub struct StructureVolumes {
    structures: Vec<Structure>,
    /// Place in the list of each element's structure.
    place: Vec<u8>,
    tets: Vec<[u32; 4]>,
    rest_ml: Vec<f64>,
}

impl StructureVolumes {
    /// Of a mesh at rest. Labels of no structure are left out.
    pub fn new(rest: &TetMesh) -> Self {
        let of = |l: &u16| Structure::from_label(*l);
        let structures: Vec<Structure> =
            Structure::ALL.into_iter().filter(|s| rest.labels.iter().any(|l| of(l) == Some(*s))).collect();
        let known = |l: &u16| of(l).and_then(|s| structures.iter().position(|k| *k == s));
        let (tets, place) = rest.tets.iter().zip(&rest.labels).filter_map(|(t, l)| Some((*t, known(l)? as u8))).unzip();
        let mut out = Self { rest_ml: Vec::new(), structures, place, tets };
        out.rest_ml = out.sums_ml(|v| rest.vertices[v as usize].to_array());
        out
    }

    /// The structures, in the order of all numbers.
    pub fn structures(&self) -> &[Structure] {
        &self.structures
    }

    /// Volume of each at rest, ml.
    pub fn rest_ml(&self) -> &[f64] {
        &self.rest_ml
    }

    /// Volume of all ventricles at rest, ml.
    pub fn ventricles_ml(&self) -> f64 {
        self.structures.iter().zip(&self.rest_ml).filter(|(s, _)| s.is_ventricle()).map(|(_, ml)| ml).sum()
    }

    /// What each has more than at rest, ml, with the nodes where they are now (mm from any one origin).
    pub fn change_ml(&self, nodes: &[[f32; 4]]) -> Vec<f64> {
        let now = self.sums_ml(|v| {
            let [x, y, z, _] = nodes[v as usize];
            [x, y, z].map(f64::from)
        });
        now.iter().zip(&self.rest_ml).map(|(now, rest)| now - rest).collect()
    }

    fn sums_ml(&self, at: impl Fn(u32) -> [f64; 3]) -> Vec<f64> {
        let mut sums = vec![0.0; self.structures.len()];
        for (tet, &place) in self.tets.iter().zip(&self.place) {
            let p = [at(tet[0]), at(tet[1]), at(tet[2]), at(tet[3])];
            let [a, b, c] = [1, 2, 3].map(|i| [0, 1, 2].map(|k| p[i][k] - p[0][k]));
            let n = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
            sums[place as usize] += n[0] * c[0] + n[1] * c[1] + n[2] * c[2];
        }
        // Six times the volume in mm3.
        sums.iter().map(|s| s / 6000.0).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::Point;

    #[test]
    fn what_a_ventricle_loses_the_brain_beside_it_has() {
        let p = |x, y, z| Point::new(x, y, z);
        let vertices = vec![p(0., 0., 0.), p(10., 0., 0.), p(0., 10., 0.), p(0., 0., 10.), p(0., 0., -10.)];
        let labels = [Structure::Brain, Structure::ThirdVentricle].map(|s| u16::from(s.label())).to_vec();
        let mesh = TetMesh { vertices, tets: vec![[0, 1, 2, 3], [0, 2, 1, 4]], labels };
        let volumes = StructureVolumes::new(&mesh);
        assert_eq!(volumes.structures(), [Structure::Brain, Structure::ThirdVentricle]);
        assert!((volumes.ventricles_ml() - 1.0 / 6.0).abs() < 1e-12);
        // The corner that both share is lowered by a tenth, as seen from another origin.
        let mut nodes: Vec<[f32; 4]> =
            mesh.vertices.iter().map(|v| [v.x as f32 - 5.0, v.y as f32, v.z as f32 + 3.0, 1.0]).collect();
        (0..3).for_each(|v| nodes[v][2] -= 1.0);
        let change = volumes.change_ml(&nodes);
        assert!((change[0] - 1.0 / 60.0).abs() < 1e-6 && (change[0] + change[1]).abs() < 1e-6, "{change:?}");
    }
}
