//! Whether the labels of a file are those of a case, around whose ventricles a mesh is fine unless something else is asked.

use super::numbers;
use monro_geometry::{Structure, Volume};

/// The label of the brain in a case.
const BRAIN: u16 = Structure::Brain.label() as u16;

/// Ventricles lie inside the head: at most this share of their voxels' faces is at nothing, the label 0. Skin around bone, or one
/// of several vertebrae, is there by more.
const AT_NOTHING: f64 = 0.25;
/// And in the brain and its fluid with at least this share.
const IN_BRAIN: f64 = 0.5;

/// The ventricles where the labels are those of a case, else all: an atlas may use the same numbers for anything.
pub(super) fn usually_fine(labels: &Volume<u16>, keep: &[u16]) -> Vec<u16> {
    let known = |l: &u16| Structure::from_label(*l).is_some();
    let ventricles = ventricles(keep);
    let of_a_case = keep.contains(&BRAIN) && keep.iter().all(known) && lie_inside(labels, &ventricles);
    if of_a_case { ventricles } else { keep.to_vec() }
}

/// Those of some labels that are ventricles in a case.
fn ventricles(keep: &[u16]) -> Vec<u16> {
    let ventricle = |l: &u16| Structure::from_label(*l).is_some_and(Structure::is_ventricle);
    keep.iter().copied().filter(ventricle).collect()
}

fn lie_inside(labels: &Volume<u16>, ventricles: &[u16]) -> bool {
    let ([nx, ny, _], data) = (labels.grid().dims(), labels.data());
    let rows = data.chunks(nx).flat_map(|row| row.iter().zip(&row[1..]));
    let sheets = data.chunks(nx * ny).flat_map(|sheet| sheet.iter().zip(&sheet[nx..]));
    let pairs = rows.chain(sheets).chain(data.iter().zip(&data[nx * ny..]));
    let (mut at_nothing, mut in_brain, mut all) = (0usize, 0usize, 0usize);
    let around = [BRAIN, u16::from(Structure::Csf.label())];
    for (a, b) in pairs.filter(|(a, b)| a != b) {
        let beside = match (ventricles.contains(a), ventricles.contains(b)) {
            (true, false) => *b,
            (false, true) => *a,
            _ => continue,
        };
        at_nothing += usize::from(beside == 0);
        in_brain += usize::from(around.contains(&beside));
        all += 1;
    }
    all > 0 && at_nothing as f64 <= AT_NOTHING * all as f64 && in_brain as f64 >= IN_BRAIN * all as f64
}

/// What is said where labels have numbers of ventricles and were not taken for these.
pub(super) fn not_taken_for_ventricles(keep: &[u16], fine: &[u16]) -> Option<String> {
    let ventricles = ventricles(keep);
    (keep.contains(&BRAIN) && !ventricles.is_empty() && fine.len() > ventricles.len()).then(|| {
        format!(
            "the mesh is as fine around all labels: {} are ventricles in cases of Monro, but here they lie at the outside or not in label 4, or \
             other numbers than those of a case are there too; \"--fine {}\" makes it fine around these alone",
            numbers(&ventricles, ", "),
            numbers(&ventricles, ",")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::Grid;

    fn balls(label: impl Fn(f64) -> u16) -> Volume<u16> {
        let grid = Grid::axis_aligned([24; 3], [1.0; 3], [0.0; 3]).expect("grid");
        let far = |at: usize| grid.voxel(at).map(|x| (x as f64 - 11.5).powi(2)).iter().sum::<f64>().sqrt();
        Volume::new(grid, (0..grid.len()).map(|at| label(far(at))).collect()).expect("count")
    }

    #[test]
    fn skin_numbered_like_a_ventricle_got_half_of_the_elements() {
        // White and grey matter, fluid, bone, skin, from inside to outside.
        let head = balls(|r| [3.0, 5.0, 7.0, 9.0, 11.0].iter().position(|&end| r < end).map_or(0, |l| l as u16 + 1));
        let keep = [1, 2, 3, 4, 5];
        assert_eq!(usually_fine(&head, &keep), keep);
        let said = not_taken_for_ventricles(&keep, &keep).expect("told");
        assert!(said.contains("5 are ventricles") && said.contains("lie at the outside"), "{said}");
        // A plate numbered like one in what is no brain had two of five labels made coarse regions.
        let plate = balls(|r| [2.0, 4.0, 8.0, 10.0].iter().position(|&end| r < end).map_or(0, |l| [4, 3, 5, 1][l]));
        assert_eq!(usually_fine(&plate, &keep), keep);
        let case = balls(|r| if r < 4.0 { 5 } else { u16::from(r < 10.0) * 4 });
        assert_eq!(usually_fine(&case, &[4, 5]), [5]);
    }
}
