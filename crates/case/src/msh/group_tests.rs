//! Labels from physical groups, partitions and entities.

use super::*;

const FORMAT: &str = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n";
const NODES: &str = "$Nodes\n1 5 1 5\n3 1 0 5\n1\n2\n3\n4\n5\n0 0 0\n9 0 0\n0 9 0\n0 0 9\n0 0 -9\n$EndNodes\n";

/// A volume of `$Entities` with its groups, as `"1 7"`.
fn volume(tag: i32, groups: &str) -> String {
    format!("{tag} 0 0 0 9 9 9 {groups} 0\n")
}

/// Two tetrahedra, one in each of two volumes of these groups.
fn entities(groups: [&str; 2]) -> String {
    format!("$Entities\n0 0 0 2\n{}{}$EndEntities\n", volume(1, groups[0]), volume(2, groups[1]))
}

/// Two tetrahedra, one in a block of each entity.
fn elements(entities: [i32; 2]) -> String {
    let [one, two] = entities;
    format!("$Elements\n2 2 1 2\n3 {one} 4 1\n1 1 2 3 4\n3 {two} 4 1\n2 1 3 2 5\n$EndElements\n")
}

fn labels(text: &str) -> Vec<u16> {
    decode(text.as_bytes()).expect("readable").mesh.labels
}

fn fault(text: &str) -> String {
    decode(text.as_bytes()).expect_err("refused").to_string()
}

/// Two volumes, the first cut into two partitions: a point and three volumes, and a ghost entity.
fn partitions(groups: &str) -> String {
    format!(
        "$PartitionedEntities\n2\n1\n30 2\n1 0 0 2\n10 0 1 2 1 2 0 0 0 0\n11 3 1 1 1 0 0 0 9 9 9 {groups} 0\n12 3 2 1 2 0 0 0 9 9 9 {groups} 1 4\n$EndPartitionedEntities\n"
    )
}

#[test]
fn blocks_of_partitions_had_their_own_numbers_as_labels_and_not_the_groups_of_their_volumes() {
    let mesh = |volumes: [&str; 2], parts: &str| {
        labels(&[FORMAT, &entities(volumes), &partitions(parts), NODES, &elements([11, 12])].concat())
    };
    assert_eq!(mesh(["1 7", "1 9"], "0"), [7, 9]);
    // Groups that partitioning has made do not count beside those of the volume.
    assert_eq!(mesh(["1 7", "1 9"], "1 3"), [7, 9]);
    assert_eq!(mesh(["0", "0"], "1 3"), [3, 3]);
    assert_eq!(mesh(["0", "0"], "0"), [1, 2]);
}

#[test]
fn partitions_in_binary_files_are_read_too() {
    let mut out = b"$MeshFormat\n4.1 1 8\n".to_vec();
    let int = |out: &mut Vec<u8>, values: &[i32]| values.iter().for_each(|v| out.extend_from_slice(&v.to_le_bytes()));
    let size = |out: &mut Vec<u8>, values: &[u64]| values.iter().for_each(|v| out.extend_from_slice(&v.to_le_bytes()));
    let real = |out: &mut Vec<u8>, n: usize| out.extend_from_slice(&[0; 8].repeat(n));
    int(&mut out, &[1]);
    out.extend_from_slice(b"\n$EndMeshFormat\n$Entities\n");
    size(&mut out, &[0, 0, 0, 1]);
    int(&mut out, &[1]);
    real(&mut out, 6);
    size(&mut out, &[1]);
    int(&mut out, &[7]);
    size(&mut out, &[0]);
    out.extend_from_slice(b"\n$EndEntities\n$PartitionedEntities\n");
    size(&mut out, &[2, 1]);
    int(&mut out, &[30, 2]);
    size(&mut out, &[0, 0, 0, 1]);
    int(&mut out, &[11, 3, 1]);
    size(&mut out, &[2]);
    int(&mut out, &[1, 2]);
    real(&mut out, 6);
    size(&mut out, &[0, 1]);
    int(&mut out, &[-4]);
    out.extend_from_slice(b"\n$EndPartitionedEntities\n$Nodes\n");
    size(&mut out, &[1, 4, 1, 4]);
    int(&mut out, &[3, 11, 0]);
    size(&mut out, &[4, 1, 2, 3, 4]);
    for v in [0., 0., 0., 1., 0., 0., 0., 1., 0., 0., 0., 1f64] {
        out.extend_from_slice(&v.to_le_bytes());
    }
    out.extend_from_slice(b"\n$EndNodes\n$Elements\n");
    size(&mut out, &[1, 1, 1, 1]);
    int(&mut out, &[3, 11, 4]);
    size(&mut out, &[1, 1, 1, 2, 3, 4]);
    out.extend_from_slice(b"\n$EndElements\n");
    assert_eq!(decode(&out).expect("binary").mesh.labels, [7]);
}

#[test]
fn a_block_of_an_entity_that_the_file_does_not_list_made_its_number_a_label() {
    let text = [FORMAT, &entities(["1 7", "1 9"]), NODES, &elements([1, 12])].concat();
    let told = fault(&text);
    assert!(told.contains("element 2") && told.contains("volume 12"), "{told}");
    // A file without a list has nothing but the numbers.
    assert_eq!(labels(&[FORMAT, NODES, &elements([1, 12])].concat()), [1, 12]);
}
