//! The touched landmarks beside their marks in the scan.

use crate::args::RegisterArgs;
use crate::calibrate::named_points;
use anyhow::{Context, Result, bail};
use monro_case::Case;
use monro_case::markups::{self, NamedPoint};
use monro_geometry::{Bvh, Patient, Point, Tool};
use monro_guidance::Covariance;
use monro_guidance::registration::Landmark;
use std::path::Path;

/// Marks further from the skin are remarked upon, mm: screws in bone lie nearer.
const TOLD_MM: f64 = 15.0;
/// Marks most of which are further from it are of no head that lies here, mm.
const MOST_MM: f64 = 60.0;

/// All marks: those of a file of one's own, or the case's.
pub(super) fn marked(args: &RegisterArgs, case: &Case) -> Result<Vec<NamedPoint>> {
    args.marked.as_deref().map_or_else(|| Ok(case.landmarks.clone()), read_marks)
}

/// The touched points beside their marks of the same name.
pub(super) fn landmarks(args: &RegisterArgs, marked: &[NamedPoint]) -> Result<Vec<Landmark<Patient, Tool>>> {
    let noise = Covariance::isotropic(args.touch_sigma);
    let pair = |(name, touched): (String, Point<Tool>)| {
        let names = || marked.iter().map(|m| m.label.as_str());
        if is_twice(names(), &name) {
            bail!("'{name}' is marked twice; keep the mark that counts");
        }
        let mark = marked.iter().find(|m| m.label.eq_ignore_ascii_case(&name));
        let listed = || names().collect::<Vec<_>>().join(", ");
        let none = || {
            if marked.is_empty() {
                "none at all: does the case lack its landmarks.mrk.json?".to_owned()
            } else {
                listed()
            }
        };
        let mark = mark.with_context(|| format!("no landmark is marked as '{name}' (marked: {})", none()))?;
        Ok(Landmark { name, touched, marked: mark.position, noise })
    };
    let touched = named_points(&args.landmarks)?;
    let names = || touched.iter().map(|t| t.0.as_str());
    if let Some(name) = names().find(|name| is_twice(names(), name)) {
        bail!("{}: '{name}' is given twice; keep the touch that counts", args.landmarks.display());
    }
    touched.into_iter().map(pair).collect()
}

fn read_marks(path: &Path) -> Result<Vec<NamedPoint>> {
    let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
    markups::decode(&text).with_context(|| path.display().to_string())
}

fn is_twice<'a>(names: impl Iterator<Item = &'a str>, name: &str) -> bool {
    names.filter(|n| n.eq_ignore_ascii_case(name)).count() > 1
}

/// Marks that lie far off the skin of the case, in words, the furthest first: of another scan, or within the head, as the foramina of
/// Monro among the case's own.
///
/// # Errors
/// Most are so far off that they are of another scan or frame.
pub(super) fn off_skin(
    args: &RegisterArgs,
    case: &Case,
    landmarks: &[Landmark<Patient, Tool>],
) -> Result<Option<String>> {
    let skin = Bvh::new(&case.skin);
    let distance = |l: &Landmark<Patient, Tool>| skin.nearest(l.marked).map_or(0.0, |n| n.distance);
    let mut off: Vec<(f64, &str)> = landmarks.iter().map(|l| (distance(l), l.name.as_str())).collect();
    off.sort_by(|a, b| b.0.total_cmp(&a.0));
    let told: Vec<String> =
        off.iter().filter(|o| o.0 > TOLD_MM).map(|(d, name)| format!("'{name}' by {d:.0} mm")).collect();
    let way_out = match args.marked {
        Some(_) => "were they set in this scan, in mm, LPS or with their coordinateSystem?",
        None => "nothing can touch them there; leave them out",
    };
    match off.get(off.len() / 2) {
        _ if told.is_empty() => Ok(None),
        Some(middle) if middle.0 > MOST_MM => {
            bail!("the marks lie off the skin of this head: {}; {way_out}", told.join(", "))
        }
        _ => Ok(Some(format!("Marked off the skin of this head: {}; {way_out}", told.join(", ")))),
    }
}
