//! Images of a series that lie between the slices of a stack and are not of it.

use super::folder::name;
use super::image::Image;
use super::series::{FEWEST, Series, along};

/// Remarks on each stack that can be taken about images of the same series that lie between its slices, are too few for a stack
/// of their own, and have other pixels, another size or another direction: what they show is missing there.
pub(super) fn note(all: &mut [Series]) {
    let told: Vec<Option<String>> = (0..all.len()).map(|n| remark(all, n)).collect();
    all.iter_mut().zip(told).for_each(|(series, told)| series.warnings.extend(told));
}

fn remark(all: &[Series], n: usize) -> Option<String> {
    let own = all.get(n).filter(|s| s.refusal.is_none())?;
    let first = own.images.first()?.placement.as_ref().ok()?;
    let end = along(first, own.images.last()?);
    let between = |i: &&Image| !i.localizer && !i.projection && (0.0..end).contains(&along(first, i));
    let few = all.iter().filter(|s| s.uid == own.uid && s.images.len() < FEWEST);
    let strays: Vec<&Image> = few.flat_map(|s| &s.images).filter(between).collect();
    let stray = strays.first()?;
    Some(format!(
        "{} image(s) of the same series lie between its slices and are not like them (the first: {}, {}; the others: {}): they \
         were left out, and what they show is interpolated",
        strays.len(),
        name(&stray.file),
        look(stray),
        look(&own.images[0])
    ))
}

/// What slices of one stack have in common.
fn look(image: &Image) -> String {
    let mm = image.placement.as_ref().map_or([0.0; 2], |p| [p.u.norm(), p.v.norm()]);
    let kernel = image.about.kernel.as_deref().map_or(String::new(), |k| format!(", kernel {k}"));
    format!("{} x {} pixels of {:.4} x {:.4} mm{kernel}", image.size[0], image.size[1], mm[0], mm[1])
}
