//! Coordinate frames as zero-sized types, so that a point of one frame cannot be used in another.

/// A coordinate frame. The table of all frames (origin, axes, unit) is in ARCHITECTURE.md.
pub trait Frame: Copy + Clone + core::fmt::Debug + PartialEq + Send + Sync + 'static {
    /// Name used in error messages and logs.
    const NAME: &'static str;
}

macro_rules! frames {
    ($($(#[$doc:meta])* $name:ident = $text:literal;)*) => {$(
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub struct $name;
        impl Frame for $name {
            const NAME: &'static str = $text;
        }
    )*};
}

frames! {
    /// Continuous voxel index (column, row, slice); voxel centres are at whole numbers. Unit: voxel.
    Voxel = "voxel";
    /// DICOM patient coordinates, LPS axes. Unit: mm.
    Patient = "patient";
    /// The tracking system's world, right-handed. Unit: mm.
    Tracker = "tracker";
    /// A tracked tool's own body frame. Unit: mm.
    Tool = "tool";
    /// The display's eye frame (x right, y up, z towards the viewer). Unit: mm.
    Display = "display";
}
