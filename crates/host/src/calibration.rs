//! Calibrating a glove on the host: the same code as the product's, for a session on a wire or in files.
//!
//! What decides lies in [`glove::calibration`] and [`glove::headings`]. Here is how a person is led through a session ([`mod@guide`]), how one in files is read ([`mod@recorded`]), run
//! ([`mod@replay`]), and told ([`mod@report`]), and how a glove's profile is kept ([`profile_file`], [`profile_store`]).

pub mod guide;
pub mod profile_file;
pub mod profile_store;
pub mod recorded;
pub mod replay;
pub mod report;
pub mod virtual_person;

pub use guide::{Guide, Judged};
pub use profile_file::Kept;
pub use profile_store::{Found, ProfileStore, may_be_ideal, profile_of};
pub use recorded::Recorded;
pub use replay::{Replay, replay};
