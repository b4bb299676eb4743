//! The symbolic link under which a pseudo-terminal is found: never in the way of anything else.

use std::io;
use std::path::{Path, PathBuf};

/// Where the system keeps the terminals' ends.
const TERMINALS: &str = "/dev/pts/";

/// A link of ours; dropping it removes it, if it still is ours.
#[derive(Debug)]
pub(super) struct Link {
    path: PathBuf,
    target: PathBuf,
}

impl Link {
    /// Links `path` to the terminal `target`.
    ///
    /// What stands at `path` is replaced only where it is a link to a terminal that no longer is, or
    /// that is `target` itself (terminals' numbers are used again).
    ///
    /// # Errors
    /// Anything else is there, or the folder is not there or not writable.
    pub fn create(path: &Path, target: &Path) -> io::Result<Self> {
        if let Ok(there) = std::fs::symlink_metadata(path) {
            let dead = there.file_type().is_symlink() && is_dead(path, target);
            if !dead {
                let text = format!(
                    "{} exists and is not a dead link to a terminal: choose another path or remove it",
                    path.display()
                );
                return Err(io::Error::new(io::ErrorKind::AlreadyExists, text));
            }
            std::fs::remove_file(path)?;
        }
        // Fails rather than replaces, should another have been quicker.
        std::os::unix::fs::symlink(target, path).map_err(|e| {
            io::Error::new(
                e.kind(),
                format!(
                    "no link at {}: {e}: choose a writable folder",
                    path.display()
                ),
            )
        })?;
        Ok(Self {
            path: path.to_owned(),
            target: target.to_owned(),
        })
    }

    pub fn path(&self) -> &Path {
        &self.path
    }
}

fn is_dead(path: &Path, ours: &Path) -> bool {
    std::fs::read_link(path)
        .is_ok_and(|to| to == ours || (to.starts_with(TERMINALS) && !to.exists()))
}

impl Drop for Link {
    fn drop(&mut self) {
        if std::fs::read_link(&self.path).is_ok_and(|to| to == self.target) {
            // Gone already is as good.
            let _ = std::fs::remove_file(&self.path);
        }
    }
}
