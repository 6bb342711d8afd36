//! Who looks on while a case is built.

/// The stages, in order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Stage {
    /// Labels, found or checked.
    Segment,
    /// Closed surfaces of skin, skull, brain and ventricles.
    Surfaces,
    /// Landmarks and the planned path.
    Plan,
    /// The simulation mesh.
    Tetrahedra,
    /// Files.
    Write,
}

impl Stage {
    /// All of them, in order.
    pub const ALL: [Self; 5] = [Self::Segment, Self::Surfaces, Self::Plan, Self::Tetrahedra, Self::Write];

    /// Name for people and reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Segment => "segment",
            Self::Surfaces => "surfaces",
            Self::Plan => "plan",
            Self::Tetrahedra => "tetrahedra",
            Self::Write => "write",
        }
    }
}

/// Is told what happens; every method has a default that does nothing.
pub trait Observer {
    /// A stage begins.
    fn begin(&self, _stage: Stage) {}
    /// The same stage is over, well or not.
    fn end(&self, _stage: Stage) {}
    /// A remark on scan, labels or plan that the user should not miss; all of them are also in the case.
    fn remark(&self, _text: &str) {}
    /// Whether to give up; asked before each stage.
    fn cancelled(&self) -> bool {
        false
    }
}

/// Nobody looks on.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Observer for Silent {}
