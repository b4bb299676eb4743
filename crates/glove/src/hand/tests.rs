use super::*;
use nalgebra::{Matrix3, Rotation3, Vector3};

extern crate std;
use std::{println, string::String, vec::Vec};

const X: Vector3<f32> = Vector3::new(1.0, 0.0, 0.0);
const Y: Vector3<f32> = Vector3::new(0.0, 1.0, 0.0);
const Z: Vector3<f32> = Vector3::new(0.0, 0.0, 1.0);

/// A small generator of numbers in [−1, 1): the crate has no random numbers of its own.
struct Lcg(u64);

impl Lcg {
    fn next(&mut self) -> f32 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 40) as f32) / 8_388_608.0 - 1.0
    }

    fn quaternion(&mut self) -> Quaternion {
        loop {
            let raw = nalgebra::Quaternion::new(self.next(), self.next(), self.next(), self.next());
            if raw.norm() > 0.1 {
                return Quaternion::new_normalize(raw);
            }
        }
    }
}

fn joint(name: &str) -> usize {
    JOINT_NAMES.iter().position(|&n| n == name).unwrap()
}

fn segment(name: &str) -> usize {
    SEGMENT_NAMES.iter().position(|&n| n == name).unwrap()
}

fn posed(name: &str, angle: f32, side: Side) -> [Quaternion; SEGMENT_COUNT] {
    let mut angles = [0.0; JOINT_COUNT];
    angles[joint(name)] = angle;
    segment_orientations(&angles, side)
}

/// What a BNO055 register holds: 2⁻¹⁴ a count, rounded; then read back and made unit.
fn through_registers(q: &Quaternion) -> Quaternion {
    let count = |v: f32| libm::roundf(v * 16_384.0) as i16 as f32 / 16_384.0;
    let q = q.quaternion();
    Quaternion::new_normalize(nalgebra::Quaternion::new(
        count(q.w),
        count(q.i),
        count(q.j),
        count(q.k),
    ))
}

#[test]
fn flexion_bends_the_finger_towards_the_palm_on_either_hand() {
    for side in [Side::Right, Side::Left] {
        let pose = posed("index_mcp_flex", core::f32::consts::FRAC_PI_2, side);
        let tip = pose[segment("index_distal")] * Z;
        assert!(
            (tip + Y).norm() < 1e-6,
            "distal turns to palmar (−y): {tip}"
        );
        assert_eq!(pose[segment("middle_distal")], Quaternion::identity());
    }
}

#[test]
fn abduction_moves_the_finger_to_the_thumb_side_and_twist_lifts_that_side() {
    // Radial is +x on a right hand and −x on a left hand.
    for (side, radial) in [(Side::Right, 1.0), (Side::Left, -1.0)] {
        let tip = posed("ring_mcp_abd", 0.3, side)[segment("ring_proximal")] * Z;
        assert!(
            (tip.x * radial - libm::sinf(0.3)).abs() < 1e-6,
            "{side:?} {tip}"
        );
        let edge = posed("ring_mcp_twist", 0.3, side)[segment("ring_proximal")] * (X * radial);
        assert!((edge.y - libm::sinf(0.3)).abs() < 1e-6, "{side:?} {edge}");
    }
}

#[test]
fn a_joint_of_three_degrees_is_rx_ry_rz_by_nalgebras_matrices() {
    let mut random = Lcg(1);
    for _ in 0..1000 {
        let [a, b, c] = [
            3.0 * random.next(),
            1.5 * random.next(),
            3.0 * random.next(),
        ];
        let by_matrices = Rotation3::from_axis_angle(&Vector3::x_axis(), a)
            * Rotation3::from_axis_angle(&Vector3::y_axis(), b)
            * Rotation3::from_axis_angle(&Vector3::z_axis(), c);
        let ours: Matrix3<f32> = *rotation::compose(a, b, c).to_rotation_matrix().matrix();
        assert!((by_matrices.matrix() - ours).norm() < 1e-5);
    }
}

#[test]
fn equal_angles_on_the_left_hand_are_the_mirror_image() {
    // Mirroring at the y-z plane keeps the x part of a rotation and negates its y and z parts.
    let mut random = Lcg(2);
    let mut angles = [0.0; JOINT_COUNT];
    angles.iter_mut().for_each(|a| *a = random.next());
    let right = segment_orientations(&angles, Side::Right);
    let left = segment_orientations(&angles, Side::Left);
    for (r, l) in right.iter().zip(&left) {
        let mirrored = nalgebra::Quaternion::new(r.w, r.i, -r.j, -r.k);
        assert!((mirrored - l.quaternion()).norm() < 1e-6);
    }
}

#[test]
fn every_posture_within_the_limits_comes_back_within_a_fifth_of_a_degree() {
    let mut random = Lcg(3);
    let mut worst = 0.0f32;
    for round in 0..2000 {
        let side = if round % 2 == 0 {
            Side::Right
        } else {
            Side::Left
        };
        let mut angles = [0.0; JOINT_COUNT];
        for (angle, (low, high)) in angles.iter_mut().zip(LIMITS) {
            *angle = low + (high - low) * 0.5 * (random.next() + 1.0);
        }
        let world = random.quaternion();
        let sensors = segment_orientations(&angles, side).map(|q| through_registers(&(world * q)));
        let back = joint_angles(&sensors, &Calibration::identity(), side);
        for (a, b) in angles.iter().zip(back) {
            worst = worst.max((a - b).abs());
        }
    }
    assert!(worst.to_degrees() < 0.2, "worst {}°", worst.to_degrees());
}

#[test]
fn flat_hand_calibration_takes_any_mounting_away() {
    let mut random = Lcg(4);
    for _ in 0..200 {
        let mut mounting = [Quaternion::identity(); SEGMENT_COUNT];
        mounting[1..]
            .iter_mut()
            .for_each(|m| *m = random.quaternion());
        let worn = |world: Quaternion, angles: &[f32; JOINT_COUNT]| {
            let mut sensors = segment_orientations(angles, Side::Right);
            for (q, m) in sensors.iter_mut().zip(&mounting) {
                *q = through_registers(&(world * *q * m));
            }
            sensors
        };
        let calibration =
            Calibration::from_flat_hand(&worn(random.quaternion(), &[0.0; JOINT_COUNT]));
        let mut angles = [0.0; JOINT_COUNT];
        angles.iter_mut().for_each(|a| *a = random.next());
        let back = joint_angles(
            &worn(random.quaternion(), &angles),
            &calibration,
            Side::Right,
        );
        for (a, b) in angles.iter().zip(back) {
            assert!((a - b).abs().to_degrees() < 0.2, "{a} {b}");
        }
        assert_eq!(
            calibration,
            Calibration::from_mounting(*calibration.mounting())
        );
    }
}

#[test]
fn angles_compose_to_the_measured_rotation_even_in_gimbal_lock() {
    let mut random = Lcg(5);
    let half_pi = core::f32::consts::FRAC_PI_2;
    for offset in [0.0, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2] {
        for b in [half_pi - offset, -half_pi + offset] {
            for _ in 0..200 {
                let q = rotation::compose(3.0 * random.next(), b, 3.0 * random.next());
                let [x, y, z] = rotation::decompose(&q);
                assert!([x, y, z].iter().all(|v| v.is_finite()));
                assert!(offset > 0.0 || x == 0.0, "in lock the twist carries both");
                let turned = q.angle_to(&rotation::compose(x, y, z));
                assert!(turned < 2e-3, "b = {b}: off by {turned} rad");
            }
        }
    }
}

#[test]
fn any_unit_quaternions_give_finite_angles_in_range() {
    let mut random = Lcg(6);
    let pi = core::f32::consts::PI + 1e-6;
    let check = |sensors: &[Quaternion; SEGMENT_COUNT]| {
        for angle in joint_angles(sensors, &Calibration::identity(), Side::Left) {
            assert!(angle.is_finite() && angle.abs() <= pi, "{angle}");
        }
    };
    for _ in 0..5000 {
        let mut sensors = [Quaternion::identity(); SEGMENT_COUNT];
        sensors.iter_mut().for_each(|q| *q = random.quaternion());
        check(&sensors);
    }
    // Half turns about each axis, where a hinge's twist is undefined.
    for axis in [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()] {
        let turned = Quaternion::from_axis_angle(&axis, core::f32::consts::PI);
        let mut sensors = [Quaternion::identity(); SEGMENT_COUNT];
        sensors.iter_mut().step_by(2).for_each(|q| *q = turned);
        check(&sensors);
    }
}

#[test]
fn a_sensor_that_is_not_a_number_shows_in_its_joints_and_nowhere_else() {
    let mut sensors = [Quaternion::identity(); SEGMENT_COUNT];
    let lost = segment("middle_middle");
    sensors[lost] = Quaternion::new_unchecked(nalgebra::Quaternion::new(f32::NAN, 0.0, 0.0, 0.0));
    let angles = joint_angles(&sensors, &Calibration::identity(), Side::Right);
    for (index, angle) in angles.iter().enumerate() {
        let touched = joints_of_segment(lost) >> index & 1 == 1;
        assert_eq!(angle.is_nan(), touched, "{}", JOINT_NAMES[index]);
    }
}

#[test]
fn the_sign_of_a_quaternion_does_not_matter() {
    let mut random = Lcg(7);
    let mut angles = [0.0; JOINT_COUNT];
    angles.iter_mut().for_each(|a| *a = random.next());
    let mut sensors = segment_orientations(&angles, Side::Right);
    sensors
        .iter_mut()
        .skip(1)
        .step_by(3)
        .for_each(|q| *q = Quaternion::new_unchecked(-q.into_inner()));
    let back = joint_angles(&sensors, &Calibration::identity(), Side::Right);
    assert!(angles.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-5));
}

#[test]
fn a_segments_joints_are_those_its_orientation_enters() {
    // Witness: turn one segment's sensor and see which angles change.
    let mut random = Lcg(8);
    for lost in 1..SEGMENT_COUNT {
        let mut sensors = [Quaternion::identity(); SEGMENT_COUNT];
        sensors[lost] = random.quaternion();
        let angles = joint_angles(&sensors, &Calibration::identity(), Side::Right);
        let changed = (0..JOINT_COUNT)
            .filter(|&j| angles[j] != 0.0)
            .fold(0, |m, j| m | 1 << j);
        assert_eq!(joints_of_segment(lost), changed, "{}", SEGMENT_NAMES[lost]);
    }
    assert_eq!(joints_of_segment(segment("hand")), 0x01FF_FFFF);
    assert_eq!(joints_of_segment(16), 0x01FF_FFFF);
}

#[test]
fn limits_are_ordered_and_hold_the_flat_hand() {
    for ((low, high), name) in LIMITS.iter().zip(JOINT_NAMES) {
        assert!(low < high && *low <= 0.0 && *high >= 0.0, "{name}");
        assert!(high - low < core::f32::consts::PI, "{name}");
    }
}

#[test]
fn the_recorded_hand_comes_back_within_a_fifth_of_a_degree() {
    let Some(text) = rig::skip::shared("hand/recorded_hand_30hz.csv") else {
        return;
    };
    let frames = read_angles(&text);
    assert_eq!(frames.len(), 621);
    let mut random = Lcg(9);
    let mut worst = [0.0f32; JOINT_COUNT];
    for angles in &frames {
        for side in [Side::Right, Side::Left] {
            let world = random.quaternion();
            let sensors =
                segment_orientations(angles, side).map(|q| through_registers(&(world * q)));
            let back = joint_angles(&sensors, &Calibration::identity(), side);
            for (joint, slot) in worst.iter_mut().enumerate() {
                *slot = slot.max((angles[joint] - back[joint]).abs().to_degrees());
            }
        }
    }
    let worst_of_all = worst.iter().copied().fold(0.0, f32::max);
    println!("recorded hand: worst joint {worst_of_all:.4}°");
    for (name, error) in JOINT_NAMES.iter().zip(worst) {
        assert!(error < 0.2, "{name}: {error}°");
    }
}

/// The 25 columns by name from a poses file.
fn read_angles(text: &str) -> Vec<[f32; JOINT_COUNT]> {
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let columns = JOINT_NAMES.map(|name| header.iter().position(|h| *h == name).unwrap());
    let row = |line: &str| {
        let fields: Vec<String> = line.split(',').map(String::from).collect();
        columns.map(|c| fields[c].parse().unwrap())
    };
    lines.filter(|l| !l.is_empty()).map(row).collect()
}
