//! Writing NIfTI-1.

use super::HEADER;
use flate2::{Compression, write::GzEncoder};
use monro_geometry::{Grid, Matrix3, Patient, Vector, Volume};
use std::io::Write;

/// Header and the four bytes that say "no extensions".
const VOXEL_OFFSET: usize = 352;

/// A CT as `.nii.gz`.
///
/// # Panics
/// When a dimension exceeds 32767, which the format cannot express; no volume that this crate reads does.
pub fn encode_i16(volume: &Volume<i16>) -> Vec<u8> {
    // Noise hardly compresses, so the fastest level is as good as any.
    let voxels = volume.data().iter().flat_map(|v| v.to_le_bytes());
    encode(volume.grid(), 4, 16, voxels, Compression::fast())
}

/// Labels as `.nii.gz`.
///
/// # Panics
/// As [`encode_i16`].
pub fn encode_u8(volume: &Volume<u8>) -> Vec<u8> {
    encode(volume.grid(), 2, 8, volume.data().iter().copied(), Compression::default())
}

/// Labels beyond 255 as `.nii.gz`.
///
/// # Panics
/// As [`encode_i16`].
pub fn encode_u16(volume: &Volume<u16>) -> Vec<u8> {
    let voxels = volume.data().iter().flat_map(|v| v.to_le_bytes());
    encode(volume.grid(), 512, 16, voxels, Compression::default())
}

fn encode(grid: &Grid, datatype: i16, bits: i16, voxels: impl Iterator<Item = u8>, level: Compression) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), level);
    let mut buffer = header_bytes(grid, datatype, bits).to_vec();
    let mut voxels = voxels.peekable();
    while voxels.peek().is_some() {
        buffer.extend(voxels.by_ref().take(1 << 16));
        infallible(encoder.write_all(&buffer));
        buffer.clear();
    }
    encoder.finish().unwrap_or_default()
}

/// Writing to memory cannot fail.
fn infallible(result: std::io::Result<()>) {
    debug_assert!(result.is_ok());
}

fn header_bytes(grid: &Grid, datatype: i16, bits: i16) -> [u8; VOXEL_OFFSET] {
    let mut h = [0u8; VOXEL_OFFSET];
    let mut put = |at: usize, bytes: &[u8]| h[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, &(HEADER as i32).to_le_bytes());
    put(38, b"r");
    let dims = grid.dims();
    assert!(dims.iter().all(|&d| d <= i16::MAX as usize), "NIfTI-1 cannot express dimensions {dims:?}");
    for (a, d) in [3, dims[0], dims[1], dims[2], 1, 1, 1, 1].into_iter().enumerate() {
        put(40 + 2 * a, &(d as i16).to_le_bytes());
    }
    put(70, &datatype.to_le_bytes());
    put(72, &bits.to_le_bytes());
    let q = Quaternion::of(grid);
    let s = grid.spacing();
    for (a, v) in [q.qfac, s[0], s[1], s[2]].into_iter().enumerate() {
        put(76 + 4 * a, &(v as f32).to_le_bytes());
    }
    put(108, &(VOXEL_OFFSET as f32).to_le_bytes());
    put(112, &1f32.to_le_bytes());
    put(123, &[2]);
    put(252, &i16::from(q.exact).to_le_bytes());
    put(254, &1i16.to_le_bytes());
    let m = grid.patient_from_voxel();
    for (a, flip) in [-1.0, -1.0, 1.0].into_iter().enumerate() {
        put(256 + 4 * a, &(q.bcd[a] as f32).to_le_bytes());
        put(268 + 4 * a, &((flip * m.offset[a]) as f32).to_le_bytes());
        let row = m.linear.rows[a];
        for (c, v) in [row[0], row[1], row[2], m.offset[a]].into_iter().enumerate() {
            put(280 + 16 * a + 4 * c, &((flip * v) as f32).to_le_bytes());
        }
    }
    put(344, b"n+1\0");
    h
}

/// The qform of a grid: rotation as a quaternion's vector part, and qfac for a left-handed grid.
struct Quaternion {
    bcd: [f64; 3],
    qfac: f64,
    /// Whether the grid is rectangular, so that a qform can express it.
    exact: bool,
}

impl Quaternion {
    fn of(grid: &Grid) -> Self {
        let linear = grid.patient_from_voxel().linear;
        let axes = [0, 1, 2].map(|a| {
            let c = linear.column(a);
            Vector::<Patient>::new(-c[0], -c[1], c[2]).normalized().unwrap_or(Vector::ZERO)
        });
        let exact = [(0, 1), (0, 2), (1, 2)].iter().all(|&(a, b)| axes[a].dot(axes[b]).abs() < 1e-5);
        let qfac = if axes[0].cross(axes[1]).dot(axes[2]) < 0.0 { -1.0 } else { 1.0 };
        let rotation = Matrix3::from_columns(axes[0], axes[1], axes[2] * qfac);
        let bcd = if exact { vector_part(&rotation.rows) } else { [0.0; 3] };
        Self { bcd, qfac, exact }
    }
}

/// Vector part of the unit quaternion (with non-negative scalar part) of a rotation, by Shepperd's method: the largest
/// of the four components is taken from the diagonal, the others from it, so that nothing is divided by nearly zero.
fn vector_part(r: &[[f64; 3]; 3]) -> [f64; 3] {
    let trace = r[0][0] + r[1][1] + r[2][2];
    let axis = |a: usize| 1.0 - trace + 2.0 * r[a][a];
    let squares = [1.0 + trace, axis(0), axis(1), axis(2)];
    let largest = (0..4).fold(0, |best, i| if squares[i] > squares[best] { i } else { best });
    let twice = squares[largest].max(0.0).sqrt();
    let half = 0.5 / twice;
    let (x, y, z) = (r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]);
    let (xy, xz, yz) = (r[0][1] + r[1][0], r[0][2] + r[2][0], r[1][2] + r[2][1]);
    let q = match largest {
        0 => [0.5 * twice, x * half, y * half, z * half],
        1 => [x * half, 0.5 * twice, xy * half, xz * half],
        2 => [y * half, xy * half, 0.5 * twice, yz * half],
        _ => [z * half, xz * half, yz * half, 0.5 * twice],
    };
    let sign = if q[0] < 0.0 { -1.0 } else { 1.0 };
    [q[1] * sign, q[2] * sign, q[3] * sign]
}
