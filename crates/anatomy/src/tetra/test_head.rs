// A small analytic head for tests and benches (included by path from the bench).

use monro_geometry::{Grid, Volume};

/// A brain-like ellipsoid (half-axes 60, 75, 55 mm) with two curved horns, a thin septum between them and a third
/// ventricle that both touch.
pub(crate) fn head(spacing: [f64; 3]) -> Volume<u8> {
    let half = [64.0, 80.0, 60.0];
    let dims: [usize; 3] = std::array::from_fn(|a| (2.0 * half[a] / spacing[a]).ceil() as usize);
    let grid = Grid::axis_aligned(dims, spacing, half.map(|h| -h)).expect("grid");
    let data = (0..grid.len()).map(|at| {
        let [i, j, k] = grid.voxel(at);
        head_label(grid.centre(i, j, k).to_array())
    });
    Volume::new(grid, data.collect()).expect("count")
}

fn head_label([x, y, z]: [f64; 3]) -> u8 {
    if (x / 60.0).powi(2) + (y / 75.0).powi(2) + (z / 55.0).powi(2) > 1.0 {
        return 0;
    }
    // A horn: an arc of radius 25 mm in the plane x = 8, 6 mm thick in front and 3 mm behind.
    let lateral = |x: f64| {
        let angle = z.atan2(y + 5.0);
        let along = (y + 5.0).hypot(z) - 25.0;
        let thick = 3.5 + 2.5 * (angle * 0.5).cos();
        x > 1.0 && angle > -0.6 && angle < 2.6 && ((x - 7.0) / 1.2).hypot(along) < thick
    };
    let third = (x / 2.6).powi(2) + ((y - 14.0) / 12.0).powi(2) + ((z - 12.0) / 9.0).powi(2) < 1.0;
    match () {
        () if third => 7,
        () if lateral(x) => 5,
        () if lateral(-x) => 6,
        () => 4,
    }
}
