//! `monro mesh` with meshes instead of labels: checked, converted, or refused by name.

use crate::common::{json, point, refusal, text};
use monro_case::vtu::{self, UnstructuredGrid};
use monro_case::{msh, ply, stl};
use monro_geometry::{Grid, Point, TetMesh, TriangleMesh, Volume};
use monro_scan::nifti;
use std::fs;
use std::path::Path;

fn two() -> TetMesh {
    let vertices = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [0., 0., -1.5]];
    let vertices = vertices.map(Point::from_array).to_vec();
    TetMesh { vertices, tets: vec![[0, 1, 2, 3], [0, 2, 1, 4]], labels: vec![4, 5] }
}

#[test]
fn a_mesh_goes_from_format_to_format_unchanged() {
    let dir = tempfile::tempdir().expect("temp");
    let [a, b, c, s] = ["a.vtu", "b.msh", "c.vtu", "s.stl"].map(|n| dir.path().join(n));
    fs::write(&a, vtu::encode(&UnstructuredGrid::from_mesh(&two()))).expect("write");
    assert_eq!(json(&["mesh", text(&a), "--out", text(&b)])["elements"], 2);
    assert_eq!(msh::decode(&fs::read(&b).expect("read")).expect("msh").mesh, two());
    json(&["mesh", text(&b), "--out", text(&c)]);
    assert_eq!(fs::read(&a).expect("a"), fs::read(&c).expect("c"));
    json(&["mesh", text(&b), "--out", text(&s)]);
    assert_eq!(stl::decode(&fs::read(&s).expect("read")).expect("stl").triangles.len(), 6);
    for name in ["o.obj", "g.glb"] {
        json(&["mesh", text(&s), "--out", text(&dir.path().join(name))]);
    }
}

/// 3D Slicer writes the words into PLY and STL; left and right must not change sides.
#[test]
fn a_surface_in_ras_is_turned_to_lps_with_a_remark() {
    let dir = tempfile::tempdir().expect("temp");
    let [file, out] = ["ras.ply", "out.ply"].map(|n| dir.path().join(n));
    let lps = ply::encode(&two().surface(|_| true), None);
    let at = lps.windows(9).position(|w| w == b"SPACE=LPS").expect("said");
    let ras = [&lps[..at], b"SPACE=RAS", &lps[at + 9..]].concat();
    fs::write(&file, ras).expect("write");
    let done = json(&["mesh", text(&file), "--out", text(&out)]);
    assert!(done["remarks"][0].as_str().is_some_and(|r| r.contains("SPACE=RAS")), "{done}");
    let found = ply::decode(&fs::read(&out).expect("read")).expect("ply");
    let half_turn = two().surface(|_| true).vertices.iter().map(|p| Point::new(-p.x, -p.y, p.z)).collect::<Vec<_>>();
    assert_eq!(found.vertices, half_turn);
}

#[test]
fn a_broken_mesh_is_refused_with_its_element_and_a_wrong_format_with_the_right_ones() {
    let dir = tempfile::tempdir().expect("temp");
    let [bad, surface, out] = ["bad.vtu", "s.stl", "out.msh"].map(|n| dir.path().join(n));
    let mut mesh = two();
    mesh.tets[1].swap(0, 1);
    fs::write(&bad, vtu::encode(&UnstructuredGrid::from_mesh(&mesh))).expect("write");
    assert!(refusal(&["mesh", text(&bad), "--out", text(&out)]).contains("tetrahedron 1 has volume"));
    fs::write(&surface, stl::encode(&two().surface(|_| true))).expect("write");
    assert!(refusal(&["mesh", text(&surface), "--out", text(&out)]).contains("no tetrahedra"));
    let said = refusal(&["mesh", text(&surface), "--out", text(&dir.path().join("x.fbx"))]);
    assert!(said.contains(".glb"), "{said}");
    assert!(!out.exists());
}

#[test]
fn a_file_without_an_element_or_a_triangle_is_refused_not_converted_to_nothing() {
    let dir = tempfile::tempdir().expect("temp");
    let [stl_in, ply_in, msh_in, out] = ["e.stl", "e.ply", "e.msh", "out.obj"].map(|n| dir.path().join(n));
    fs::write(&stl_in, stl::encode(&TriangleMesh::default())).expect("write");
    fs::write(&ply_in, ply::encode(&TriangleMesh { triangles: Vec::new(), ..two().surface(|_| true) }, None))
        .expect("write");
    fs::write(&msh_in, msh::encode(&TetMesh::default())).expect("write");
    assert!(refusal(&["mesh", text(&stl_in), "--out", text(&out)]).contains("0 vertices, but no triangle"));
    assert!(refusal(&["mesh", text(&ply_in), "--out", text(&out)]).contains("5 vertices, but no triangle"));
    assert!(refusal(&["mesh", text(&msh_in), "--out", text(&out)]).contains("e.msh is refused"));
    assert!(!out.exists());
}

/// Each fault as `.vtu` and as `.msh`.
#[test]
fn elements_that_do_not_fit_together_are_refused_with_their_numbers() {
    let dir = tempfile::tempdir().expect("temp");
    let out = dir.path().join("out.vtu");
    let mut thrice = two();
    thrice.vertices.push(Point::new(0.2, 0.2, 2.0));
    thrice.tets.push([0, 1, 2, 5]);
    let mut twice = two();
    twice.tets.push([1, 2, 0, 3]);
    for (mesh, reason) in
        [(&mut thrice, "tetrahedra [1, 0, 2] share the face"), (&mut twice, "tetrahedra 0 and 2 have the same")]
    {
        // Written by label in `.msh`: the numbers stay.
        mesh.labels.push(5);
        let [vtu, msh] = ["bad.vtu", "bad.msh"].map(|n| dir.path().join(n));
        fs::write(&vtu, vtu::encode(&UnstructuredGrid::from_mesh(mesh))).expect("write");
        fs::write(&msh, msh::encode(mesh)).expect("write");
        for bad in [&vtu, &msh] {
            let said = refusal(&["mesh", text(bad), "--out", text(&out)]);
            assert!(said.contains(reason), "{said}");
        }
    }
    let empty = dir.path().join("empty.vtu");
    fs::write(&empty, vtu::encode(&UnstructuredGrid::from_mesh(&TetMesh::default()))).expect("write");
    assert!(refusal(&["mesh", text(&empty), "--out", text(&out)]).contains("no tetrahedra"));
    assert!(!out.exists());
}

/// A VTU holds what its program meant to be the mesh; Gmsh's files hold nodes of the geometry besides.
#[test]
fn an_unused_vertex_is_refused_in_a_vtu_and_left_out_of_a_msh_with_a_remark() {
    let dir = tempfile::tempdir().expect("temp");
    let [bad, msh, out] = ["bad.vtu", "m.msh", "out.vtu"].map(|n| dir.path().join(n));
    let mut mesh = two();
    mesh.vertices.push(Point::new(9.0, 9.0, 9.0));
    fs::write(&bad, vtu::encode(&UnstructuredGrid::from_mesh(&mesh))).expect("write");
    assert!(refusal(&["mesh", text(&bad), "--out", text(&out)]).contains("vertex 5 belongs to no tetrahedron"));
    fs::write(&msh, "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n5\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n8 9 9 9\n$EndNodes\n$Elements\n1\n2 4 2 6 1 1 2 3 4\n$EndElements\n").expect("write");
    let done = json(&["mesh", text(&msh), "--out", text(&out)]);
    assert_eq!(done["vertices"], 4);
    assert!(done["remarks"][0].as_str().is_some_and(|r| r.contains("tag 8")), "{done}");
}

/// Each fault as the file that shows it, what is said, and what was left in peace.
#[test]
fn a_torn_mesh_and_a_faulty_surface_are_refused_with_their_elements() {
    let dir = tempfile::tempdir().expect("temp");
    let [tets, surface, out] = ["torn.vtu", "faulty.ply", "out.stl"].map(|n| dir.path().join(n));
    let mut torn = two();
    torn.vertices.push(torn.vertices[2]);
    torn.tets[1][1] = 5;
    fs::write(&tets, vtu::encode(&UnstructuredGrid::from_mesh(&torn))).expect("write");
    let said = refusal(&["mesh", text(&tets), "--out", text(&out)]);
    assert!(said.contains("vertices 2 and 5 are both at (0.000, 1.000, 0.000) mm"), "{said}");
    let sound = two().surface(|_| true);
    let [mut turned, mut twice, mut loose] = [sound.clone(), sound.clone(), sound];
    turned.triangles[2].swap(0, 1);
    twice.triangles.push(twice.triangles[1]);
    loose.vertices.push(Point::new(9.0, 9.0, 9.0));
    for (mesh, reason) in [
        (turned, "triangle 2 is turned against its neighbour"),
        (twice, "triangles 1 and 6 have the same three vertices"),
        (loose, "vertex 5 belongs to no triangle"),
    ] {
        fs::write(&surface, ply::encode(&mesh, None)).expect("write");
        let said = refusal(&["mesh", text(&surface), "--out", text(&out)]);
        assert!(said.contains(reason), "{said}");
    }
    assert!(!out.exists());
}

#[test]
fn a_doubtful_mesh_is_told_and_refused_by_strict() {
    let dir = tempfile::tempdir().expect("temp");
    let [tets, surface, out] = ["tets.vtu", "open.ply", "out.ply"].map(|n| dir.path().join(n));
    let mut overlapping = two();
    overlapping.vertices.extend(two().vertices.iter().map(|p| Point::new(p.x + 0.1, p.y + 0.1, p.z + 0.1)));
    overlapping.tets.extend([[5, 6, 7, 8], [5, 7, 6, 9]]);
    overlapping.labels.extend([4, 5]);
    let mut flat = two();
    flat.vertices[3].z = 1e-5;
    let mut open = two().surface(|_| true);
    open.triangles.pop();
    fs::write(&surface, ply::encode(&open, None)).expect("write");
    let mut hanging = two();
    hanging.vertices.push(Point::new(1.0 / 3.0, 1.0 / 3.0, 0.0));
    hanging.tets[1] = [0, 5, 1, 4];
    hanging.tets.extend([[1, 5, 2, 4], [2, 5, 0, 4]]);
    hanging.labels.extend([5, 5]);
    let mut torn = two();
    torn.vertices.push(Point::new(1e-8, 1.0, 0.0));
    torn.tets[1][1] = 5;
    for (mesh, file, reason) in [
        (Some(overlapping), &tets, "parts of the mesh overlap"),
        (Some(flat), &tets, "1 element(s) of bad shape"),
        (Some(hanging), &tets, "the first is vertex 5 on tetrahedron 0 at (0.33, 0.33, 0.00) mm"),
        (Some(torn), &tets, "of tetrahedra 0 and 1 with vertices 2 and 5 at (0.00, 1.00, 0.00) mm"),
        (None, &surface, "the surface is open: 3 edge(s)"),
    ] {
        if let Some(mesh) = mesh {
            fs::write(file, vtu::encode(&UnstructuredGrid::from_mesh(&mesh))).expect("write");
        }
        let done = json(&["mesh", text(file), "--out", text(&out), "--force"]);
        assert!(done["remarks"].to_string().contains(reason), "{done}");
        let said = refusal(&["mesh", text(file), "--out", text(&out), "--force", "--strict"]);
        assert!(said.contains("refused by --strict") && said.contains(reason), "{said}");
    }
}

/// Three quarters of a surface within another one, and the same apart.
#[test]
fn a_surface_that_passes_through_itself_was_taken() {
    let dir = tempfile::tempdir().expect("temp");
    let [file, out] = ["two.ply", "out.ply"].map(|n| dir.path().join(n));
    let ask = |by: f64| {
        let mut both = two().surface(|_| true);
        let mut other = both.clone();
        other.vertices.iter_mut().for_each(|p| *p = Point::new(p.x + by, p.y + by, p.z + 0.01));
        both.append(&other);
        fs::write(&file, ply::encode(&both, None)).expect("write");
        json(&["mesh", text(&file), "--out", text(&out), "--force"])
    };
    let done = ask(0.1);
    assert!(done["remarks"].to_string().contains("the surface passes through itself"), "{done}");
    assert!(done["self_crossing"]["pairs"].as_u64() > Some(2), "{done}");
    let at = point(&done["self_crossing"]["at_lps_mm"]);
    assert!(at.iter().all(|c| (-1.5..1.2).contains(c)), "{done}");
    let said = refusal(&["mesh", text(&file), "--out", text(&out), "--force", "--strict"]);
    assert!(said.contains("refused by --strict") && said.contains("passes through itself"), "{said}");
    assert_eq!(ask(2.0)["self_crossing"], serde_json::Value::Null);
}

#[test]
fn options_for_labels_were_passed_over_for_a_mesh() {
    let dir = tempfile::tempdir().expect("temp");
    let [file, out] = ["a.vtu", "out.vtu"].map(|n| dir.path().join(n));
    fs::write(&file, vtu::encode(&UnstructuredGrid::from_mesh(&two()))).expect("write");
    for option in [
        ["--keep", "4"],
        ["--fine", "4"],
        ["--path", "0,0,0:1,1,1"],
        ["--elements", "500"],
        ["--density", "4=2"],
        ["--growth", "0.7"],
        ["--coarsest", "5"],
        ["--report", "no-such.html"],
    ] {
        let said = refusal(&["mesh", text(&file), option[0], option[1], "--out", text(&out)]);
        assert!(said.contains(option[0]) && said.contains("is a mesh already"), "{said}");
    }
    assert!(!out.exists());
}

#[test]
fn a_mesh_that_is_checked_is_told_in_the_fields_of_one_that_is_made() {
    let dir = tempfile::tempdir().expect("temp");
    let [volume, made, again, surface] = ["l.nii.gz", "m.vtu", "n.vtu", "s.ply"].map(|n| dir.path().join(n));
    labels(&volume);
    let label_5 = |done: &serde_json::Value| {
        let all = done["labels"].as_array().expect("labels");
        all.iter().find(|l| l["label"] == 5).expect("label 5").clone()
    };
    let first = json(&["mesh", text(&volume), "--elements", "3000", "--out", text(&made)]);
    let second = json(&["mesh", text(&made), "--strict", "--out", text(&again)]);
    for field in [
        "elements",
        "vertices",
        "dihedral_min_deg",
        "dihedral_max_deg",
        "dihedral_p1_deg",
        "radius_ratio_min",
        "bad_shapes",
        "bounds_mm",
    ] {
        assert_eq!(first[field], second[field], "{field}");
    }
    for field in ["label", "elements", "volume_mm3", "euler", "surfaces", "closed", "manifold"] {
        assert!(!label_5(&second)[field].is_null(), "{field}: {second}");
        assert_eq!(label_5(&first)[field], label_5(&second)[field], "{field}");
    }
    let outer = json(&["mesh", text(&made), "--out", text(&surface)]);
    let outer =
        (outer["outer"].clone(), json(&["mesh", text(&surface), "--strict", "--out", text(&dir.path().join("s.obj"))]));
    assert_eq!(outer.0, outer.1["outer"]);
    assert!(outer.1["volume_mm3"].as_f64().is_some_and(|v| (3e4..3.6e4).contains(&v)), "{}", outer.1);
}

#[test]
fn a_mesh_of_labels_has_a_page_that_holds_all_it_shows() {
    let dir = tempfile::tempdir().expect("temp");
    let [volume, out, page] = ["labels.nii.gz", "m.vtu", "m.html"].map(|n| dir.path().join(n));
    labels(&volume);
    let ask = ["mesh", text(&volume), "--elements", "3000", "--report", text(&page), "--out", text(&out)];
    json(&ask);
    let html = fs::read_to_string(&page).expect("a page");
    for part in [">label 4<", ">label 5<", "radius ratio", "Grading", "labels.nii.gz", "Each label against its voxels"]
    {
        assert!(html.contains(part), "{part}");
    }
    assert!(!html.contains("src=\"http") && !html.contains("brain") && html.matches("<svg").count() >= 5);
    fs::remove_file(&out).expect("removed");
    assert!(refusal(&ask).contains("m.html exists already") && !out.exists());
}

#[test]
fn a_grid_without_labels_is_read_as_one_label_with_a_remark() {
    let dir = tempfile::tempdir().expect("temp");
    let [file, out] = ["other.vtu", "out.vtu"].map(|n| dir.path().join(n));
    let mut grid = UnstructuredGrid::from_mesh(&two());
    grid.cell_data[0].name = "region".into();
    fs::write(&file, vtu::encode(&grid)).expect("write");
    let done = json(&["mesh", text(&file), "--out", text(&out)]);
    let said = done["remarks"][0].as_str().expect("a remark");
    assert!(said.contains("only \"region\"") && said.contains("all elements have the label 1"), "{said}");
    assert_eq!(done["labels"][0]["label"], 1);
}

#[test]
fn a_surface_far_from_the_origin_is_refused_where_it_would_collapse() {
    let dir = tempfile::tempdir().expect("temp");
    let [file, ply_out, stl_out] = ["far.vtu", "far.ply", "far.stl"].map(|n| dir.path().join(n));
    let mut far = two();
    far.vertices.iter_mut().for_each(|p| p.x += 1e8);
    fs::write(&file, vtu::encode(&UnstructuredGrid::from_mesh(&far))).expect("write");
    let said = refusal(&["mesh", text(&file), "--out", text(&stl_out)]);
    assert!(said.contains("single precision") && said.contains("write .ply"), "{said}");
    json(&["mesh", text(&file), "--out", text(&ply_out)]);
    assert_eq!(ply::decode(&fs::read(&ply_out).expect("read")).expect("ply"), far.surface(|_| true));
    far.vertices.iter_mut().for_each(|p| p.x += 7e4 + 0.3 - 1e8);
    fs::write(&file, vtu::encode(&UnstructuredGrid::from_mesh(&far))).expect("write");
    let done = json(&["mesh", text(&file), "--out", text(&stl_out)]);
    assert!(done["remarks"].to_string().contains("single precision"), "{done}");
}

/// A ball of label 4 with a smaller one of label 5, voxels of 2 mm.
fn labels(file: &Path) {
    balls(file, [4, 5]);
}

/// A ball of one label with a smaller one of another, voxels of 2 mm.
fn balls(file: &Path, [outer, inner]: [u8; 2]) {
    split_balls(file, [outer, outer, inner]);
}

/// A ball with one label to its right and another to its left, and a smaller one of a third; voxels of 2 mm.
fn split_balls(file: &Path, [right, left, inner]: [u8; 3]) {
    let grid = Grid::axis_aligned([24; 3], [2.0; 3], [-23.0; 3]).expect("grid");
    let at = |n: usize| {
        let [i, j, k] = grid.voxel(n);
        let p = grid.centre(i, j, k);
        match p.distance(Point::ORIGIN) {
            r if r < 10.0 => inner,
            r if r < 20.0 => [right, left][usize::from(p.x > 0.0)],
            _ => 0,
        }
    };
    let volume: Volume<u8> = Volume::new(grid, (0..grid.len()).map(at).collect()).expect("count");
    fs::write(file, nifti::encode_u8(&volume)).expect("write");
}

#[test]
fn parcels_of_an_atlas_were_taken_for_the_ventricles_of_a_case() {
    let dir = tempfile::tempdir().expect("temp");
    let [file, out] = ["labels.nii.gz", "out.vtu"].map(|n| dir.path().join(n));
    let meshed = |more: &[&'static str]| {
        let done = json(&[&["mesh", text(&file), "--elements", "3000", "--force", "--out", text(&out)], more].concat());
        let told = done["remarks"].to_string().contains("5 are ventricles in cases of Monro");
        (done["fine"].clone(), told)
    };
    for (labels, fine, told) in [
        ([4, 4, 5], serde_json::json!([5]), false),
        ([12, 12, 5], serde_json::json!([5, 12]), false),
        ([12, 13, 4], serde_json::json!([4, 12, 13]), false),
        ([12, 4, 5], serde_json::json!([4, 5, 12]), true),
    ] {
        split_balls(&file, labels);
        assert_eq!(meshed(&[]), (fine, told), "{labels:?}");
    }
    assert_eq!(meshed(&["--fine", "5"]), (serde_json::json!([5]), false));
    assert_eq!(meshed(&["--keep", "4,5"]), (serde_json::json!([5]), false));
}

#[test]
fn labels_and_paths_that_are_not_in_the_volume_are_told() {
    let dir = tempfile::tempdir().expect("temp");
    let [file, out] = ["labels.nii.gz", "out.vtu"].map(|n| dir.path().join(n));
    labels(&file);
    let mesh = |more: &[&'static str]| {
        [&["mesh", text(&file), "--elements", "3000", "--force", "--out", text(&out)], more].concat()
    };
    let said = refusal(&mesh(&["--keep", "9"]));
    assert!(said.contains("holds the labels 4, 5"), "{said}");
    let said = refusal(&mesh(&["--keep", "4,x"]));
    assert!(said.contains("\"x\" is no label") && said.contains("as in 4,5"), "{said}");
    let twice = json(&mesh(&["--keep", "4,5,5", "--fine", "5,4,5"]));
    assert_eq!(twice["fine"], serde_json::json!([5, 4]), "{twice}");
    let done = json(&mesh(&["--keep", "4,5,9", "--path", "500,0,0:520,0,0"]));
    let remarks = done["remarks"].as_array().expect("remarks").iter().filter_map(|r| r.as_str()).collect::<Vec<_>>();
    assert!(remarks.iter().any(|r| r.contains("label 9") && r.contains("4, 5")), "{remarks:?}");
    assert!(remarks.iter().any(|r| r.contains("the path passes")), "{remarks:?}");
    // 900 of 1000 mm beside the body were taken without a word.
    let [low, high] = [0, 1].map(|i| &done["bounds_mm"][i]);
    let middle: Vec<f64> =
        (0..3).map(|a| 0.5 * (low[a].as_f64().expect("low") + high[a].as_f64().expect("high"))).collect();
    let path = format!("{},{},{}:1000,0,0", middle[0], middle[1], middle[2]);
    let far = json(&[&mesh(&[])[..], &["--path", &path]].concat());
    assert!(far["remarks"].to_string().contains("outside of all labels"), "{far}");
    let absent = json(&mesh(&["--fine", "8"]));
    assert!(absent["remarks"].to_string().contains("edges are alike everywhere"), "{absent}");
    let outer = &done["outer"];
    assert_eq!((&outer["closed"], &outer["manifold"], &outer["euler"]), (&true.into(), &true.into(), &2.into()));
    let plain = json(&mesh(&["--strict"]));
    assert_eq!(plain["remarks"], serde_json::json!([]));
}

#[test]
fn a_count_that_cannot_be_is_refused_at_once_with_the_limits() {
    for count in ["0", "100", "-5", "x", "99999999999"] {
        let said = refusal(&["mesh", "no-such-file", "--elements", count, "--out", "x.vtu"]);
        assert!(said.contains("500") || said.contains("unexpected argument"), "{count}: {said}");
    }
}

#[test]
fn a_growth_or_a_longest_edge_that_cannot_be_is_refused_at_once_with_the_limits() {
    for (option, value, limits) in [
        ("--growth", "0", "0.01 to 2"),
        ("--growth", "NaN", "0.01 to 2"),
        ("--growth", "fast", "no number"),
        ("--coarsest", "0.5", "1 to 64"),
        ("--coarsest", "inf", "1 to 64"),
    ] {
        let said = refusal(&["mesh", "no-such-file", option, value, "--out", "x.vtu"]);
        assert!(said.contains(limits), "{option} {value}: {said}");
    }
}
