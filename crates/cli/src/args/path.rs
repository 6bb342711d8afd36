//! A straight path from text.

use crate::mesh::place;
use anyhow::{Context, Result, bail, ensure};
use monro_geometry::{Patient, Point};

/// Coordinates of a path lie within this of the origin, mm: no scanner is a thousand kilometres away.
const FARTHEST: f64 = 1e9;

/// `X,Y,Z:X,Y,Z` in LPS mm, as the value of an option.
pub(crate) fn path(option: &str, text: &str) -> Result<[Point<Patient>; 2]> {
    let point = |part: &str| -> Option<Point<Patient>> {
        let numbers: Vec<f64> = part.split(',').map(|n| n.trim().parse().ok()).collect::<Option<_>>()?;
        let p = Point::from_array(numbers.try_into().ok()?);
        p.is_finite().then_some(p)
    };
    let ends = text.split_once(':').and_then(|(a, b)| Some([point(a)?, point(b)?]));
    let [from, to] = ends.with_context(|| format!("{option} \"{text}\" is not X,Y,Z:X,Y,Z (LPS mm)"))?;
    for p in [from, to] {
        let far = p.to_array().into_iter().find(|c| c.abs() > FARTHEST);
        if let Some(c) = far {
            bail!("{option} \"{text}\": a coordinate of {c:e} mm is further than {FARTHEST:e} mm away");
        }
    }
    ensure!(
        from != to,
        "{option} \"{text}\": both ends are at {} mm; give two different points",
        place(from.to_array())
    );
    Ok([from, to])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_is_two_points_or_an_error_that_shows_the_form() {
        let [a, b] = path("--path", "1,-2.5,3: 4,5,6e1").expect("a path");
        assert_eq!((a, b), (Point::new(1.0, -2.5, 3.0), Point::new(4.0, 5.0, 60.0)));
        for bad in ["", "1,2,3", "1,2:3,4", "1,2,3:4,5,x", "1,2,3:4,5,inf"] {
            assert!(path("--path", bad).expect_err("refused").to_string().contains("X,Y,Z:X,Y,Z"), "{bad}");
        }
    }

    #[test]
    fn a_path_without_length_or_beyond_all_scanners_was_taken() {
        let said = path("--path", "1,2,3:1,2,3").expect_err("refused").to_string();
        assert!(said.contains("both ends are at (1.00, 2.00, 3.00) mm"), "{said}");
        let said = path("--path", "1e300,2,3:1,2,3").expect_err("refused").to_string();
        assert!(said.contains("1e300 mm") && said.len() < 120, "{said}");
    }
}
