//! A map taught by a person, who mimics gripper poses with the hand (Algorithm 1 with a human operator).
//!
//! [`Teaching`] decides: which pose is asked, whether the hand holds still, what is taken and what is refused. It takes the time as an
//! argument and does no input or output. [`Learner`] trains meanwhile on a thread of its own and says which pose is next; [`kept`]
//! keeps the pairs on the disk, each as soon as it is taken. [`Free`] asks for the free motion before.
//!
//! The pairs and the recorded motion are the whole state: the trainings that led to a pose follow from them bit for bit, and are made
//! again in less than a second where a session goes on.

use std::time::Duration;

pub mod aim;
pub mod doubt;
mod free;
mod hold;
pub mod kept;
mod learner;
mod rounds;

pub use aim::{Aim, Taught};
pub use doubt::Doubt;
pub use free::{Free, FreeAsk};
pub use hold::{HOLD, Hold, READ, Stage};
pub use learner::{Learned, Learner, Wanted};
pub use rounds::{Act, Ask, Counts, Earlier, News, State, Teaching};

/// How long a person who has shown the poses is likely to wait for the map: of several starts as many as end in this time.
pub const LAST_STAGE: Duration = Duration::from_secs(20);
