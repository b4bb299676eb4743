//! What is said of a taught map.

use crate::tell::Tell;
use host::training::judgement::Judgement;

/// The verdict, which finger moves what, and how far the map is off the pairs.
pub(super) fn verdict(judgement: &Judgement, tell: &Tell) {
    tell.say(format_args!("verdict    {judgement}"));
    for sentence in judgement.influence.words() {
        tell.say(format_args!("           {sentence}"));
    }
    if let Some(pairs) = &judgement.pairs {
        let (most, middle) = pairs.off();
        tell.say(format_args!(
            "pairs      the map is off them by {most:.0} counts at most, by {middle:.0} in the middle"
        ));
    }
}
