//! Camera calibration of lines `x y z u v` (mm, pixels) from standard input, for the foreign oracle:
//! `calibrate_camera WIDTH HEIGHT`. Prints focal lengths, principal point, k1 k2 p1 p2, the residual (pixels), and the
//! rows of the 3 x 4 camera pose, in one line.

use monro_geometry::{Point, Tracker};
use monro_guidance::optics::{CameraOptions, Correspondence, calibrate_camera};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let size: Vec<u32> = std::env::args().skip(1).map(|a| a.parse()).collect::<Result<_, _>>()?;
    let [width, height] = size.as_slice() else { return Err("usage: calibrate_camera WIDTH HEIGHT".into()) };
    let mut corners = Vec::new();
    for line in std::io::stdin().lines() {
        let v: Vec<f64> = line?.split_whitespace().map(str::parse).collect::<Result<_, _>>()?;
        let [x, y, z, u, v] = v.as_slice() else { return Err("each line needs five numbers".into()) };
        corners.push(Correspondence { point: Point::<Tracker>::new(*x, *y, *z), pixel: [*u, *v] });
    }
    let found = calibrate_camera(&corners, &CameraOptions::new(*width, *height))?;
    let (lens, pose) = (found.camera.lens, found.camera.camera_from);
    let mut out = [lens.focal, lens.centre, [lens.radial[0], lens.radial[1]], lens.tangential].concat();
    out.push(found.residual);
    for (row, t) in pose.rotation().rows.iter().zip(pose.translation().to_array()) {
        out.extend(row.iter().chain([&t]));
    }
    println!("{}", out.iter().map(f64::to_string).collect::<Vec<_>>().join(" "));
    Ok(())
}
