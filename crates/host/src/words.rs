//! Codes of the devices in a person's words.

use glove::hand;
use glove::scan::Health;
use gripper::{Activation, Contact};
use rustix::io::Errno;

use gripper::space::AXES;
/// The gripper's axes as a person reads them; files have [`crate::session::record::AXIS_NAMES`].
pub const AXIS_WORDS: [&str; AXES] = ["finger A", "finger B", "finger C", "scissor"];

/// The same of a gripper with so many axes.
pub fn axis_words(axes: usize) -> &'static [&'static str] {
    match axes {
        1 => &["fingers"],
        _ => &AXIS_WORDS,
    }
}

/// The speed of a glove's line, baud; `None` on an I²C port.
pub fn line_speed(baud: Option<u32>) -> String {
    match baud {
        Some(baud) => format!("{baud} baud"),
        None => "on an I2C port".to_owned(),
    }
}

/// Counts in words: "finger A closed, fingers B and C open, scissor wide".
pub fn gripper_words(counts: &[f32]) -> String {
    let closed = |count: f32| match count {
        ..26.0 => "open",
        26.0..90.0 => "a quarter closed",
        90.0..166.0 => "half closed",
        166.0..230.0 => "nearly closed",
        _ => "closed",
    };
    let [a, b, c, scissor] = counts else {
        let all = counts.first().copied().unwrap_or(0.0);
        return format!("fingers {}", closed(all));
    };
    let scissor = match scissor {
        ..50.0 => "wide",
        50.0..100.0 => "rather wide",
        100.0..166.0 => "in the middle",
        166.0..215.0 => "rather narrow",
        _ => "in a pinch",
    };
    let [a, b, c] = [*a, *b, *c].map(closed);
    let fingers = match (a == b, b == c) {
        (true, true) => format!("all fingers {a}"),
        (true, false) => format!("fingers A and B {a}, finger C {c}"),
        (false, true) => format!("finger A {a}, fingers B and C {b}"),
        (false, false) if a == c => format!("fingers A and C {a}, finger B {b}"),
        (false, false) => format!("finger A {a}, finger B {b}, finger C {c}"),
    };
    format!("{fingers}, scissor {scissor}")
}

/// The fingers, thumb first: each has five joint angles in a row.
pub const FINGER_NAMES: [&str; 5] = ["thumb", "index", "middle", "ring", "little"];

/// What is wrong with a gripper, and what to do.
pub fn fault(fault: gripper::Fault) -> String {
    format!(
        "gripper fault {:02X}: {}; {}",
        fault.code(),
        fault.sentence(),
        fault.action()
    )
}

/// gIMC: 0 reset, 1 activating, 2 changing mode, 3 ready.
pub fn activation_code(activation: Activation) -> u8 {
    match activation {
        Activation::Reset => 0,
        Activation::Activating => 1,
        Activation::ChangingMode => 2,
        Activation::Ready => 3,
    }
}

/// gDTx.
pub fn contact_code(contact: Contact) -> u8 {
    match contact {
        Contact::Moving => 0,
        Contact::ContactOpening => 1,
        Contact::ContactClosing => 2,
        Contact::AtPosition => 3,
    }
}

/// What an axis does.
pub fn contact(contact: Contact) -> &'static str {
    match contact {
        Contact::Moving => "moving",
        Contact::ContactOpening => "stopped while opening",
        Contact::ContactClosing => "holds something",
        Contact::AtPosition => "there",
    }
}

/// How ready a gripper is.
pub fn activation(activation: Activation) -> &'static str {
    match activation {
        Activation::Reset => "not activated",
        Activation::Activating => "activating",
        Activation::ChangingMode => "changing its mode",
        Activation::Ready => "ready",
    }
}

/// For each finger, whether all its five angles rest on good sensors. `good`: by segment.
pub fn fingers_good(good: &[bool; hand::SEGMENT_COUNT]) -> [bool; 5] {
    let lost = good
        .iter()
        .enumerate()
        .filter(|(_, good)| !**good)
        .fold(0_u32, |mask, (segment, _)| {
            mask | hand::joints_of_segment(segment)
        });
    core::array::from_fn(|finger| lost >> (5 * finger) & 0b1_1111 == 0)
}

/// The sensors that are not good, by name.
pub fn lost_sensors(health: &[Health; hand::SEGMENT_COUNT]) -> Option<String> {
    let lost: Vec<String> = hand::SEGMENT_NAMES
        .iter()
        .zip(health)
        .filter(|(_, health)| **health != Health::Good)
        .map(|(name, health)| format!("{name} ({health})"))
        .collect();
    match lost.len() {
        0 => None,
        1..=3 => Some(format!("sensor {}", lost.join(", "))),
        count => Some(format!("{count} of 16 sensors, {} first", lost[0])),
    }
}

/// The sensors that are not used although they give orientations, by name. `distrusted`: bit k is segment k.
pub fn distrusted_sensors(distrusted: u16) -> Option<String> {
    let what = "jumped, restarted, slipped or was exchanged: its joints are held until the next calibration";
    sensors_that(distrusted, what)
}

/// The sensors that show what no hand does, by name. `impossible`: bit k is segment k.
pub fn impossible_sensors(impossible: u16) -> Option<String> {
    let what =
        "shows a joint turned farther than a hand's can be: its joints are held as long as it does";
    sensors_that(impossible, what)
}

fn sensors_that(bits: u16, what: &str) -> Option<String> {
    let names = names_of(bits);
    (!names.is_empty()).then(|| format!("sensor {} {what}", names.join(", ")))
}

/// Why a file is not written.
pub fn disk(error: &std::io::Error) -> String {
    match error.raw_os_error().map(Errno::from_raw_os_error) {
        Some(Errno::NOSPC) => "no space left on the disk".to_owned(),
        Some(Errno::DQUOT) => "no space left: your quota on that disk is used up".to_owned(),
        Some(Errno::FBIG) => {
            "the file is as long as the system lets this program make one (ulimit -f)".to_owned()
        }
        Some(Errno::ROFS) => "its folder is on a disk that is read-only".to_owned(),
        Some(Errno::ACCESS | Errno::PERM) => "you may not write in its folder".to_owned(),
        _ => error.to_string(),
    }
}

/// The segments of a mask, by name.
fn names_of(segments: u16) -> Vec<&'static str> {
    hand::SEGMENT_NAMES
        .iter()
        .enumerate()
        .filter(|(segment, _)| segments >> segment & 1 == 1)
        .map(|(_, name)| *name)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lost_sensor_marks_its_own_finger_and_the_back_of_the_hand_all() {
        let mut good = [true; hand::SEGMENT_COUNT];
        good[4] = false; // index_proximal
        assert_eq!(fingers_good(&good), [true, false, true, true, true]);
        good[4] = true;
        good[0] = false;
        assert_eq!(fingers_good(&good), [false; 5]);
    }

    #[test]
    fn a_sensor_that_shows_what_no_hand_does_is_named() {
        assert_eq!(impossible_sensors(0), None);
        let text = impossible_sensors(1 << 4 | 1 << 11).unwrap();
        assert!(text.starts_with("sensor index_proximal, ring_middle shows"));
    }

    #[test]
    fn one_lost_sensor_is_named_and_many_are_counted() {
        let mut health = [Health::Good; hand::SEGMENT_COUNT];
        assert_eq!(lost_sensors(&health), None);
        health[11] = Health::Starting;
        assert_eq!(
            lost_sensors(&health).as_deref(),
            Some("sensor ring_middle (starting)")
        );
        health = [Health::Starting; hand::SEGMENT_COUNT];
        assert!(lost_sensors(&health).unwrap().starts_with("16 of 16"));
    }
}
