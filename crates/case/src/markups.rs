//! 3D Slicer markups (`.mrk.json`): plans as lines, landmarks as point lists.
//!
//! Slicer stores RAS or LPS as the file says; everything here is converted to LPS mm on reading and written as LPS.

use monro_geometry::{Patient, Point};
use serde_json::{Value, json};
use thiserror::Error;

/// Why a markups file was refused.
#[derive(Debug, Error)]
pub enum MarkupsError {
    /// Not JSON.
    #[error("the file is not JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// Not a markups file.
    #[error("the file has no \"markups\" list with control points; save a line or point list from 3D Slicer")]
    NoMarkups,
    /// A coordinate system other than RAS or LPS.
    #[error("coordinate system {0}: only \"RAS\" and \"LPS\" are known")]
    CoordinateSystem(String),
    /// A unit other than millimetre.
    #[error("coordinate unit {0}: only \"mm\" is known")]
    Unit(String),
    /// A control point without three finite numbers.
    #[error("control point {0} has no three finite numbers as its position")]
    Position(usize),
    /// A plan needs two points.
    #[error("a plan needs an entry and a target, but the file has {0} placed points")]
    Count(usize),
    /// Which points are entry and target is not said.
    #[error(
        "the file does not say which of its points are entry and target ({}): a plan is a line of two points from entry \
         to target, or has one point named \"entry\" and one named \"target\"",
        .0.join(", ")
    )]
    Unnamed(Vec<String>),
}

/// A named point in the patient frame.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedPoint {
    /// The control point's label.
    pub label: String,
    /// Its position, LPS mm.
    pub position: Point<Patient>,
}

/// Kind of markup to write.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A line of two points.
    Line,
    /// A list of points.
    Fiducial,
}

/// Writes one markup with the given points, as LPS.
pub fn encode(kind: Kind, points: &[NamedPoint]) -> String {
    let name = match kind {
        Kind::Line => "Line",
        Kind::Fiducial => "Fiducial",
    };
    let control_points: Vec<Value> = points
        .iter()
        .enumerate()
        .map(|(i, p)| {
            json!({
                "id": (i + 1).to_string(), "label": p.label, "description": "", "associatedNodeID": "",
                "position": p.position.to_array(), "orientation": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
                "selected": true, "locked": false, "visibility": true, "positionStatus": "defined"
            })
        })
        .collect();
    let markup = json!({
        "type": name, "coordinateSystem": "LPS", "coordinateUnits": "mm", "locked": false,
        "labelFormat": "%N-%d", "controlPoints": control_points, "measurements": []
    });
    let schema = "https://raw.githubusercontent.com/slicer/slicer/master/Modules/Loadable/Markups/Resources/Schema/markups-schema-v1.0.3.json#";
    let document = json!({ "@schema": schema, "markups": [markup] });
    format!("{document:#}\n")
}

/// Reads all placed control points of all markups of a file, as LPS.
///
/// # Errors
/// A named fault; nothing is guessed about an unknown coordinate system.
pub fn decode(text: &str) -> Result<Vec<NamedPoint>, MarkupsError> {
    let document: Value = serde_json::from_str(text)?;
    let markups = document["markups"].as_array().ok_or(MarkupsError::NoMarkups)?;
    let mut points = Vec::new();
    for markup in markups {
        let flip = flips_to_lps(&markup["coordinateSystem"])?;
        match &markup["coordinateUnits"] {
            Value::Null => {}
            Value::String(u) if u == "mm" => {}
            // Newer files give a coded unit: ["mm", "UCUM", "millimeter"].
            Value::Array(a) if a.first().and_then(Value::as_str) == Some("mm") => {}
            other => return Err(MarkupsError::Unit(other.to_string())),
        }
        for p in markup["controlPoints"].as_array().ok_or(MarkupsError::NoMarkups)? {
            if matches!(p["positionStatus"].as_str(), None | Some("defined")) {
                points.push(control_point(p, points.len(), flip)?);
            }
        }
    }
    Ok(points)
}

/// Whether x and y change sign on the way to LPS. Slicer 4.11 wrote numbers: 0 RAS, 1 LPS; without the entry it is LPS, as in
/// Slicer and its schema.
fn flips_to_lps(system: &Value) -> Result<bool, MarkupsError> {
    match system {
        Value::String(s) if s == "RAS" || s == "0" => Ok(true),
        Value::Null => Ok(false),
        Value::String(s) if s == "LPS" || s == "1" => Ok(false),
        Value::Number(n) if n.as_i64() == Some(0) => Ok(true),
        Value::Number(n) if n.as_i64() == Some(1) => Ok(false),
        other => Err(MarkupsError::CoordinateSystem(other.to_string())),
    }
}

fn control_point(p: &Value, index: usize, flip: bool) -> Result<NamedPoint, MarkupsError> {
    let position = p["position"].as_array().filter(|a| a.len() == 3).ok_or(MarkupsError::Position(index))?;
    let mut xyz = [0.0; 3];
    for (v, c) in position.iter().zip(&mut xyz) {
        *c = v.as_f64().filter(|v| v.is_finite()).ok_or(MarkupsError::Position(index))?;
    }
    let sign = if flip { -1.0 } else { 1.0 };
    let position = Point::new(sign * xyz[0], sign * xyz[1], xyz[2]);
    Ok(NamedPoint { label: p["label"].as_str().unwrap_or("").to_owned(), position })
}

/// Entry and target of a plan: the points labelled so (any case, also as part of the label), else those of a line of two
/// in their order.
///
/// # Errors
/// As [`decode`], fewer than two placed points, or a list that does not say which of its points are meant.
pub fn decode_plan(text: &str) -> Result<[Point<Patient>; 2], MarkupsError> {
    let points = decode(text)?;
    let is = |p: &NamedPoint, word: &str| p.label.to_lowercase().contains(word);
    // A line called "entry-target" names both of its points by both words, which tells nothing.
    let named = |word: &str, other: &str| -> Vec<Point<Patient>> {
        points.iter().filter(|p| is(p, word) && !is(p, other)).map(|p| p.position).collect()
    };
    let landmarks = points.iter().any(|p| LANDMARKS.iter().any(|word| is(p, word)));
    match (&named("entry", "target")[..], &named("target", "entry")[..], &points[..]) {
        ([entry], [target], _) => Ok([*entry, *target]),
        ([entry], [], [a, b]) => Ok([*entry, if a.position == *entry { b.position } else { a.position }]),
        ([], [target], [a, b]) => Ok([if a.position == *target { b.position } else { a.position }, *target]),
        ([], [], [a, b]) if !landmarks => Ok([a.position, b.position]),
        (_, _, few @ ([] | [_])) => Err(MarkupsError::Count(few.len())),
        _ => Err(MarkupsError::Unnamed(points.into_iter().map(|p| p.label).collect())),
    }
}

/// Words in the names of landmarks: points of these names are marks on a head, not the ends of a path.
const LANDMARKS: [&str; 5] = ["nasion", "midline", "kocher", "monro", "tragus"];

#[cfg(test)]
mod tests {
    use super::*;

    fn plan() -> Vec<NamedPoint> {
        let at = |label: &str, position| NamedPoint { label: label.into(), position };
        vec![at("target", Point::new(1.0, 2.0, 3.0)), at("entry", Point::new(4.0, -5.0, 6.5))]
    }

    #[test]
    fn a_plan_is_read_back_by_its_labels_not_its_order() {
        let [entry, target] = decode_plan(&encode(Kind::Line, &plan())).expect("own file");
        assert_eq!((entry, target), (Point::new(4.0, -5.0, 6.5), Point::new(1.0, 2.0, 3.0)));
    }

    #[test]
    fn the_first_two_of_a_list_of_landmarks_were_taken_as_entry_and_target() {
        let list = |labels: &[&str]| {
            let at = |(i, label): (usize, &&str)| NamedPoint {
                label: (*label).into(),
                position: Point::new(i as f64, 0.0, 0.0),
            };
            decode_plan(&encode(Kind::Fiducial, &labels.iter().enumerate().map(at).collect::<Vec<_>>()))
        };
        for unclear in [
            &["nasion", "midline above nasion", "Kocher left", "Kocher right", "Monro left", "Monro right"][..],
            &["nasion", "Kocher left"],
            &["F-1", "F-2", "F-3"],
            &["entry left", "target left", "entry right", "target right"],
        ] {
            let refused = list(unclear).expect_err(unclear[0]);
            assert!(matches!(refused, MarkupsError::Unnamed(_)), "{unclear:?}: {refused}");
            assert!(refused.to_string().contains(unclear[1]) && refused.to_string().contains("named \"entry\""));
        }
        let x = |labels: &[&str]| list(labels).map(|ends| ends.map(|p| p.x)).expect("a plan");
        assert_eq!(x(&["L-1", "L-2"]), [0.0, 1.0]);
        assert_eq!(x(&["entry-target-1", "entry-target-2"]), [0.0, 1.0]);
        assert_eq!(x(&["F-1", "Entry"]), [1.0, 0.0]);
        assert_eq!(x(&["target", "F-2"]), [1.0, 0.0]);
        assert_eq!(x(&["nasion", "Target", "my entry"]), [2.0, 1.0]);
    }

    #[test]
    fn ras_is_converted_and_an_unknown_system_is_refused() {
        let text = encode(Kind::Line, &plan());
        let ras = decode(&text.replace("\"LPS\"", "\"RAS\"")).expect("ras");
        assert_eq!(ras[0].position, Point::new(-1.0, -2.0, 3.0));
        let old = decode(&text.replace("\"LPS\"", "1")).expect("numbers of Slicer 4.11");
        assert_eq!(old[0].position, Point::new(1.0, 2.0, 3.0));
        let unsaid = decode(&text.replace("\"coordinateSystem\"", "\"other\"")).expect("the schema's default");
        assert_eq!(unsaid[0].position, Point::new(1.0, 2.0, 3.0));
        assert!(matches!(decode(&text.replace("\"LPS\"", "\"XYZ\"")), Err(MarkupsError::CoordinateSystem(_))));
        assert!(matches!(decode(&text.replace("\"mm\"", "\"m\"")), Err(MarkupsError::Unit(_))));
    }

    #[test]
    fn unplaced_points_do_not_count_and_one_point_is_no_plan() {
        let text = encode(Kind::Fiducial, &plan()).replacen("\"defined\"", "\"preview\"", 1);
        assert!(matches!(decode_plan(&text), Err(MarkupsError::Count(1))));
        assert!(matches!(decode("{}"), Err(MarkupsError::NoMarkups)));
        assert!(matches!(decode("no"), Err(MarkupsError::Json(_))));
        let nan = encode(Kind::Line, &plan()).replace("-5.0", "null");
        assert!(matches!(decode(&nan), Err(MarkupsError::Position(1))));
    }
}
