//! Which speeds there are, and what is known of them on this line ([`super::speed`] says how they are found).

use super::baud_divisor;

/// A port whose speed may be changed.
pub trait SetBaud {
    /// Sets the speed of what is sent and received from now on (8N1), at once and without waiting. A port that is away keeps
    /// it for its return.
    ///
    /// # Errors
    /// [`BaudRefused`]; the port stays at its speed then.
    fn set_baud(&mut self, baud: u32) -> Result<(), BaudRefused>;
}

/// Why a port keeps its speed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BaudRefused {
    /// It cannot change its speed at all: it is not asked again.
    Fixed,
    /// It cannot make this one.
    Unsupported(u32),
}

impl core::fmt::Display for BaudRefused {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Fixed => f.write_str("the port's speed cannot be changed"),
            Self::Unsupported(baud) => write!(f, "the port cannot make {baud} baud"),
        }
    }
}

impl core::error::Error for BaudRefused {}

/// The chip's speed after a reset.
pub const RESET_BAUD: u32 = 9_600;

/// The speeds at which a chip is looked for and to which it is raised, from the highest.
pub const SPEEDS: [u32; 4] = [460_800, 230_400, 115_200, RESET_BAUD];

/// No chip that is raised is ever lowered below this: the glove's samples would be too old to follow.
pub const FLOOR: u32 = 115_200;

/// Status bytes that must come in a row, all the same and nothing between them, before a speed is trusted.
pub const TRIAL: usize = 8;

/// How often the trial at the speed a chip is being raised to fails before that is ruled out.
pub const RAISE_TRIES: u8 = 2;

/// A lost reply counts 32, a chip out of step 64, a reply takes one away: at this a raised speed is ruled out. One reply
/// lost in 32 for long, or eight at once.
pub const LOSSES_MAX: u16 = 256;
pub(super) const LOST: u16 = 32;
pub(super) const OUT_OF_STEP: u16 = 64;

pub(super) type Set<S> = fn(&mut S, u32) -> Result<(), BaudRefused>;

/// What is known of the speeds.
#[derive(Debug)]
pub(super) struct Speeds<S> {
    pub(super) set: Option<Set<S>>,
    /// Of the port now.
    pub(super) line: u32,
    /// No chip is lowered below it.
    pub(super) floor: u32,
    /// Highest one wished for, and highest not ruled out.
    pub(super) limit: u32,
    pub(super) ceiling: u32,
    /// What the chip was told last, and the newest at which it passed a trial.
    pub(super) told: u32,
    pub(super) heard: u32,
    /// The chip answered just before it was told.
    pub(super) answered: bool,
    /// Place in the round of the search.
    pub(super) turn: u8,
    /// Trials at the target that failed in a row.
    pub(super) failed: u8,
    pub(super) losses: u16,
}

impl<S> Speeds<S> {
    pub(super) fn new(baud: u32, raise_to: Option<u32>) -> Self {
        let limit = raise_to.unwrap_or(baud);
        Self {
            set: None,
            line: baud,
            floor: raise_to.map_or(baud, |_| baud.min(FLOOR)),
            limit,
            ceiling: limit,
            told: baud,
            heard: baud,
            answered: false,
            turn: 0,
            failed: 0,
            losses: 0,
        }
    }

    /// The speed the chip is to run at: the highest that is not ruled out.
    pub(super) fn target(&self) -> u32 {
        let speeds = SPEEDS.into_iter().chain([self.floor]);
        let possible = speeds.filter(|&s| s <= self.ceiling && baud_divisor(s).is_some());
        possible.max().unwrap_or(self.floor)
    }

    /// Rules the target out, if there is a lower one; false if not.
    pub(super) fn lower(&mut self) -> bool {
        let target = self.target();
        (self.failed, self.losses) = (0, 0);
        if target <= self.floor {
            return false;
        }
        self.ceiling = target.saturating_sub(1);
        self.turn = 0;
        true
    }

    /// The speed of the next try.
    pub(super) fn next(&mut self) -> u32 {
        let all = [self.told, self.heard, RESET_BAUD]
            .into_iter()
            .chain(SPEEDS);
        let mut round = heapless::Vec::<u32, 8>::new();
        for speed in all {
            if !round.contains(&speed) {
                // Seven at most.
                let _ = round.push(speed);
            }
        }
        let place = usize::from(self.turn) % round.len().max(1);
        self.turn = ((place + 1) % round.len().max(1)) as u8;
        round.get(place).copied().unwrap_or(self.floor)
    }
}
