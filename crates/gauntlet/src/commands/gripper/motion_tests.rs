//! Commands and the numbers they are made from.

use super::*;
use crate::commands::gripper::axes::next_command;
use host::gripper::{Activation, Contact};

fn status<const X: usize>(position: [u8; X]) -> Status<X> {
    Status {
        stamp: host::gripper::Instant::from_ticks(0),
        activation: Activation::Ready,
        going_to: true,
        contact: [Contact::AtPosition; X],
        echo: position,
        position,
        current: [0; X],
        fault: host::gripper::Fault::None,
    }
}

#[test]
fn no_command_is_more_than_forty_counts_from_where_an_axis_is() {
    for here in 0..=255 {
        for target in 0..=255 {
            let [next] = next_command([target], &status([here]), Axes::Each, [LEAD], None);
            assert!(next.abs_diff(here) <= LEAD);
            assert!(next.abs_diff(target) <= here.abs_diff(target));
            assert!(next != here || here == target);
        }
    }
    let next = next_command(
        [250; 4],
        &status([10, 20, 30, 137]),
        Axes::Fingers,
        [LEAD; 4],
        None,
    );
    assert_eq!(next, [50, 60, 70, 137]);
    let next = next_command(
        [250; 4],
        &status([10, 20, 30, 137]),
        Axes::Scissor,
        [LEAD; 4],
        None,
    );
    assert_eq!(Axes::Scissor.block(next), [177, 20, 30, 177]);
}

#[test]
fn a_way_that_ends_where_fingers_and_scissor_are_apart_never_leads_through_where_they_meet() {
    // The scissor is closed and must open before the fingers may close.
    let (mut here, target) = ([20, 20, 20, 230], [250, 250, 250, 100]);
    for _ in 0..200 {
        let next = next_command(target, &status(here), Axes::Each, [LEAD; 4], None);
        let corner = core::array::from_fn(|axis| next[axis].max(here[axis]));
        assert!(space::contains_counts(&corner), "{here:?} {next:?}");
        // The fingers are the faster ones.
        for (axis, speed) in [9, 7, 8, 2].into_iter().enumerate() {
            here[axis] = next[axis].clamp(
                here[axis].saturating_sub(speed),
                here[axis].saturating_add(speed),
            );
        }
    }
    assert_eq!(here, target);
}

#[test]
fn one_number_is_for_all_and_four_are_checked_for_interference() {
    assert_eq!(positions::<4>(&[9], "").ok(), Some([9; 4]));
    assert_eq!(positions::<4>(&[1, 2, 3, 4], "").ok(), Some([1, 2, 3, 4]));
    assert!(positions::<4>(&[1, 2], "").is_err());
    assert!(positions::<1>(&[1, 2, 3, 4], "").is_err());
    let refused = positions::<4>(&[200, 200, 200, 200], "").unwrap_err();
    assert_eq!(refused.exit_code(), host::failure::EXIT_USAGE);
    let near: Vec<u8> = refused.next_step()[5..]
        .split_once(" (")
        .unwrap()
        .0
        .split(',')
        .map(|n| n.parse().unwrap())
        .collect();
    assert!(positions::<4>(&near, "").is_ok(), "{near:?}");
}
