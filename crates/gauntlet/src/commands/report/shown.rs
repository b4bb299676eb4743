//! What the page is of.

use std::path::Path;

use host::trainer::data::{Matrix, Pairs};
use host::trainer::hand::Space;
use host::trainer::model::Model;

use host::training::curve::Moment;
use host::training::judgement::Judgement;
use host::training::motion::Motion;

/// Everything that the page shows.
pub(super) struct Shown<'a> {
    pub file: &'a Path,
    pub poses: &'a Path,
    pub model: &'a Model,
    pub space: Space,
    pub motion: &'a Motion,
    pub frames: &'a Matrix,
    pub targets: &'a Matrix,
    pub pairs: Option<&'a Pairs>,
    pub held_out: Option<bool>,
    pub judgement: &'a Judgement,
    pub curve: &'a [Moment],
}
