//! The `monro` command.

fn main() {}
