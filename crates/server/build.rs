//! Puts the built web app (`web/dist`) into the binary. Without it, Monro builds all the same: no Node is needed, and the
//! server shows a page that says how to build the app.

use std::env;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

fn main() {
    let root = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets it")).join("../../web/dist");
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets it"));
    // Its parent while it is not there, so that its appearance is noticed.
    let watched = if root.is_dir() { root.clone() } else { root.join("..") };
    println!("cargo:rerun-if-changed={}", watched.display());
    let mut files = Vec::new();
    if root.join("index.html").is_file() {
        collect(&root, &root, &mut files);
    }
    files.sort();
    let mut table = String::from("static FILES: &[(&str, &[u8])] = &[\n");
    for (number, (name, path)) in files.iter().enumerate() {
        // Copies, so that the app can be built anew while Monro is being built.
        let copy = out.join(format!("web_file_{number}"));
        fs::copy(path, &copy).expect("a file of web/dist can be copied");
        writeln!(table, "    ({name:?}, include_bytes!({copy:?})),").expect("a string takes all");
    }
    table.push_str("];\n");
    fs::write(out.join("web_files.rs"), table).expect("the build folder can be written");
}

fn collect(root: &Path, folder: &Path, files: &mut Vec<(String, PathBuf)>) {
    for entry in fs::read_dir(folder).expect("web/dist can be read") {
        let path = entry.expect("web/dist can be read").path();
        if path.is_dir() {
            collect(root, &path, files);
        } else {
            let name = path.strip_prefix(root).expect("below").to_string_lossy().replace('\\', "/");
            files.push((name, path));
        }
    }
}
