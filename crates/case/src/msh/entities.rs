//! The volumes that a file lists, their physical groups, and the volumes that partitions are parts of.

use super::source::Source;
use std::collections::{BTreeMap, BTreeSet};

/// What `$Entities` and `$PartitionedEntities` say of volumes.
#[derive(Debug, Default)]
pub(super) struct Entities {
    /// The file lists an entity of any dimension.
    listed: bool,
    /// Physical groups of each volume.
    groups: BTreeMap<i32, Vec<i32>>,
    /// The volume that each partition is a part of.
    parents: BTreeMap<i32, i32>,
    /// Physical groups of the parts of each volume. Programs that partition may make groups of their own: they count
    /// only where the volume itself has none.
    of_parts: BTreeMap<i32, Vec<i32>>,
}

impl Entities {
    /// Reads `$Entities`.
    pub(super) fn read(&mut self, source: &mut Source<'_>) -> Result<(), String> {
        for (dimension, count) in counts(source)?.into_iter().enumerate() {
            for _ in 0..count {
                self.listed = true;
                let tag = source.int()?;
                let groups = shape(source, dimension)?;
                if dimension == 3 {
                    self.groups.insert(tag, groups);
                }
            }
        }
        Ok(())
    }

    /// Reads `$PartitionedEntities`: as `$Entities`, but each with its parent and its partitions.
    pub(super) fn read_partitions(&mut self, source: &mut Source<'_>) -> Result<(), String> {
        let (_partitions, ghosts) = (source.size()?, source.size()?);
        for _ in 0..ghosts {
            let (_tag, _partition) = (source.int()?, source.int()?);
        }
        for (dimension, count) in counts(source)?.into_iter().enumerate() {
            for _ in 0..count {
                self.listed = true;
                let (tag, of, parent) = (source.int()?, source.int()?, source.int()?);
                ints(source)?;
                let groups = shape(source, dimension)?;
                if dimension == 3 {
                    let volume = if of == 3 { parent } else { tag };
                    self.parents.insert(tag, volume);
                    self.of_parts.entry(volume).or_default().extend(groups);
                }
            }
        }
        Ok(())
    }

    /// The volume that a block of tetrahedra belongs to; `None` where the file lists entities, but not this one.
    pub(super) fn volume_of(&self, entity: i32) -> Option<i32> {
        if let Some(&volume) = self.parents.get(&entity) {
            return Some(volume);
        }
        (!self.listed || self.groups.contains_key(&entity)).then_some(entity)
    }

    /// The physical groups of a volume, each once.
    pub(super) fn groups_of(&self, volume: i32) -> BTreeSet<i32> {
        let own = self.groups.get(&volume).filter(|g| !g.is_empty());
        own.or_else(|| self.of_parts.get(&volume)).into_iter().flatten().copied().collect()
    }

    /// How many volumes each physical group holds.
    pub(super) fn volumes_of_groups(&self) -> BTreeMap<i32, usize> {
        let volumes: BTreeSet<i32> = self.groups.keys().chain(self.of_parts.keys()).copied().collect();
        let mut sizes = BTreeMap::new();
        for group in volumes.into_iter().flat_map(|v| self.groups_of(v)) {
            *sizes.entry(group).or_default() += 1;
        }
        sizes
    }
}

/// Numbers of entities of each dimension.
fn counts(source: &mut Source<'_>) -> Result<[u64; 4], String> {
    Ok([source.size()?, source.size()?, source.size()?, source.size()?])
}

/// The place or the bounds of an entity, its groups, which are returned, and what bounds it.
fn shape(source: &mut Source<'_>, dimension: usize) -> Result<Vec<i32>, String> {
    for _ in 0..if dimension == 0 { 3 } else { 6 } {
        source.double()?;
    }
    let groups = ints(source)?;
    if dimension > 0 {
        ints(source)?;
    }
    Ok(groups)
}

/// A count and as many integers.
fn ints(source: &mut Source<'_>) -> Result<Vec<i32>, String> {
    let count = source.size()?;
    let mut out = Vec::new();
    for _ in 0..count {
        out.push(source.int()?);
    }
    Ok(out)
}
