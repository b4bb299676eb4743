//! The weights store on a flash that can lose power.

mod common;

use bridge::store::{Contents, Error, Expected, Image, WeightsStore};
use common::{Flash, image};
use hae::image::JointOrder;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rig::flash::{Cut, Phase, Power};

const ERASE: usize = 256;
/// Three erase blocks of image (640 bytes), one of records.
const CAPACITY: usize = 4 * ERASE;
const SHAPE: [usize; 3] = [3, 7, 2];
const EXPECTED: Expected = Expected {
    shape: SHAPE,
    joint_order: JointOrder::Columns,
};

type Store = WeightsStore<Flash<ERASE>>;

fn small(version: u32) -> Vec<u8> {
    image(SHAPE, JointOrder::Columns, version, version)
}

fn empty(power: &Power) -> Store {
    WeightsStore::new(
        [Flash::new(CAPACITY, power), Flash::new(CAPACITY, power)],
        EXPECTED,
    )
}

/// All RAM is lost, the flash stays.
fn reboot(store: Store) -> Store {
    let slots = store.release();
    slots[0].0.power().restore();
    WeightsStore::new(slots, EXPECTED)
}

fn flash(store: &mut Store, bytes: &[u8]) -> Result<(), Error> {
    store.begin(bytes.len())?;
    for (index, chunk) in bytes.chunks(200).enumerate() {
        store.chunk(index * 200, chunk)?;
    }
    store.commit()
}

/// A store with images of these versions flashed one after the other.
fn with(power: &Power, versions: &[u32]) -> Store {
    let mut store = empty(power);
    for version in versions {
        flash(&mut store, &small(*version)).expect("a good flash");
    }
    store
}

fn version(store: &Store) -> Option<u32> {
    store.active().map(|(_, image)| image.checked.meta.version)
}

#[test]
fn an_erased_store_is_empty_and_gives_no_map() {
    let store = empty(&Power::new());
    assert!(store.active().is_none() && store.active_bytes().is_none());
    assert!(store.map::<3, 7, 2>().is_none());
    assert_eq!(store.contents(), &[Contents::Empty; 2]);
}

#[test]
fn what_is_committed_is_active_byte_for_byte_now_and_after_a_restart() {
    let mut store = with(&Power::new(), &[1]);
    for _ in 0..2 {
        assert_eq!(store.active_bytes(), Some(&small(1)[..]));
        assert!(store.map::<3, 7, 2>().is_some());
        store = reboot(store);
    }
}

#[test]
fn images_alternate_between_the_slots_and_the_newest_is_active() {
    let mut store = with(&Power::new(), &[1]);
    let mut slot = store.active().unwrap().0;
    for next in 2..10 {
        flash(&mut store, &small(next)).unwrap();
        assert_eq!(store.active().unwrap().0, 1 - slot);
        slot = 1 - slot;
        store = reboot(store);
        assert_eq!(version(&store), Some(next));
    }
}

#[test]
fn the_active_image_is_untouched_until_the_commit() {
    let mut store = with(&Power::new(), &[1]);
    let new = small(2);
    store.begin(new.len()).unwrap();
    assert_eq!(store.active_bytes(), Some(&small(1)[..]));
    store.chunk(0, &new).unwrap();
    assert_eq!(store.active_bytes(), Some(&small(1)[..]));
    assert_eq!(version(&reboot(store)), Some(1));
}

#[test]
fn an_abort_keeps_the_active_image() {
    let mut store = with(&Power::new(), &[1]);
    store.begin(small(2).len()).unwrap();
    store.chunk(0, &small(2)).unwrap();
    store.abort();
    assert_eq!(store.commit(), Err(Error::NotBegun));
    assert_eq!(version(&reboot(store)), Some(1));
}

#[test]
fn chunks_of_any_size_and_repeated_ones_give_the_same_image() {
    for size in [1, 3, 63, 64, 255, 256, 257, 640] {
        let mut store = empty(&Power::new());
        let bytes = small(1);
        store.begin(bytes.len()).unwrap();
        for (index, chunk) in bytes.chunks(size).enumerate() {
            store.chunk(index * size, chunk).unwrap();
            store.chunk(index * size, chunk).unwrap();
            let from = (index * size).saturating_sub(5);
            let end = index * size + chunk.len();
            store.chunk(from, &bytes[from..end]).unwrap();
            assert_eq!(store.progress(), Some((end, bytes.len())));
        }
        store.commit().unwrap();
        assert_eq!(store.active_bytes(), Some(&bytes[..]), "chunks of {size}");
    }
}

#[test]
fn what_does_not_fit_the_protocol_is_refused_by_number() {
    let mut store = empty(&Power::new());
    let bytes = small(1);
    assert_eq!(store.chunk(0, &bytes), Err(Error::NotBegun));
    assert_eq!(store.commit(), Err(Error::NotBegun));
    assert_eq!(
        store.begin(3 * ERASE + 1),
        Err(Error::TooLong {
            length: 769,
            capacity: 768
        })
    );
    store.begin(640).unwrap();
    assert_eq!(
        store.chunk(10, &bytes[10..]),
        Err(Error::Offset {
            found: 10,
            expected: 0
        })
    );
    store.chunk(0, &bytes[..600]).unwrap();
    assert_eq!(
        store.chunk(600, &[0; 41]),
        Err(Error::Overrun {
            end: 641,
            length: 640
        })
    );
    assert_eq!(
        store.chunk(usize::MAX, &[0; 41]),
        Err(Error::Overrun {
            end: usize::MAX,
            length: 640
        })
    );
    assert_eq!(
        store.commit(),
        Err(Error::Incomplete {
            found: 600,
            expected: 640
        })
    );
    assert_eq!(store.select(0), Err(Error::Busy));
    // None of it cost the image.
    store.chunk(600, &bytes[600..]).unwrap();
    store.commit().unwrap();
}

#[test]
fn what_is_no_image_for_this_bridge_is_refused_and_the_old_one_stays() {
    let mut damaged = small(2);
    damaged[300] ^= 1;
    let mut future = small(2);
    future[8] = 99;
    type Check = fn(&Error) -> bool;
    let cases: [(Vec<u8>, Check); 6] = [
        (image([3, 8, 2], JointOrder::Columns, 2, 1), |e| {
            *e == Error::Shape {
                found: [3, 8, 2],
                expected: SHAPE,
            }
        }),
        (image([4, 7, 1], JointOrder::Columns, 2, 1), |e| {
            matches!(e, Error::Shape { .. })
        }),
        (damaged, |e| {
            matches!(e, Error::Image(hae::image::Error::Crc { .. }))
        }),
        (future, |e| {
            matches!(e, Error::Image(hae::image::Error::Format { .. }))
        }),
        (vec![0x55; 640], |e| {
            matches!(e, Error::Image(hae::image::Error::Magic { .. }))
        }),
        (
            image(SHAPE, JointOrder::Columns, 2, 1)[..600].to_vec(),
            |e| matches!(e, Error::Image(_)),
        ),
    ];
    for (bytes, expected) in cases {
        let mut store = with(&Power::new(), &[3]);
        let error = flash(&mut store, &bytes).unwrap_err();
        assert!(expected(&error), "{error}");
        assert_eq!(version(&store), Some(3));
        assert_eq!(version(&reboot(store)), Some(3));
    }
}

#[test]
fn an_image_for_another_joint_order_is_refused() {
    let shape = [25, 16, 1];
    let expected = Expected {
        shape,
        joint_order: JointOrder::Hand25,
    };
    let power = Power::new();
    let slots = [
        Flash::<ERASE>::new(8 * 1024, &power),
        Flash::new(8 * 1024, &power),
    ];
    let mut store = WeightsStore::new(slots, expected);
    let bytes = image(shape, JointOrder::Columns, 1, 1);
    let error = flash(&mut store, &bytes).unwrap_err();
    assert_eq!(
        error,
        Error::JointOrder {
            found: JointOrder::Columns,
            expected: JointOrder::Hand25
        }
    );
}

#[test]
fn an_older_version_is_refused_and_the_same_version_is_taken() {
    let mut store = with(&Power::new(), &[5]);
    assert_eq!(
        flash(&mut store, &small(4)),
        Err(Error::Older {
            found: 4,
            active: 5
        })
    );
    assert_eq!(
        flash(&mut store, &image(SHAPE, JointOrder::Columns, 5, 77)),
        Ok(())
    );
    assert_eq!(
        store.active_bytes(),
        Some(&image(SHAPE, JointOrder::Columns, 5, 77)[..])
    );
}

#[test]
fn a_length_that_is_not_the_images_is_refused() {
    let mut store = empty(&Power::new());
    let mut bytes = small(1);
    bytes.resize(700, 0);
    assert_eq!(
        flash(&mut store, &bytes),
        Err(Error::Length {
            found: 640,
            expected: 700
        })
    );
}

#[test]
fn the_other_slot_can_be_selected_and_stays_selected() {
    let mut store = with(&Power::new(), &[1, 2]);
    let old = 1 - store.active().unwrap().0;
    store.select(old).unwrap();
    assert_eq!(version(&store), Some(1));
    let mut store = reboot(store);
    assert_eq!(version(&store), Some(1));
    assert_eq!(store.select(2), Err(Error::NoSlot { slot: 2 }));
    // And the next flash goes to the slot that is not active.
    flash(&mut store, &small(3)).unwrap();
    assert_eq!(version(&reboot(store)), Some(3));
}

#[test]
fn selecting_ends_when_the_records_are_full_and_flashing_makes_room() {
    let mut store = with(&Power::new(), &[1, 2]);
    let mut selections = 0;
    let error = loop {
        let other = 1 - store.active().unwrap().0;
        match store.select(other) {
            Ok(()) => selections += 1,
            Err(error) => break error,
        }
        store = reboot(store);
    };
    // 256 / 32 = 8 records a slot, one of each used by the commit.
    assert_eq!(selections, 14);
    assert!(matches!(error, Error::RecordsFull { .. }));
    flash(&mut store, &small(3)).unwrap();
    assert_eq!(version(&reboot(store)), Some(3));
}

#[test]
fn an_empty_slot_cannot_be_selected() {
    let mut store = with(&Power::new(), &[1]);
    assert_eq!(store.select(1), Err(Error::NoImage { slot: 1 }));
}

#[test]
fn a_flash_that_is_too_small_is_refused_by_its_numbers() {
    let power = Power::new();
    let mut store: Store = WeightsStore::new(
        [Flash::new(ERASE, &power), Flash::new(ERASE, &power)],
        EXPECTED,
    );
    assert_eq!(
        store.begin(640),
        Err(Error::Geometry {
            slot: 0,
            write_size: 4,
            erase_size: ERASE,
            capacity: ERASE
        })
    );
}

/// The cut is planned, the action done as far as it goes, the machine rebooted: old or new, whole.
fn cut(
    mut store: Store,
    plan: Cut,
    act: impl Fn(&mut Store) -> Result<(), Error>,
    old: Option<u32>,
    new: u32,
) -> (Store, bool) {
    store.slots()[0].0.power().plan(plan);
    let result = act(&mut store);
    let cut = !store.slots()[0].0.power().is_on();
    let store = reboot(store);
    let found = version(&store);
    if !cut {
        assert_eq!(result, Ok(()));
        assert_eq!(found, Some(new));
    }
    assert!(found == old || found == Some(new), "{plan:?}: {found:?}");
    if let Some(found) = found {
        assert_eq!(store.active_bytes(), Some(&small(found)[..]), "{plan:?}");
    }
    (store, cut)
}

const PHASES: [Phase; 3] = [Phase::Before, Phase::Inside, Phase::After];

/// Every cut point of one operation list: `visit` sees each plan until one is beyond the end.
fn every_cut(seeds: u64, mut visit: impl FnMut(Cut) -> bool) -> u64 {
    let mut cuts = 0;
    for after_operations in 0.. {
        let mut any = false;
        for phase in PHASES {
            for seed in 0..if phase == Phase::Inside { seeds } else { 1 } {
                let hit = visit(Cut {
                    after_operations,
                    phase,
                    seed,
                });
                any |= hit;
                cuts += u64::from(hit);
            }
        }
        if !any {
            break;
        }
    }
    cuts
}

#[test]
fn every_single_power_cut_leaves_the_old_image_or_the_new_one_whole() {
    for before in [&[][..], &[1], &[1, 2], &[1, 2, 3]] {
        let old = before.last().copied();
        let cuts = every_cut(40, |plan| {
            let act = |store: &mut Store| flash(store, &small(9));
            let (mut store, hit) = cut(with(&Power::new(), before), plan, act, old, 9);
            // And one clean flash puts everything right.
            flash(&mut store, &small(10)).unwrap();
            assert_eq!(reboot(store).active_bytes(), Some(&small(10)[..]));
            hit
        });
        println!("{cuts} single cuts after {before:?}");
        // 1 + 3 erases, 3 pages, 1 record.
        assert_eq!(cuts, 8 * 42);
    }
}

#[test]
fn every_pair_of_power_cuts_leaves_a_whole_image() {
    let mut pairs = 0;
    every_cut(3, |first| {
        let act = |store: &mut Store| flash(store, &small(8));
        let (_, hit) = cut(with(&Power::new(), &[6, 7]), first, act, Some(7), 8);
        pairs += every_cut(3, |second| {
            let (store, _) = cut(with(&Power::new(), &[6, 7]), first, act, Some(7), 8);
            let old = version(&store);
            let act = |store: &mut Store| flash(store, &small(9));
            let (mut store, hit) = cut(store, second, act, old, 9);
            flash(&mut store, &small(10)).unwrap();
            assert_eq!(reboot(store).active_bytes(), Some(&small(10)[..]));
            hit
        });
        hit
    });
    println!("{pairs} pairs of cuts");
    assert!(pairs > 1_000);
}

#[test]
fn every_cut_while_selecting_leaves_one_of_the_two_selected() {
    let cuts = every_cut(40, |plan| {
        let store = with(&Power::new(), &[1, 2]);
        let other = 1 - store.active().unwrap().0;
        let (mut store, hit) = cut(store, plan, |store| store.select(other), Some(2), 1);
        store.select(other).unwrap();
        assert_eq!(version(&reboot(store)), Some(1));
        hit
    });
    assert_eq!(cuts, 42);
}

#[test]
fn any_contents_of_the_slots_give_a_whole_image_or_none() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let (mut whole, mut none) = (0, 0);
    for round in 0..20_000u32 {
        let power = Power::new();
        let mut slots = if round % 4 == 0 {
            empty(&power)
        } else {
            with(&power, &[1, 2])
        }
        .release();
        for slot in &mut slots {
            let cells = slot.0.cells_mut();
            for _ in 0..random.next_u32() % 3 {
                let start = random.next_u32() as usize % cells.len();
                let end = (start + 1 + random.next_u32() as usize % 40).min(cells.len());
                match random.next_u32() % 3 {
                    0 => cells[start] ^= 1 << (random.next_u32() % 8),
                    1 => random.fill_bytes(&mut cells[start..end]),
                    _ => cells.fill((random.next_u32() & 0xFF) as u8),
                }
            }
        }
        let store: Store = WeightsStore::new(slots, EXPECTED);
        match version(&store) {
            Some(found) => {
                whole += 1;
                assert_eq!(store.active_bytes(), Some(&small(found)[..]));
            }
            None => none += 1,
        }
    }
    println!("{whole} whole, {none} without");
    assert!(whole > 5_000 && none > 2_000);
}

#[test]
fn a_damaged_active_image_gives_way_to_the_older_whole_one() {
    let mut slots = with(&Power::new(), &[1, 2]).release();
    slots[1].0.cells_mut()[400] ^= 4;
    let store: Store = WeightsStore::new(slots, EXPECTED);
    assert_eq!(version(&store), Some(1));
    assert!(matches!(
        store.contents()[1],
        Contents::Damaged(Error::Image(_))
    ));
    assert!(matches!(store.contents()[0], Contents::Whole(Image { .. })));
}

/// The record names an image by length and CRC: another whole image in its place is not the one that was committed.
#[test]
fn an_image_the_record_does_not_name_does_not_count() {
    let mut slots = with(&Power::new(), &[1, 2]).release();
    slots[1].0.cells_mut()[..640].copy_from_slice(&small(7));
    let store: Store = WeightsStore::new(slots, EXPECTED);
    assert_eq!(version(&store), Some(1));
    assert_eq!(
        store.contents()[1],
        Contents::Damaged(Error::NoImage { slot: 1 })
    );
}
