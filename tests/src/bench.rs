//! A glove and a gripper on byte-timed wires and one virtual clock, and a weights store that holds a map.

use crate::nor_slot::NorSlot;
use bridge::{Board, Instant, Platform, WeightsStore};
use gripper::driver::ThreeFinger;
use rig::glove::VirtualGlove;
use rig::gripper::{Family, VirtualGripper};
use rig::{Clock, MemoryWire};

/// Both wires' speed.
pub const BAUD: u32 = 115_200;

/// The virtual devices and the bridge's ends of their wires.
pub struct Devices {
    /// The time of all of them.
    pub clock: Clock,
    /// The glove.
    pub glove: VirtualGlove,
    /// The glove's wire.
    pub glove_wire: MemoryWire,
    /// The gripper, just powered on.
    pub gripper: VirtualGripper,
    /// The gripper's wire.
    pub gripper_wire: MemoryWire,
}

impl Devices {
    /// A hand that holds `pose` at each time, and an open gripper.
    pub fn new(pose: impl Fn(f64) -> [f32; 25] + Send + 'static) -> Self {
        Self::with(pose, Family::ThreeFinger)
    }

    /// The same with a gripper of this family.
    pub fn with(pose: impl Fn(f64) -> [f32; 25] + Send + 'static, family: Family) -> Self {
        let glove = VirtualGlove::new(Box::new(pose), rig::glove::Config::at_baud(BAUD));
        Self::wearing(glove, family)
    }

    /// The same with this glove.
    pub fn wearing(glove: VirtualGlove, family: Family) -> Self {
        let clock = Clock::new();
        let gripper = VirtualGripper::new(rig::gripper::Config::of(family));
        Self {
            glove_wire: MemoryWire::new(&clock, glove.clone(), BAUD),
            gripper_wire: MemoryWire::new(&clock, gripper.clone(), BAUD),
            clock,
            glove,
            gripper,
        }
    }
}

/// What a bridge between such devices stands on: time goes to the next event.
pub struct Machine(pub Clock);

impl Platform for Machine {
    fn now(&mut self) -> Instant {
        self.0.now()
    }

    fn wait_until(&mut self, due: Instant) {
        let soonest = Instant::from_ticks(self.0.now().as_ticks() + 1);
        self.0.wait_until(due.max(soonest));
    }
}

impl Board<4> for Machine {
    type Glove = glove::sc18im::Sc18im<MemoryWire>;
    type Gripper = ThreeFinger<MemoryWire>;
    type Flash = NorSlot;
}

/// A store that holds `image`, a sound one for four axes.
///
/// # Panics
/// Where the store does not take it.
pub fn store(image: &[u8]) -> WeightsStore<NorSlot> {
    let mut store = empty_store(4);
    store.begin(image.len()).expect("room");
    store.chunk(0, image).expect("bytes");
    store.commit().expect("a sound image");
    store
}

/// A store without an image, for a gripper with this many axes.
pub fn empty_store(axes: usize) -> WeightsStore<NorSlot> {
    let slots = [NorSlot::new(), NorSlot::new()];
    WeightsStore::new(slots, bridge::app::expected(axes))
}
