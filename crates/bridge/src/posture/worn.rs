//! A glove whose profile is known: its sensors by where they sit, brought to one time, their headings kept.

use crate::Instant;
use glove::calibration::{Align, Bound, Misfit};
use glove::hand::{Calibration, Quaternion, SEGMENT_COUNT};
use glove::headings::{self, Config, Headings, Known, NotFlat, PoseReport, Reading};
use glove::imu::UniqueId;
use glove::scan::Frame;

/// The profile in use, and what it says of the newest frames. Everything is by segment but what is said to be as wired.
#[derive(Debug, Clone)]
pub(super) struct Worn {
    /// As wired.
    ids: [UniqueId; SEGMENT_COUNT],
    /// The sensor on each segment, as it is wired.
    seats: [u8; SEGMENT_COUNT],
    align: Align,
    headings: Headings,
    /// How often each sensor had been started, as wired.
    starts: [u16; SEGMENT_COUNT],
    fit: Result<(), Misfit>,
    /// Segments whose sensor's id is not known: it may be another's.
    unread: u16,
    /// A flat pose is asked for.
    posing: bool,
}

impl Worn {
    pub fn new(bound: &Bound) -> Self {
        let mut seated = bound.profile;
        seated.sensors = core::array::from_fn(|k| k as u8);
        Self {
            ids: bound.ids,
            seats: bound.profile.sensors,
            align: Align::new(),
            headings: Headings::new(&seated, finding(false)),
            starts: [0; SEGMENT_COUNT],
            fit: Err(Misfit::NoIds),
            unread: u16::MAX,
            posing: false,
        }
    }

    pub fn bound(&self) -> Bound {
        let mut profile = *self.headings.profile();
        profile.sensors = self.seats;
        Bound {
            profile,
            ids: self.ids,
        }
    }

    pub fn headings(&self) -> &Headings {
        &self.headings
    }

    /// The sensor on each segment, as it is wired.
    pub fn seats(&self) -> &[u8; SEGMENT_COUNT] {
        &self.seats
    }

    /// Whether the profile is this glove's.
    pub fn fit(&self) -> Result<(), Misfit> {
        self.fit
    }

    /// Segments whose sensor's id is not known (bit k): it is not used.
    pub fn unread(&self) -> u16 {
        self.unread
    }

    /// The sensors' ids as far as they are known, as wired.
    pub fn meet(&mut self, ids: &[Option<UniqueId>; SEGMENT_COUNT]) {
        self.fit = self.bound().fits(ids);
        let seats = self.seats.iter().enumerate();
        self.unread = seats
            .filter(|(_, seat)| ids[usize::from(**seat) % SEGMENT_COUNT].is_none())
            .fold(0, |mask, (segment, _)| mask | 1 << segment);
    }

    /// How often each sensor has been started, as wired. The segments whose sensor has started anew, a first start among them;
    /// `relative`: its heading is another then.
    pub fn hear(&mut self, starts: &[u16; SEGMENT_COUNT], relative: bool, now: Instant) -> u16 {
        let mut restarted = 0;
        for (segment, &seat) in self.seats.iter().enumerate() {
            let k = usize::from(seat) % SEGMENT_COUNT;
            if starts[k] != self.starts[k] {
                self.starts[k] = starts[k];
                restarted |= 1 << segment;
            }
        }
        for segment in (0..SEGMENT_COUNT).filter(|segment| restarted >> segment & 1 == 1) {
            self.align.forget(segment);
            if relative {
                self.lose(segment, now);
            }
        }
        restarted
    }

    /// The heading of a segment's sensor is another than it was.
    pub fn lose(&mut self, segment: usize, now: Instant) {
        self.headings.restarted(segment, now);
    }

    /// Takes a frame by segment, without the sensors in `unused` and those whose id is not known. Which segments are not known in it, and what it says of the hand.
    pub fn take(&mut self, frame: &Frame, unused: u16, finds_flat: bool) -> (u16, Reading) {
        let mut scan = self.align.take(frame);
        scan.good &= !self.unread;
        if !self.posing {
            scan.good &= !unused;
        }
        self.headings.set_finds_flat(finds_flat);
        (!scan.good, self.headings.take(&scan))
    }

    /// Segments whose heading is not known: as few as explain which joints have none.
    pub fn astray(&self) -> u16 {
        headings::to_blame(self.headings.unknown())
    }

    /// A flat pose begins, or begins anew.
    pub fn begin_pose(&mut self) {
        self.posing = true;
        self.headings.begin_flat();
    }

    pub fn end_pose(&mut self, now: Instant) -> Result<PoseReport, NotFlat> {
        self.posing = false;
        self.headings.end_flat(now)
    }

    /// No pose after all. What was `unused` is as little known as before.
    pub fn cancel_pose(&mut self, unused: u16, now: Instant) {
        if self.posing {
            self.posing = false;
            self.headings.cancel_flat();
            for segment in (0..SEGMENT_COUNT).filter(|segment| unused >> segment & 1 == 1) {
                self.lose(segment, now);
            }
        }
    }

    pub fn is_posing(&self) -> bool {
        self.posing
    }

    pub fn known(&self) -> (Known, [u16; SEGMENT_COUNT]) {
        (self.headings.known(), self.starts)
    }

    /// Goes back to the headings of before. What started since has another.
    pub fn take_back(
        &mut self,
        known: &Known,
        starts: &[u16; SEGMENT_COUNT],
        relative: bool,
        now: Instant,
    ) {
        let newest = core::mem::replace(&mut self.starts, *starts);
        self.headings.take_back(known);
        self.hear(&newest, relative, now);
    }

    /// How the sensors sit on a flat hand, headings aside, the thumb's among them.
    pub fn seating(&self) -> Calibration {
        let profile = self.headings.profile();
        let mounting = core::array::from_fn(|k| {
            // The thumb's frames count from its base.
            let base = if (1..4).contains(&k) {
                profile.thumb_base
            } else {
                Quaternion::identity()
            };
            base * profile.mounting[k]
        });
        Calibration::from_mounting(mounting)
    }
}

fn finding(finds_flat: bool) -> Config {
    Config {
        finds_flat,
        ..Config::default()
    }
}
