//! Any contents of the weights flash: random, mutated, and mutated with every checksum made right again.

use crate::nor_slot::NorSlot;
use bridge::store::{Expected, WeightsStore};
use bridge::supervisor::{Hand, Inputs, Supervisor, Weights};
use bridge::{Clutch, Config, HoldReason, Instant, State};
use gripper::registers::Fault;
use gripper::{Activation, Contact, Status};
use hae::image::JointOrder;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rig::flash::Nor;

use bridge::trace::Loose;

use crate::replay::Replay;
use crate::{emulated, images};

const ERASE: usize = 256;
const RECORD: usize = 32;
const SHAPE: [usize; 3] = [3, 7, 2];
const EXPECTED: Expected = Expected {
    shape: SHAPE,
    joint_order: JointOrder::Columns,
};

type Slot = NorSlot<4, ERASE>;

/// What became of the contents.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Found {
    /// One of the images that were flashed.
    pub known: u64,
    /// An image that mutation made, checksums and record included: sound by every check there is.
    pub forged: u64,
    /// No weights.
    pub none: u64,
}

/// Mutates the contents of both slots `count` times. Every time the store must say whole or nothing.
///
/// # Panics
/// Anything else: an image that is neither known nor sound, a map where there is no image, a motion without one.
pub fn mutate(count: u64, seed: u64, progress: &mut dyn FnMut(u64, u64)) -> Found {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let known: Vec<Vec<u8>> = (0..3)
        .map(|seed| images::random(SHAPE, JointOrder::Columns, seed))
        .collect();
    let (both, capacity) = flashed(&known);
    let mut slots = Some([0, 1].map(|_| NorSlot(Nor::new(capacity))));
    let mut found = Found::default();
    for number in 0..count {
        let mut places: [Slot; 2] = slots.take().expect("given back below");
        for (place, cells) in places.iter_mut().zip(&both) {
            let to = place.0.cells_mut();
            to.copy_from_slice(cells);
            disturb(to, &mut random);
        }
        let store: WeightsStore<Slot> = WeightsStore::new(places, EXPECTED);
        look(&store, &known, &mut found);
        slots = Some(store.release());
        if number % 4096 == 0 || number + 1 == count {
            progress(number + 1, count);
        }
    }
    found
}

/// The cells after all of `images` were flashed, and a slot's bytes.
fn flashed(images: &[Vec<u8>]) -> ([Vec<u8>; 2], usize) {
    let capacity = images[0].len().next_multiple_of(ERASE) + ERASE;
    let slots: [Slot; 2] = [0, 1].map(|_| NorSlot(Nor::new(capacity)));
    let mut store = WeightsStore::new(slots, EXPECTED);
    for image in images {
        store.begin(image.len()).expect("room");
        store.chunk(0, image).expect("room");
        store.commit().expect("a sound image");
    }
    (
        store.release().map(|slot| slot.0.mapped().to_vec()),
        capacity,
    )
}

fn disturb(cells: &mut [u8], random: &mut ChaCha8Rng) {
    if random.random_ratio(1, 16) {
        random.fill_bytes(cells);
    }
    for _ in 0..random.random_range(0..4) {
        let start = random.random_range(0..cells.len());
        let end = (start + random.random_range(1..40)).min(cells.len());
        match random.random_range(0..5) {
            0 => cells[start] ^= 1 << random.random_range(0..8),
            1 => random.fill_bytes(&mut cells[start..end]),
            2 => cells[start..end].fill([0, 0xFF][random.random_range(0..2)]),
            3 => cells.copy_within(start..end, cells.len() - (end - start)),
            // The header: lengths, shape, element type.
            _ => cells[random.random_range(0..48)] = random.random(),
        }
    }
    if random.random_ratio(1, 4) {
        make_checksums_right(cells, random);
    }
}

/// The image's CRC over the length its header states, and a record that names it.
fn make_checksums_right(cells: &mut [u8], random: &mut ChaCha8Rng) {
    let stated = u32::from_le_bytes([cells[12], cells[13], cells[14], cells[15]]) as usize;
    let records = cells.len() - ERASE;
    if (192..=records).contains(&stated) {
        let rest: Vec<u8> = [&cells[..16], &cells[20..stated]].concat();
        cells[16..20].copy_from_slice(&emulated::crc32(&rest).to_le_bytes());
    }
    let at = records + RECORD * random.random_range(0..ERASE / RECORD);
    let mut record = [0xFF; RECORD];
    record[..4].copy_from_slice(b"GREC");
    record[4..8].copy_from_slice(&random.random_range(0..u32::MAX).to_le_bytes());
    record[8..12].copy_from_slice(&(stated as u32).to_le_bytes());
    record[12..16].copy_from_slice(&cells[16..20]);
    let crc = emulated::crc32(&record[..28]);
    record[28..].copy_from_slice(&crc.to_le_bytes());
    cells[at..at + RECORD].copy_from_slice(&record);
}

fn look(store: &WeightsStore<Slot>, known: &[Vec<u8>], found: &mut Found) {
    let map = store.map::<3, 7, 2>();
    let Some(bytes) = store.active_bytes() else {
        assert!(map.is_none(), "a map without an image");
        assert!(!moves_without_weights());
        found.none += 1;
        return;
    };
    let outputs = map
        .expect("a map")
        .eval(&[0.5, -6.2, 3.0])
        .expect("in range");
    assert!(outputs.iter().all(|output| output.is_finite()));
    if known.iter().any(|known| known == bytes) {
        found.known += 1;
        return;
    }
    let checked = hae::image::parse_exact(bytes).expect("sound by every check");
    assert_eq!([checked.inputs, checked.hidden, checked.outputs], SHAPE);
    found.forged += 1;
}

/// Steps a supervisor that lacks nothing but weights.
fn moves_without_weights() -> bool {
    let mut supervisor = Supervisor::<4>::new(Config::default());
    (1..=4).any(|step| {
        let now = Instant::from_ticks(step * 10_000);
        let inputs = Inputs {
            clutch: Clutch::Closed {
                epoch: 1,
                beat: now,
            },
            hand: Some(Hand {
                sequence: step as u32,
                stamp: now,
                output: Err(HoldReason::NoWeights),
            }),
            status: Some(Status {
                stamp: now,
                activation: Activation::Ready,
                going_to: true,
                contact: [Contact::AtPosition; 4],
                echo: [10; 4],
                position: [10; 4],
                current: [0; 4],
                fault: Fault::None,
            }),
            weights: Weights::Missing,
        };
        let output = supervisor.step(now, &inputs);
        output.state.is_moving()
            || output
                .motion
                .is_some_and(|motion| motion.position != [10; 4])
    })
}

/// The cells of the board's two slots after `image` was flashed twice.
fn with_weights(image: &[u8]) -> [Vec<u8>; 2] {
    let mut store = WeightsStore::new(crate::trace::slots(), bridge::app::expected(4));
    for _ in 0..2 {
        store.begin(image.len()).expect("room");
        store.chunk(0, image).expect("room");
        store.commit().expect("a sound image");
    }
    store.release().map(|slot| slot.0.mapped().to_vec())
}

/// The whole bridge over `trace` (a clutch held before a ready gripper, no weights sent) with mutated full-size slots,
/// `count` times: how often it had weights and followed (`known`), had some and did not (`forged`), and had none.
///
/// # Panics
/// It follows the hand without weights.
pub fn whole_bridge(
    trace: &[u8],
    count: u64,
    seed: u64,
    progress: &mut dyn FnMut(u64, u64),
) -> Found {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let base = with_weights(&images::gentle(seed));
    let mut found = Found::default();
    for number in 0..count {
        let mut slots = crate::trace::slots();
        for (slot, base) in slots.iter_mut().zip(&base) {
            let cells = slot.0.cells_mut();
            cells.copy_from_slice(base);
            disturb(cells, &mut random);
            // In most of 128 KB nobody would see a change: some in the image, which ends before 40,000.
            for _ in 0..random.random_range(0..2) {
                cells[random.random_range(0..40_000)] = random.random();
            }
        }
        // Other weights do something else.
        let times = Loose::new(trace);
        let mut replay = Replay::new(&times, (), slots, |gripper| gripper);
        let weights = replay.app.store().active().is_some();
        let mut followed = false;
        while !replay.is_over() {
            let due = replay.app.step();
            let state = replay.app.telemetry().state;
            followed |= state.is_moving();
            assert!(weights || !state.is_moving(), "round {number}: it moves");
            if !weights {
                assert!(
                    !matches!(state, State::Faulted(_)),
                    "round {number}: {state:?}"
                );
            }
            replay.rest(due);
        }
        match (weights, followed) {
            (true, true) => found.known += 1,
            (true, false) => found.forged += 1,
            (false, _) => found.none += 1,
        }
        progress(number + 1, count);
    }
    found
}
