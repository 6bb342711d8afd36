//! Points of soft surfaces that follow the nodes of the mesh: for displays that cannot move them themselves.

use monro_geometry::Embedding;

/// Points, each moved by the weighted displacements of four nodes.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Bound(Vec<([u32; 4], [f32; 4])>);

impl Bound {
    /// Appends the points of an embedding.
    pub(crate) fn append(&mut self, embedding: &Embedding) {
        self.0.extend((0..embedding.points()).map(|i| embedding.binding(i)));
    }

    /// Displacement of each point (mm), from those of the nodes. A node that is not there does not move.
    pub(crate) fn displacements<'a>(&'a self, nodes: &'a [[f32; 3]]) -> impl Iterator<Item = [f32; 3]> + 'a {
        self.0.iter().map(|(four, weights)| {
            let mut sum = [0.0; 3];
            for (node, weight) in four.iter().zip(weights) {
                let moved = nodes.get(*node as usize).copied().unwrap_or_default();
                (0..3).for_each(|a| sum[a] += weight * moved[a]);
            }
            sum
        })
    }
}

impl From<&Embedding> for Bound {
    fn from(embedding: &Embedding) -> Self {
        let mut out = Self::default();
        out.append(embedding);
        out
    }
}
