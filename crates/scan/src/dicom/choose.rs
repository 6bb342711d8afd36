//! Which series of a folder is the best head CT.

use super::folder::Survey;
use super::series::Series;
use crate::error::ScanError;
use crate::resample::Stack;
use crate::{ReadOptions, check};
use monro_geometry::{Patient, Point};
use std::path::Path;

/// A head is taller than this, mm: a shorter series may be a part of one.
const HEAD_MM: f64 = 130.0;
/// Beyond the series that is taken another one goes on by at least this, mm.
const BEYOND_MM: f64 = 15.0;
/// Slices of one examination lie above each other to this, mm.
const ASIDE_MM: f64 = 40.0;

/// So many of the series passed over are named.
const NAMED: usize = 5;

/// Merits in the order in which they decide; all that is equal is decided by the first series met.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Merit {
    /// As large as a head.
    large: bool,
    /// In HU, as far as the header says.
    hu: bool,
    axial: bool,
    /// Not a bone kernel: the ventricles drown in its noise.
    soft: bool,
    /// Without contrast agent.
    plain: bool,
    /// Slices of at most 3 mm.
    thin: bool,
    slices: usize,
}

impl Merit {
    fn of(series: &Series) -> Self {
        let s = series.source();
        Self {
            large: check::foresee(&s).is_none(),
            hu: series.doubtful_unit().is_none(),
            axial: s.orientation == "axial",
            soft: !s.kernel.as_deref().is_some_and(is_bone_kernel),
            plain: !series.with_contrast(),
            thin: s.native_spacing_mm[2] <= 3.0,
            slices: series.images.len(),
        }
    }

    /// The first merit in which this one is better.
    fn beats(self, other: Self) -> &'static str {
        if self.large != other.large {
            "it is as large as a head"
        } else if self.hu != other.hu {
            "its values are in HU"
        } else if self.axial != other.axial {
            "it is axial"
        } else if self.soft != other.soft {
            "it has no bone kernel"
        } else if self.plain != other.plain {
            "its header names no contrast agent"
        } else if self.thin != other.thin {
            "its slices are thinner"
        } else if self.slices != other.slices {
            "it has more slices"
        } else {
            "it comes first"
        }
    }
}

/// Kernels made for bone and lung, as the makers name them.
pub(crate) fn is_bone_kernel(kernel: &str) -> bool {
    let k = kernel.trim().to_uppercase();
    let words = ["BONE", "EDGE", "LUNG", "SHARP"];
    // Philips.
    let exact = ["D", "E", "F", "L", "YD", "YE", "YL"];
    let digits: String = k.chars().skip_while(|c| !c.is_ascii_digit()).take_while(char::is_ascii_digit).collect();
    let number: u32 = digits.parse().unwrap_or(0);
    let numbered = if k.starts_with("FC") {
        // Toshiba and Canon: 30 to 39 bone, 50 to 59 lung, 80 to 89 bone of high resolution.
        matches!(number, 30..=39 | 50..=59 | 80..=89)
    } else {
        // Siemens: H31s is soft, H60s and Hr68 are sharp.
        k.starts_with(['B', 'H', 'J', 'U', 'I', 'V', 'T', 'Q']) && (60..=99).contains(&number)
    };
    words.iter().any(|w| k.contains(w)) || exact.contains(&k.as_str()) || numbered
}

/// Index of the best usable series among the candidates, and why.
pub(crate) fn best(series: &[Series]) -> (Option<usize>, String) {
    let mut usable: Vec<(usize, Merit)> =
        series.iter().enumerate().filter(|(_, s)| s.refusal.is_none()).map(|(n, s)| (n, Merit::of(s))).collect();
    // A stable sort: of equals, the first stays first.
    usable.sort_by_key(|&(_, merit)| core::cmp::Reverse(merit));
    let Some(&(chosen, merit)) = usable.first() else {
        return (None, "no series can be taken".into());
    };
    let reason = match usable.get(1) {
        None if series.len() == 1 => "the only DICOM series".to_owned(),
        None => "the only DICOM series that can be taken".to_owned(),
        Some(_) => {
            let others = usable[1..].iter().take(NAMED);
            let why: Vec<String> = others
                .map(|&(n, other)| format!("rather than {}, because {}", series[n].id, merit.beats(other)))
                .collect();
            let more = match usable.len() - 1 - why.len() {
                0 => String::new(),
                n => format!("; rather than {n} more"),
            };
            format!("{} series can be taken; {}{more}", usable.len(), why.join("; "))
        }
    };
    (Some(chosen), reason)
}

/// The wanted series, or the best one; and why, where others could be taken and none was asked for.
///
/// # Errors
/// Unknown series, several patients, nothing usable.
pub(crate) fn choose(
    path: &Path,
    survey: &Survey,
    mut series: Vec<Series>,
    o: &ReadOptions,
) -> Result<(Series, Option<String>), ScanError> {
    if let Some(wanted) = &o.series_uid {
        let known = series.iter().map(|s| s.id.clone()).collect();
        series.retain(|s| s.uid == *wanted || s.id == *wanted);
        if series.is_empty() {
            return Err(ScanError::UnknownSeries { wanted: wanted.clone(), known });
        }
    } else {
        let images = survey.patients();
        if images.len() > 1 {
            return Err(ScanError::SeveralPatients { folder: path.to_path_buf(), images });
        }
    }
    if let (Some(n), reason) = best(&series) {
        let alone = o.series_uid.is_some() || series.iter().filter(|s| s.refusal.is_none()).count() == 1;
        let rest = series.iter().enumerate().filter(|&(i, s)| i != n && s.refusal.is_none());
        let goes_on: Vec<String> = rest.filter_map(|(_, other)| goes_on(&series[n], other)).collect();
        let mut chosen = series.swap_remove(n);
        chosen.warnings.extend(goes_on);
        return Ok((chosen, (!alone).then_some(reason)));
    }
    if series.len() == 1 {
        let s = series.swap_remove(0);
        return match s.refusal {
            Some(problem) => Err(ScanError::Series { series: s.id, problem }),
            None => Ok((s, None)),
        };
    }
    let reason = |s: &Series| s.refusal.as_ref().map(|r| format!("{}: {r}", s.id));
    Err(ScanError::NoUsableSeries { folder: path.to_path_buf(), reasons: series.iter().filter_map(reason).collect() })
}

/// That another series shows what lies beyond one that is too short for a head.
fn goes_on(chosen: &Series, other: &Series) -> Option<String> {
    let (own, beyond) = (chosen.stack.as_ref()?, other.stack.as_ref()?);
    let normal = own.u.cross(own.v).normalized()?;
    let (first, last) = (*own.origins.first()?, *own.origins.last()?);
    let along = |p: Point<Patient>| (p - first).dot(normal);
    let middle = |s: &Stack, origin| origin + s.u * (0.5 * s.size[0] as f64) + s.v * (0.5 * s.size[1] as f64);
    let high = along(last);
    let [from, to] = [*beyond.origins.first()?, *beyond.origins.last()?].map(along);
    let parallel = beyond.u.cross(beyond.v).normalized()?.dot(normal).abs() > 0.99;
    let way = middle(beyond, *beyond.origins.first()?) - middle(own, first);
    let aside = (way - normal * way.dot(normal)).norm();
    let more = (-from.min(to)).max(from.max(to) - high);
    (parallel && high < HEAD_MM && aside < ASIDE_MM && more > BEYOND_MM).then(|| {
        format!(
            "series {} is {high:.0} mm high, which is less than a head, and series {} goes on for {more:.0} mm beyond it: the head \
             may be in two parts, of which one is used; join them, or take a series that shows all of it",
            chosen.id, other.id
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kernels_of_all_makers() {
        for bone in [
            "BONE", "BONEPLUS", "EDGE", "LUNG", "H60s", "H70h", "Hr68f\\3", "Br64", "J70h", "FC30", "FC81", "FC51",
            "D", "YE",
        ] {
            assert!(is_bone_kernel(bone), "{bone}");
        }
        for soft in [
            "STANDARD", "STD+", "SOFT", "H31s", "H40s", "Hr40", "J40s", "FC68", "FC26", "FC13", "UB", "B", "C", "HEAD",
            "",
        ] {
            assert!(!is_bone_kernel(soft), "{soft}");
        }
    }

    #[test]
    fn merits_decide_in_their_order() {
        let base = Merit { large: true, hu: true, axial: true, soft: true, plain: true, thin: false, slices: 30 };
        let cases = [
            (Merit { large: false, slices: 900, ..base }, "it is as large as a head"),
            (Merit { hu: false, thin: true, slices: 300, ..base }, "its values are in HU"),
            (Merit { axial: false, thin: true, ..base }, "it is axial"),
            (Merit { soft: false, thin: true, slices: 300, ..base }, "it has no bone kernel"),
            (Merit { plain: false, thin: true, slices: 300, ..base }, "its header names no contrast agent"),
            (Merit { slices: 29, ..base }, "it has more slices"),
            (base, "it comes first"),
        ];
        for (other, why) in cases {
            assert!(base >= other);
            assert_eq!(base.beats(other), why);
        }
        assert!(Merit { thin: true, slices: 10, ..base } > base);
    }
}
