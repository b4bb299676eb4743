//! How fast the line to a glove runs, in words.

use std::path::Path;

use crate::tell::Tell;
use host::lines::glove::Reading;

/// Tells of a glove that was found fresh from its power-on. Elsewhere it is where it was left, which is no news.
pub(in crate::commands) fn found(tell: &Tell, glove: &Path, found: Option<u32>) {
    if let Some(baud @ 9_600) = found {
        tell.say(format_args!(
            "glove    {}  spoke {baud} baud, as after power-on",
            glove.display()
        ));
    }
}

/// Warns of a line that runs slower than asked for.
pub(in crate::commands) fn runs(tell: &Tell, glove: &Path, reading: Reading, baud: Option<u32>) {
    let place = glove.display().to_string();
    let Some(slow) = baud.and_then(|baud| reading.slow(&place, baud)) else {
        return;
    };
    tell.say(format_args!("warning: {}", slow.what));
    tell.say(format_args!("  try: {}", slow.next));
}
