use super::start::Grown;
use super::test_head::head;
use super::thickness::Thin;
use super::*;
use monro_geometry::{Bvh, Grid, Vector};
use proptest::prelude::*;

/// A head's count is met within 2 %; what a random blob may miss is what a mesh is refused beyond.
fn check(mesh: &TetMesh, report: &MeshReport, elements: usize) {
    let miss = mesh.tets.len() as f64 / elements as f64 - 1.0;
    assert!(miss.abs() <= COUNT, "{} for {elements}", mesh.tets.len());
    sound(mesh, report);
}

fn sound(mesh: &TetMesh, report: &MeshReport) {
    mesh.validate().expect("valid");
    let whole = mesh.surface(|_| true).topology();
    assert!(whole.is_closed() && whole.is_oriented(), "{whole:?}");
    for l in report.labels.iter().filter(|_| !report.coarse_regions) {
        assert!(l.surface.closed, "{l:?}");
    }
}

#[test]
fn a_head_with_horns_is_meshed_to_count() {
    let labels = head([0.9; 3]);
    let mut options = MeshOptions::new(&[4, 5, 6, 7], &[5, 6, 7], 37_336);
    options.path = Some([Point::new(30.0, 40.0, 38.0), Point::new(7.0, 15.0, 10.0)]);
    let (mesh, report) = mesh(&labels, &options).expect("mesh");
    if std::env::var_os("MONRO_SHOW").is_some() {
        eprintln!("{report:#?}");
    }
    check(&mesh, &report, options.elements);
    // Solvers need these bounds; where three labels meet they used to be missed (16.5 to 157.9 degrees).
    assert!(report.dihedral_min >= 22.0 && report.dihedral_max <= 155.0, "{report:?}");
    assert!(report.dihedral_p1 >= 28.0 && report.radius_ratio_min >= 0.2, "{report:?}");
    for l in &report.labels {
        assert!(l.surface.manifold && l.volume_error.abs() < 0.01, "{l:?}");
    }
    // As in the paper; the path had 3.5 mm beside 2.4 around the labels.
    assert!(report.core_edge_mean < 3.0 && report.path_edge_mean.is_some_and(|mean| mean < 3.0), "{report:?}");
}

/// The head in voxels of 0.9 mm, each with the label that is made of its place and its own.
fn changed_head(label: impl Fn([f64; 3], u8) -> u8) -> Volume<u8> {
    let mut labels = head([0.9; 3]);
    let grid = *labels.grid();
    for at in 0..grid.len() {
        let [i, j, k] = grid.voxel(at);
        let own = labels.data()[at];
        labels.data_mut()[at] = label(grid.centre(i, j, k).to_array(), own);
    }
    labels
}

/// Its outer surface has folds of up to a quarter of its radius, so many radians of them a mm.
fn folded_head(f: f64) -> Volume<u8> {
    changed_head(|[x, y, z], label| {
        let folds = 0.25 * ((f * x).sin() * (f * y).sin() * (f * z).sin()).abs();
        if label == 4 && (x / 60.0).hypot(y / 75.0).hypot(z / 55.0) > 1.0 - folds { 0 } else { label }
    })
}

#[test]
fn more_than_one_in_a_hundred_angles_of_a_coarse_mesh_were_below_28_degrees() {
    let options = MeshOptions::new(&[4, 5, 6, 7], &[5, 6, 7], 12_000);
    let (mesh, report) = mesh(&folded_head(0.45), &options).expect("mesh");
    check(&mesh, &report, options.elements);
    // It was 27.85 degrees.
    assert!(report.dihedral_p1 >= 28.0, "{report:?}");
}

#[test]
fn the_last_elements_that_flips_and_moves_do_not_better_get_points_put_in() {
    let options = MeshOptions::new(&[4, 5, 6, 7], &[5, 6, 7], 14_000);
    let (mesh, report) = mesh(&folded_head(0.55), &options).expect("mesh");
    check(&mesh, &report, options.elements);
    // Elements had a radius ratio of 0.167, after surfaces had been given way for them.
    assert!(report.radius_ratio_min >= 0.2 && report.dihedral_min >= 22.0, "{report:?}");
}

#[test]
fn a_head_with_folds_was_meshed_twice() {
    // Edges that cut corners of a rough surface are split in the end: some 2.5 % more elements than wanted, and all of it was done
    // again with fewer in mind, for twice the time.
    let labels = folded_head(0.45);
    let options = MeshOptions::new(&[4, 5, 6, 7], &[5, 6, 7], 65_691);
    let mut coarsened = 0;
    let observe = |stage| coarsened += usize::from(stage == Stage::Coarsen);
    let (mesh, report) = mesh_observed(&labels, &options, observe).expect("mesh");
    check(&mesh, &report, options.elements);
    assert_eq!(coarsened, 1);
    assert!(report.dihedral_min >= 22.0 && report.dihedral_max <= 155.0, "{report:?}");
    assert!(report.dihedral_p1 >= 28.0 && report.radius_ratio_min >= 0.2, "{report:?}");
    assert!(report.labels.iter().all(|l| l.surface.manifold && l.volume_error.abs() < 0.01), "{report:?}");
}

#[test]
fn layers_as_thick_as_an_element_were_torn_beside_the_largest_one() {
    // A ball of nine layers three voxels thick, the largest in the middle. Labels were cut off in the order of their numbers, so
    // the one above the largest lost both its surfaces at once: 0.5 mm off on average, up to 2.9 mm, for 0.1 and 0.7.
    let grid = Grid::axis_aligned([60; 3], [1.0; 3], [0.0; 3]).expect("grid");
    let layer = |at| {
        let [i, j, k] = grid.voxel(at);
        let own = ((k as f64 - 30.0) / 3.0).floor() + 5.0;
        let inside = (grid.centre(i, j, k) - Point::new(30.0, 30.0, 30.0)).norm() < 28.0;
        if inside && (1.0..10.0).contains(&own) { own as u16 } else { 0 }
    };
    let labels = Volume::new(grid, (0..grid.len()).map(layer).collect()).expect("count");
    let keep: Vec<u16> = (1..10).collect();
    let (_, report) = mesh(&labels, &MeshOptions::new(&keep, &keep, 20_677)).expect("mesh");
    assert!(!report.coarse_regions && report.all_remarks().is_empty(), "{:?}", report.all_remarks());
    assert!(report.labels.iter().map(|l| l.label).eq(keep), "{:?}", report.labels);
    for l in &report.labels {
        let off = l.interface.expect("a surface");
        assert!(off.mean < 0.2 && off.max < 1.2, "label {}: {off:?}", l.label);
    }
}

#[test]
fn an_onion_with_a_small_core_lost_all_of_its_surfaces() {
    // Six shells of four voxels or more around a core of eight, whose edges are six: coarse regions at 20,000 to 65,000 elements,
    // and none where the core was of five, nine or ten.
    let grid = Grid::axis_aligned([88; 3], [1.0; 3], [0.0; 3]).expect("grid");
    let shell = |at| {
        let [i, j, k] = grid.voxel(at);
        let r = (grid.centre(i, j, k) - Point::new(43.5, 43.5, 43.5)).norm();
        [42.0, 38.0, 34.0, 30.0, 26.0, 22.0, 8.0].iter().filter(|&&outer| r < outer).count() as u16
    };
    let labels = Volume::new(grid, (0..grid.len()).map(shell).collect()).expect("count");
    let keep: Vec<u16> = (1..8).collect();
    let (_, report) = mesh(&labels, &MeshOptions::new(&keep, &keep, 20_000)).expect("mesh");
    assert!(!report.coarse_regions, "{:?}", report.all_remarks());
    for l in &report.labels {
        assert!(l.volume_error.abs() < 0.01 && l.surface.euler == l.surface.euler_labels, "{l:?}");
    }
}

/// Labels 1 to `sites` in cells around points of a cube of `n` mm, in voxels of 1 mm.
struct Cells {
    n: usize,
    sites: usize,
}

impl Cells {
    fn site(&self, i: usize) -> [f64; 3] {
        [0.819_173, 0.671_044, 0.549_700].map(|g| (0.31 + g * i as f64).fract() * self.n as f64)
    }

    fn nearest(&self, p: [f64; 3]) -> usize {
        let off = |i: &usize| d3::distance(self.site(*i), p);
        (0..self.sites).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(0)
    }

    fn labels(&self) -> Volume<u16> {
        let grid = Grid::axis_aligned([self.n; 3], [1.0; 3], [0.5; 3]).expect("grid");
        let label = |at| {
            let [i, j, k] = grid.voxel(at);
            self.nearest(grid.centre(i, j, k).to_array()) as u16 + 1
        };
        Volume::new(grid, (0..grid.len()).map(label).collect()).expect("count")
    }

    fn keep(&self) -> Vec<u16> {
        (1..=self.sites as u16).collect()
    }
}

#[test]
fn the_largest_label_turned_up_where_others_meet_far_from_it() {
    // Where three or four cells met, rounding left elements to the largest, up to its whole distance off.
    let cells = Cells { n: 54, sites: 20 };
    let (mesh, _) = mesh(&cells.labels(), &MeshOptions::new(&cells.keep(), &[1], 20_677)).expect("mesh");
    let middle = |t: usize| mesh.corners(t).iter().fold([0.0; 3], |s, p| d3::add(s, d3::scale(p.to_array(), 0.25)));
    // How much nearer to another point than to its own.
    let off = |t: usize| {
        let (p, own) = (middle(t), usize::from(mesh.labels[t]) - 1);
        d3::distance(cells.site(own), p) - d3::distance(cells.site(cells.nearest(p)), p)
    };
    let most = (0..mesh.tets.len()).map(off).fold(0.0, f64::max);
    assert!(most < 4.0, "{most}");
}

#[test]
fn where_many_labels_meet_the_count_was_missed_and_all_was_made_again() {
    // Bad elements of the cuts were merged after the count had been met, 5 % of all.
    let cells = Cells { n: 70, sites: 30 };
    let mut coarsened = 0;
    let observe = |stage| coarsened += usize::from(stage == Stage::Coarsen);
    let options = MeshOptions::new(&cells.keep(), &cells.keep(), 80_000);
    let (mesh, report) = mesh_observed(&cells.labels(), &options, observe).expect("mesh");
    check(&mesh, &report, options.elements);
    assert!(coarsened == 1 && !report.coarse_regions, "{coarsened} {:?}", report.all_remarks());
    assert!(report.dihedral_min >= 22.0 && report.dihedral_max <= 155.0, "{report:?}");
}

#[test]
fn cuts_between_two_labels_lay_a_cell_inside_one_that_was_cut_off_before() {
    // An edge along the surface of a convex label runs inside it. Where no later label is left there, the cut between these lay
    // where one of them ends and not where they meet: a tenth of all points of surfaces were off by a quarter of an edge.
    let cells = Cells { n: 54, sites: 20 };
    let labels = cells.labels();
    let fields = LabelFields::new(&labels, &cells.keep()).expect("fields");
    let options = MeshOptions::new(&cells.keep(), &cells.keep(), 20_677);
    let size = SizeField::new(&fields, &(0..20).collect::<Vec<_>>(), &options).expect("size");
    let raw = Grown::new(&fields, &size, &Thin::none(), 4.0).tree.cut(&Thin::none(), &fields);
    let mut around: Vec<Vec<u8>> = vec![Vec::new(); raw.points.len()];
    for (t, &label) in raw.tets.iter().zip(&raw.labels) {
        t.iter().for_each(|&v| around[v as usize].push(label));
    }
    let (mut count, mut off) = (0, 0);
    for (mut at, &p) in around.into_iter().zip(&raw.points) {
        at.sort_unstable();
        at.dedup();
        if let [a, b] = at[..]
            && fields.union.at(p) > 0.9
        {
            count += 1;
            off += usize::from(fields.between(a, Some(b), p).0.abs() > 0.02);
        }
    }
    assert!(count > 1000 && off * 100 < count, "{off} of {count}");
}

#[test]
fn where_labels_meet_thin_wedges_left_something_to_the_largest_one_far_off() {
    // Told as "34 mm apart", at a point where three others met.
    let cells = Cells { n: 54, sites: 20 };
    let fields = LabelFields::new(&cells.labels(), &cells.keep()).expect("fields");
    let last = usize::from(fields.labels[19]) - 1;
    let grid = fields.union.volume().grid();
    // More than the reach of the smoothing from the last one.
    let far = |p: [f64; 3]| {
        let other = d3::distance(cells.site(cells.nearest(p)), p);
        d3::distance(cells.site(last), p) - other > 8.0
    };
    let places = (0..grid.len()).map(|at| grid.voxel(at)).map(|[i, j, k]| grid.centre(i, j, k).to_array());
    let rest: Vec<f64> = places.filter(|&p| far(p) && fields.union.at(p) > 0.5).map(|p| fields.rest(p)).collect();
    let most = rest.iter().copied().fold(0.0, f64::max);
    assert!(rest.len() > 10_000 && most < 0.1, "{most}");
}

#[test]
fn strong_growth_of_edges_stepped_over_what_is_fine() {
    // The first cells of the lattice are as large as the whole: edges as long were wanted in their middles, and they were not
    // split. "Too thin or too small", or half a minute for lattices of millions of elements.
    let grid = Grid::axis_aligned([120, 70, 60], [1.0; 3], [-59.5, -34.5, -29.5]).expect("grid");
    let label = |at| {
        let [x, y, z] = grid.centre(grid.voxel(at)[0], grid.voxel(at)[1], grid.voxel(at)[2]).to_array();
        let inside = (x / 55.0).hypot(y / 32.0).hypot(z / 26.0) < 1.0;
        u8::from(inside) + u8::from((x - 44.0).hypot(y).hypot(z) < 6.0)
    };
    let labels = Volume::new(grid, (0..grid.len()).map(label).collect()).expect("count");
    let mut options = MeshOptions::new(&[1, 2], &[2], 8_000);
    (options.growth, options.coarsest) = (2.0, 64.0);
    let fields = LabelFields::new(&labels, &options.keep).expect("fields");
    let of = fields.labels.iter().position(|&l| l == 2).expect("there");
    let size = SizeField::new(&fields, &[of], &options).expect("size");
    for finest in [1.0, 2.0, 3.0] {
        let raw = Grown::new(&fields, &size, &Thin::none(), finest).tree.cut(&Thin::none(), &fields);
        let volume = |t: &[u32; 4]| d3::volume6(t.map(|v| raw.points[v as usize])) / 6.0;
        let own = raw.tets.iter().zip(&raw.labels).filter(|(_, l)| usize::from(**l) == of);
        let found: f64 = own.map(|(t, _)| volume(t)).sum();
        assert!(
            (found / fields.volumes[of] - 1.0).abs() < 0.15,
            "finest {finest}: {found} mm3, {} tets",
            raw.tets.len()
        );
    }
    let (mesh, report) = mesh(&labels, &options).expect("mesh");
    check(&mesh, &report, options.elements);
    assert!(!report.coarse_regions && report.dihedral_min >= 22.0, "{report:?}");
}

#[test]
fn the_horns_stay_at_a_few_thousand_elements() {
    // Horn tips and the third ventricle used to be merged away below 20,000 elements.
    let options = MeshOptions::new(&[4, 5, 6, 7], &[5, 6, 7], 5_824);
    let (mesh, report) = mesh(&head([0.9; 3]), &options).expect("mesh");
    check(&mesh, &report, options.elements);
    assert!(!report.coarse_regions && report.dihedral_min >= 12.0, "{report:?}");
    for l in &report.labels {
        let off = l.interface.expect("a surface");
        assert!(l.surface.manifold && l.volume_error.abs() < 0.01 && off.mean < 0.8 && off.max < 4.0, "{l:?}");
    }
}

#[test]
fn too_few_elements_leave_coarse_regions_and_say_so() {
    let options = MeshOptions::new(&[4, 5, 6, 7], &[5, 6, 7], 612);
    let (mesh, report) = mesh(&head([1.8; 3]), &options).expect("mesh");
    check(&mesh, &report, options.elements);
    assert!(report.coarse_regions && report.remarks.iter().any(|r| r.contains("coarse regions")), "{report:?}");
    assert!(report.labels.iter().all(|l| l.elements > 0), "{report:?}");
}

#[test]
fn a_denser_label_gets_more_elements_at_the_same_count() {
    let labels = head([1.8; 3]);
    let count = |density: Vec<(u16, f64)>| {
        let options = MeshOptions { density, ..MeshOptions::new(&[4, 5, 6, 7], &[], 20_000) };
        let (mesh, _) = mesh(&labels, &options).expect("mesh");
        mesh.labels.iter().filter(|&&l| l == 5).count() as f64
    };
    let (plain, dense) = (count(Vec::new()), count(vec![(5, 4.0)]));
    // Four times, less what the growth of edges from a structure of some millimetres takes back at its border.
    assert!(dense > 1.8 * plain, "{plain} and {dense}");
}

/// Labels 1 to 3 as overlapping boxes in a small volume: thin sheets, touching labels, single voxels, the border.
fn boxes(parts: &[([usize; 3], [usize; 3], u8)], thick: f64) -> Volume<u8> {
    let grid = Grid::axis_aligned([16, 16, 12], [1.0, 1.0, thick], [0.0; 3]).expect("grid");
    let mut volume = Volume::filled(grid, 0);
    for &(from, size, label) in parts {
        for at in 0..grid.len() {
            let v = grid.voxel(at);
            if (0..3).all(|a| v[a] >= from[a] && v[a] < from[a] + size[a]) {
                volume.data_mut()[at] = label;
            }
        }
    }
    volume
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4))]
    #[test]
    fn random_blobs_give_manifolds_or_a_named_error(
        parts in proptest::collection::vec(
            (proptest::array::uniform3(0..12usize), proptest::array::uniform3(1..9usize), 1..4u8), 1..7),
        thick in 0.8..2.5f64,
    ) {
        let mut options = MeshOptions::new(&[1, 2, 3], &[2, 3], 1_000);
        options.strict = true;
        match mesh(&boxes(&parts, thick), &options) {
            Ok((mesh, report)) => {
                prop_assert!((mesh.tets.len() as f64 / options.elements as f64 - 1.0).abs() <= ACCEPTED);
                sound(&mesh, &report);
            }
            Err(e) => {
                use MeshError::{ClosedGaps, Count, Empty, Euler, Far, Lost, Overlap, SelfCrossing, Shape, TooFew, TooThin, Topology, Torn, Volume};
                let named = matches!(
                    e,
                    Count { .. } | Empty { .. } | Euler { .. } | Lost { .. } | Shape { .. } | TooThin { .. } | TooFew { .. } | ClosedGaps(_) | Overlap(_) | SelfCrossing(_)
                        | Topology { .. } | Torn { .. } | Far { .. } | Volume { .. }
                );
                prop_assert!(named, "{e}");
            }
        }
    }
}

#[test]
fn the_same_input_gives_the_same_bits_on_any_number_of_threads() {
    let labels = head([1.8; 3]);
    let options = MeshOptions::new(&[4, 5, 6, 7], &[5, 6, 7], 8_000);
    let run = |n| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("pool");
        pool.install(|| mesh(&labels, &options)).expect("mesh").0
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn nothing_to_keep_and_odd_options_are_named() {
    let labels = head([4.0; 3]);
    let none = mesh(&labels, &MeshOptions::new(&[9], &[], 1_000));
    assert!(matches!(none, Err(MeshError::Empty { .. })));
    let mut options = MeshOptions::new(&[4], &[], 5);
    assert!(matches!(mesh(&labels, &options), Err(MeshError::Option { name: "elements", .. })));
    options = MeshOptions::new(&[4], &[], 1_000);
    options.density = vec![(4, 0.0)];
    assert!(matches!(mesh(&labels, &options), Err(MeshError::Option { name: "density", .. })));
    options = MeshOptions::new(&[4], &[], 1_000);
    options.growth = f64::NAN;
    assert!(matches!(mesh(&labels, &options), Err(MeshError::Option { name: "growth", .. })));
}

#[test]
fn a_recess_thinner_than_the_elements_is_followed_to_its_end() {
    // Two voxels thick, 14 mm long, from the third ventricle upwards: such ended 3 to 7 mm early, or as beads.
    let labels = changed_head(
        |[x, y, z], label| {
            if x.abs() < 1.0 && (y - 14.0).abs() < 1.0 && z > 18.0 && z < 35.0 { 7 } else { label }
        },
    );
    let grid = *labels.grid();
    let top = |points: &mut dyn Iterator<Item = f64>| points.fold(f64::NEG_INFINITY, f64::max);
    let voxels = (0..grid.len()).filter(|&at| labels.data()[at] == 7).map(|at| grid.voxel(at));
    let wanted = top(&mut voxels.map(|[i, j, k]| grid.centre(i, j, k).z + 0.45));
    for elements in [20_677, 65_691] {
        let options = MeshOptions::new(&[4, 5, 6, 7], &[5, 6, 7], elements);
        let (mesh, report) = mesh(&labels, &options).expect("mesh");
        check(&mesh, &report, elements);
        let third = report.labels.iter().find(|l| l.label == 7).expect("there");
        assert!(third.surface.surfaces == 1 && third.surface.euler == 2 && third.surface.manifold, "{third:?}");
        let found = top(&mut mesh.surface(|l| l == 7).vertices.iter().map(|p| p.z));
        assert!((found - wanted).abs() < 1.5, "{elements}: {found} for {wanted}");
    }
}

/// A ball of radius 14 voxels in a volume of 40 of them, labelled by the place of each voxel from the middle, in voxels.
fn ball(spacing: f64, label: impl Fn([f64; 3]) -> u8) -> Volume<u8> {
    let grid = Grid::axis_aligned([40; 3], [spacing; 3], [-19.5 * spacing; 3]).expect("grid");
    let of = |at| {
        let p = grid.voxel(at).map(|i| i as f64 - 19.5);
        if p.iter().map(|x| x * x).sum::<f64>() < 14.0 * 14.0 { label(p) } else { 0 }
    };
    Volume::new(grid, (0..grid.len()).map(of).collect()).expect("count")
}

#[test]
fn labels_that_meet_in_a_plane_of_the_lattice_have_good_elements() {
    // The middle plane of what is meshed holds points of the lattice, on which rounding alone tells the sides: half a minute,
    // then a hundred elements of angles from 0 to 180 degrees, some turned inside out.
    let quarters = ball(1.0, |[x, y, _]| 1 + u8::from(x > 0.0) + 2 * u8::from(y > 0.0));
    let (mesh, report) = mesh(&quarters, &MeshOptions::new(&[1, 2, 3, 4], &[1, 2, 3, 4], 8_000)).expect("mesh");
    sound(&mesh, &report);
    assert!(!report.coarse_regions && report.dihedral_min >= 22.0 && report.dihedral_max <= 155.0, "{report:?}");
    assert!(report.labels.iter().all(|l| l.volume_error.abs() < 0.01 && l.surface.euler == 2), "{report:?}");
}

#[test]
fn nested_labels_numbered_from_outside_got_each_other_s_volumes() {
    let grid = Grid::axis_aligned([64; 3], [1.0; 3], [-31.5; 3]).expect("grid");
    let radii = [29.0, 23.0, 17.0, 9.0];
    let label = |from_outside: bool, at: usize| {
        let [i, j, k] = grid.voxel(at);
        let shells = radii.iter().filter(|&&r| grid.centre(i, j, k).distance(Point::ORIGIN) < r).count() as u8;
        if from_outside || shells == 0 { shells } else { 5 - shells }
    };
    for (from_outside, elements) in [(true, 20_000), (true, 60_000), (false, 20_000)] {
        let data = (0..grid.len()).map(|at| label(from_outside, at)).collect();
        let labels = Volume::new(grid, data).expect("count");
        let all = [1, 2, 3, 4];
        let (mesh, report) = mesh(&labels, &MeshOptions::new(&all, &all, elements)).expect("mesh");
        check(&mesh, &report, elements);
        assert!(!report.coarse_regions, "{elements}: {report:?}");
        for l in &report.labels {
            assert!(l.volume_error.abs() < 1e-3 && l.interface.is_some_and(|i| i.max < 1.0), "{elements}: {l:?}");
        }
    }
}

#[test]
fn metres_and_microns_are_meshed_like_millimetres() {
    // A ball of 28 m took tens of gigabytes, one of 28 um had 24 elements at most.
    for spacing in [1000.0, 60.0, 0.001] {
        let labels = ball(spacing, |[x, y, z]| 1 + u8::from(x.hypot(y).hypot(z) < 7.0));
        let (mesh, report) = mesh(&labels, &MeshOptions::new(&[1, 2], &[2], 8_000)).expect("mesh");
        check(&mesh, &report, 8_000);
        assert!(!report.coarse_regions && report.dihedral_min >= 22.0 && report.all_remarks().is_empty(), "{report:?}");
        let off = report.labels.iter().filter_map(|l| l.interface).fold(0.0, |worst, i| i.mean.max(worst));
        assert!(off < 0.3 * spacing, "{off} of {spacing}");
    }
}

#[test]
fn thick_slices_keep_balls_of_a_few_slices() {
    // Caps ended right behind the last slice: two balls over three and four slices lost so much of their volume that they
    // became coarse regions, whatever the number of elements.
    let grid = Grid::axis_aligned([80, 60, 16], [1.0, 1.0, 6.0], [-39.5, -29.5, -45.0]).expect("grid");
    let label = |at| {
        let [x, y, z] = grid.centre(grid.voxel(at)[0], grid.voxel(at)[1], grid.voxel(at)[2]).to_array();
        let ball = |centre: f64, radius: f64| (x - centre).hypot(y).hypot(z) < radius;
        match () {
            () if ball(-12.0, 8.0) => 2u8,
            () if ball(12.0, 10.0) => 3,
            () => u8::from((x / 36.0).hypot(y / 26.0).hypot(z / 40.0) < 1.0),
        }
    };
    let labels = Volume::new(grid, (0..grid.len()).map(label).collect()).expect("count");
    let (mesh, report) = mesh(&labels, &MeshOptions::new(&[1, 2, 3], &[2, 3], 10_000)).expect("mesh");
    check(&mesh, &report, 10_000);
    assert!(!report.coarse_regions, "{report:?}");
    assert!(report.labels.iter().all(|l| l.volume_error.abs() < 0.01 && l.surface.manifold), "{report:?}");
}

#[test]
fn more_than_sixty_labels_are_meshed() {
    let labels = ball(1.0, |p| {
        let [i, j, k] = p.map(|x| ((x + 14.0) / 5.7) as u8);
        1 + i + 5 * j + 25 * k
    });
    let mut all: Vec<u16> = labels.data().iter().map(|&l| u16::from(l)).filter(|&l| l > 0).collect();
    all.sort_unstable();
    all.dedup();
    assert!(all.len() > 64, "{}", all.len());
    let (mesh, report) = mesh(&labels, &MeshOptions::new(&all, &all, 20_000)).expect("mesh");
    check(&mesh, &report, 20_000);
    assert_eq!(report.labels.len(), all.len());
    let refused =
        super::mesh(&labels, &MeshOptions::new(&(1..300).collect::<Vec<_>>(), &[], 5_000)).expect_err("too many");
    assert_eq!(refused, MeshError::TooManyLabels(299));
}

#[test]
fn a_path_changed_nothing_among_labels_that_are_all_fine() {
    let labels = ball(1.0, |_| 1);
    let path = [Point::new(0.0, 0.0, 14.0), Point::new(0.0, 0.0, 0.0)];
    let options = MeshOptions { path: Some(path), ..MeshOptions::new(&[1], &[1], 1_500) };
    let (_, report) = mesh(&labels, &options).expect("mesh");
    let along = report.path_edge_mean.expect("along the path");
    assert!(along < 0.85 * report.core_edge_mean, "{along} of {}", report.core_edge_mean);
}

#[test]
fn where_thin_labels_took_the_elements_a_path_was_left_with_edges_of_eight_millimetres() {
    // The slits take so many that the count affords no more than long edges elsewhere.
    let slit = |x: f64, y: f64| (0..3).any(|i| (x - 8.0 * f64::from(i) + 8.0).abs() < 1.4) && y.abs() < 40.0;
    let labels = changed_head(|[x, y, z], label| if label == 4 && slit(x, y) && z < 5.0 { 5 } else { label });
    let path = [Point::new(30.0, 40.0, 38.0), Point::new(7.0, 15.0, 10.0)];
    let options = MeshOptions { path: Some(path), ..MeshOptions::new(&[4, 5, 6, 7], &[5, 6, 7], 37_336) };
    let (_, report) = mesh(&labels, &options).expect("mesh");
    assert!((report.elements as f64 / 37_336.0 - 1.0).abs() < 0.02, "{}", report.elements);
    assert!(report.path_edge_mean.is_some_and(|mean| mean < 3.5), "{:?}", report.path_edge_mean);
}

/// Chords lie within a lumen, and what was won there was given on the outside: 74, 78 and 88 % of the section were left.
#[test]
fn a_lumen_that_leads_out_of_a_ball_keeps_its_section() {
    let grid = Grid::axis_aligned([64; 3], [1.0; 3], [-31.5; 3]).expect("grid");
    let radius = 3.0;
    let label = |at: usize| {
        let [x, y, z] = grid.voxel(at).map(|i| i as f64 - 31.5);
        4 * u8::from(x.hypot(y).hypot(z) < 27.0 && (x - 1.3).hypot(y + 0.7) >= radius)
    };
    let labels = Volume::new(grid, (0..grid.len()).map(label).collect()).expect("count");
    for (elements, least) in [(5_824, 0.87), (20_677, 0.88), (65_691, 0.92)] {
        let (mesh, report) = mesh(&labels, &MeshOptions::new(&[4], &[4], elements)).expect("a mesh");
        assert!(report.labels[0].volume_error.abs() < 1e-3, "{report:?}");
        let wall = Bvh::new(&mesh.surface(|_| true));
        let (mut sum, mut count) = (0.0, 0.0);
        for (z, turn) in (-13..=13).flat_map(|z| (0..48).map(move |turn| (z, turn))) {
            let angle = f64::from(turn) * core::f64::consts::TAU / 48.0;
            let from = Point::new(1.3, -0.7, f64::from(z) + 0.37);
            let hit = wall.ray(from, Vector::new(angle.cos(), angle.sin(), 0.0)).expect("a wall");
            sum += hit.t * hit.t;
            count += 1.0;
        }
        let section = sum / count / (radius * radius);
        println!("{elements}: {section}");
        assert!((least..1.03).contains(&section), "{elements}: {section}");
    }
}

/// Two labels and the outside meet in long lines. Merged across them, surfaces met themselves, and mending that gave elements by the
/// hundred to the other label: volumes 3 % off at this count, 37 % in a larger block, and a sixth of the handles gone.
#[test]
fn two_labels_that_fill_a_block_keep_their_handles_and_volumes() {
    let grid = Grid::axis_aligned([44; 3], [1.0; 3], [0.0; 3]).expect("grid");
    let gyroid = |at: usize| {
        let [x, y, z] = grid.voxel(at).map(|i| i as f64 * core::f64::consts::TAU / 22.0);
        1 + u8::from(x.sin() * y.cos() + y.sin() * z.cos() + z.sin() * x.cos() > 0.0)
    };
    let labels = Volume::new(grid, (0..grid.len()).map(gyroid).collect()).expect("count");
    for elements in [1_500, 2_500] {
        let (mesh, report) = mesh(&labels, &MeshOptions::new(&[1, 2], &[], elements)).expect("a mesh");
        check(&mesh, &report, elements);
        assert!(!report.coarse_regions);
        for l in &report.labels {
            assert!(l.volume_error.abs() < 0.01, "label {} at {elements}: {}", l.label, l.volume_error);
            assert_eq!(l.surface.euler, l.surface.euler_labels, "label {} at {elements}", l.label);
        }
    }
}
