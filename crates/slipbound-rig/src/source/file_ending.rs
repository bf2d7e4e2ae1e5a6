//! Endings of file names.

use std::path::Path;

/// Whether a file's name ends so, in capital or small letters.
pub fn has_ending(path: &Path, ending: &str) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(ending))
}
