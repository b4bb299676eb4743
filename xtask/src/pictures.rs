//! Pictures of the page, made by a browser without a screen.

use crate::setup::{self, Thing};
use crate::step::{self, Failure};

/// The README's picture, and one of each state of the page.
pub fn run() -> Result<(), Failure> {
    setup::require(&[Thing::Browser])?;
    let folder = step::workspace_root().join("target/pictures");
    std::fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let only = ["--ignored", "--test-threads", "1", "browser::"];
    step::run(
        "pictures of the page",
        step::whole_loop().args(only).env("PAGE_PICTURES", &folder),
    )?;
    // The states of a real training, as the program shows them.
    let training = ["--nocapture", "taught::poses_are_shown"];
    step::run(
        "pictures of a training",
        step::whole_loop()
            .args(training)
            .env("PAGE_PICTURES", &folder),
    )?;
    println!("docs/view.webp, and to look at: {}", folder.display());
    Ok(())
}
