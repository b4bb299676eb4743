//! Training a map as the tool does it: data, operator, progress, stopping and going on, measures, model.

pub mod curve;
pub mod domains;
pub mod hand;
pub mod judgement;
mod learn;
pub mod lessons;
pub mod measuring;
pub mod model;
pub mod motion;
pub mod movements;
mod pairs;
pub mod pairs_kept;
pub mod prompts;
pub mod quality;
pub mod recorded;
mod task;
mod told;

pub use hand::{Outcome, Request, train};
pub use learn::learn;
pub use pairs::{PairChoice, PairKind};
pub use task::{Course, Ended, Learned, Task, Units, sorted};
