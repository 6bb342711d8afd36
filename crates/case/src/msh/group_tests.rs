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

#[test]
fn of_several_groups_of_a_volume_the_first_was_taken_in_silence() {
    let text = |groups: [&str; 2]| [FORMAT, &entities(groups), NODES, &elements([1, 2])].concat();
    // A group of all tissue beside those of its parts, in any order.
    for groups in [["2 1 7", "2 1 9"], ["2 7 1", "2 9 1"]] {
        let read = decode(text(groups).as_bytes()).expect("the smaller groups are meant");
        assert_eq!(read.mesh.labels, [7, 9]);
        let [remark] = &read.remarks[..] else { panic!("{:?}", read.remarks) };
        assert!(remark.contains("volume 1 in 1, 7 (label 7)") && remark.contains("volume 2 in 1, 9"), "{remark}");
    }
    for groups in [["2 7 8", "1 9"], ["2 7 8", "2 7 8"], ["3 8 1 7", "1 1"]] {
        let told = fault(&text(groups));
        assert!(told.contains("volume 1 is in the physical groups") && told.contains("7, 8"), "{told}");
    }
    assert_eq!(decode(text(["2 7 7", "1 9"]).as_bytes()).expect("the same twice").remarks, [""; 0]);
}

#[test]
fn a_volume_without_a_group_beside_others_with_one_had_its_number_as_label() {
    let told = fault(&[FORMAT, &entities(["1 2", "0"]), NODES, &elements([1, 2])].concat());
    assert!(told.contains("element 2") && told.contains("of volume(s) 2") && told.contains("SaveAll"), "{told}");
    // A volume without tetrahedra is of no interest.
    assert_eq!(labels(&[FORMAT, &entities(["1 2", "0"]), NODES, &elements([1, 1])].concat()), [2, 2]);
    let told = fault(&old("1 4 2 2 1 1 2 3 4", "2 4 2 0 2 1 3 2 5"));
    assert!(told.contains("element 2") && told.contains("of volume(s) 2"), "{told}");
}

/// A file of version 2.2 with these elements.
fn old(one: &str, two: &str) -> String {
    let nodes = "$Nodes\n5\n1 0 0 0\n2 9 0 0\n3 0 9 0\n4 0 0 9\n5 0 0 -9\n$EndNodes\n";
    format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n{nodes}$Elements\n2\n{one}\n{two}\n$EndElements\n")
}

#[test]
fn elements_written_once_for_each_of_their_groups_were_called_the_same_without_a_reason() {
    let told = fault(&old("1 4 2 5 1 1 2 3 4", "2 4 2 1 1 1 2 3 4"));
    assert!(told.contains("elements 1 and 2") && told.contains("groups 5 and 1") && told.contains("4.1"), "{told}");
    assert!(fault(&old("1 4 2 5 1 1 2 3 4", "2 4 2 5 1 1 2 3 4")).contains("tetrahedra 0 and 1 have the same"));
}

#[test]
fn the_group_zero_of_a_mesh_that_has_only_that_was_taken_for_none() {
    assert_eq!(labels(&[FORMAT, &entities(["1 0", "1 0"]), NODES, &elements([1, 2])].concat()), [0, 0]);
}
