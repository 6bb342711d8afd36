//! Surfaces from voxels: seconds of extraction and smoothing on a scan of 512 x 512 x 91, and what they keep.

use anyhow::Result;
use monro_anatomy::phantom::{self, HeadOptions};
use monro_anatomy::surface::{Smoothing, SurfaceOptions, isosurface, label_surface, smooth};
use monro_geometry::{Structure, TriangleMesh, Volume};
use serde_json::{Value, json};
use std::time::Instant;

/// Voxels of a common head CT.
const DIMS: [usize; 3] = [512, 512, 91];
/// The box that head phantoms are painted in, mm.
const BOX: [f64; 3] = [214.0, 248.0, 206.0];
const REPEATS: usize = 5;

/// Surfaces of the true labels of a phantom, on the present threads.
pub(super) fn measure() -> Result<Value> {
    let spacing_mm = core::array::from_fn(|a| BOX[a] / DIMS[a] as f64);
    let labels = phantom::head(&HeadOptions { spacing_mm, ..HeadOptions::default() })?.labels;
    let ventricle = |l: u8| Structure::from_label(l).is_some_and(Structure::is_ventricle);
    let inside = |l: u8| ventricle(l) || [Structure::Brain.label(), Structure::Csf.label()].contains(&l);
    let skull = |l: u8| l == Structure::Skull.label();
    let rows = [
        row("inside of the skull", &labels, &inside)?,
        row("ventricles", &labels, &ventricle)?,
        row("skull", &labels, &skull)?,
    ];
    Ok(json!({ "dims": labels.grid().dims(), "threads": rayon::current_num_threads(), "rows": rows }))
}

fn row(name: &str, labels: &Volume<u8>, keep: &(impl Fn(u8) -> bool + Sync)) -> Result<Value> {
    let field = labels.map(|l| f32::from(u8::from(keep(l))));
    let (extract, raw) = least(|| isosurface(&field, 0.5));
    let on = |threads| -> Result<TriangleMesh> {
        Ok(rayon::ThreadPoolBuilder::new().num_threads(threads).build()?.install(|| isosurface(&field, 0.5)))
    };
    let (filter, smoothed) = least(|| {
        let mut mesh = raw.clone();
        smooth(&mut mesh, Smoothing::default());
        mesh
    });
    let (whole, made) = least(|| label_surface(labels, keep, &SurfaceOptions::default()));
    let (made, voxels) = (made?, labels.data().iter().filter(|&&l| keep(l)).count());
    Ok(json!({
        "surface": name, "extract_s": extract, "triangles": raw.triangles.len(), "smooth_s": filter,
        "smoothing_volume_change": smoothed.signed_volume() / raw.signed_volume() - 1.0,
        "same_bits_on_1_3_4_threads": on(1)? == raw && on(3)? == raw && on(4)? == raw,
        "label_surface_s": whole, "label_surface_step_mm": made.step, "label_surface_triangles": made.mesh.triangles.len(),
        "label_surface_volume_error": made.mesh.signed_volume() / (voxels as f64 * labels.grid().voxel_volume()) - 1.0,
        "closed_manifold": made.topology.is_closed() && made.topology.is_manifold(),
    }))
}

/// Least seconds of some runs, and the last result.
fn least<T>(mut run: impl FnMut() -> T) -> (f64, T) {
    let mut timed = || {
        let begin = Instant::now();
        let out = run();
        (begin.elapsed().as_secs_f64(), out)
    };
    let first = timed();
    (1..REPEATS).fold(first, |(seconds, _), _| {
        let (next, out) = timed();
        (seconds.min(next), out)
    })
}
