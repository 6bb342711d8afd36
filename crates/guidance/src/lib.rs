//! Plan, needle pose, angles and distances. Pure functions; time, where it matters, is an argument.

mod plan;

pub use plan::{Plan, PlanError, Side};
