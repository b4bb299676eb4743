//! Power cuts in the weights store, on [`rig::flash::Nor`].
//!
//! A plan is a list of cuts, each in a flash of its own that follows the restart after the cut before. After every cut all
//! RAM is built anew over the same cells: the store then must hold the image it held before or the one being written,
//! whole, byte for byte. After the last cut one clean flash must be there after another restart.
//!
//! An operation is one program unit ([`UNIT`] bytes) or one erased sector; the cut comes before it, inside it (a prefix of
//! its bytes, random bits) or after it.

use std::ops::Range;

use crate::nor_slot::NorSlot;
use bridge::WeightsStore;
use bridge::store::{Error, Expected};
use hae::image::JointOrder;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rig::flash::{Cut, Nor, Phase, Power};

use crate::images;

/// Bytes of a program unit.
pub const UNIT: usize = 4;
const CHUNK: usize = 512;
/// Random images of each shape that the campaigns take theirs from.
const IMAGES: u64 = 16;

/// A bench of two slots with a common supply, for images of one shape.
pub struct Bench<const ERASE: usize> {
    expected: Expected,
    images: Vec<Vec<u8>>,
    power: Power,
    /// The flash; taken while a store has it.
    slots: Option<[NorSlot<UNIT, ERASE>; 2]>,
}

type Store<const ERASE: usize> = WeightsStore<NorSlot<UNIT, ERASE>>;

/// What the cells of both slots hold.
pub type Cells = [Vec<u8>; 2];

/// Which image is written, and where the power fails meanwhile.
#[derive(Debug, Clone, Copy)]
pub struct Attempt {
    /// Number of the image among the bench's.
    pub image: usize,
    /// The cut.
    pub cut: Cut,
}

/// What an attempt left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Left {
    /// The image that was there before, or none when there was none.
    Old,
    /// The new one, though the power failed.
    New,
    /// The cut was planned for after the end: the image was written.
    Uncut,
}

/// The bench for images of the bridge's own map.
pub fn full_size() -> Bench<4096> {
    Bench::new(images::SHAPE, JointOrder::Hand25)
}

/// The bench for images of 640 bytes.
pub fn small() -> Bench<256> {
    Bench::new([3, 7, 2], JointOrder::Columns)
}

/// The bench for images of 4,096 bytes.
pub fn four_kilobytes() -> Bench<1024> {
    Bench::new([9, 48, 10], JointOrder::Columns)
}

impl<const ERASE: usize> Bench<ERASE> {
    fn new(shape: [usize; 3], joint_order: JointOrder) -> Self {
        let images: Vec<Vec<u8>> = (0..IMAGES)
            .map(|seed| images::random(shape, joint_order, seed))
            .collect();
        let power = Power::new();
        let capacity = images[0].len().next_multiple_of(ERASE) + ERASE;
        let slot = || NorSlot(Nor::with_power(capacity, &power).by_unit());
        Self {
            expected: Expected { shape, joint_order },
            slots: Some([slot(), slot()]),
            images,
            power,
        }
    }

    /// Bytes of an image.
    pub fn image_bytes(&self) -> usize {
        self.images[0].len()
    }

    /// Operations of one flash.
    pub fn operations(&mut self) -> u64 {
        let (start, _) = self.start(&[0]);
        let before = self.power.operations();
        self.clean(&start, 1);
        self.power.operations() - before
    }

    /// The cells after these images were flashed one after the other, and the active one.
    pub fn start(&mut self, images: &[usize]) -> (Cells, Option<usize>) {
        let capacity = self.expected_cells();
        let mut cells = [vec![0xFF; capacity], vec![0xFF; capacity]];
        for &image in images {
            cells = self.clean(&cells, image);
        }
        (cells, images.last().copied())
    }

    fn expected_cells(&self) -> usize {
        self.image_bytes().next_multiple_of(ERASE) + ERASE
    }

    /// A store whose RAM is new, over these cells.
    fn boot(&mut self, cells: Option<&Cells>) -> Store<ERASE> {
        self.power.restore();
        let mut slots = self.slots.take().expect("no store has it");
        if let Some(cells) = cells {
            for (slot, cells) in slots.iter_mut().zip(cells) {
                slot.0.cells_mut().copy_from_slice(cells);
            }
        }
        WeightsStore::new(slots, self.expected)
    }

    fn end(&mut self, store: Store<ERASE>) {
        self.slots = Some(store.release());
    }

    fn cells(&self) -> Cells {
        let slots = self.slots.as_ref().expect("no store has it");
        slots.each_ref().map(|slot| slot.0.mapped().to_vec())
    }

    /// Flashes `image` over `cells` and holds against what a restart finds; the cells then.
    fn clean(&mut self, cells: &Cells, image: usize) -> Cells {
        let mut store = self.boot(Some(cells));
        write(&mut store, &self.images[image]).expect("a clean flash");
        self.end(store);
        let store = self.boot(None);
        let found = store.active_bytes();
        assert_eq!(found, Some(&self.images[image][..]), "a clean flash");
        self.end(store);
        self.cells()
    }

    /// One attempt over `cells`, in which `old` is active. Returns what is there after the restart.
    ///
    /// # Panics
    /// Neither the old image nor the new one, whole, or a finished one that is lost.
    pub fn attempt(
        &mut self,
        cells: &Cells,
        old: Option<usize>,
        attempt: Attempt,
    ) -> (Cells, Option<usize>, Left) {
        let mut store = self.boot(Some(cells));
        self.power.plan(attempt.cut);
        let result = write(&mut store, &self.images[attempt.image]);
        let cut = !self.power.is_on();
        self.end(store);
        let store = self.boot(None);
        let found = store.active_bytes();
        let new = found == Some(&self.images[attempt.image][..]);
        let same = found == old.map(|old| &self.images[old][..]);
        assert!(new || same, "{attempt:?} over {old:?}: neither old nor new");
        assert!(cut == result.is_err(), "{attempt:?}: {result:?}");
        assert!(cut || new, "{attempt:?} over {old:?}: lost");
        self.end(store);
        let left = match (cut, new) {
            (false, _) => Left::Uncut,
            (true, true) => Left::New,
            (true, false) => Left::Old,
        };
        let active = if new { Some(attempt.image) } else { old };
        (self.cells(), active, left)
    }

    /// Attempts one after the other, then one clean flash.
    pub fn chain(
        &mut self,
        start: &(Cells, Option<usize>),
        attempts: &[Attempt],
        last: usize,
    ) -> u64 {
        let (mut cells, mut active) = start.clone();
        let mut cuts = 0;
        for attempt in attempts {
            let left;
            (cells, active, left) = self.attempt(&cells, active, *attempt);
            cuts += u64::from(left != Left::Uncut);
        }
        self.clean(&cells, last);
        cuts
    }
}

fn write<const ERASE: usize>(store: &mut Store<ERASE>, image: &[u8]) -> Result<(), Error> {
    store.begin(image.len())?;
    for (index, chunk) in image.chunks(CHUNK).enumerate() {
        store.chunk(index * CHUNK, chunk)?;
    }
    store.commit()
}

/// Every cut of one operation: before, inside (as often as `insides` says, with other bits each time), after.
fn cuts_of(after_operations: u64, insides: u64) -> impl Iterator<Item = Cut> {
    let cut = move |phase, seed| Cut {
        after_operations,
        phase,
        seed,
    };
    let inside = (0..insides).map(move |seed| {
        cut(
            Phase::Inside,
            crate::random(after_operations * 1_000 + seed),
        )
    });
    [cut(Phase::Before, 0), cut(Phase::After, 0)]
        .into_iter()
        .chain(inside)
}

/// Every single cut, after no, one and several images: how many.
pub fn every_single<const ERASE: usize>(
    bench: &mut Bench<ERASE>,
    insides: u64,
    progress: &mut dyn FnMut(u64, u64),
) -> u64 {
    let starts = [&[][..], &[0], &[0, 1, 2]].map(|images| bench.start(images));
    let operations = bench.operations();
    let mut cuts = 0;
    for operation in 0..operations {
        for (number, cut) in cuts_of(operation, insides).enumerate() {
            let start = &starts[(operation as usize + number) % starts.len()];
            let image = 3 + (operation as usize + number) % 5;
            cuts += bench.chain(start, &[Attempt { image, cut }], 8);
        }
        progress(operation + 1, operations);
    }
    cuts
}

/// Every pair of cuts: how many.
pub fn every_pair<const ERASE: usize>(
    bench: &mut Bench<ERASE>,
    insides: u64,
    progress: &mut dyn FnMut(u64, u64),
) -> u64 {
    let operations = bench.operations();
    pairs_after(bench, 0..operations, insides, progress)
}

/// Every pair whose first cut is at one of these operations: how many. What the first left is kept, so that only the
/// second flash runs again.
pub fn pairs_after<const ERASE: usize>(
    bench: &mut Bench<ERASE>,
    firsts: Range<u64>,
    insides: u64,
    progress: &mut dyn FnMut(u64, u64),
) -> u64 {
    let start = bench.start(&[0, 1]);
    let operations = bench.operations();
    let mut pairs = 0;
    for first in firsts {
        for cut in cuts_of(first, insides) {
            let image = 2 + first as usize % 3;
            let (cells, active, left) = bench.attempt(&start.0, start.1, Attempt { image, cut });
            assert!(left != Left::Uncut);
            let after_first = (cells, active);
            for second in 0..operations {
                for cut in cuts_of(second, insides) {
                    let image = 5 + second as usize % 3;
                    pairs += bench.chain(&after_first, &[Attempt { image, cut }], 9);
                }
            }
        }
        progress(first + 1, operations);
    }
    pairs
}

/// `count` random lists of `depth` cuts: how many cuts hit.
pub fn random<const ERASE: usize>(
    bench: &mut Bench<ERASE>,
    depth: usize,
    count: u64,
    seed: u64,
    progress: &mut dyn FnMut(u64, u64),
) -> u64 {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let starts = [&[][..], &[0], &[0, 1], &[0, 1, 2]].map(|images| bench.start(images));
    let operations = bench.operations();
    let mut cuts = 0;
    for number in 0..count {
        let attempts: Vec<Attempt> = (0..depth)
            .map(|_| Attempt {
                image: random.random_range(3..IMAGES as usize - 1),
                cut: Cut {
                    after_operations: random.random_range(0..operations),
                    phase: [Phase::Before, Phase::Inside, Phase::After][random.random_range(0..3)],
                    seed: random.random(),
                },
            })
            .collect();
        let start = &starts[random.random_range(0..starts.len())];
        cuts += bench.chain(start, &attempts, IMAGES as usize - 1);
        if number % 64 == 0 || number + 1 == count {
            progress(number + 1, count);
        }
    }
    cuts
}
