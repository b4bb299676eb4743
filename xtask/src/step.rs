//! Running one program as a named step: what it is, how long it took, and a clear word when it fails.

use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

/// Why a chore stopped, in words for a person.
pub type Failure = String;

/// The root folder of the workspace.
pub fn workspace_root() -> PathBuf {
    let own = Path::new(env!("CARGO_MANIFEST_DIR"));
    own.parent().unwrap_or(own).to_path_buf()
}

/// `cargo` of the toolchain that runs this chore, started in the workspace root.
pub fn cargo(arguments: &[&str]) -> Command {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(cargo);
    command.args(arguments).current_dir(workspace_root());
    command
}

/// `cargo` of the nightly toolchain, whatever toolchain runs this chore.
pub fn nightly(arguments: &[&str]) -> Command {
    let mut command = Command::new("rustup");
    command
        .args(["run", "nightly", "cargo"])
        .args(arguments)
        .env_remove("CARGO")
        .env_remove("RUSTC")
        .env_remove("RUSTUP_TOOLCHAIN");
    command
}

/// The tool's whole-loop tests; what is added names those that run.
pub fn whole_loop() -> Command {
    cargo(&[
        "test",
        "--locked",
        "--package",
        "gauntlet",
        "--test",
        "whole_loop",
        "--",
    ])
}

/// Runs `command` to its end, with its output on the terminal; prints the step's name before and its time after.
pub fn run(name: &str, command: &mut Command) -> Result<(), Failure> {
    println!("==> {name}");
    let started = Instant::now();
    let status = command
        .status()
        .map_err(|error| format!("{name}: cannot start {:?}: {error}", command.get_program()))?;
    let seconds = started.elapsed().as_secs_f64();
    if !status.success() {
        return Err(format!(
            "{name} failed ({status}) after {seconds:.1} s; the lines above say why"
        ));
    }
    println!("<== {name}: {seconds:.1} s");
    Ok(())
}

/// Becomes `command`: whoever ends this process (Ctrl-C, `kill` by its id) ends that program, and none is left behind.
pub fn become_program(name: &str, command: &mut Command) -> Failure {
    println!("==> {name}");
    let error = command.exec();
    format!("{name}: cannot start {:?}: {error}", command.get_program())
}

/// Whether `command` starts and ends well; its errors stand on the terminal.
pub fn says(command: &mut Command) -> bool {
    command
        .stdout(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
}

/// Whether `command` starts and ends well; its output is dropped.
pub fn succeeds(command: &mut Command) -> bool {
    command.output().is_ok_and(|output| output.status.success())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    /// Set for the process that becomes another program.
    const BECOMES: &str = "GAUNTLET_XTASK_BECOMES";

    #[test]
    fn whoever_ends_the_chore_ends_the_program_that_it_became() {
        if std::env::var_os(BECOMES).is_some() {
            panic!(
                "{}",
                become_program("sleep", Command::new("sleep").arg("60"))
            );
        }
        let own = std::env::current_exe().expect("this test's program");
        let mut child = Command::new(own)
            .args([
                "--exact",
                "step::tests::whoever_ends_the_chore_ends_the_program_that_it_became",
            ])
            .env(BECOMES, "1")
            .stdout(Stdio::null())
            .spawn()
            .expect("a process");
        let comm = format!("/proc/{}/comm", child.id());
        let end = Instant::now() + Duration::from_secs(20);
        while std::fs::read_to_string(&comm).unwrap_or_default().trim() != "sleep" {
            let ended = child.try_wait().expect("its status");
            assert!(
                ended.is_none() && Instant::now() < end,
                "it became nothing: {ended:?}"
            );
            std::thread::sleep(Duration::from_millis(10));
        }
        assert!(says(
            Command::new("kill").args(["-TERM", &child.id().to_string()])
        ));
        let status = child.wait().expect("its status");
        assert_eq!(
            std::os::unix::process::ExitStatusExt::signal(&status),
            Some(15)
        );
    }
}
