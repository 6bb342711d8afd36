//! The automatic segmentation against truth: phantoms of many seeds, and scans with reference labels; and the livewire.

use super::livewire;
use crate::args::PhantomKind;
use crate::columns::{Column, column, table};
use crate::console::Console;
use crate::phantom;
use anyhow::{Context, Result, bail};
use monro_anatomy::compare::{Agreement, agreement};
use monro_anatomy::segment::{self, Part, SegmentError, Segmentation};
use monro_geometry::{Grid, Structure, Volume};
use monro_scan::ReadOptions;
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;
use std::path::Path;
use std::time::Instant;

/// Labels of a reference that make one of our structures.
type Match = (Structure, Vec<u16>);

/// Prints one JSON object: `livewire`, and a row per phantom and scan. `against` holds SCAN, LABELS, MAP in turns.
pub(super) fn run(seeds: u64, against: &[String], dump: Option<&Path>, console: &Console) -> Result<()> {
    let against = against.chunks(3).map(Against::read).collect::<Result<Vec<_>>>()?;
    let wire = console.stage("livewire", || livewire::measure(dump))?;
    let mut rows = Vec::new();
    for seed in 0..seeds {
        let made = phantom::make(PhantomKind::Head, seed)?;
        let own: Vec<Match> = Structure::ALL.into_iter().skip(1).map(|s| (s, vec![u16::from(s.label())])).collect();
        rows.push(row(&format!("phantom {seed}"), &made.ct, &made.labels.map(u16::from), &own, console)?);
    }
    for Against { scan, reference, map } in against {
        let ct = monro_scan::read(scan, &ReadOptions::default())?.volume;
        let name = scan.parent().and_then(Path::file_name).unwrap_or_default().to_string_lossy().into_owned();
        rows.push(row(&name, &ct, &reference, &map, console)?);
    }
    let mut result = json!({ "livewire": wire.clone(), "scans": rows });
    for key in ["livewire_contour_error_px", "livewire_path_ms", "livewire_map_ms"] {
        result[key] = wire[key].clone();
    }
    let text = format!("{}\n{}", table(&flat(&result["scans"]), &columns()), livewire::words(&wire));
    console.result(&result, &text);
    Ok(())
}

/// A scan with reference labels, and what they are of ours.
struct Against<'a> {
    scan: &'a Path,
    reference: Volume<u16>,
    map: Vec<Match>,
}

impl<'a> Against<'a> {
    fn read(three: &'a [String]) -> Result<Self> {
        let [scan, labels, map] = three else { bail!("--against wants SCAN LABELS MAP") };
        let (matches, reference) = (parse(map)?, monro_scan::read_labels(Path::new(labels))?);
        let asked: BTreeSet<u16> = matches.iter().flat_map(|m| m.1.iter().copied()).collect();
        let there: BTreeSet<u16> = reference.data().iter().copied().filter(|&l| l != 0).collect();
        if let Some(missing) = asked.difference(&there).next() {
            let there = there.iter().map(u16::to_string).collect::<Vec<_>>().join(", ");
            bail!("{map:?} asks for label {missing}, which {labels} does not hold (it has {there})");
        }
        Ok(Self { scan: Path::new(scan), reference, map: matches })
    }
}

/// A row for each structure of each scan.
fn flat(scans: &Value) -> Vec<Value> {
    let of = |scan: &Value| -> Vec<Value> {
        let row = |(name, agreement): (&String, &Value)| json!({ "scan": scan["scan"], "structure": name.replace('_', " "), "of": agreement });
        scan["structures"].as_object().into_iter().flatten().map(row).collect()
    };
    scans.as_array().into_iter().flatten().flat_map(of).collect()
}

fn columns() -> Vec<Column> {
    vec![
        column("scan", "/scan"),
        column("structure", "/structure"),
        column("Dice", "/of/dice"),
        column("expected", "/of/confidence"),
        column("off mm, mean", "/of/mean_mm"),
        column("95 %", "/of/hausdorff95_mm"),
        column("found ml", "/of/found_ml"),
        column("reference ml", "/of/reference_ml"),
        column("seconds", "/of/seconds"),
    ]
}

/// `5=1,6=2,56=1+2`: our labels and those of the reference; several of ours together are compared as one.
fn parse(map: &str) -> Result<Vec<Match>> {
    let one = |part: &str| -> Option<Match> {
        let (ours, theirs) = part.split_once('=')?;
        let structure = Structure::from_label(ours.trim().parse::<u16>().ok()?)?;
        let theirs = theirs.split('+').map(|l| l.trim().parse().ok()).collect::<Option<Vec<u16>>>()?;
        Some((structure, theirs))
    };
    map.split(',').map(one).collect::<Option<Vec<_>>>().with_context(|| format!("{map:?} is not like 5=1,6=2,7=3+4"))
}

fn row(name: &str, ct: &Volume<i16>, reference: &Volume<u16>, map: &[Match], console: &Console) -> Result<Value> {
    let (found, times) = timed(ct).with_context(|| format!("{name} cannot be segmented"))?;
    let seconds: f64 = times.iter().map(|(_, s)| s).sum();
    console.note(&format!("{name}: {seconds:.2} s"));
    // On the coarser grid: where the centre of a fine voxel lies between two coarse ones, the nearest is a coin's toss that
    // shifts the coarse labels by half a fine voxel.
    let finer = reference.grid().voxel_volume() < ct.grid().voxel_volume();
    let grid = if finer { *ct.grid() } else { *reference.grid() };
    let ours: Vec<u8> = sampled(&found.labels, &grid);
    let truth: Vec<u16> = sampled(reference, &grid);
    let compare = |ours_are: &dyn Fn(u8) -> bool, theirs: &[u16]| {
        let a: Vec<bool> = ours.iter().map(|&l| ours_are(l)).collect();
        let b: Vec<bool> = truth.iter().map(|l| theirs.contains(l)).collect();
        agreement(&grid, &a, &b)
    };
    let mut structures = Map::new();
    for (s, theirs) in map {
        let trust = found.confidence.iter().find(|(t, _)| t == s).map(|(_, c)| *c);
        structures.insert(s.name().into(), described(&compare(&|l| l == s.label(), theirs), trust, until(&times, *s)));
    }
    for (name, wanted) in [
        ("lateral_ventricles", &[Structure::LeftLateralVentricle, Structure::RightLateralVentricle][..]),
        ("ventricles", &Structure::ALL[5..]),
    ] {
        let parts: Vec<&Match> = map.iter().filter(|(s, _)| wanted.contains(s)).collect();
        if parts.len() == wanted.len() {
            let theirs: Vec<u16> = parts.iter().flat_map(|(_, t)| t.clone()).collect();
            let is = |l: u8| wanted.iter().any(|s| s.label() == l);
            structures.insert(name.into(), described(&compare(&is, &theirs), None, until(&times, wanted[0])));
        }
    }
    Ok(json!({ "scan": name, "seconds": seconds, "structures": structures }))
}

/// Seconds of each part.
type Times = Vec<(Part, f64)>;

fn timed(ct: &Volume<i16>) -> Result<(Segmentation, Times), SegmentError> {
    let mut times = Times::new();
    let mut begin = Instant::now();
    let found = segment::segment_by_parts(ct, &mut |part| {
        times.push((part, begin.elapsed().as_secs_f64()));
        begin = Instant::now();
    })?;
    Ok((found, times))
}

/// Seconds of the parts that a structure needs; those that several structures need count for each of them.
fn until(times: &Times, structure: Structure) -> f64 {
    times.iter().filter(|(part, _)| part.leads_to(structure)).map(|(_, s)| s).sum()
}

/// The nearest label at each voxel centre of a grid; 0 outside.
fn sampled<T: Copy + Default>(labels: &Volume<T>, grid: &Grid) -> Vec<T> {
    let centre = |n: usize| {
        let [i, j, k] = grid.voxel(n);
        grid.centre(i, j, k)
    };
    (0..grid.len()).map(|n| labels.nearest(centre(n)).unwrap_or_default()).collect()
}

fn described(a: &Agreement, confidence: Option<f64>, seconds: f64) -> Value {
    json!({
        "dice": a.dice, "hausdorff95_mm": a.hausdorff95_mm, "mean_mm": a.mean_mm, "found_ml": a.found_ml,
        "reference_ml": a.reference_ml, "confidence": confidence, "seconds": seconds,
    })
}
