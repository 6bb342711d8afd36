//! A file that a command writes: what must not be lost for it.

use anyhow::{Result, bail};
use monro_case::check_output_file;
use std::path::Path;

/// Whether a command that reads `inputs` may write the file `out`.
pub(crate) fn check(out: &Path, force: bool, inputs: &[&Path]) -> Result<()> {
    check_output_file(out, inputs)?;
    if out.is_dir() {
        bail!("{} is a folder; give the name of a file in it", out.display());
    }
    if out.exists() && !force {
        bail!("{} exists already; give --force to overwrite it, or another name", out.display());
    }
    Ok(())
}
