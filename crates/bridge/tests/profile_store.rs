//! The glove's profile on a flash that can lose power.

mod common;

use bridge::store::profile::{Error, ProfileStore};
use common::Flash;
use common::host::crc32;
use glove::calibration::{Bound, Profile, Unreadable};
use glove::hand::Side;
use rig::flash::{Cut, Phase, Power};

const ERASE: usize = 512;
/// A profile takes two blocks.
const CAPACITY: usize = 3 * ERASE;

type Store = ProfileStore<Flash<ERASE>>;

/// A profile that is known by its number.
fn bound(number: u8) -> Bound {
    Bound {
        profile: Profile::straight(Side::Right),
        ids: core::array::from_fn(|k| [number.wrapping_add(k as u8); 16]),
    }
}

fn empty(power: &Power) -> Store {
    ProfileStore::new([Flash::new(CAPACITY, power), Flash::new(CAPACITY, power)])
}

/// All RAM is lost, the flash stays.
fn reboot(store: Store) -> Store {
    let slots = store.release();
    slots[0].0.power().restore();
    ProfileStore::new(slots)
}

fn save(store: &mut Store, number: u8) -> Result<(), Error> {
    let bytes = bound(number).to_bytes();
    for (index, chunk) in bytes.chunks(200).enumerate() {
        store.chunk(200 * index, chunk)?;
    }
    store.commit(bytes.len(), crc32(&bytes))?;
    while !store.step()? {}
    Ok(())
}

fn erase(store: &mut Store) -> Result<(), Error> {
    store.erase();
    while !store.step()? {}
    Ok(())
}

fn number(store: &Store) -> Option<u8> {
    store.profile().map(|bound| bound.ids[0][0])
}

#[test]
fn a_profile_is_there_after_a_restart_and_the_newest_counts() {
    let mut store = empty(&Power::new());
    assert_eq!(store.profile(), None);
    for next in 1..9 {
        save(&mut store, next).expect("kept");
        assert_eq!(store.profile(), Some(bound(next)));
        store = reboot(store);
        assert_eq!(store.profile(), Some(bound(next)));
        assert_eq!(store.bytes(), Some(&bound(next).to_bytes()[..]));
    }
    erase(&mut store).expect("gone");
    assert_eq!(store.profile(), None);
    assert_eq!(reboot(store).profile(), None);
}

#[test]
fn chunks_may_come_again_and_what_does_not_follow_is_refused() {
    let mut store = empty(&Power::new());
    let bytes = bound(1).to_bytes();
    assert_eq!(store.chunk(0, &bytes[..500]), Ok(500));
    assert_eq!(store.chunk(0, &bytes[..500]), Ok(500));
    assert_eq!(
        store.chunk(600, &bytes[600..]),
        Err(Error::Offset {
            found: 600,
            expected: 500
        })
    );
    let short = Error::Length {
        found: 500,
        expected: Bound::BYTES,
    };
    assert_eq!(store.commit(500, crc32(&bytes[..500])), Err(short));
    assert!(matches!(
        store.chunk(700, &[0; 49]),
        Err(Error::Length { .. })
    ));
    assert_eq!(store.chunk(500, &bytes[500..]), Ok(Bound::BYTES));
    assert!(matches!(
        store.commit(Bound::BYTES, 7),
        Err(Error::Crc { found: 7, .. })
    ));
    let mut wrong = bytes;
    wrong[30] ^= 1;
    store.chunk(0, &wrong).expect("bytes");
    let refused = store.commit(Bound::BYTES, crc32(&wrong));
    assert_eq!(refused, Err(Error::Unreadable(Unreadable::Crc)));
    assert_eq!(store.profile(), None, "nothing was written");
}

/// What is done to a store.
type Work = fn(&mut Store) -> Result<(), Error>;

/// Stores that keep the last of these profiles, what is done to them, and what they keep then.
fn works() -> [(&'static [u8], Work, Option<u8>); 4] {
    [
        (&[], |store| save(store, 7), Some(7)),
        (&[1], |store| save(store, 7), Some(7)),
        (&[1, 2, 3], |store| save(store, 7), Some(7)),
        (&[1, 2], erase, None),
    ]
}

/// A store that keeps the last of these.
fn with(before: &[u8]) -> Store {
    let mut store = empty(&Power::new());
    for number in before {
        save(&mut store, *number).expect("kept");
    }
    store
}

/// Does `work` with this cut planned, then restarts; whether the power was cut.
fn cut(mut store: Store, plan: Cut, work: Work) -> (Store, bool) {
    let slots = store.release();
    let power = slots[0].0.power().clone();
    store = ProfileStore::new(slots);
    power.plan(plan);
    let _ = work(&mut store);
    let hit = !power.is_on();
    (reboot(store), hit)
}

/// Every cut of one piece of work: `visit` says whether it was hit.
fn every_cut(seeds: u64, mut visit: impl FnMut(Cut) -> bool) -> u64 {
    let mut cuts = 0;
    for after_operations in 0.. {
        let mut hit = false;
        for seed in 0..seeds {
            for phase in [Phase::Before, Phase::Inside, Phase::After] {
                let plan = Cut {
                    after_operations,
                    phase,
                    seed: 1_000 * seed + after_operations,
                };
                hit = visit(plan);
                cuts += u64::from(hit);
            }
        }
        if !hit {
            break;
        }
    }
    cuts
}

#[test]
fn a_power_cut_at_any_operation_leaves_the_old_profile_or_the_new_one() {
    for (before, work, after) in works() {
        let old = before.last().copied();
        let cuts = every_cut(20, |plan| {
            let (mut store, hit) = cut(with(before), plan, work);
            let kept = number(&store);
            if hit {
                assert!(kept == old || kept == after, "{kept:?} {plan:?}");
            } else {
                assert_eq!(kept, after);
            }
            // Whatever the cut left, the next one is kept.
            save(&mut store, 9).expect("kept");
            assert_eq!(number(&reboot(store)), Some(9));
            hit
        });
        println!("{cuts} cuts after {before:?}");
        assert!(cuts >= 3 * 4 * 20, "{cuts}");
    }
}

#[test]
fn a_second_power_cut_while_it_is_done_anew_leaves_a_whole_profile() {
    for (before, work, after) in works() {
        let old = before.last().copied();
        let mut pairs = 0;
        every_cut(2, |first| {
            let (_, hit) = cut(with(before), first, work);
            pairs += every_cut(2, |second| {
                let (store, _) = cut(with(before), first, work);
                let (store, hit) = cut(store, second, work);
                let kept = number(&store);
                assert!(
                    kept == old || kept == after,
                    "{kept:?} {first:?} {second:?}"
                );
                hit
            });
            hit
        });
        println!("{pairs} pairs after {before:?}");
    }
}
