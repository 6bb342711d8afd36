//! Reads a scan and prints one JSON object for comparison with other readers: dims, affine (LPS, row-major), checksum of
//! the values in storage order, trilinear values at the given LPS positions.
//!
//!     dump_scan [--labels] [--any-size] [--series ID] [--write-dicom DIR] [--write-nifti FILE] [--write-nrrd FILE]
//!               PATH [x,y,z ...]
//!     dump_scan --inspect PATH

use monro_geometry::{Point, Volume};
use monro_scan::dicom::{SeriesMeta, write_series};
use monro_scan::{ReadOptions, inspect, nifti, nrrd, read, read_labels};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

#[derive(Default)]
struct Args {
    labels: bool,
    inspect: bool,
    options: ReadOptions,
    dicom: Option<PathBuf>,
    nifti: Option<PathBuf>,
    nrrd: Option<PathBuf>,
    path: PathBuf,
    points: Vec<[f64; 3]>,
}

fn args() -> Args {
    let mut out = Args::default();
    let mut rest = std::env::args().skip(1);
    while let Some(arg) = rest.next() {
        match arg.as_str() {
            "--labels" => out.labels = true,
            "--inspect" => out.inspect = true,
            "--any-size" => out.options.any_size = true,
            "--series" => out.options.series_uid = rest.next(),
            "--write-dicom" => out.dicom = rest.next().map(PathBuf::from),
            "--write-nifti" => out.nifti = rest.next().map(PathBuf::from),
            "--write-nrrd" => out.nrrd = rest.next().map(PathBuf::from),
            _ if out.path.as_os_str().is_empty() => out.path = PathBuf::from(arg),
            _ => {
                let xyz: Vec<f64> = arg.split(',').filter_map(|w| w.parse().ok()).collect();
                out.points.extend(<[f64; 3]>::try_from(xyz).ok());
            }
        }
    }
    out
}

/// FNV-1a over the values as little-endian 16-bit.
fn checksum(values: impl Iterator<Item = [u8; 2]>) -> u64 {
    values.flatten().fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3))
}

fn common<T: Copy + Into<f64>>(volume: &Volume<T>, checksum: u64, points: &[[f64; 3]]) -> String {
    let grid = volume.grid();
    let m = grid.patient_from_voxel();
    let sum: f64 = volume.data().iter().map(|&v| v.into()).sum();
    let value = |p: &[f64; 3]| volume.trilinear(Point::from_array(*p)).map_or("null".into(), |v| v.to_string());
    let samples = points.iter().map(value).collect::<Vec<_>>().join(",");
    format!(
        "\"dims\":{:?},\"linear\":{:?},\"offset\":{:?},\"spacing\":{:?},\"sum\":{sum},\"checksum\":{checksum},\"samples\":[{samples}]",
        grid.dims(),
        m.linear.rows,
        m.offset,
        grid.spacing()
    )
}

fn write(args: &Args, volume: &Volume<i16>) -> Result<(), Box<dyn Error>> {
    if let Some(dir) = &args.dicom {
        write_series(volume, dir, &SeriesMeta::default())?;
    }
    if let Some(file) = &args.nifti {
        std::fs::write(file, nifti::encode_i16(volume))?;
    }
    if let Some(file) = &args.nrrd {
        std::fs::write(file, nrrd::encode_i16(volume))?;
    }
    Ok(())
}

fn listed(path: &Path) -> Result<String, Box<dyn Error>> {
    let i = inspect(path)?;
    let one = |s: &monro_scan::SeriesSummary| {
        let (d, r) = (s.source.description.as_deref().unwrap_or(""), s.refusal.as_deref().unwrap_or(""));
        format!(
            "{{\"id\":{:?},\"images\":{},\"orientation\":{:?},\"dims\":{:?},\"spacing\":{:?},\"tilt\":{},\"description\":{d:?},\"refusal\":{r:?}}}",
            s.source.series,
            s.images,
            s.source.orientation,
            s.source.native_dims,
            s.source.native_spacing_mm,
            s.source.tilt_deg
        )
    };
    let series: Vec<String> = i.series.iter().map(one).collect();
    let chosen = i.chosen.map_or("null".into(), |n| n.to_string());
    Ok(format!(
        "{{\"series\":[{}],\"chosen\":{chosen},\"reason\":{:?},\"warnings\":{:?}}}",
        series.join(","),
        i.reason,
        i.warnings
    ))
}

fn dump(args: &Args) -> Result<String, Box<dyn Error>> {
    if args.inspect {
        return listed(&args.path);
    }
    if args.labels {
        let v = read_labels(&args.path)?;
        let sum = checksum(v.data().iter().map(|x| x.to_le_bytes()));
        return Ok(format!("{{{}}}", common(&v, sum, &args.points)));
    }
    let s = read(&args.path, &args.options)?;
    write(args, &s.volume)?;
    let sum = checksum(s.volume.data().iter().map(|x| x.to_le_bytes()));
    Ok(format!(
        "{{{},\"pseudonym\":{:?},\"series\":{:?},\"description\":{:?},\"warnings\":{:?},\"resampled\":{:?}}}",
        common(&s.volume, sum, &args.points),
        s.pseudonym,
        s.source.series,
        s.source.description.unwrap_or_default(),
        s.warnings,
        s.resampled.unwrap_or_default()
    ))
}

fn main() -> ExitCode {
    match dump(&args()) {
        Ok(json) => println!("{json}"),
        Err(e) => {
            eprintln!("{e}");
            return ExitCode::FAILURE;
        }
    }
    ExitCode::SUCCESS
}
