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

/// Whether x and y change sign on the way to LPS. Slicer 4.11 wrote numbers: 0 RAS, 1 LPS; without the entry it is RAS.
fn flips_to_lps(system: &Value) -> Result<bool, MarkupsError> {
    match system {
        Value::Null => Ok(true),
        Value::String(s) if s == "RAS" || s == "0" => Ok(true),
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

/// Entry and target of a plan: the points labelled so (any case, also as part of the label), else the first two.
///
/// # Errors
/// As [`decode`], or fewer than two placed points.
pub fn decode_plan(text: &str) -> Result<[Point<Patient>; 2], MarkupsError> {
    let points = decode(text)?;
    let named = |word: &str| points.iter().find(|p| p.label.to_lowercase().contains(word)).map(|p| p.position);
    match (named("entry"), named("target"), points.as_slice()) {
        (Some(entry), Some(target), _) => Ok([entry, target]),
        (_, _, [a, b, ..]) => Ok([a.position, b.position]),
        (_, _, few) => Err(MarkupsError::Count(few.len())),
    }
}

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
    fn ras_is_converted_and_an_unknown_system_is_refused() {
        let text = encode(Kind::Line, &plan());
        let ras = decode(&text.replace("\"LPS\"", "\"RAS\"")).expect("ras");
        assert_eq!(ras[0].position, Point::new(-1.0, -2.0, 3.0));
        let old = decode(&text.replace("\"LPS\"", "1")).expect("numbers of Slicer 4.11");
        assert_eq!(old[0].position, Point::new(1.0, 2.0, 3.0));
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
