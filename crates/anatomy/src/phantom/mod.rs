//! The digital phantoms.
