//! What the phantoms promise, checked over seeds.

use super::*;
use monro_geometry::Structure;

fn coarse(seed: u64) -> HeadOptions {
    HeadOptions { seed, spacing_mm: [2.5, 2.5, 2.5], ..HeadOptions::default() }
}

fn millilitres(p: &Phantom, s: Structure) -> f64 {
    let count = p.labels.data().iter().filter(|&&l| l == s.label()).count();
    count as f64 * p.labels.grid().voxel_volume() / 1000.0
}

/// Mean density of the voxels of a structure whose six neighbours are the same structure.
fn core_density(p: &Phantom, s: Structure) -> f64 {
    let g = p.labels.grid();
    let [nx, ny, nz] = g.dims();
    let (mut sum, mut count) = (0.0, 0.0);
    for n in 0..g.len() {
        let [i, j, k] = g.voxel(n);
        let inner = i > 0 && j > 0 && k > 0 && i + 1 < nx && j + 1 < ny && k + 1 < nz;
        let steps = [1, nx, nx * ny];
        if inner && steps.iter().all(|d| [n - d, n, n + d].iter().all(|&m| p.labels.data()[m] == s.label())) {
            sum += f64::from(p.ct.data()[n]);
            count += 1.0;
        }
    }
    sum / count
}

#[test]
fn heads_of_many_seeds_have_adult_volumes() {
    for seed in 0..6 {
        let p = head(&coarse(seed)).expect("grid");
        let brain = millilitres(&p, Structure::Brain);
        let (left, right) =
            (millilitres(&p, Structure::LeftLateralVentricle), millilitres(&p, Structure::RightLateralVentricle));
        assert!((1000.0..1600.0).contains(&brain), "seed {seed}: brain {brain}");
        assert!((7.0..45.0).contains(&left) && (7.0..45.0).contains(&right), "seed {seed}: {left} {right}");
        let third = millilitres(&p, Structure::ThirdVentricle);
        assert!((1.0..5.0).contains(&third), "seed {seed}: third {third}");
        assert!((400.0..950.0).contains(&millilitres(&p, Structure::Skull)), "seed {seed}");
    }
}

#[test]
fn tissue_densities_are_those_of_a_head_ct() {
    let p = head(&HeadOptions {
        spacing_mm: [1.2; 3],
        ventricle_width: Some(1.3),
        head_rest: false,
        ..HeadOptions::default()
    })
    .expect("grid");
    for (s, low, high) in [
        (Structure::Outside, -1001.0, -990.0),
        (Structure::Skull, 600.0, 1300.0),
        (Structure::Brain, 28.0, 36.0),
        (Structure::LeftLateralVentricle, 4.0, 9.0),
        (Structure::RightLateralVentricle, 4.0, 9.0),
        (Structure::ThirdVentricle, 4.0, 9.0),
    ] {
        let mean = core_density(&p, s);
        assert!(low < mean && mean < high, "{s:?}: {mean} HU");
    }
}

#[test]
fn labels_are_the_analytic_structure_at_each_voxel() {
    let options = coarse(4);
    let (p, model) = (head(&options).expect("grid"), HeadModel::new(&options));
    let g = p.labels.grid();
    for n in (0..g.len()).step_by(37) {
        let [i, j, k] = g.voxel(n);
        assert_eq!(p.labels.data()[n], model.structure_at(g.centre(i, j, k)).label(), "voxel {i} {j} {k}");
    }
}

#[test]
fn distances_agree_with_labels_and_change_by_a_millimetre_per_millimetre() {
    let model = HeadModel::new(&coarse(5));
    let left = landmarks::find(&model, Ventricles::left_foramen()).monro_left;
    let mut checked = 0;
    for n in 0..40_000u32 {
        let offset = [n % 41, n / 41 % 31, n / 1271].map(|v| f64::from(v) * 3.1);
        let p = Point::new(left.x - 60.0 + offset[0], left.y - 50.0 + offset[1], left.z - 45.0 + offset[2]);
        let d = model.ventricle_distance(p);
        assert_eq!(d < 0.0, model.structure_at(p).is_ventricle(), "{p:?}");
        if d.abs() < 2.0 {
            let h = 0.05;
            let slope = |dx, dy, dz| {
                let (a, b) = (Point::new(p.x + dx, p.y + dy, p.z + dz), Point::new(p.x - dx, p.y - dy, p.z - dz));
                (model.ventricle_distance(a) - model.ventricle_distance(b)) / (2.0 * h)
            };
            let gradient = slope(h, 0.0, 0.0).hypot(slope(0.0, h, 0.0)).hypot(slope(0.0, 0.0, h));
            checked += usize::from((0.75..1.25).contains(&gradient));
            checked += 10_000;
        }
    }
    let (near, good) = (checked / 10_000, checked % 10_000);
    assert!(near > 500 && good as f64 > 0.95 * near as f64, "{good} of {near}");
}

#[test]
fn landmarks_lie_on_the_skin_and_at_the_foramina() {
    for seed in 0..6 {
        let model = HeadModel::new(&coarse(seed));
        let l = landmarks::find(&model, Ventricles::left_foramen());
        for p in [l.nasion, l.midline_110mm, l.kocher_left, l.kocher_right] {
            assert!(
                model.skin_distance(p).abs() < 0.3,
                "seed {seed}: {p:?} is {} off the skin",
                model.skin_distance(p)
            );
        }
        // An arc of 110 mm over a head spans a chord of 90 to 110 mm, one of 30 mm nearly its length.
        assert!((90.0..110.0).contains(&l.nasion.distance(l.midline_110mm)), "seed {seed}");
        for side in [l.kocher_left, l.kocher_right] {
            assert!((28.0..30.01).contains(&side.distance(l.midline_110mm)), "seed {seed}");
        }
        assert!(l.kocher_left.x > l.kocher_right.x && l.monro_left.x > l.monro_right.x);
        for p in [l.monro_left, l.monro_right] {
            assert!(model.ventricle_distance(p) < -1.5, "seed {seed}: the foramen is open");
        }
        let depth = l.kocher_left.distance(l.monro_left);
        assert!((60.0..95.0).contains(&depth), "seed {seed}: {depth} mm from Kocher's point to the foramen");
    }
}

#[test]
fn the_nasion_is_a_hollow_between_brow_and_nose() {
    for seed in 0..6 {
        let model = HeadModel::new(&HeadOptions { turn_deg: Some([0.0; 3]), ..coarse(seed) });
        let n = landmarks::find(&model, Ventricles::left_foramen()).nasion;
        // Skin 12 mm above and below stands further forward.
        for dz in [12.0, -14.0] {
            let ahead = Point::new(n.x, n.y - 1.5, n.z + dz);
            assert!(model.skin_distance(ahead) < 0.0, "seed {seed}, {dz} mm: {}", model.skin_distance(ahead));
        }
    }
}

#[test]
fn the_vault_is_closed_and_no_ventricle_touches_its_csf() {
    let p = head(&HeadOptions { spacing_mm: [1.8; 3], ..HeadOptions::default() }).expect("grid");
    let [nx, ny, nz] = p.labels.grid().dims();
    let steps = [1, nx, nx * ny];
    let data = p.labels.data();
    let monro = p.labels.grid().containing(p.landmarks.monro_left).expect("inside");
    for n in 0..data.len() {
        let [i, j, k] = p.labels.grid().voxel(n);
        if i + 1 == nx || j + 1 == ny || k + 1 == nz {
            continue;
        }
        for m in steps.map(|s| n + s) {
            let pair = [data[n].min(data[m]), data[n].max(data[m])];
            let inside = Structure::from_label(pair[1]).expect("label").is_intracranial();
            assert!(!(inside && pair[0] < 2 && k > monro[2]), "the vault is open at {i} {j} {k}: {pair:?}");
            assert!(!(pair[0] == 3 && pair[1] >= 5), "a ventricle opens into a cistern at {i} {j} {k}: {pair:?}");
            assert_ne!(pair, [5, 6], "the septum is open at {i} {j} {k}");
        }
    }
}

#[test]
fn the_same_seed_gives_the_same_bits_on_any_number_of_threads() {
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("pool");
    let three = rayon::ThreadPoolBuilder::new().num_threads(3).build().expect("pool");
    let a = one.install(|| head(&coarse(9))).expect("grid");
    let b = three.install(|| head(&coarse(9))).expect("grid");
    assert_eq!((a.ct.data(), a.labels.data()), (b.ct.data(), b.labels.data()));
    let other = head(&coarse(10)).expect("grid");
    assert_ne!(a.ct.data(), other.ct.data());
}

#[test]
fn skipping_empty_air_changes_nothing() {
    let options = HeadOptions { noise_hu: Some(0.0), ..coarse(3) };
    let (p, model) = (head(&options).expect("grid"), HeadModel::new(&options));
    let g = p.ct.grid();
    let blur = 1.6 * 2.5;
    for n in (0..g.len()).step_by(29) {
        let [i, j, k] = g.voxel(n);
        let c = g.centre(i, j, k);
        let layers = [-0.25, 0.25].map(|dz| model.hounsfield_at(Point::new(c.x, c.y, c.z + dz * 2.5), blur));
        let expected = 0.5 * (layers[0] + layers[1]);
        assert!(
            (f64::from(p.ct.data()[n]) - expected).abs() < 1.01,
            "voxel {i} {j} {k}: {} {expected}",
            p.ct.data()[n]
        );
    }
}

#[test]
fn the_drawer_holds_two_chambers_and_its_landmarks() {
    let p = drawer(&DrawerOptions { spacing_mm: [2.0, 2.0, 2.0], ..DrawerOptions::default() }).expect("grid");
    // Boxes of 20 x 48 x 24 mm with rounded edges, less what the channel takes; the head scales by up to a tenth.
    for s in [Structure::LeftLateralVentricle, Structure::RightLateralVentricle] {
        assert!((17.0..26.0).contains(&millilitres(&p, s)), "{}", millilitres(&p, s));
    }
    assert!((700.0..1200.0).contains(&millilitres(&p, Structure::Brain)));
    assert!(millilitres(&p, Structure::Skull) > 100.0 && millilitres(&p, Structure::ThirdVentricle) > 1.0);
    for m in [p.landmarks.monro_left, p.landmarks.monro_right] {
        let label = p.labels.nearest(m).and_then(Structure::from_label).expect("inside");
        assert!(label.is_ventricle(), "{label:?}");
    }
}

#[test]
fn spacings_that_make_no_grid_are_refused() {
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-12] {
        assert!(head(&HeadOptions { spacing_mm: [bad, 1.0, 1.0], ..HeadOptions::default() }).is_err(), "{bad}");
    }
}
