//! The virtual person of `simulate` hears what a person is asked for: `calibrate` and its relatives tell it on a socket beside the
//! glove's link ([`host::calibration::virtual_person`]).

use std::io::ErrorKind;
use std::os::unix::fs::FileTypeExt;
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};

use anyhow::Result;
use host::calibration::virtual_person;
use host::failure::{Failure, OrFail};
use rig::glove::VirtualGlove;
use rig::person::{Attitude, Task};

use crate::wearer::mimicked;

/// Requests that are obeyed in one look.
const AT_ONCE: usize = 16;

/// The ear of the person in a virtual glove; the socket goes away with it.
pub(crate) struct Ear {
    socket: UnixDatagram,
    place: PathBuf,
    glove: VirtualGlove,
}

impl Ear {
    /// Of the person in `glove`, whose port is linked at `link`.
    ///
    /// # Errors
    /// Something else is in the way there.
    pub(crate) fn of(glove: &VirtualGlove, link: &Path) -> Result<Self> {
        let place = virtual_person::place(link);
        let refused = || format!("the virtual person cannot hear at {}", place.display());
        // What a simulation left that was ended roughly.
        match std::fs::symlink_metadata(&place) {
            Ok(there) if there.file_type().is_socket() => {
                std::fs::remove_file(&place).or_fail(refused, "taking it away")?;
            }
            Ok(_) => {
                let what = format!("{}: something else is there", refused());
                return Err(
                    Failure::new(what, "another path for --glove, or taking it away").into(),
                );
            }
            Err(_) => {}
        }
        let socket = UnixDatagram::bind(&place)
            .and_then(|socket| socket.set_nonblocking(true).map(|()| socket))
            .or_fail(refused, "a path in a folder that you may write to")?;
        Ok(Self {
            socket,
            place,
            glove: glove.clone(),
        })
    }

    /// Obeys what was asked. Never waits.
    pub(crate) fn listen(&self) {
        for _ in 0..AT_ONCE {
            let mut request = [0; virtual_person::LONGEST];
            match self.socket.recv(&mut request) {
                Ok(count) => {
                    let text = request.get(..count).unwrap_or_default();
                    if let Some(task) = std::str::from_utf8(text).ok().and_then(task) {
                        self.glove.ask(task);
                    }
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(_) => return,
            }
        }
    }
}

impl Drop for Ear {
    fn drop(&mut self) {
        // It may be gone already.
        let _ = std::fs::remove_file(&self.place);
    }
}

/// What a request asks for.
fn task(request: &str) -> Option<Task> {
    Some(match request {
        "flat" => Task::Flat,
        "turn" => Task::Turn,
        "fists" => Task::Fists,
        "thumb" => Task::Thumb,
        "free" => Task::Free,
        "move" => Task::Use(Attitude::PalmDown),
        show if show.starts_with("show ") => mimicked(&virtual_person::counts_to_show(show)?)?,
        other => Task::Alone(virtual_person::finger(other.strip_prefix("bend ")?)?.number()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use host::calibration::guide::PLAN;

    #[test]
    fn every_step_of_the_session_is_understood() {
        let heard: Vec<Task> = PLAN
            .iter()
            .map(|part| task(&virtual_person::request(part.step)).unwrap())
            .collect();
        assert_eq!(heard[0], Task::Flat);
        assert_eq!(heard[1], Task::Turn);
        assert_eq!(heard[3..8], [1, 2, 3, 4, 0].map(Task::Alone));
        assert_eq!(
            heard[8..],
            [Task::Fists, Task::Thumb, Task::Free, Task::Flat]
        );
        assert_eq!(task("move"), Some(Task::Use(Attitude::PalmDown)));
        let shown = task(&virtual_person::request_to_show(&[
            255.0, 0.0, 12.34, 130.0,
        ]));
        assert!(matches!(shown, Some(Task::Posture(angles)) if angles[3] > 0.5));
        for other in ["show", "show 1 2", "show 1 x", "show nan 1 2 3"] {
            assert_eq!(task(other), None, "{other}");
        }
        for other in ["", "bend", "bend 5", "bend x", "flatter"] {
            assert_eq!(task(other), None, "{other}");
        }
    }

    #[test]
    fn a_socket_that_was_left_is_taken_over_and_anything_else_is_not_touched() {
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("glove");
        let glove = VirtualGlove::new(Box::new(|_: f64| [0.0; 25]), rig::glove::Config::default());
        drop(UnixDatagram::bind(virtual_person::place(&link)).unwrap());
        let ear = Ear::of(&glove, &link).unwrap();
        assert!(virtual_person::VirtualPerson::at(&link).is_some());
        drop(ear);
        assert!(virtual_person::VirtualPerson::at(&link).is_none());
        std::fs::write(virtual_person::place(&link), "mine").unwrap();
        assert!(Ear::of(&glove, &link).is_err());
        assert_eq!(
            std::fs::read(virtual_person::place(&link)).unwrap(),
            b"mine"
        );
    }
}
