//! Power cuts in the weights store and any contents of its flash: a small part of what `cargo xtask powercut` does.
#![allow(missing_docs)]

use loop_tests::power_cuts::{self, UNIT, every_single, full_size, small};
use loop_tests::slot_contents::{mutate, whole_bridge};
use loop_tests::trace::record;

const SEED: u64 = 1;

#[test]
fn every_single_cut_of_a_small_image_leaves_the_old_one_or_the_new_one_whole() {
    let mut bench = small();
    let operations = bench.operations();
    let cuts = every_single(&mut bench, 2, &mut |_, _| {});
    println!(
        "{cuts} single cuts: {operations} operations of {UNIT} bytes or a sector, {} bytes of image",
        bench.image_bytes()
    );
    // 1 + 3 erases, 160 + 8 units; before, after and twice inside each.
    assert_eq!((operations, cuts), (172, 4 * 172));
}

#[test]
fn random_single_cuts_of_a_full_size_image_leave_it_whole() {
    let mut bench = full_size();
    let cuts = power_cuts::random(&mut bench, 1, 300, SEED, &mut |_, _| {});
    println!(
        "seed {SEED}: {cuts} single cuts of {} bytes",
        bench.image_bytes()
    );
    assert_eq!(cuts, 300);
}

#[test]
fn random_pairs_and_triples_of_cuts_leave_a_whole_image() {
    let pairs = power_cuts::random(&mut full_size(), 2, 100, SEED, &mut |_, _| {});
    let triples = power_cuts::random(&mut small(), 3, 10_000, SEED, &mut |_, _| {});
    println!("seed {SEED}: {pairs} cuts in pairs at full size, {triples} in triples of 640 bytes");
    assert_eq!((pairs, triples), (200, 30_000));
}

#[test]
fn every_pair_that_begins_with_one_of_the_first_cuts_leaves_a_whole_image() {
    let mut bench = small();
    let singles = 4 * bench.operations();
    let mut seen = 0;
    let pairs = power_cuts::pairs_after(&mut bench, 0..3, 2, &mut |_, _| seen += 1);
    println!("{pairs} pairs");
    assert_eq!((pairs, seen), (3 * 4 * singles, 3));
}

#[test]
fn any_contents_of_the_slots_give_known_weights_sound_ones_or_none() {
    let found = mutate(100_000, SEED, &mut |_, _| {});
    println!("seed {SEED}: {found:?}");
    assert!(
        found.known > 10_000 && found.none > 1_000 && found.forged > 100,
        "{found:?}"
    );
}

#[test]
fn without_whole_weights_the_bridge_never_follows() {
    let hand = |time_s: f64| [0.3 * time_s.sin() as f32; 25];
    let trace = record(&[], hand, 2, false, SEED).trace;
    let found = whole_bridge(&trace, 20, SEED, &mut |_, _| {});
    println!("seed {SEED}: {found:?}");
    assert!(found.none >= 2 && found.known >= 2, "{found:?}");
}
