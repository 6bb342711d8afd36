//! How much of the region, and of its surfaces, lies at which distance from what is fine: for estimates of a lattice's
//! elements before there is one.

use super::fields::{Field, LabelFields};
use monro_geometry::Point;
use monro_geometry::d3::D3;

/// Elements of a cell of an even lattice.
const PER_CELL: f64 = 12.0;
/// Elements that cutting adds where a surface passes through a cell, for each square of the cell's size (measured).
const PER_SQUARE: f64 = 8.0;
/// Faces of voxels over the area of the surface that they stand for, on average over its directions.
const STAIRS: f64 = 1.5;
/// Width of the bins of distance, mm.
const BIN: f64 = 0.1;
/// Cells of the fields are looked at by blocks of so many along each axis, surfaces at every so many-th line of cells.
const STRIDE: usize = 3;

/// Volume (mm3) and surface (mm2) in a bin of distance.
#[derive(Debug, Clone, Copy, Default)]
struct Share {
    volume: f64,
    area: f64,
}

/// Shares by distance.
#[derive(Debug, Clone)]
pub(super) struct Census {
    bins: Vec<Share>,
    /// Width of a bin, mm.
    width: f64,
}

impl Census {
    /// Of a region by its [`blocks`], with a field of distances, and one of relative lengths of edges where there are any.
    pub(super) fn new(
        fields: &LabelFields,
        blocks: &[(D3, usize)],
        distance: impl Fn(D3) -> f64,
        scale: impl Fn(D3) -> f64,
    ) -> Self {
        let mut census = Self { bins: Vec::new(), width: BIN * fields.unit };
        let cell = fields.step.powi(3);
        for &(p, n) in blocks {
            census.share(distance(p)).volume += n as f64 * cell * scale(p).powi(-3);
        }
        let face = fields.step.powi(2) * (STRIDE * STRIDE) as f64 / STAIRS;
        for surface in std::iter::once(&fields.union).chain(&fields.parts) {
            each_face(surface, |p| census.share(distance(p)).area += face * scale(p).powi(-2));
        }
        census.fit(fields.volumes.iter().sum());
        census
    }

    fn share(&mut self, distance: f64) -> &mut Share {
        let bin = (distance / self.width) as usize;
        if bin >= self.bins.len() {
            self.bins.resize(bin + 1, Share::default());
        }
        &mut self.bins[bin]
    }

    /// Scales to a volume in mm3.
    fn fit(&mut self, volume: f64) {
        let found: f64 = self.bins.iter().map(|b| b.volume).sum();
        if found > 0.0 {
            self.bins.iter_mut().for_each(|b| b.volume *= volume / found);
        } else {
            self.share(0.0).volume = volume;
        }
    }

    /// Elements of a cut lattice whose cells at a distance have the size `cell`, at a guess.
    pub(super) fn estimate(&self, cell: impl Fn(f64) -> f64) -> f64 {
        let mut sum = 0.0;
        for (i, bin) in self.bins.iter().enumerate().filter(|(_, b)| b.volume + b.area > 0.0) {
            let cell = cell((i as f64 + 0.5) * self.width);
            sum += PER_CELL * bin.volume / cell.powi(3) + PER_SQUARE * bin.area / cell.powi(2);
        }
        sum
    }
}

/// The middle of each block of `STRIDE` cells along each axis that holds inner ones, and how many.
pub(super) fn blocks(field: &Field) -> Vec<(D3, usize)> {
    let (grid, data) = (field.volume().grid(), field.volume().data());
    let [nx, ny, nz] = grid.dims();
    let place = grid.patient_from_voxel();
    let middle = |i: usize| (i * STRIDE) as f64 + 0.5 * (STRIDE - 1) as f64;
    let mut found = Vec::new();
    // Of each column of cells through a row of blocks.
    let mut inner = vec![0u8; nx];
    for k in 0..nz.div_ceil(STRIDE) {
        for j in 0..ny.div_ceil(STRIDE) {
            inner.fill(0);
            let rows = |j: usize, n: usize| j * STRIDE..n.min((j + 1) * STRIDE);
            for (z, y) in rows(k, nz).flat_map(|z| rows(j, ny).map(move |y| (z, y))) {
                let row = &data[grid.index(0, y, z)..][..nx];
                inner.iter_mut().zip(row).for_each(|(n, &v)| *n += u8::from(v >= 0.5));
            }
            for (i, block) in inner.chunks(STRIDE).enumerate() {
                let n: usize = block.iter().map(|&n| usize::from(n)).sum();
                if n > 0 {
                    found.push((place.point(Point::new(middle(i), middle(j), middle(k))).to_array(), n));
                }
            }
        }
    }
    found
}

/// Faces between an inner cell and an outer one, along all three axes, at every so many-th line of cells.
fn each_face(field: &Field, mut found: impl FnMut(D3)) {
    let (grid, data) = (field.volume().grid(), field.volume().data());
    let dims = grid.dims();
    for axis in 0..3 {
        let step = [1, dims[0], dims[0] * dims[1]][axis];
        // Line by line as they lie in memory: along the axis every cell but the last.
        let stride = |a: usize| if a == axis { 1 } else { STRIDE };
        let cells = |a: usize| (0..dims[a] - usize::from(a == axis)).step_by(stride(a));
        for k in cells(2) {
            for j in cells(1) {
                let first = grid.index(0, j, k);
                for i in cells(0) {
                    if (data[first + i] >= 0.5) != (data[first + i + step] >= 0.5) {
                        found(grid.centre(i, j, k).to_array());
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::{Grid, Volume};

    #[test]
    fn the_census_of_a_ball_has_its_volume_and_surface() {
        let (radius, grid) = (17.0, Grid::axis_aligned([40; 3], [1.0; 3], [-19.4, -19.6, -19.5]).expect("grid"));
        let data = (0..grid.len()).map(|at| {
            let [i, j, k] = grid.voxel(at);
            let [x, y, z] = grid.centre(i, j, k).to_array();
            u16::from((x * x + y * y + z * z).sqrt() < radius)
        });
        let fields = LabelFields::new(&Volume::new(grid, data.collect()).expect("count"), &[1]).expect("fields");
        // Far cells are so large that only those within 8.5 mm of the middle plane count. Blocks of 2 mm may lie on either side.
        let census = Census::new(&fields, &blocks(&fields.union), |p| p[0].abs(), |_| 1.0);
        let sum = |of: fn(&Share) -> f64| census.bins.iter().map(of).sum::<f64>();
        let ball = std::f64::consts::PI * radius * radius;
        assert!((sum(|b| b.volume) / (4.0 / 3.0 * ball * radius) - 1.0).abs() < 0.01);
        assert!((sum(|b| b.area) / (4.0 * ball) - 1.0).abs() < 0.05, "{}", sum(|b| b.area) / (4.0 * ball));
        let near = census.estimate(|d| if d < 0.5 * radius { 1.0 } else { 1e9 });
        // A slab as thick as the radius holds 11/16 of the ball and half of its surface.
        let wanted = PER_CELL * 11.0 / 16.0 * 4.0 / 3.0 * ball * radius + PER_SQUARE * 2.0 * ball;
        assert!((near / wanted - 1.0).abs() < 1.0 / 17.0, "{near} for {wanted}");
    }
}
