//! What a person is asked to do: the movements of the paper's data (§3.3.2), fingers spread besides, and everything once more.

use std::time::Duration;

use super::movements::Movement;

/// One thing to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Prompt {
    /// In words.
    pub ask: &'static str,
    /// How long.
    pub time: Duration,
    /// What it should show.
    pub shows: &'static [Movement],
}

const fn prompt(ask: &'static str, seconds: u64, shows: &'static [Movement]) -> Prompt {
    Prompt {
        ask,
        time: Duration::from_secs(seconds),
        shows,
    }
}

/// All of them, one after another.
pub const GUIDED: [Prompt; 10] = [
    prompt(
        "open the hand flat, make a fist, open it: again and again",
        10,
        &[Movement::Flat, Movement::Fist],
    ),
    prompt(
        "bend the thumb alone across the palm, and stretch it",
        6,
        &[Movement::Thumb],
    ),
    prompt(
        "bend and stretch the index finger alone",
        6,
        &[Movement::Index],
    ),
    prompt(
        "bend and stretch the middle finger alone",
        6,
        &[Movement::Middle],
    ),
    prompt(
        "bend and stretch the ring finger alone",
        6,
        &[Movement::Ring],
    ),
    prompt(
        "bend and stretch the little finger alone",
        6,
        &[Movement::Little],
    ),
    prompt(
        "bend two or three fingers together, each time others",
        10,
        &[Movement::Several],
    ),
    prompt(
        "gather the fingertips against the thumb, and open: again and again",
        8,
        &[Movement::Gather],
    ),
    prompt(
        "spread the fingers wide, and close them: again and again",
        8,
        &[Movement::Spread],
    ),
    prompt("move the hand as you like, all of it once more", 14, &[]),
];

/// No prompts: for `time`.
pub const fn free(time: Duration) -> Prompt {
    Prompt {
        ask: "move the hand: fist and flat, each finger alone, several together, fingertips gathered, fingers spread",
        time,
        shows: &[],
    }
}

/// What to ask once more for what was not seen.
pub fn again(missing: &[Movement]) -> Vec<Prompt> {
    let lacks = |prompt: &&Prompt| prompt.shows.iter().any(|shown| missing.contains(shown));
    GUIDED.iter().filter(lacks).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_movement_is_asked_for_and_only_what_is_missing_is_asked_again() {
        for movement in Movement::ALL {
            let asked = again(&[movement]);
            assert_eq!(asked.len(), 1, "{}", movement.name());
            assert!(asked[0].shows.contains(&movement));
        }
        assert!(again(&[]).is_empty());
        assert_eq!(again(&[Movement::Flat, Movement::Fist]).len(), 1);
    }
}
