//! Anatomical landmarks for planning.
