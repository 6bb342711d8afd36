//! `dump_scan PATH [x,y,z ...]`: reads a scan and prints one JSON object for comparison with other readers: dims, affine
//! (LPS, row-major), a checksum of the HU in storage order, and the trilinear HU at the given LPS positions.
//! With `--labels` first, reads a label volume; with `--any-size`, skips the head check; `--series ID` chooses.

use monro_geometry::{Point, Volume};
use monro_scan::{ReadOptions, ScanError, read, read_labels};
use std::path::Path;
use std::process::ExitCode;

/// FNV-1a over the values as little-endian 16-bit.
fn checksum(values: impl Iterator<Item = [u8; 2]>) -> u64 {
    values.flatten().fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3))
}

fn common<T: Copy + Into<f64>>(volume: &Volume<T>, checksum: u64, points: &[[f64; 3]]) -> String {
    let grid = volume.grid();
    let m = grid.patient_from_voxel();
    let sum: f64 = volume.data().iter().map(|&v| v.into()).sum();
    let samples: Vec<String> = points
        .iter()
        .map(|&p| volume.trilinear(Point::from_array(p)).map_or("null".into(), |v| v.to_string()))
        .collect();
    format!(
        "\"dims\":{:?},\"linear\":{:?},\"offset\":{:?},\"spacing\":{:?},\"sum\":{sum},\"checksum\":{checksum},\"samples\":[{}]",
        grid.dims(),
        m.linear.rows,
        m.offset,
        grid.spacing(),
        samples.join(",")
    )
}

fn dump(path: &Path, labels: bool, options: &ReadOptions, points: &[[f64; 3]]) -> Result<String, ScanError> {
    if labels {
        let v = read_labels(path)?;
        let sum = checksum(v.data().iter().map(|x| x.to_le_bytes()));
        return Ok(format!("{{{}}}", common(&v, sum, points)));
    }
    let s = read(path, options)?;
    let sum = checksum(s.volume.data().iter().map(|x| x.to_le_bytes()));
    Ok(format!(
        "{{{},\"pseudonym\":{:?},\"series\":{:?},\"warnings\":{:?},\"resampled\":{:?}}}",
        common(&s.volume, sum, points),
        s.pseudonym,
        s.source.series,
        s.warnings,
        s.resampled.unwrap_or_default()
    ))
}

fn main() -> ExitCode {
    let mut args = std::env::args().skip(1);
    let (mut labels, mut options, mut path, mut points) = (false, ReadOptions::default(), None, Vec::new());
    while let Some(arg) = args.next() {
        match arg.as_str() {
            "--labels" => labels = true,
            "--any-size" => options.any_size = true,
            "--series" => options.series_uid = args.next(),
            _ if path.is_none() => path = Some(arg),
            _ => {
                let xyz: Vec<f64> = arg.split(',').filter_map(|w| w.parse().ok()).collect();
                points.extend(<[f64; 3]>::try_from(xyz).ok());
            }
        }
    }
    let Some(path) = path else {
        eprintln!("usage: dump_scan [--labels] [--any-size] [--series ID] PATH [x,y,z ...]");
        return ExitCode::FAILURE;
    };
    match dump(Path::new(&path), labels, &options, &points) {
        Ok(json) => println!("{json}"),
        Err(e) => {
            eprintln!("{e}");
            return ExitCode::FAILURE;
        }
    }
    ExitCode::SUCCESS
}
