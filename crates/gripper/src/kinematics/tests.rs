use super::*;
use std::vec::Vec;

extern crate std;

const TWO: [two_finger::Model; 3] = [
    two_finger::Model::TwoFinger85,
    two_finger::Model::TwoFinger140,
    two_finger::Model::HandE,
];

fn all() -> Vec<Model> {
    let mut all: Vec<Model> = TWO.map(Model::TwoFinger).into();
    all.push(Model::ThreeFinger);
    all
}

fn index(model: Model, name: &str) -> usize {
    let links = model.links();
    links.iter().position(|link| link.name == name).unwrap()
}

fn distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    let square = |k: usize| (a[k] - b[k]) * (a[k] - b[k]);
    libm::sqrtf(square(0) + square(1) + square(2))
}

/// Where a link ends, in the palm's frame.
fn end(model: Model, counts: &[f32], name: &str) -> [f32; 3] {
    let index = index(model, name);
    model.poses(counts).unwrap()[index].at(model.links()[index].end)
}

/// The direction in which a link points.
fn along(model: Model, counts: &[f32], name: &str) -> [f32; 3] {
    let turned = Pose {
        position: [0.0; 3],
        ..model.poses(counts).unwrap()[index(model, name)]
    };
    turned.at([0.0, 0.0, 1.0])
}

/// Counts through the whole range, each axis at its own pace.
fn counts(step: usize, axes: usize) -> Vec<f32> {
    let count = |axis: usize| ((step * (3 + 4 * axis)) % 256) as f32;
    (0..axes).map(count).collect()
}

#[test]
fn every_link_begins_where_its_parent_ends_whatever_the_counts() {
    for model in all() {
        let links = model.links();
        for step in 0..600 {
            let poses = model.poses(&counts(step, model.axes())).unwrap();
            assert_eq!(poses.len(), links.len());
            for (link, pose) in links.iter().zip(poses.iter()) {
                let [w, x, y, z] = pose.orientation;
                assert!(
                    (w * w + x * x + y * y + z * z - 1.0).abs() < 1e-5,
                    "{link:?}"
                );
                let Some(parent) = link.parent.filter(|&parent| parent != 0) else {
                    continue;
                };
                let joint = poses[parent].at(links[parent].end);
                assert!(distance(joint, pose.position) < 1e-3, "{link:?} {step}");
                let back = poses[parent].then(&pose.seen_from(&poses[parent]));
                assert!(distance(back.position, pose.position) < 1e-3);
            }
        }
    }
}

#[test]
fn fingertips_stay_parallel_up_to_110_counts_and_bend_in_beyond() {
    // Inwards is −y for finger A, +y for the others; the scissor in its middle.
    for (tip, inwards) in [
        ("finger_a_distal", -1.0),
        ("finger_b_distal", 1.0),
        ("finger_c_distal", 1.0),
    ] {
        for count in 0..=255_u8 {
            let g = f32::from(count);
            let [x, y, z] = along(Model::ThreeFinger, &[g, g, g, 127.5], tip);
            assert!(x.abs() < 1e-5, "{tip} {count}");
            if count <= 110 {
                assert!(y.abs() < 1e-5 && z > 0.999_99, "{tip} {count}: {y}");
            } else {
                assert!(y * inwards > 0.0, "{tip} {count}: {y}");
            }
        }
    }
}

#[test]
fn lengths_are_those_of_the_description() {
    let links = &THREE_FINGER;
    assert!((links[2].length() - libm::hypotf(50.0, 28.0)).abs() < 1e-3);
    let finger: f32 = links[2..5].iter().map(Link::length).sum();
    assert!((finger - 125.0).abs() < 0.5, "{finger}");
    // With joint angles 0 the second joint is 50 up and 28 out from the first.
    let poses = Model::ThreeFinger.poses(&[0.0, 0.0, 0.0, 127.5]).unwrap();
    let [x, y, z] = poses[3].position;
    assert!(distance([x, y, z], [0.0, 45.5 + 28.0, 41.4 + 50.0]) < 1e-2);
}

#[test]
fn finger_a_is_the_single_one_and_the_scissor_moves_only_the_other_two() {
    let at = |scissor: f32, tip: &str| end(Model::ThreeFinger, &[40.0, 40.0, 40.0, scissor], tip);
    assert_eq!(at(0.0, "finger_a_distal"), at(255.0, "finger_a_distal"));
    assert!(at(0.0, "finger_a_distal")[1] > 0.0 && at(0.0, "finger_b_distal")[1] < 0.0);
    let apart = |scissor: f32| {
        let (b, c) = (
            at(scissor, "finger_b_distal"),
            at(scissor, "finger_c_distal"),
        );
        assert!((b[0] + c[0]).abs() < 1e-3 && (b[2] - c[2]).abs() < 1e-3);
        b[0] - c[0]
    };
    assert!(apart(0.0) > apart(127.5) + 40.0, "{}", apart(0.0));
    assert!(apart(127.5) > apart(255.0) + 40.0, "{}", apart(255.0));
    // Pinched, their tips meet, as thick as they are, and do not cross.
    let gap = apart(255.0);
    assert!((gap - 18.0).abs() < 5.0, "{gap}");
}

#[test]
fn one_count_moves_no_link_by_leaps() {
    for model in all() {
        let mut last: Option<Poses> = None;
        for count in 0..=255_u8 {
            let counts = [f32::from(count); AXES];
            let poses = model.poses(&counts[..model.axes()]).unwrap();
            if let Some(last) = last.replace(poses) {
                for ((pose, before), link) in poses.iter().zip(last.iter()).zip(model.links()) {
                    let moved = distance(pose.at(link.end), before.at(link.end));
                    assert!(moved < 2.5, "{link:?} at {count}: {moved} mm");
                }
            }
        }
    }
}

#[test]
fn two_fingers_open_by_their_stroke_and_meet_when_closed() {
    for two in TWO {
        let model = Model::TwoFinger(two);
        for (count, share) in [(0.0, 1.0), (127.5, 0.5), (255.0, 0.0)] {
            let left = end(model, &[count], "left_finger");
            let right = end(model, &[count], "right_finger");
            let faces = right[1] - left[1] - 2.0 * HALF;
            assert!(
                (faces - share * two.stroke_mm()).abs() < 1e-2,
                "{two:?} {faces}"
            );
            assert!((left[2] - right[2]).abs() < 1e-3 && left[0].abs() < 1e-3);
            assert!(along(model, &[count], "left_finger")[2] > 0.999_99);
        }
    }
}

#[test]
fn counts_beyond_the_range_are_its_ends_and_other_axes_are_refused() {
    let beyond = Model::ThreeFinger.poses(&[-9.0, 300.0, f32::INFINITY, -0.5]);
    assert_eq!(beyond, Model::ThreeFinger.poses(&[0.0, 255.0, 255.0, 0.0]));
    assert_eq!(Model::ThreeFinger.poses(&[0.0]), None);
    assert_eq!(
        Model::TwoFinger(two_finger::Model::HandE).poses(&[0.0; 4]),
        None
    );
    let odd = Model::ThreeFinger
        .poses(&[f32::NAN, 0.0, 0.0, 0.0])
        .unwrap();
    assert!(odd[2].orientation[0].is_nan() && odd[6].orientation[0].is_finite());
}

#[test]
fn a_parent_stands_before_its_children_and_names_differ() {
    for model in all() {
        let links = model.links();
        assert!(links.len() <= LINKS);
        for (place, link) in links.iter().enumerate() {
            assert_eq!(link.parent.is_none(), place == 0);
            assert!(link.parent.is_none_or(|parent| parent < place));
            assert!(links[..place].iter().all(|other| other.name != link.name));
        }
    }
}
