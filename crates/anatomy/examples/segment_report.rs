//! Segments a scan and prints sizes, confidence, findings, landmarks and, with a reference, Dice and surface distances;
//! draws slices with contours into a folder.
//!
//! `segment_report SCAN [--reference LABELS] [--map 1=5,2=6,3=7] [--landmarks FILE] [--pictures DIR]`
//!
//! SCAN may be `phantom:SEED`. `--map` turns the numbers of the reference into ours. `--landmarks` is a JSON file with
//! `"name": [x, y, z]` entries in RAS mm.

use monro_anatomy::{landmarks, phantom, segment};
use monro_geometry::{Patient, Point, Structure, Volume};
use monro_scan::ReadOptions;
use std::{env, error::Error, path::Path, time::Instant};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let scan = arguments
        .first()
        .ok_or("usage: segment_report SCAN [--reference LABELS] [--map 1=5] [--landmarks FILE] [--pictures DIR]")?;
    let option = |name: &str| arguments.iter().position(|a| a == name).and_then(|n| arguments.get(n + 1));
    let (ct, truth) = open(scan)?;
    let start = Instant::now();
    let found = segment::segment(&ct)?;
    println!("segment {:.2} s", start.elapsed().as_secs_f64());
    sizes(&found);
    let truth = match option("--reference") {
        Some(path) => Some(monro_scan::read_labels(Path::new(path))?.map(|l| mapped(l, option("--map")))),
        None => truth,
    };
    if let Some(truth) = &truth {
        compare(&found.labels, truth);
    }
    let start = Instant::now();
    match landmarks::find(&ct, &found) {
        Ok(marks) => {
            println!("landmarks {:.2} s", start.elapsed().as_secs_f64());
            print_landmarks(&marks, option("--landmarks"))?;
        }
        Err(error) => println!("landmarks: {error}"),
    }
    if let Some(folder) = option("--pictures") {
        pictures(&ct, &found.labels, truth.as_ref(), Path::new(folder))?;
    }
    Ok(())
}

/// A scan, and its truth where it has one.
type Opened = (Volume<i16>, Option<Volume<u8>>);

fn open(scan: &str) -> Result<Opened, Box<dyn Error>> {
    if let Some(seed) = scan.strip_prefix("phantom:") {
        let made = phantom::head(&phantom::HeadOptions { seed: seed.parse()?, ..Default::default() })?;
        println!("truth {:?}", made.landmarks);
        return Ok((made.ct, Some(made.labels)));
    }
    Ok((monro_scan::read(Path::new(scan), &ReadOptions::default())?.volume, None))
}

fn mapped(label: u16, map: Option<&String>) -> u8 {
    let Some(map) = map else { return u8::try_from(label).unwrap_or(0) };
    let pair = |entry: &str| entry.split_once('=').map(|(a, b)| (a.parse::<u16>(), b.parse::<u8>()));
    map.split(',').filter_map(pair).find_map(|(from, to)| if from == Ok(label) { to.ok() } else { None }).unwrap_or(0)
}

fn sizes(found: &segment::Segmentation) {
    for (structure, confidence) in &found.confidence {
        let voxels = found.labels.data().iter().filter(|&&l| l == structure.label()).count();
        let ml = voxels as f64 * found.labels.grid().voxel_volume() / 1000.0;
        println!("{:<24} {ml:9.2} mL  confidence {confidence:.2}", structure.name());
    }
    println!("midsagittal {:?}", found.midsagittal);
    found.findings.iter().for_each(|f| println!("finding: {f}"));
}

/// Compares on the reference's own grid.
fn compare(labels: &Volume<u8>, truth: &Volume<u8>) {
    let grid = truth.grid();
    let mut both = [[0usize; 3]; 10];
    for (n, &t) in truth.data().iter().enumerate() {
        let [i, j, k] = grid.voxel(n);
        let f = labels.nearest(grid.centre(i, j, k)).unwrap_or(0);
        let lateral = |l: u8| l == 5 || l == 6;
        let ventricle = |l: u8| (5..8).contains(&l);
        for (s, row) in both.iter_mut().enumerate() {
            let is = |l: u8| match s {
                8 => lateral(l),
                9 => ventricle(l),
                _ => usize::from(l) == s,
            };
            row[0] += usize::from(is(f) && is(t));
            row[1] += usize::from(is(f));
            row[2] += usize::from(is(t));
        }
    }
    for (s, [common, found, wanted]) in both.iter().enumerate().filter(|(_, r)| r[2] > 0) {
        let name = match s {
            8 => "both lateral",
            9 => "all ventricles",
            _ => Structure::ALL[s].name(),
        };
        println!("dice {name:<24} {:.4}", 2.0 * *common as f64 / (found + wanted).max(1) as f64);
    }
}

fn print_landmarks(marks: &landmarks::Landmarks, reference: Option<&String>) -> Result<(), Box<dyn Error>> {
    let text = reference.map(std::fs::read_to_string).transpose()?;
    let named = [
        ("nasion", "nasion_skin", marks.nasion),
        ("midline 110 mm", "midline_110mm_from_nasion_skin", marks.midline_110mm),
        ("kocher left", "kocher_left_skin", marks.kocher_left),
        ("kocher right", "kocher_right_skin", marks.kocher_right),
        ("monro left", "foramen_monro_left", marks.monro_left),
        ("monro right", "foramen_monro_right", marks.monro_right),
    ];
    for (name, key, p) in named {
        let off = text
            .as_deref()
            .and_then(|t| entry(t, key))
            .map_or(String::new(), |q| format!("off {:.1} mm", p.distance(q)));
        println!("{name:<15} {:8.1} {:8.1} {:8.1}  {off}", p.x, p.y, p.z);
    }
    marks.findings.iter().for_each(|f| println!("finding: {f}"));
    Ok(())
}

/// The RAS point of a key in a flat JSON text, as LPS.
fn entry(text: &str, key: &str) -> Option<Point<Patient>> {
    let rest = &text[text.find(&format!("\"{key}\""))?..];
    let inside = &rest[rest.find('[')? + 1..rest.find(']')?];
    let v: Vec<f64> = inside.split(',').filter_map(|n| n.trim().parse().ok()).collect();
    (v.len() == 3).then(|| Point::new(-v[0], -v[1], v[2]))
}

const COLOURS: [[u8; 3]; 8] = [
    [0, 0, 0],
    [200, 140, 90],
    [240, 240, 160],
    [70, 110, 255],
    [160, 60, 160],
    [255, 40, 40],
    [40, 255, 40],
    [0, 255, 255],
];

/// Nine slices at 0.5 mm: axial, coronal and sagittal through the ventricles. Ours in colours, the reference in white.
fn pictures(
    ct: &Volume<i16>,
    labels: &Volume<u8>,
    truth: Option<&Volume<u8>>,
    folder: &Path,
) -> Result<(), Box<dyn Error>> {
    std::fs::create_dir_all(folder)?;
    let inside: Vec<Point<Patient>> = (0..labels.data().len())
        .filter(|&n| (5..8).contains(&labels.data()[n]))
        .map(|n| {
            let [i, j, k] = labels.grid().voxel(n);
            labels.grid().centre(i, j, k)
        })
        .collect();
    let count = inside.len().max(1) as f64;
    let centre = inside.iter().fold([0.0; 3], |c, p| [c[0] + p.x / count, c[1] + p.y / count, c[2] + p.z / count]);
    for (name, axis, offsets) in [
        ("axial", 2, [-45.0, -25.0, -14.0, -8.0, 0.0, 8.0]),
        ("coronal", 1, [-40.0, -20.0, -10.0, 0.0, 12.0, 30.0]),
        ("sagittal", 0, [-25.0, -8.0, 0.0, 4.0, 8.0, 25.0]),
    ] {
        let mut sheet = image::RgbImage::new(3 * 440, 2 * 480);
        for (n, offset) in offsets.iter().enumerate() {
            let mut at = centre;
            at[axis] += offset;
            slice(ct, labels, truth, at, axis, &mut sheet, (n as u32 % 3 * 440, n as u32 / 3 * 480));
        }
        sheet.save(folder.join(format!("{name}.png")))?;
    }
    Ok(())
}

fn slice(
    ct: &Volume<i16>,
    labels: &Volume<u8>,
    truth: Option<&Volume<u8>>,
    at: [f64; 3],
    axis: usize,
    sheet: &mut image::RgbImage,
    corner: (u32, u32),
) {
    let place = |u: f64, v: f64| match axis {
        2 => Point::new(at[0] + u, at[1] + v, at[2]),
        1 => Point::new(at[0] + u, at[1], at[2] - v),
        _ => Point::new(at[0], at[1] + u, at[2] - v),
    };
    for y in 0..480 {
        for x in 0..440 {
            let at = |dx: i32, dy: i32| place((x + dx) as f64 * 0.5 - 110.0, (y + dy) as f64 * 0.5 - 120.0);
            let grey = ct.trilinear(at(0, 0)).map_or(0, |v| ((v + 40.0) * 2.0).clamp(0.0, 255.0) as u8);
            let here = labels.nearest(at(0, 0)).unwrap_or(0);
            let edge = |volume: &Volume<u8>, l: u8| {
                [(1, 0), (0, 1)].iter().find_map(|&(dx, dy)| {
                    let other = volume.nearest(at(dx, dy)).unwrap_or(0);
                    (other != l).then(|| l.max(other))
                })
            };
            let mut colour = edge(labels, here).map_or([grey; 3], |l| COLOURS[usize::from(l.min(7))]);
            if let Some(truth) = truth {
                let t = truth.nearest(at(0, 0)).unwrap_or(0);
                if edge(truth, t).is_some_and(|l| l >= 5) {
                    colour = [255; 3];
                }
            }
            sheet.put_pixel(corner.0 + x as u32, corner.1 + y as u32, image::Rgb(colour));
        }
    }
}
