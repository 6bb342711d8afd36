//! The slice that the web app should have drawn, made in software: for the browser tests.
//!
//! stdin: `{case, nodes, centre, right, up, mm_per_pixel, size, window}`, one JSON object: the folder of the case, where
//! the simulation's nodes are (x, y, z of all, mm), and the plane. stdout: the grey (0 to 255) of each pixel, row by row
//! from the upper left, as a JSON array.

use monro_case::Case;
use monro_geometry::{Patient, Point, TetMesh, Vector};
use monro_scan::ReadOptions;
use monro_session::DeformedSampler;
use serde::Deserialize;
use std::path::PathBuf;

#[derive(Deserialize)]
struct Request {
    case: PathBuf,
    nodes: Vec<f64>,
    centre: [f64; 3],
    right: [f64; 3],
    up: [f64; 3],
    mm_per_pixel: f64,
    size: [usize; 2],
    window: [f64; 2],
}

impl Request {
    /// The patient point at the middle of a pixel.
    fn at(&self, x: usize, y: usize) -> Point<Patient> {
        let from_middle = |n: usize, size: usize| (n as f64 + 0.5 - size as f64 / 2.0) * self.mm_per_pixel;
        let (right, up) = (Vector::from_array(self.right), Vector::from_array(self.up));
        Point::from_array(self.centre) + right * from_middle(x, self.size[0]) - up * from_middle(y, self.size[1])
    }

    fn grey(&self, hu: f64) -> u8 {
        (255.0 * ((hu - self.window[0]) / self.window[1] + 0.5).clamp(0.0, 1.0)).round() as u8
    }
}

fn main() {
    let request: Request = serde_json::from_reader(std::io::stdin()).expect("a request");
    let case = Case::open(&request.case).expect("a case");
    let options = ReadOptions { any_size: true, ..ReadOptions::default() };
    let ct = monro_scan::read(&request.case.join("ct.nii.gz"), &options).expect("a CT").volume;
    let vertices = request.nodes.chunks_exact(3).map(|p| Point::new(p[0], p[1], p[2])).collect();
    let deformed = TetMesh { vertices, ..case.tets.clone() };
    let sampler = DeformedSampler::new(&case.tets, &deformed).expect("a deformed mesh");
    let [width, height] = request.size;
    let pixel = |i: usize| {
        let p = request.at(i % width, i / width);
        // Where no tissue is any more there is nothing to be seen.
        let hu = sampler.rest_position(p).and_then(|p| ct.trilinear(p));
        hu.map_or(0, |hu| request.grey(hu))
    };
    let greys: Vec<u8> = (0..width * height).map(pixel).collect();
    println!("{}", serde_json::json!(greys));
}
