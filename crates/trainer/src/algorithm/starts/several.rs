//! How many starts, by what they are judged, and what is told of them.

use crate::algorithm::Progress;
use core::time::Duration;

/// Most starts of a training.
pub const MOST: usize = 64;

/// By what starts are judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Judge {
    /// Eq. 13 without Pin.
    Cost,
    /// The same with α = 0, so that nothing is measured in the input domain but the reconstruction. For inputs of many more dimensions
    /// than targets: what of them lies off any image of g makes up most of UCD(Q, g(X)), and says nothing of f.
    CostInTarget,
}

/// How many starts, when one is left of them, and by what they are judged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Several {
    /// Starts, at least one.
    pub count: usize,
    /// So many of them (at most half of all, at least one) are left at the full λ3.
    pub finalists: usize,
    /// After this share of the epochs at the full λ3, 0 to 1, one of the finalists is fitted to the mean of those that cost about as
    /// little and are alike, and goes on alone. Of one finalist there is no mean.
    pub joined: f64,
    /// By what they are judged.
    pub judge: Judge,
}

impl Several {
    /// One start: Algorithm 1 as it stands.
    pub const ONE: Self = Self {
        count: 1,
        finalists: 1,
        joined: 1.0,
        judge: Judge::Cost,
    };
}

/// What became of a start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    /// Its seed.
    pub seed: u64,
    /// Epochs done.
    pub epochs: usize,
    /// What it cost when it was judged last; infinite where its weights were no longer finite, `None` before the first time.
    pub cost: Option<f64>,
    /// Whether it is still in the running; at the end the one that is taken.
    pub is_live: bool,
}

/// Where all starts stand.
#[derive(Clone, Debug)]
pub struct Standing<'a> {
    /// The first start that is still in the running.
    pub first: Progress<'a>,
    /// Starts in the running.
    pub live: usize,
    /// All starts.
    pub starts: usize,
    /// Epochs done by all starts together.
    pub epochs: usize,
    /// Of how many.
    pub total: usize,
    /// How long the rest will take at the speed so far.
    pub remaining: Duration,
}
