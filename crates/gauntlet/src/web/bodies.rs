//! Hand and gripper as links for the page, from the one kinematics of each: [`glove::hand`] and [`gripper::kinematics`].
//!
//! What is added here is flesh: a palm between its knuckles, a body between the fingers' bases.

use host::glove::hand::shape::{self, THICKNESS};
use host::glove::hand::{JOINT_COUNT, SEGMENT_COUNT, Side};
use host::gripper::kinematics::Model;

use super::picture::{Link, Part};

/// How thick the palm is drawn at wrist and knuckles, mm.
const PALM: [f32; 2] = [13.0, 10.5];
/// A sensor's case lies so far on the segment's skin, mm.
const CASE: f32 = 2.0;

/// A hand's bones, and where its sensors sit: by segment, mm. Nothing where an angle is not finite.
pub fn hand(angles: &[f32; JOINT_COUNT], side: Side) -> (Vec<Link>, Vec<[f32; 3]>) {
    if !angles.iter().all(|angle| angle.is_finite()) {
        return (Vec::new(), Vec::new());
    }
    let poses = shape::poses(angles, side);
    let mut links = palm(side);
    for (segment, pose) in poses.iter().enumerate().skip(1) {
        let radius = 0.5 * THICKNESS[segment];
        // The next segment's thickness, or a rounder tip.
        let next = match segment % 3 {
            0 => 0.88 * radius,
            _ => 0.5 * THICKNESS[segment + 1],
        };
        links.push(Link {
            from: pose.position.into(),
            to: pose.at(shape::end(segment, side)).into(),
            radius: [radius, next],
            part: Part::Segment(segment as u8),
        });
    }
    let sensors = (0..SEGMENT_COUNT).map(|segment| {
        let mut place = 0.5 * shape::end(segment, side);
        if segment == 0 {
            place.x = 0.0;
        }
        place.y += 0.5 * THICKNESS[segment] + CASE;
        poses[segment].at(place).into()
    });
    (links, sensors.collect())
}

/// From the wrist to each knuckle, and the ball of the thumb.
fn palm(side: Side) -> Vec<Link> {
    let wrist = |finger: usize| {
        let joint = shape::first_joint(finger, side);
        [0.55 * joint.x, 0.5 * joint.y - 1.0, 4.0]
    };
    let mut links: Vec<Link> = (1..5)
        .map(|finger| Link {
            from: wrist(finger),
            to: shape::first_joint(finger, side).into(),
            radius: PALM,
            part: Part::Palm,
        })
        .collect();
    let across = |a: usize, b: usize, radius: f32| Link {
        from: shape::first_joint(a, side).into(),
        to: shape::first_joint(b, side).into(),
        radius: [radius; 2],
        part: Part::Palm,
    };
    links.extend([across(1, 2, 10.0), across(2, 3, 10.0), across(3, 4, 9.5)]);
    links.push(Link {
        from: wrist(1),
        to: shape::first_joint(0, side).into(),
        radius: [13.0, 12.0],
        part: Part::Palm,
    });
    links
}

/// A gripper's links by its counts. Nothing for another number of axes than the model has.
pub fn gripper(model: Model, counts: &[u8]) -> Vec<Link> {
    let counts: Vec<f32> = counts.iter().copied().map(f32::from).collect();
    let Some(poses) = model.poses(&counts) else {
        return Vec::new();
    };
    let mut links = Vec::new();
    for (link, pose) in model.links().iter().zip(poses.iter()) {
        let to = pose.at(link.end);
        let radius = 0.5 * link.thickness;
        let Some(parent) = link.parent else {
            let low = [0.0, 0.0, -34.0];
            let high = [0.0, 0.0, 0.1 * link.end[2]];
            links.push(body(low, high, 0.4 * link.thickness));
            continue;
        };
        if parent == 0 {
            // From the middle of the body to the finger's base.
            let high = 0.35 * pose.position[2];
            links.push(body([0.0, 0.0, high], pose.position, radius + 3.0));
        }
        links.push(Link {
            from: pose.position,
            to,
            radius: [radius, 0.92 * radius],
            part: Part::Finger(finger(link.name)),
        });
    }
    links
}

fn body(from: [f32; 3], to: [f32; 3], radius: f32) -> Link {
    Link {
        from,
        to,
        radius: [radius; 2],
        part: Part::Base,
    }
}

/// Which finger a link belongs to: of two fingers each is like finger A, which has one count, too.
fn finger(name: &str) -> u8 {
    match name.get(..8) {
        Some("finger_b") => 1,
        Some("finger_c") => 2,
        _ => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use host::gripper::registers::two_finger;

    #[test]
    fn every_segment_of_the_hand_and_every_link_of_each_gripper_is_drawn() {
        let (links, sensors) = hand(&[0.1; JOINT_COUNT], Side::Left);
        let segments: Vec<u8> = links
            .iter()
            .filter_map(|link| match link.part {
                Part::Segment(segment) => Some(segment),
                _ => None,
            })
            .collect();
        assert_eq!(segments, (1..16).collect::<Vec<u8>>());
        assert_eq!(sensors.len(), SEGMENT_COUNT);
        let fingers = |model, counts: &[u8]| {
            let links = gripper(model, counts);
            let is_finger = |link: &&Link| matches!(link.part, Part::Finger(_));
            links.iter().filter(is_finger).count()
        };
        assert_eq!(fingers(Model::ThreeFinger, &[0, 90, 255, 30]), 12);
        let small = Model::TwoFinger(two_finger::Model::TwoFinger85);
        assert_eq!(fingers(small, &[17]), 4);
        assert_eq!(fingers(small, &[0, 0, 0, 0]), 0);
    }

    #[test]
    fn a_hand_with_an_angle_that_is_no_number_is_not_drawn() {
        let mut angles = [0.0; JOINT_COUNT];
        angles[7] = f32::NAN;
        assert_eq!(hand(&angles, Side::Right), (Vec::new(), Vec::new()));
    }
}
