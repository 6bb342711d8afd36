//! Labels as data of elements (`$ElementData`), as programs write them that know no physical groups: meshio does.

use super::read::Tet;
use super::source::{Encoding, Source};
use std::collections::HashMap;

/// The name of the data that are labels, as in VTU files.
const NAME: &str = "label";

/// The label of each element by its tag. A file may hold it in several sections, one for each partition.
#[derive(Debug, Default)]
pub(super) struct ElementLabels {
    of: HashMap<u64, f64>,
}

impl ElementLabels {
    /// Reads a section and its end; data of another name are passed over.
    pub(super) fn read(&mut self, source: &mut Source<'_>) -> Result<(), String> {
        let names = tags(source)?;
        if names.first().map(|n| n.trim_matches('"')) != Some(NAME) {
            return source.skip("ElementData");
        }
        tags(source)?;
        let numbers = tags(source)?;
        let number = |i: usize| numbers.get(i).and_then(|n| n.parse::<u64>().ok());
        let (Some(components), Some(count)) = (number(1), number(2)) else {
            return Err(format!("\"{NAME}\" does not say how many components and elements it has"));
        };
        if components != 1 {
            return Err(format!("\"{NAME}\" has {components} components; labels have one"));
        }
        for _ in 0..count {
            let (element, value) = entry(source)?;
            if let Some(other) = self.of.insert(element, value).filter(|other| *other != value) {
                return Err(format!(
                    "element {element} has the labels {other} and {value}; save it with one step of \"{NAME}\""
                ));
            }
        }
        source.close("ElementData")
    }

    /// The labels of all tetrahedra; `None` where the file has none.
    pub(super) fn of_all(&self, tets: &[Tet]) -> Result<Option<Vec<i64>>, String> {
        let known = tets.iter().filter(|t| self.of.contains_key(&t.tag)).count();
        if known == 0 {
            return Ok(None);
        }
        let label = |t: &Tet| match self.of.get(&t.tag) {
            Some(&v) if v.fract() == 0.0 && (0.0..=65535.0).contains(&v) => Ok(v as i64),
            Some(v) => Err(format!("element {}: {v} is no label (0 to 65535)", t.tag)),
            None => Err(format!("element {} has no \"{NAME}\": {known} of {} tetrahedra have one", t.tag, tets.len())),
        };
        tets.iter().map(label).collect::<Result<_, _>>().map(Some)
    }

    /// What is said where physical groups are the labels and these differ.
    pub(super) fn remark(&self, tets: &[Tet], groups: &[i64]) -> Option<String> {
        let differs = |(t, &group): (&Tet, &i64)| {
            let label = *self.of.get(&t.tag)?;
            (label != group as f64).then_some((t.tag, label, group))
        };
        let mut all = tets.iter().zip(groups).filter_map(differs);
        let (element, label, group) = all.next()?;
        Some(format!(
            "the element data \"{NAME}\" are left out for the physical groups, which differ in {} tetrahedra (element {element}: {label}, group {group})",
            all.count() + 1
        ))
    }
}

/// A count and as many lines: text in binary files, too.
fn tags<'a>(source: &mut Source<'a>) -> Result<Vec<&'a str>, String> {
    let line = source.line().ok_or("the file ends here")?;
    let count: u64 = line.parse().map_err(|_| format!("\"{line}\" is not the number of tags expected here"))?;
    (0..count).map(|_| source.line().ok_or_else(|| "the file ends here".to_owned())).collect()
}

/// The tag of an element and its value.
fn entry(source: &mut Source<'_>) -> Result<(u64, f64), String> {
    if source.encoding != Encoding::Ascii {
        let tag = source.int()?;
        return Ok((u64::from(tag.cast_unsigned()), source.double()?));
    }
    let tag = source.size()?;
    let text = source.text()?;
    // meshio 5.3 writes integers of NumPy 2 as "np.uint16(4)".
    let bare = text.strip_prefix("np.").and_then(|t| t.split_once('(')?.1.strip_suffix(')')).unwrap_or(&text);
    let value = bare.parse().map_err(|_| format!("element {tag}: \"{text}\" is no number"))?;
    Ok((tag, value))
}
