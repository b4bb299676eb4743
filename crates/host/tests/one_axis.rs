//! A hand's map for a gripper of one axis.
#![allow(missing_docs, clippy::unwrap_used)]

use glove::hand::LIMITS;
use host::interrupt::Interrupt;
use host::report::Nobody;
use host::training::motion::Motion;
use host::training::{Request, train};
use trainer::algorithm::Schedule;
use trainer::hand::Space;
use trainer::hand::motion::Generator;

#[test]
fn the_open_hand_opens_it_the_fist_closes_it_and_the_map_is_good_for_any_seed() {
    for seed in 1..=3 {
        let request = Request {
            motion: &Motion::Generated { seed },
            space: Space::OneAxis,
            schedule: Schedule::Fast,
            epochs: None,
            pairs: 8,
            start_pairs: true,
            seed,
            within: None,
            reporter: &Nobody,
        };
        let outcome = train(&request, &Interrupt::never().unwrap()).unwrap();
        let hand = Generator::new(&LIMITS, seed);
        let [open, fist] = [hand.flat_hand(), hand.fist()].map(|pose| {
            let images = outcome
                .model
                .map_all(&trainer::data::Matrix::from_rows(&[pose]));
            images.row(0)[0]
        });
        println!(
            "seed {seed}: open {open:.1}, fist {fist:.1}, {:?} {:.1?}",
            outcome.quality, outcome.took
        );
        assert!(open <= 5.0 && fist >= 250.0, "seed {seed}: {open} {fist}");
        assert!(outcome.quality.good(), "seed {seed}: {:?}", outcome.quality);
    }
}
