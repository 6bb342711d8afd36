//! Reading.

use super::data::ElementLabels;
use super::entities::Entities;
use super::labels::{self, Numbers};
use super::source::{Encoding, Source};
use super::{MshError, TETRAHEDRON, nodes_of, solid_name};
use monro_geometry::{Point, TetMesh, TetMeshError};
use std::collections::{BTreeMap, HashMap};

/// Decodes the tetrahedra of an MSH file. Other elements, and nodes that no tetrahedron uses, are left out: Gmsh keeps
/// nodes of its geometry that are none of the mesh.
///
/// # Errors
/// A version that is not read, a section that cannot be read, a missing node, a group that is no label, an inverted
/// element, elements that do not fit together ([`TetMesh::check_conforming`]): each by name. Never allocates more than the file's own size suggests.
pub fn decode(bytes: &[u8]) -> Result<Imported, MshError> {
    let mut source = Source { bytes, encoding: Encoding::Ascii };
    let mut found = Found::default();
    let modern = format(&mut source)?;
    while let Some(name) = source.section() {
        let fault = |reason| MshError::Section { section: format!("${name}"), reason };
        found.section(&mut source, name, modern).map_err(fault)?;
    }
    found.mesh()
}

/// What a file holds.
#[derive(Debug, Clone, PartialEq)]
pub struct Imported {
    /// Its linear tetrahedra and their nodes.
    pub mesh: TetMesh,
    /// Tags of nodes that were left out because no tetrahedron uses them, in the order of the file.
    pub unused: Vec<u64>,
    /// No element has a physical group, data called "label" or an entity: all have the label 1.
    pub unlabelled: bool,
    /// Other elements that fill space and were left out: what they are called, and how many there are.
    pub others: Vec<(&'static str, usize)>,
    /// What should be known of where the labels are from, in words.
    pub remarks: Vec<String>,
}

/// Reads `$MeshFormat`; true for 4.1, false for 2.2.
fn format(source: &mut Source<'_>) -> Result<bool, MshError> {
    let fail = |reason: &str| MshError::Section { section: "$MeshFormat".into(), reason: reason.into() };
    loop {
        match source.line().ok_or_else(|| fail("the file has none"))? {
            "$MeshFormat" => break,
            "" => {}
            line => {
                let name = line.strip_prefix('$').ok_or_else(|| fail(&format!("\"{line}\" stands before it")))?;
                source.skip(name).map_err(|reason| MshError::Section { section: line.into(), reason })?;
            }
        }
    }
    let line = source.line().ok_or_else(|| fail("the file ends here"))?;
    let modern = match line.split_whitespace().collect::<Vec<_>>()[..] {
        ["4.1", "0", "8"] => true,
        ["4.1", "1", "8"] => {
            // The number 1 as the writer's machine stores it.
            source.encoding = Encoding::Little;
            match source.int() {
                Ok(1) => {}
                Ok(0x0100_0000) => source.encoding = Encoding::Big,
                _ => return Err(fail("the number that tells the order of bytes is not 1")),
            }
            true
        }
        ["2.2", "0", _] => false,
        _ => return Err(MshError::Version(line.to_owned())),
    };
    source.close("MeshFormat").map_err(|reason| fail(&reason))?;
    Ok(modern)
}

/// A tetrahedron with the tags of its nodes.
pub(super) struct Tet {
    pub(super) tag: u64,
    nodes: [u64; 4],
    pub(super) place: Place,
}

/// Where an element lies.
#[derive(Clone, Copy)]
pub(super) struct Place {
    pub(super) entity: i32,
    /// Its physical group as version 2.2 tells it; 0 is none.
    pub(super) group: i32,
}

#[derive(Default)]
struct Found {
    entities: Entities,
    labels: ElementLabels,
    numbers: HashMap<u64, u32>,
    /// Of the nodes, in the order of the file.
    tags: Vec<u64>,
    positions: Vec<[f64; 3]>,
    tets: Vec<Tet>,
    /// Other elements that fill space.
    others: BTreeMap<&'static str, usize>,
}

impl Found {
    /// Reads a section and its end. What is not known here is passed over.
    fn section(&mut self, source: &mut Source<'_>, name: &str, modern: bool) -> Result<(), String> {
        match (name, modern) {
            ("Entities", true) => self.entities.read(source)?,
            ("PartitionedEntities", true) => self.entities.read_partitions(source)?,
            ("Nodes", true) => self.nodes(source)?,
            ("Nodes", false) => self.nodes_2(source)?,
            ("Elements", true) => self.elements(source)?,
            ("Elements", false) => self.elements_2(source)?,
            ("ElementData", _) => return self.labels.read(source),
            _ => return source.skip(name),
        }
        source.close(name)
    }

    fn nodes(&mut self, source: &mut Source<'_>) -> Result<(), String> {
        let blocks = source.size()?;
        (0..3).try_for_each(|_| source.size().map(drop))?;
        for _ in 0..blocks {
            let (dimension, _tag, parametric) = (source.int()?, source.int()?, source.int()?);
            let count = source.size()?;
            let mut tags = Vec::new();
            for _ in 0..count {
                tags.push(source.size()?);
            }
            let extra = if parametric == 0 { 0 } else { dimension.clamp(0, 3) };
            for tag in tags {
                let p = [source.double()?, source.double()?, source.double()?];
                (0..extra).try_for_each(|_| source.double().map(drop))?;
                self.node(tag, p)?;
            }
        }
        Ok(())
    }

    fn node(&mut self, tag: u64, p: [f64; 3]) -> Result<(), String> {
        let number = u32::try_from(self.positions.len()).map_err(|_| "more than 2^32 nodes")?;
        if self.numbers.insert(tag, number).is_some() {
            return Err(format!("node {tag} occurs twice"));
        }
        self.tags.push(tag);
        self.positions.push(p);
        Ok(())
    }

    fn elements(&mut self, source: &mut Source<'_>) -> Result<(), String> {
        let blocks = source.size()?;
        (0..3).try_for_each(|_| source.size().map(drop))?;
        for _ in 0..blocks {
            let (_dimension, entity, kind) = (source.int()?, source.int()?, source.int()?);
            let count = source.size()?;
            let nodes = nodes_of(kind).ok_or_else(|| format!("element type {kind} is unknown"))?;
            for _ in 0..count {
                let tag = source.size()?;
                self.element(source, tag, kind, nodes, Place { entity, group: 0 })?;
            }
        }
        Ok(())
    }

    fn element(
        &mut self,
        source: &mut Source<'_>,
        tag: u64,
        kind: i32,
        nodes: usize,
        place: Place,
    ) -> Result<(), String> {
        let mut corners = [0; 4];
        for i in 0..nodes {
            let node = source.size()?;
            if let Some(c) = corners.get_mut(i) {
                *c = node;
            }
        }
        if kind == TETRAHEDRON {
            self.tets.push(Tet { tag, nodes: corners, place });
        }
        if let Some(name) = solid_name(kind) {
            *self.others.entry(name).or_default() += 1;
        }
        Ok(())
    }

    fn nodes_2(&mut self, source: &mut Source<'_>) -> Result<(), String> {
        for _ in 0..source.size()? {
            let tag = source.size()?;
            let p = [source.double()?, source.double()?, source.double()?];
            self.node(tag, p)?;
        }
        Ok(())
    }

    fn elements_2(&mut self, source: &mut Source<'_>) -> Result<(), String> {
        for _ in 0..source.size()? {
            let (tag, kind, count) = (source.size()?, source.int()?, source.size()?);
            // The physical group, then the entity, then partitions; a group of 0 is none.
            let mut tags = [0; 2];
            for i in 0..count {
                let value = source.int()?;
                if let Some(t) = tags.get_mut(i as usize) {
                    *t = value;
                }
            }
            let nodes = nodes_of(kind).ok_or_else(|| format!("element type {kind} is unknown"))?;
            self.element(source, tag, kind, nodes, Place { group: tags[0], entity: tags[1] })?;
        }
        Ok(())
    }

    /// The nodes in use, in the order of the file.
    fn mesh(self) -> Result<Imported, MshError> {
        if self.tets.is_empty() {
            return Err(MshError::Section { section: "$Elements".into(), reason: self.no_tetrahedron() });
        }
        let (values, unlabelled, remarks) = self.numbers()?;
        let mut used = vec![false; self.positions.len()];
        let mut mesh = TetMesh::default();
        for (t, &group) in self.tets.iter().zip(&values) {
            let fault = MshError::Group { element: t.tag, group };
            mesh.labels.push(if unlabelled { 1 } else { u16::try_from(group).map_err(|_| fault)? });
            let mut tet = [0; 4];
            for (to, &node) in tet.iter_mut().zip(&t.nodes) {
                *to = *self.numbers.get(&node).ok_or(MshError::Node { element: t.tag, node })?;
                used[*to as usize] = true;
            }
            mesh.tets.push(tet);
        }
        let mut number = vec![0u32; used.len()];
        for (i, &p) in self.positions.iter().enumerate().filter(|(i, _)| used[*i]) {
            number[i] = mesh.vertices.len() as u32;
            mesh.vertices.push(Point::from_array(p));
        }
        mesh.tets.iter_mut().flatten().for_each(|v| *v = number[*v as usize]);
        mesh.validate()?;
        mesh.check_conforming().map_err(|e| self.repeated(&e).unwrap_or_else(|| e.into()))?;
        let unused = self.tags.into_iter().zip(used).filter(|(_, used)| !used).map(|(tag, _)| tag).collect();
        Ok(Imported { mesh, unused, unlabelled, others: self.others.into_iter().collect(), remarks })
    }

    /// A number for each tetrahedron, whether these are none at all, and what should be known of them.
    fn numbers(&self) -> Result<(Vec<i64>, bool, Vec<String>), MshError> {
        let Numbers { values, grouped, mut remarks } = labels::number(&self.tets, &self.entities)?;
        if grouped {
            remarks.extend(self.labels.remark(&self.tets, &values));
            return Ok((values, false, remarks));
        }
        let fault = |reason| MshError::Section { section: "$ElementData".into(), reason };
        if let Some(labels) = self.labels.of_all(&self.tets).map_err(fault)? {
            return Ok((labels, false, remarks));
        }
        let unlabelled = values.iter().all(|&v| v == 0);
        Ok((values, unlabelled, remarks))
    }

    /// Version 2.2 repeats an element for each of its groups.
    fn repeated(&self, fault: &TetMeshError) -> Option<MshError> {
        let &TetMeshError::Duplicate { first, second } = fault else { return None };
        let (first, second) = (self.tets.get(first)?, self.tets.get(second)?);
        let groups = [first, second].map(|t| t.place.group);
        (groups[0] != groups[1]).then_some(MshError::Repeated { first: first.tag, second: second.tag, groups })
    }

    fn no_tetrahedron(&self) -> String {
        let others: Vec<String> = self.others.iter().map(|(name, n)| format!("{n} {name}")).collect();
        match others[..] {
            [] => "no linear tetrahedron in the file".into(),
            _ => format!(
                "no linear tetrahedron in the file, but {}; save it with linear tetrahedra (Gmsh: Mesh.ElementOrder = 1)",
                others.join(", ")
            ),
        }
    }
}
