//! A recorded calibration session and the use after it: from the sensors' bytes to the profile and the angles, the way that the bridge
//! and the host go.
//!
//! Input, a row a scan: the prompt u8 (0 none, from 1 on a step of [`STEPS`], then [`FLAT_IN_USE`]), its beginning u64 in microseconds,
//! the sensors that were read u16, and 8 bytes each of 16. Output: the profile's bytes, bound to no ids; then for each scan after
//! the calibration 25 angles f32 and the joints held u32.

use bridge::glove::Instant;
use bridge::glove::calibration::{Align, Bound, Finger, Reads, Session, Step};
use bridge::glove::headings::{Config, Headings};

/// Bytes of a row.
const ROW: usize = 1 + 8 + 2 + 16 * 8;
/// From one sensor's read to the next, microseconds.
const SKEW_US: u64 = 1_800;
/// The steps by their numbers, less one.
const STEPS: [Step; 12] = [
    Step::FirstFlat,
    Step::Turn,
    Step::SecondFlat,
    Step::Alone(Finger::Index),
    Step::Alone(Finger::Middle),
    Step::Alone(Finger::Ring),
    Step::Alone(Finger::Little),
    Step::Alone(Finger::Thumb),
    Step::Fists,
    Step::Thumb,
    Step::Free,
    Step::LastFlat,
];
/// A flat pose in the use.
const FLAT_IN_USE: u8 = STEPS.len() as u8 + 1;

type Sensors = [(Option<[u8; 8]>, Instant); 16];

fn row(bytes: &[u8]) -> Option<(u8, Sensors)> {
    let (prompt, bytes) = bytes.split_first()?;
    let (at, bytes) = bytes.split_first_chunk::<8>()?;
    let (there, bytes) = bytes.split_first_chunk::<2>()?;
    let (at, there) = (u64::from_le_bytes(*at), u16::from_le_bytes(*there));
    let reads = bytes.as_chunks::<8>().0;
    let sensors = core::array::from_fn(|k| {
        let read = reads.get(k).filter(|_| there >> k & 1 == 1);
        (read.copied(), Instant::from_ticks(at + SKEW_US * k as u64))
    });
    Some((*prompt, sensors))
}

/// The bytes put out; `None` where the calibration came to nothing, or there is no room.
pub fn run(rows: &[u8], output: &mut [u8]) -> Option<usize> {
    let (mut reads, mut align, mut session) = (Reads::new(), Align::new(), Session::new());
    let mut headings: Option<Headings> = None;
    let (mut starts, mut asked, mut length) = ([0u16; 16], false, 0);
    let mut put = |bytes: &[u8]| {
        let end = length + bytes.len();
        output.get_mut(length..end)?.copy_from_slice(bytes);
        length = end;
        Some(end)
    };
    let mut all = None;
    for bytes in rows.chunks_exact(ROW) {
        let (prompt, sensors) = row(bytes)?;
        let frame = reads.frame(&sensors);
        for (k, start) in starts.iter_mut().enumerate() {
            let before = core::mem::replace(start, reads.starts[k]);
            if before == *start || before == 0 {
                continue;
            }
            align.forget(k);
            match &mut headings {
                Some(headings) => headings.restarted(k, frame.samples[k].stamp),
                None => session.restarted(k),
            }
        }
        let scan = align.take(&frame);
        let step = STEPS.get(usize::from(prompt).wrapping_sub(1)).copied();
        if let (Some(step), None) = (step, &headings) {
            if session.step() != Some(step) {
                session.begin(step);
            }
            session.take(&scan);
            continue;
        }
        let is_last = session.step() == Some(Step::LastFlat);
        session.end();
        if is_last && headings.is_none() {
            let outcome = session.finish().ok()?;
            let bound = Bound {
                profile: outcome.profile,
                ids: [[0; 16]; 16],
            };
            put(&bound.to_bytes())?;
            headings = Some(Headings::start(&outcome, scan.at, Config::default()));
        }
        let Some(headings) = &mut headings else {
            continue;
        };
        let is_asked = prompt == FLAT_IN_USE;
        if is_asked && !asked {
            headings.begin_flat();
        }
        let reading = headings.take(&scan);
        if asked && !is_asked {
            // Refused: it goes on with what it has.
            let _ = headings.end_flat(scan.at);
        }
        asked = is_asked;
        for angle in reading.angles {
            put(&angle.to_bits().to_le_bytes())?;
        }
        all = put(&reading.held.to_le_bytes());
    }
    all
}
