//! The soft body, seen from outside.

mod against_planes;
mod askew;
mod attachments;
mod calm;
mod common;
mod contact;
mod equilibrium;
mod fluid;
mod hands;
mod hole;
mod insertion_forces;
mod moduli;
mod oblique_tools;
mod paper_mode;
mod physical_mode;
mod rigid_bodies;
mod room;
mod seen_from_outside;
mod slivers;
mod stable;
mod thin_membrane;
