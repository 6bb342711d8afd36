//! What the structures are called in SNOMED CT, as DICOM and 3D Slicer write it.

use monro_geometry::Structure;

/// A coded term of the scheme `SCT`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Term {
    /// The code.
    pub code: &'static str,
    /// Its meaning.
    pub meaning: &'static str,
}

/// Category, kind and side of a structure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Terms {
    /// Anatomical structure, body substance.
    pub category: Term,
    /// What it is.
    pub kind: Term,
    /// Left or right.
    pub modifier: Option<Term>,
}

const fn term(code: &'static str, meaning: &'static str) -> Term {
    Term { code, meaning }
}

/// The terms of a structure; `None` for the outside.
pub const fn terms(structure: Structure) -> Option<Terms> {
    let lateral = term("66720007", "Lateral Ventricle");
    let (kind, modifier) = match structure {
        Structure::Outside => return None,
        Structure::Scalp => (term("41695006", "Scalp"), None),
        Structure::Skull => (term("89546000", "Skull"), None),
        Structure::Csf => (term("65216001", "Cerebrospinal Fluid"), None),
        Structure::Brain => (term("12738006", "Brain"), None),
        Structure::LeftLateralVentricle => (lateral, Some(term("7771000", "Left"))),
        Structure::RightLateralVentricle => (lateral, Some(term("24028007", "Right"))),
        Structure::ThirdVentricle => (term("49841001", "Third ventricle"), None),
    };
    let category = if matches!(structure, Structure::Csf) {
        term("91720002", "Body Substance")
    } else {
        term("91723000", "Anatomical Structure")
    };
    Some(Terms { category, kind, modifier })
}
