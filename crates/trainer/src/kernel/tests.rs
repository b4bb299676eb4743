use super::boxes::Boxes;
use super::lanes::LANES;
use super::motion::Motion;
use super::nearest::nearest;
use super::tracker::{Field, Tracker};
use super::*;
use crate::random::Random;

fn cloud(count: usize, dims: usize, random: &mut Random) -> Blocks {
    let mut blocks = Blocks::zeros(count, dims);
    for n in 0..count {
        for i in 0..dims {
            blocks.set(n, i, random.between(-1.0, 1.0));
        }
    }
    blocks
}

fn shake(cloud: &mut Blocks, size: f32, random: &mut Random) {
    for v in &mut cloud.data {
        *v += random.between(-size, size);
    }
}

/// Follows a walk, small steps and now and then a leap; one of the two clouds moves.
fn walk(machine: Machine, dims: usize, (queries, candidates): (usize, usize), queries_move: bool) {
    let mut random = Random::new(dims as u64, 3);
    let mut queries = cloud(queries, dims, &mut random);
    let mut candidates = cloud(candidates, dims, &mut random);
    // Twins: the first of equals must win.
    for i in 0..dims {
        let value = candidates.get(0, i);
        candidates.set(candidates.count - 1, i, value);
    }
    let (mut motion, mut tracker) = (Motion::default(), Tracker::default());
    let mut total = 0.0;
    let mut generation = 0;
    let blocks = candidates.blocks().next_multiple_of(LANES);
    for step in 0..200 {
        let size = if step % 50 == 49 { 0.5 } else { 0.003 };
        let moving = if queries_move {
            &mut queries
        } else {
            &mut candidates
        };
        shake(moving, size, &mut random);
        let forget = total > 1.0;
        if forget {
            (total, generation) = (0.0, generation + 1);
        }
        motion.look(machine, dims, &moving.data, forget);
        total += motion.longest;
        let mut block_ways = vec![0.0; blocks];
        let mut query_ways = vec![0.0; queries.blocks() * LANES];
        if queries_move {
            query_ways.copy_from_slice(&motion.point);
        } else {
            block_ways[..motion.block.len()].copy_from_slice(&motion.block);
        }
        let boxes = Boxes::around(dims, &candidates.data);
        let field = Field {
            dims,
            boxes: &boxes,
            candidates: &candidates.data,
            count: candidates.count,
            block_ways: &block_ways,
            total_way: if queries_move { 0.0 } else { total },
            query_ways: &query_ways,
            longest: motion.longest,
            generation,
        };
        tracker.update(machine, &queries.data, queries.count, &field);
        let mut want = vec![0; queries.count];
        nearest(
            machine,
            dims,
            &queries.data,
            &candidates.data,
            candidates.count,
            &mut want,
        );
        assert_eq!(
            tracker.nearest, want,
            "step {step}, {dims} dimensions, {machine:?}"
        );
    }
}

#[test]
fn followed_neighbours_are_those_of_a_full_search() {
    for machine in Machine::all() {
        for dims in [1, 2, 3, 4, 7, 25] {
            for sizes in [(50, 700), (400, 33), (3, 2), (1, 1)] {
                walk(machine, dims, sizes, false);
                walk(machine, dims, sizes, true);
            }
        }
    }
}

#[test]
fn every_lane_operation_gives_the_same_bits_on_every_machine() {
    use super::lanes::Lanes;
    dispatch! {
        fn mix / mix_kernel(a: &[f32; 16], b: &[f32; 16]) -> Vec<u32>
    }
    #[inline(always)]
    unsafe fn mix_kernel<V: Lanes>(a: &[f32; 16], b: &[f32; 16]) -> Vec<u32> {
        // SAFETY: features by the caller; 16 lanes each.
        unsafe {
            let (x, y) = (V::load(a.as_ptr()), V::load(b.as_ptr()));
            let greater = x.gt(y);
            let all = [
                x.add(y),
                x.sub(y),
                x.mul(y),
                x.div(y),
                x.mul(x).sqrt(),
                x.max(y),
                x.keep(greater),
                x.choose(greater, y),
                x.keep(V::mask(0x5a3c)),
                x.mul_add(y, y),
                V::splat(x.least()),
                V::splat(f32::from(V::bits(greater))),
            ];
            let mut out = Vec::new();
            for v in all {
                let mut lanes = [0.0_f32; 16];
                v.store(lanes.as_mut_ptr());
                out.extend(lanes.map(f32::to_bits));
            }
            out
        }
    }
    let mut random = Random::new(4, 4);
    for _ in 0..200 {
        let a = core::array::from_fn(|_| random.between(-3.0, 3.0));
        let b = core::array::from_fn(|_| random.between(-3.0, 3.0));
        let want = mix(Machine::Plain, &a, &b);
        for machine in Machine::all() {
            assert_eq!(mix(machine, &a, &b), want, "{machine:?}");
        }
    }
}
