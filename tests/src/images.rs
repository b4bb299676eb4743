//! Weights images of maps: hand-written and random ones, and one that was trained.

use hae::image::{JointOrder, Meta, Parameters, encode, encoded_len};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use host::interrupt::Interrupt;
use host::training::motion::Motion;
use host::training::{Request, train};
use trainer::algorithm::Schedule;
use trainer::hand::Space;

/// Inputs, hidden units and outputs of the map that the bridge runs.
pub const SHAPE: [usize; 3] = [25, bridge::HIDDEN, 4];

/// A map as the tool trains it, of generated motion: one start of the fast schedule.
///
/// # Panics
/// Where nothing can be trained.
pub fn trained(space: Space, seed: u64) -> Vec<u8> {
    let outcome = train(
        &Request {
            space,
            motion: &Motion::Generated { seed },
            schedule: Schedule::Fast,
            epochs: None,
            pairs: 8,
            start_pairs: true,
            seed,
            within: None,
            reporter: &host::report::Nobody,
        },
        &Interrupt::never().expect("an interrupt"),
    )
    .expect("a map");
    println!("seed {seed}: {:?}", outcome.quality);
    host::training::model::image(&outcome.model).expect("an image")
}

/// A map whose fingers close with the index finger; `number` makes images differ and is their model id.
pub fn index_finger(number: u32) -> Vec<u8> {
    let [inputs, hidden, outputs] = SHAPE;
    let (mut w1, mut w2) = (vec![0.0; hidden * inputs], vec![0.0; outputs * hidden]);
    w1[5] = 1.0; // hidden unit 0 looks at index_mcp_flex
    for axis in 0..3 {
        w2[axis * hidden] = 60.0;
    }
    w2[hidden - 1] = number as f32;
    encoded(
        SHAPE,
        &meta(JointOrder::Hand25, number),
        [&w1, &vec![0.0; hidden], &w2, &[60.0, 60.0, 60.0, 137.0]],
    )
}

/// A map whose outputs stay where a gripper can follow, whatever the hand does.
pub fn gentle(seed: u64) -> Vec<u8> {
    with_spread(SHAPE, JointOrder::Hand25, seed, 1.0)
}

/// A map with the spread of a trained one: outputs within some hundred counts.
pub fn random(shape: [usize; 3], order: JointOrder, seed: u64) -> Vec<u8> {
    with_spread(shape, order, seed, 12.0)
}

fn with_spread(shape: [usize; 3], order: JointOrder, seed: u64, spread: f32) -> Vec<u8> {
    let [inputs, hidden, outputs] = shape;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut vector = |length: usize, least: f32, most: f32| -> Vec<f32> {
        (0..length)
            .map(|_| random.random_range(least..most))
            .collect()
    };
    let parameters = [
        vector(hidden * inputs, -0.3, 0.3),
        vector(hidden, -0.2, 0.2),
        vector(outputs * hidden, -spread, spread),
        vector(outputs, 100.0, 150.0),
    ];
    encoded(
        shape,
        &meta(order, seed as u32),
        parameters.each_ref().map(Vec::as_slice),
    )
}

fn meta(joint_order: JointOrder, model_id: u32) -> Meta {
    Meta {
        model_id,
        version: 1,
        joint_order,
    }
}

/// The image of w1, b1, w2, b2.
///
/// # Panics
/// Parameters that are no sound map.
pub fn encoded(shape: [usize; 3], meta: &Meta, [w1, b1, w2, b2]: [&[f32]; 4]) -> Vec<u8> {
    let [inputs, hidden, outputs] = shape;
    let parameters = Parameters {
        inputs,
        hidden,
        outputs,
        w1,
        b1,
        w2,
        b2,
    };
    let mut image = vec![0; encoded_len(inputs, hidden, outputs)];
    let length = encode(&parameters, meta, &mut image).expect("a sound map");
    image.truncate(length);
    image
}
