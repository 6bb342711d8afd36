//! A scripted livewire session on the ventricles of the digital phantom, against their exact outlines.
//!
//! Gives one JSON object: `livewire_contour_error_px` (mean distance to the truth, both ways, with `CLICKS` clicks),
//! `livewire_map_ms` (slice to cost map), `livewire_path_ms` (95th percentile of one movement of the mouse) and
//! `clicks` (mean number needed for at most half a pixel), and a row per number of clicks. It also
//! writes the slices, clicks and truths, for `scripts/bench_livewire.py` to run other tools on the very same input.

use crate::columns::short;
use anyhow::Result;
use monro_anatomy::livewire::{Axis, Contour, Livewire, LivewireError, LivewireOptions, SliceImage};
use monro_anatomy::phantom::{HeadModel, HeadOptions, head};
use monro_case::{OutputKind, check_output, nothing_known};
use monro_geometry::{Point, Structure, Volume, Voxel};
use monro_guidance::simulation::quantile;
use serde_json::{Value, json};
use std::path::Path;
use std::time::Instant;

/// Clicks of the headline number.
const CLICKS: usize = 4;
const TRIED: [usize; 6] = [2, 3, 4, 6, 8, 12];
/// Standard deviation of a click's distance from the true outline, pixels per axis.
const HAND: f64 = 0.7;

/// One outline of one structure on one slice.
struct Outline {
    slice: usize,
    structure: Structure,
    truth: Contour,
}

/// What was timed, ms.
#[derive(Default)]
struct Times {
    map: Vec<f64>,
    path: Vec<f64>,
    whole: Vec<f64>,
}

/// What is written for another program.
const INPUT: OutputKind = OutputKind {
    name: "the input of a bench",
    marks: &["input.json"],
    files: &["input.json", "slice*.f32"],
    parts: &[],
    changed: nothing_known,
};

/// Runs the sessions; with a folder, writes their input there.
pub(super) fn measure(dump: Option<&Path>) -> Result<Value> {
    dump.map_or(Ok(()), |folder| check_output(folder, true, &INPUT, &[]))?;
    // In-plane pixels of a usual head CT; 475 x 551 of them, as many as 512 x 512. Thin slices, because the truth is
    // the section through the slice's middle.
    let options = HeadOptions { seed: 1, spacing_mm: [0.45, 0.45, 1.3], ..HeadOptions::default() };
    let phantom = head(&options)?;
    let model = HeadModel::new(&options);
    let outlines = outlines(&model, &phantom.labels);
    let mut times = Times::default();
    let mut errors = vec![Vec::new(); TRIED.len()];
    for outline in &outlines {
        let image = SliceImage::of(&phantom.ct, Axis::K, outline.slice)?;
        for (n, &clicks) in TRIED.iter().enumerate() {
            errors[n].push(session(&image, outline, clicks, &mut times)?);
        }
    }
    if let Some(folder) = dump {
        write_input(folder, &phantom.ct, &outlines)?;
    }
    Ok(summary(&outlines, &errors, &times))
}

/// The largest outline of each ventricle on every fourth slice where it is at least 60 mm2 large.
fn outlines(model: &HeadModel, labels: &Volume<u8>) -> Vec<Outline> {
    let grid = labels.grid();
    let mut out = Vec::new();
    for slice in (0..grid.dims()[2]).step_by(4) {
        for structure in Structure::ALL.into_iter().filter(|s| s.is_ventricle()) {
            let Some((corner, size)) = bounds(labels, slice, structure) else { continue };
            let distance = |p: [f64; 2]| {
                let voxel = Point::<Voxel>::new(p[0], p[1], slice as f64);
                model.distance_to(structure, grid.patient_from_voxel().point(voxel)).unwrap_or(f64::INFINITY)
            };
            let loops = zero_level(corner, size, distance);
            let pixel_mm2 = grid.spacing()[0] * grid.spacing()[1];
            let largest = loops.into_iter().max_by(|a, b| a.signed_area().abs().total_cmp(&b.signed_area().abs()));
            if let Some(truth) = largest.filter(|c| c.signed_area().abs() * pixel_mm2 > 60.0) {
                out.push(Outline { slice, structure, truth });
            }
        }
    }
    out
}

/// First corner and size, in pixels and with a margin, of the box around a structure on a slice.
fn bounds(labels: &Volume<u8>, slice: usize, structure: Structure) -> Option<([usize; 2], [usize; 2])> {
    let [w, h, _] = labels.grid().dims();
    let (mut low, mut high) = ([usize::MAX; 2], [0; 2]);
    for p in (0..w * h).map(|n| [n % w, n / w]).filter(|p| labels.at(p[0], p[1], slice) == structure.label()) {
        low = [low[0].min(p[0]), low[1].min(p[1])];
        high = [high[0].max(p[0]), high[1].max(p[1])];
    }
    (low[0] <= high[0]).then(|| (low.map(|v| v.saturating_sub(3)), [0, 1].map(|a| high[a] + 7 - low[a])))
}

/// The closed curves where a field is zero, by marching squares on the pixels of a box.
fn zero_level(corner: [usize; 2], size: [usize; 2], field: impl Fn([f64; 2]) -> f64) -> Vec<Contour> {
    let place = |n: usize| [(corner[0] + n % size[0]) as f64, (corner[1] + n / size[0]) as f64];
    let values: Vec<f64> = (0..size[0] * size[1]).map(|n| field(place(n))).collect();
    let at = |x: usize, y: usize| values[y * size[0] + x];
    // Each crossed grid edge is named by its first corner and direction; a cell joins two of its edges, keeping the
    // inside on one side, so the joins chain into loops.
    let mut next = std::collections::BTreeMap::new();
    for y in 0..size[1] - 1 {
        for x in 0..size[0] - 1 {
            let corners = [(x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1)];
            let edges = [(x, y, 0), (x + 1, y, 1), (x, y + 1, 0), (x, y, 1)];
            let inside = corners.map(|(a, b)| at(a, b) < 0.0);
            for k in (0..4).filter(|&k| inside[k] && !inside[(k + 1) % 4]) {
                let back = (1..4).map(|s| (k + s) % 4).find(|&e| !inside[e] && inside[(e + 1) % 4]);
                next.insert(edges[k], edges[back.unwrap_or(k)]);
            }
        }
    }
    let point = |(x, y, along): (usize, usize, usize)| {
        let (a, b) = (at(x, y), at(x + 1 - along, y + along));
        let t = a / (a - b);
        [(corner[0] + x) as f64 + t * (1 - along) as f64, (corner[1] + y) as f64 + t * along as f64]
    };
    let mut loops = Vec::new();
    while let Some((&start, _)) = next.first_key_value() {
        let mut points = Vec::new();
        let mut edge = start;
        while let Some(following) = next.remove(&edge) {
            points.push(point(edge));
            edge = following;
        }
        loops.push(Contour { points });
    }
    loops
}

/// Clicks at equal steps along the truth, off by an unsteady hand.
fn clicks(outline: &Outline, count: usize) -> Vec<[f64; 2]> {
    let points = &outline.truth.points;
    let mut state = (outline.slice * 8 + usize::from(outline.structure.label())) as u64 * 31 + count as u64;
    let mut normal = || {
        let mut sum = -6.0;
        for _ in 0..12 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            sum += (state >> 11) as f64 / (1u64 << 53) as f64;
        }
        sum
    };
    let at = |n: usize| points[n * points.len() / count];
    (0..count).map(|n| [at(n)[0] + HAND * normal(), at(n)[1] + HAND * normal()]).collect()
}

/// Draws one outline and returns its mean error in pixels; infinite when it does not close.
fn session(image: &SliceImage, outline: &Outline, count: usize, times: &mut Times) -> Result<f64, LivewireError> {
    let begin = Instant::now();
    let mut wire = Livewire::new(image.clone(), LivewireOptions::default())?;
    times.map.push(ms(begin));
    let points = &outline.truth.points;
    for (n, click) in clicks(outline, count).into_iter().enumerate() {
        if n > 0 {
            // The mouse follows the edge to the click in steps of a few pixels.
            let (from, to) = ((n - 1) * points.len() / count, n * points.len() / count);
            for m in (from..to).step_by(4) {
                let begin = Instant::now();
                wire.hover(points[m], 0.0)?;
                times.path.push(ms(begin));
            }
        }
        wire.click(click)?;
    }
    if count == CLICKS {
        let mut whole = wire.clone();
        let begin = Instant::now();
        whole.advance(usize::MAX);
        times.whole.push(ms(begin));
    }
    let drawn = wire.close().and_then(|()| wire.contour());
    Ok(drawn.map_or(f64::INFINITY, |c| (mean_distance(&c, &outline.truth) + mean_distance(&outline.truth, &c)) / 2.0))
}

fn mean_distance(from: &Contour, to: &Contour) -> f64 {
    from.points.iter().map(|&p| to.distance(p)).sum::<f64>() / from.points.len() as f64
}

fn ms(begin: Instant) -> f64 {
    begin.elapsed().as_secs_f64() * 1e3
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn summary(outlines: &[Outline], errors: &[Vec<f64>], times: &Times) -> Value {
    let needed: Vec<f64> = (0..outlines.len())
        .filter_map(|o| (0..TRIED.len()).find(|&n| errors[n][o] <= 0.5).map(|n| TRIED[n] as f64))
        .collect();
    let headline = TRIED.iter().position(|&c| c == CLICKS).unwrap_or(0);
    let row = |(n, count): (usize, &usize)| {
        let e = &errors[n];
        json!({
            "clicks": count, "mean_px": mean(e), "median_px": quantile(e, 0.5), "worst_px": quantile(e, 1.0),
            "within_half_px": e.iter().filter(|&&v| v <= 0.5).count(),
        })
    };
    json!({
        "livewire_contour_error_px": mean(&errors[headline]),
        "livewire_path_ms": quantile(&times.path, 0.95),
        "livewire_map_ms": quantile(&times.map, 0.5),
        "clicks": mean(&needed),
        "outlines": outlines.len(),
        "outlines_solved": needed.len(),
        "path_median_ms": quantile(&times.path, 0.5),
        "path_worst_ms": quantile(&times.path, 1.0),
        "whole_slice_ms": quantile(&times.whole, 0.5),
        "by_clicks": TRIED.iter().enumerate().map(row).collect::<Vec<_>>(),
    })
}

/// The numbers that matter, for people.
pub(super) fn words(measured: &Value) -> String {
    let of = |key: &str| short(&measured[key]);
    format!(
        "livewire: contour off by {} px with {CLICKS} clicks, cost map {} ms, path {} ms (95 %)",
        of("livewire_contour_error_px"),
        of("livewire_map_ms"),
        of("livewire_path_ms")
    )
}

/// One JSON file and one raw file (little-endian f32) per slice.
fn write_input(folder: &Path, ct: &Volume<i16>, outlines: &[Outline]) -> Result<()> {
    std::fs::create_dir_all(folder)?;
    let [width, height, _] = ct.grid().dims();
    let mut rows = Vec::new();
    for outline in outlines {
        let image = SliceImage::of(ct, Axis::K, outline.slice)?;
        let bytes: Vec<u8> = image.data().iter().flat_map(|v| v.to_le_bytes()).collect();
        std::fs::write(folder.join(format!("slice{}.f32", outline.slice)), bytes)?;
        let sets: serde_json::Map<String, Value> =
            TRIED.iter().map(|&c| (c.to_string(), json!(clicks(outline, c)))).collect();
        rows.push(json!({
            "slice": outline.slice, "structure": outline.structure.name(), "truth": outline.truth.points, "clicks": sets,
        }));
    }
    let text = json!({ "width": width, "height": height, "outlines": rows }).to_string();
    std::fs::write(folder.join("input.json"), text)?;
    Ok(())
}
