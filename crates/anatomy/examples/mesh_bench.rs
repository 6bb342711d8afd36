//! Seconds per stage and quality of the tetrahedral mesher, on the analytic head of the tests or on a label file:
//! `cargo run --release --example mesh_bench -- [LABELS.nii.gz] [--elements N]`.

use monro_anatomy::tetra::{MeshError, MeshOptions, MeshReport, mesh_observed};
use monro_geometry::{Point, Volume};
use std::time::Instant;

#[path = "../src/tetra/test_head.rs"]
mod test_head;

fn main() {
    let mut counts = vec![5_824, 20_677, 37_336, 65_691, 500_000];
    let mut arguments = std::env::args().skip(1);
    while let Some(a) = arguments.next() {
        match a.as_str() {
            "--elements" => counts = arguments.next().and_then(|n| n.parse().ok()).into_iter().collect(),
            other => eprintln!("unknown argument {other}"),
        }
    }
    let labels = test_head::head([0.9; 3]);
    for elements in counts {
        run(&labels, elements);
    }
}

fn run(labels: &Volume<u8>, elements: usize) {
    let mut options = MeshOptions::new(&[4, 5, 6, 7], &[5, 6, 7], elements);
    options.path = Some([Point::new(30.0, 40.0, 38.0), Point::new(7.0, 15.0, 10.0)]);
    let start = Instant::now();
    let mut stages = Vec::new();
    let result = mesh_observed(labels, &options, |stage| stages.push((stage, start.elapsed().as_secs_f64())));
    println!("== {elements}");
    let mut before = 0.0;
    for (stage, at) in stages {
        print!("{stage:?} {:.3} s  ", at - before);
        before = at;
    }
    println!();
    match result {
        Ok((_, report)) => show(&report),
        Err(e) => show_error(&e),
    }
}

fn show_error(e: &MeshError) {
    println!("error: {e}");
}

fn show(r: &MeshReport) {
    println!(
        "{} tets {} points  dihedral {:.1}..{:.1} p1 {:.1}  radius ratio min {:.3} median {:.3}  core edge {:.2} mm",
        r.elements,
        r.vertices,
        r.dihedral_min,
        r.dihedral_max,
        r.dihedral_p1,
        r.radius_ratio_min,
        r.radius_ratio_median,
        r.core_edge_mean
    );
    let bands: Vec<String> = r.edge_bands.iter().map(|b| format!("{:.1}", b.mean)).collect();
    println!("edges by band {}", bands.join(" "));
    for l in &r.labels {
        let d = l.interface.map_or((f64::NAN, f64::NAN), |d| (d.mean, d.max));
        println!(
            "label {} tets {} volume {:+.2} %  interface {:.3} / {:.2} mm  euler {} of {}  surfaces {} of {}  closed {} manifold {}",
            l.label,
            l.elements,
            100.0 * l.volume_error,
            d.0,
            d.1,
            l.euler,
            l.euler_labels,
            l.surfaces,
            l.surfaces_labels,
            l.closed,
            l.manifold
        );
    }
}
