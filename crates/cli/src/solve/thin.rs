//! Bodies, and stiff sheets in them, across which there are too few elements for bending.

use monro_geometry::{TET_EDGES, TetMesh};
use monro_tissue::Material;
use std::collections::{BTreeMap, BTreeSet};

/// A mesh of less elements is a trial.
const FEW: usize = 50;
/// Where more than this part of the elements has a corner on the surface, there are two layers at most nearly everywhere; where
/// it has all four there, one.
const OUTER: f64 = 0.95;
/// A region that many times as stiff as the softest bears the bending,
const STIFF: f64 = 4.0;
/// and bends where it reaches so many times as far as it is thick; a cube has 5.
const SLENDER: f64 = 10.0;
/// So many times as many elements have twice the layers, or nearly so.
const REFINED: usize = 5;
/// What is known of how much.
const PLATE: &str = "a clamped plate of two layers gave way half as far as it should, of one a ninth";
const SKIN: &str = "a skin of one layer on a soft block by 15 to 24 %";
/// Half of the elements are longer than this part of the body's thickness, as of a square bar of its volume and surface: with four
/// layers of cubes it is 0.43.
const LONG: f64 = 0.5;

/// Where so few elements are across a body, or across a stiff sheet in it, that it hardly bends; `solved` is how many it was
/// solved with.
pub(super) fn remarks(mesh: &TetMesh, materials: &BTreeMap<u16, Material>, solved: usize) -> Vec<String> {
    if let Some(layers) = too_few(mesh, |_| true, solved) {
        return vec![told(mesh, solved, layers, ["given", "the whole body", PLATE])];
    }
    if let Some(long) = too_long(mesh, solved) {
        return vec![long];
    }
    let of_region = |region: u16| {
        let layers = too_few(mesh, |l| l == region, solved)?;
        let of = format!("of region {region}");
        (slenderness(extent(mesh, |l| l == region)) >= SLENDER).then(|| told(mesh, solved, layers, [&of, "it", SKIN]))
    };
    stiff_regions(mesh, materials).into_iter().filter_map(of_region).collect()
}

/// Where a slender body has elements that are long for its thickness, along which they cannot bend.
fn too_long(mesh: &TetMesh, solved: usize) -> Option<String> {
    if mesh.tets.len() < FEW {
        return None;
    }
    let extent = extent(mesh, |_| true);
    let thick = 4.0 * extent[0] / extent[1];
    let apart = |t: &[u32; 4], [i, j]: [usize; 2]| mesh.vertices[t[i] as usize].distance(mesh.vertices[t[j] as usize]);
    let mut long: Vec<f64> =
        mesh.tets.iter().map(|t| TET_EDGES.iter().map(|&e| apart(t, e)).fold(0.0, f64::max)).collect();
    let middle = long.len() / 2;
    let given = *long.select_nth_unstable_by(middle, f64::total_cmp).1;
    let now = given * (mesh.tets.len() as f64 / solved as f64).cbrt();
    (now > LONG * thick && slenderness(extent) >= SLENDER).then(|| {
        format!(
            "half of the elements are {given:.3} mm long or longer ({now:.3} mm as solved) in a body that is about {thick:.3} mm \
             thick: where it bends it is too stiff, whatever the number of layers (a bar with four layers of elements as long as \
             it was thick gave way half as far as it should), and a change from one mesh to the next does not show all of it; \
             make them a quarter as long as it is thick, or ask for --refine 1 to 3 and compare"
        )
    })
}

/// How many layers there are, if they are too few although halved.
fn too_few(mesh: &TetMesh, keep: impl Fn(u16) -> bool + Copy, solved: usize) -> Option<usize> {
    let given = mesh.labels.iter().filter(|&&l| keep(l)).count();
    let layers = layers(mesh, keep).filter(|_| given >= FEW)?;
    // Halved once they are twice as many, and eight times as many elements.
    let wanted = if layers == 1 { 8 * REFINED } else { REFINED };
    (solved < wanted * mesh.tets.len()).then_some(layers)
}

fn told(mesh: &TetMesh, solved: usize, layers: usize, [of, across, how]: [&str; 3]) -> String {
    format!(
        "the elements {of} make hardly more than {layers} layer{} across {across}, {solved} solved for {} given in all: where \
         it bends it is too stiff ({how}), and a change from one mesh to the next does not show all of it; give four layers \
         or more, or ask for --refine 1 to 3 and compare",
        if layers == 1 { "" } else { "s" },
        mesh.tets.len()
    )
}

/// The regions that are much stiffer than the softest one: they bear the bending.
fn stiff_regions(mesh: &TetMesh, materials: &BTreeMap<u16, Material>) -> Vec<u16> {
    let labels: BTreeSet<u16> = mesh.labels.iter().copied().collect();
    let shear = |l: &u16| materials[l].shear_kpa();
    let softest = labels.iter().map(shear).fold(f64::INFINITY, f64::min);
    labels.into_iter().filter(|l| shear(l) >= STIFF * softest).collect()
}

/// Volume and surface of what is kept.
fn extent(mesh: &TetMesh, keep: impl Fn(u16) -> bool) -> [f64; 2] {
    let volume = (0..mesh.tets.len()).filter(|&t| keep(mesh.labels[t])).map(|t| mesh.volume(t)).sum();
    [volume, mesh.surface(keep).area()]
}

/// How far something reaches over its thickness, both as of a square plate of its volume and surface.
fn slenderness([volume, surface]: [f64; 2]) -> f64 {
    (0.5 * surface).sqrt() * surface / (2.0 * volume)
}

/// How many layers of elements there are across the whole of what is kept, if one or two.
fn layers(mesh: &TetMesh, keep: impl Fn(u16) -> bool + Copy) -> Option<usize> {
    let mut outer = vec![false; mesh.vertices.len()];
    mesh.boundary(keep).iter().flatten().for_each(|&v| outer[v as usize] = true);
    let kept: Vec<&[u32; 4]> = mesh.tets.iter().zip(&mesh.labels).filter(|(_, l)| keep(**l)).map(|(t, _)| t).collect();
    let corners = |t: &[u32; 4]| t.iter().filter(|&&v| outer[v as usize]).count();
    let most = OUTER * kept.len() as f64;
    [4, 1].iter().position(|&n| kept.iter().filter(|t| corners(t) >= n).count() as f64 > most).map(|i| i + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::Point;

    /// A plate of so many cells, six elements each.
    fn plate([nx, ny, nz]: [u32; 3]) -> TetMesh {
        let at = |[i, j, k]: [u32; 3]| (k * (ny + 1) + j) * (nx + 1) + i;
        let corners = (0..=nz).flat_map(|k| (0..=ny).flat_map(move |j| (0..=nx).map(move |i| [i, j, k])));
        let vertices: Vec<_> = corners.map(|c| Point::from_array(c.map(f64::from))).collect();
        let mut tets = Vec::new();
        for (i, j, k) in (0..nz).flat_map(|k| (0..ny).flat_map(move |j| (0..nx).map(move |i| (i, j, k)))) {
            for [a, b, c] in [[0, 1, 2], [0, 2, 1], [1, 2, 0], [1, 0, 2], [2, 0, 1], [2, 1, 0]] {
                let mut p = [i, j, k];
                tets.push([a, b, c].into_iter().fold(vec![at(p)], |mut t, axis: usize| {
                    p[axis] += 1;
                    t.push(at(p));
                    t
                }));
            }
        }
        // Every other one is turned the other way round.
        let turned =
            |(n, t): (usize, Vec<u32>)| if n % 2 == 0 { [t[0], t[1], t[2], t[3]] } else { [t[0], t[1], t[3], t[2]] };
        let tets: Vec<[u32; 4]> = tets.into_iter().enumerate().map(turned).collect();
        TetMesh { vertices, labels: vec![1; tets.len()], tets }
    }

    /// A clamped plate of two layers gave way half as far as it should, "converged" and without a remark.
    #[test]
    fn two_layers_of_elements_are_told_from_four() {
        let found = [[12, 12, 1], [12, 12, 2], [12, 12, 4], [6, 6, 6]].map(|cells| layers(&plate(cells), |_| true));
        assert_eq!(found, [Some(1), Some(2), None, None]);
    }

    /// A bar of four layers gave way half as far as it should, and nothing was said of its elements.
    #[test]
    fn a_slender_bar_of_four_layers_of_long_elements_is_told() {
        let bar = |length: f64| {
            let mut mesh = plate([24, 4, 4]);
            mesh.vertices.iter_mut().for_each(|p| p.x *= length);
            mesh
        };
        let told = too_long(&bar(4.0), 2304).expect("told");
        assert!(
            told.contains("half of the elements are 4.243 mm long") && told.contains("about 3.918 mm thick"),
            "{told}"
        );
        // Of cubes; and halved twice.
        assert_eq!((too_long(&bar(1.0), 2304), too_long(&bar(4.0), 64 * 2304)), (None, None));
        assert_eq!(too_long(&plate([40, 40, 4]), 38_400), None);
    }

    /// A skin of one layer, ten times as stiff, was 15 to 24 % too stiff, and nothing but a change of 6 % was told.
    #[test]
    fn a_stiff_sheet_of_one_layer_on_a_block_was_not_told() {
        let mut mesh = plate([12, 12, 6]);
        assert!((slenderness(extent(&plate([5; 3]), |_| true)) - 27f64.sqrt()).abs() < 1e-9);
        mesh.labels.iter_mut().take(12 * 12 * 6).for_each(|l| *l = 2);
        let (surface, volume) = (2.0 * 144.0 + 4.0 * 12.0, 144.0);
        let wanted = (0.5f64 * surface).sqrt() * surface / (2.0 * volume);
        assert!((slenderness(extent(&mesh, |l| l == 2)) - wanted).abs() < 1e-9 * wanted, "{wanted}");
        let with = |times: f64, solved: usize| {
            let of = |young_kpa| Material { young_kpa, ..Material::BRAIN };
            remarks(&mesh, &[(1, of(1.0)), (2, of(times))].into(), solved)
        };
        let told = with(10.0, 30_000);
        assert!(told.len() == 1 && told[0].contains("of region 2 make hardly more than 1 layer across it"), "{told:?}");
        // Nearly as soft as the block, or halved often enough.
        assert_eq!([with(2.0, 30_000).len(), with(10.0, 300_000).len()], [0, 0]);
    }
}
