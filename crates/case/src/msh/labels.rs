//! The label of each tetrahedron: its physical group, or its volume where no tetrahedron is in a group.

use super::MshError;
use super::entities::Entities;
use super::read::Tet;
use std::collections::{BTreeMap, BTreeSet};

/// What is told at most of volumes, in an error or a remark.
const TOLD: usize = 8;

/// Numbers of all tetrahedra, not yet known to be labels.
pub(super) struct Numbers {
    pub(super) values: Vec<i64>,
    /// They are physical groups, not volumes.
    pub(super) grouped: bool,
    pub(super) remarks: Vec<String>,
}

/// Numbers all tetrahedra by their groups, or by their volumes where there is no group.
pub(super) fn number(tets: &[Tet], entities: &Entities) -> Result<Numbers, MshError> {
    let volumes = tets.iter().map(|t| volume(t, entities)).collect::<Result<Vec<_>, _>>()?;
    let chosen = chosen(&volumes, entities)?;
    let group = |(t, v): (&Tet, &i32)| Some(t.place.group).filter(|&g| g != 0).or_else(|| *chosen.get(v)?);
    let groups: Vec<Option<i32>> = tets.iter().zip(&volumes).map(group).collect();
    check_all_or_none(tets, &volumes, &groups)?;
    let grouped = groups.iter().any(Option::is_some);
    let values = groups.iter().zip(&volumes).map(|(g, &v)| g.unwrap_or(v).into()).collect();
    let remarks = if grouped { remark(&chosen, entities).into_iter().collect() } else { Vec::new() };
    Ok(Numbers { values, grouped, remarks })
}

fn volume(tet: &Tet, entities: &Entities) -> Result<i32, MshError> {
    let volume = tet.place.entity;
    entities.volume_of(volume).ok_or(MshError::Unlisted { element: tet.tag, volume })
}

/// The group of each volume that holds tetrahedra: its only one, or the one that holds the fewest volumes. A group of
/// all tissue beside those of its parts is common; which one is meant is plain only where one is smaller than all others.
fn chosen(volumes: &[i32], entities: &Entities) -> Result<BTreeMap<i32, Option<i32>>, MshError> {
    let sizes = entities.volumes_of_groups();
    let choose = |&volume: &i32| {
        let groups = entities.groups_of(volume);
        let size = |group: &i32| sizes.get(group).copied().unwrap_or(0);
        let least = groups.iter().copied().min_by_key(size);
        if let Some(least) = least
            && groups.iter().any(|g| *g != least && size(g) == size(&least))
        {
            return Err(MshError::Several { volume, groups: list(groups.iter()) });
        }
        Ok((volume, least))
    };
    volumes.iter().collect::<BTreeSet<_>>().into_iter().map(choose).collect()
}

fn remark(chosen: &BTreeMap<i32, Option<i32>>, entities: &Entities) -> Option<String> {
    let several = chosen.iter().filter_map(|(&volume, &group)| {
        let groups = entities.groups_of(volume);
        let label = group.filter(|_| groups.len() > 1)?;
        Some(format!("volume {volume} in {} (label {label})", list(groups.iter())))
    });
    let told = several.collect::<Vec<_>>();
    (!told.is_empty()).then(|| {
        format!(
            "volumes in several physical groups have as label the one that holds the fewest volumes: {}",
            list(&told)
        )
    })
}

fn check_all_or_none(tets: &[Tet], volumes: &[i32], groups: &[Option<i32>]) -> Result<(), MshError> {
    let of = |grouped: bool| (0..tets.len()).filter(move |&t| groups[t].is_some() == grouped);
    let (Some(first), Some(_)) = (of(false).next(), of(true).next()) else {
        return Ok(());
    };
    let listed = |grouped: bool| list(of(grouped).map(|t| volumes[t]).collect::<BTreeSet<_>>());
    Err(MshError::PartlyGrouped {
        count: of(false).count(),
        element: tets[first].tag,
        without: listed(false),
        with: listed(true),
    })
}

/// The first of these and how many more there are.
fn list(items: impl IntoIterator<Item: ToString>) -> String {
    let mut words: Vec<String> = items.into_iter().map(|i| i.to_string()).collect();
    let more = words.len().saturating_sub(TOLD);
    if more > 0 {
        words.truncate(TOLD);
        words.push(format!("{more} more"));
    }
    words.join(", ")
}
