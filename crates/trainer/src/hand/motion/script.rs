//! What the hand does: one round of the movements of §3.3.2 as a list of keys (postures to reach, how long to get there, how long to
//! stay), drawn from the seed. Every round starts and ends with the flat hand, so that rounds follow one another without a jump.

use super::joints::{COUNT, Finger};
use super::posture::Posture;
use crate::random::Random;

/// How long a round takes, seconds.
pub const ROUND_S: f64 = 34.5;

/// A posture to reach.
#[derive(Clone, Debug)]
pub struct Key {
    /// Thumb, fingers and spread.
    pub posture: Posture,
    /// How this repetition differs from every other: added to the joint angles, radians.
    pub style: [f32; COUNT],
    /// When the movement towards this key starts, seconds into the round.
    pub start_s: f64,
    /// When it arrives.
    pub arrive_s: f64,
    /// How much later than the hand's own start thumb, fingers and spread set off, as a fraction of the movement.
    pub lag: [f32; 6],
}

/// One repetition's difference from the next, radians (standard deviation): flexions, abductions, twists.
const STYLE: (f64, f64, f64) = (0.045, 0.025, 0.05);

/// The keys of round `round`, in the order of time; the first is where the round before ended.
#[must_use]
pub fn round(seed: u64, round: u64) -> Vec<Key> {
    let mut random = Random::new(seed, 2 * round + 1);
    let postures = postures(&mut random);
    let mut spans: Vec<(f64, f64)> = postures
        .iter()
        .map(|posture| (travel(&mut random), stay(&mut random, posture)))
        .collect();
    let total: f64 = spans.iter().map(|(travel, stay)| travel + stay).sum();
    for (travel, stay) in &mut spans {
        *travel *= ROUND_S / total;
        *stay *= ROUND_S / total;
    }
    let mut keys = vec![boundary(seed, round, 0.0, 0.0)];
    let mut now = 0.0;
    for (posture, (travel, stay)) in postures.iter().zip(spans) {
        keys.push(Key {
            posture: *posture,
            style: style(&mut random),
            start_s: now,
            arrive_s: now + travel,
            lag: core::array::from_fn(|_| random.between(0.0, 0.25)),
        });
        now += travel + stay;
    }
    if let Some(last) = keys.last_mut() {
        // The next round starts from exactly this.
        let next = boundary(seed, round + 1, last.start_s, last.arrive_s);
        *last = next;
    }
    keys
}

/// The flat hand between two rounds: the same key ends one and starts the next.
fn boundary(seed: u64, round: u64, start_s: f64, arrive_s: f64) -> Key {
    let mut random = Random::new(seed, 2 * round);
    Key {
        posture: Posture::FLAT,
        style: style(&mut random),
        start_s,
        arrive_s,
        lag: [0.0; 6],
    }
}

fn travel(random: &mut Random) -> f64 {
    f64::from(random.between(0.45, 0.85))
}

/// People rest in a flat hand and in a fist, and pass through the rest.
fn stay(random: &mut Random, posture: &Posture) -> f64 {
    let rests = *posture == Posture::FLAT || *posture == Posture::FIST;
    f64::from(if rests {
        random.between(0.35, 0.6)
    } else {
        random.between(0.0, 0.15)
    })
}

fn style(random: &mut Random) -> [f32; COUNT] {
    let mut style = [0.0; COUNT];
    for (joint, value) in style.iter_mut().enumerate() {
        let size = match joint % 5 {
            1 => STYLE.1,
            2 => STYLE.2,
            _ => STYLE.0,
        };
        *value = (size * random.normal()) as f32;
    }
    style
}

/// The movements of a round: flat, fist, flat; each finger alone, in random order; several fingers together; gathering the
/// fingertips; spreading; thumb motions; flat.
fn postures(random: &mut Random) -> Vec<Posture> {
    let mut list = vec![Posture::FLAT, Posture::FIST, Posture::FLAT];
    let mut movements: Vec<fn(&mut Random) -> Vec<Posture>> = vec![
        alone, alone, together, together, together, gather, gather, gather, spread, spread, spread,
        thumb,
    ];
    random.shuffle(&mut movements);
    for movement in movements {
        list.extend(movement(random));
    }
    list.push(Posture::FLAT);
    list
}

/// One finger flexed and stretched; its neighbours are drawn along, as tendons have it.
fn alone(random: &mut Random) -> Vec<Posture> {
    let mut order = Finger::ALL;
    random.shuffle(&mut order);
    let mut keys = Vec::new();
    for &finger in &order[..2] {
        let bent = Posture {
            thumb: random.between(0.0, 0.15),
            fingers: drawn_along(finger, random.between(0.85, 1.0)),
            spread: random.between(-0.1, 0.2),
        };
        keys.push(bent);
        keys.push(loosened(&bent, random.between(0.05, 0.2)));
    }
    keys
}

/// Curls of all fingers when one of them curls.
fn drawn_along(finger: Finger, curl: f32) -> [f32; 4] {
    let share: [f32; 4] = match finger {
        Finger::Index => [1.0, 0.2, 0.05, 0.0],
        Finger::Middle => [0.15, 1.0, 0.3, 0.1],
        Finger::Ring => [0.05, 0.4, 1.0, 0.6],
        Finger::Little => [0.0, 0.15, 0.55, 1.0],
    };
    share.map(|part| part * curl)
}

fn loosened(posture: &Posture, part: f32) -> Posture {
    Posture {
        thumb: posture.thumb * part,
        fingers: posture.fingers.map(|curl| curl * part),
        spread: posture.spread,
    }
}

/// Several fingers at once: thumb, index and the ring side each at an extreme or anywhere, the middle finger between its neighbours.
fn together(random: &mut Random) -> Vec<Posture> {
    (0..5)
        .map(|_| {
            let spread = random.between(-0.25, 0.9);
            grasp(random, spread)
        })
        .collect()
}

fn grasp(random: &mut Random, spread: f32) -> Posture {
    let thumb = extreme(random);
    let index = extreme(random);
    let ring = extreme(random);
    let little = (ring + random.between(-0.12, 0.12)).clamp(0.0, 1.0);
    let middle = 0.5 * (index + ring) + random.between(-0.12, 0.12);
    Posture::from_array([thumb, index, middle, ring, little, spread])
}

/// Mostly 0 or 1, else anything between.
fn extreme(random: &mut Random) -> f32 {
    if random.chance(0.65) {
        f32::from(u8::from(random.chance(0.5)))
    } else {
        random.unit()
    }
}

/// The fingertips come together: open first, then closing on one another, then a part of them lets go.
fn gather(random: &mut Random) -> Vec<Posture> {
    let tight = random.between(-1.0, -0.8);
    let closed = random.between(0.35, 0.55);
    let thumb_side = random.chance(0.5);
    let each = |curl: f32, random: &mut Random| (curl + random.between(-0.06, 0.06)).max(0.0);
    let mut keys = Vec::new();
    for (thumb, index, ring) in [
        (0.03, 0.03, 0.03),
        (closed, closed, closed),
        if thumb_side {
            (random.between(0.6, 1.0), 0.06, random.between(0.0, 0.15))
        } else {
            (0.06, random.between(0.3, 1.0), random.between(0.3, 1.0))
        },
    ] {
        let (thumb, index, ring) = (each(thumb, random), each(index, random), each(ring, random));
        let little = each(ring, random);
        let middle = 0.5 * (index + ring);
        keys.push(Posture::from_array([
            thumb, index, middle, ring, little, tight,
        ]));
    }
    random.shuffle(&mut keys);
    keys
}

/// The fingers go apart, flat or with some of them bent.
fn spread(random: &mut Random) -> Vec<Posture> {
    let wide = random.between(0.85, 1.0);
    let bent = grasp(random, wide);
    let flat = Posture {
        spread: wide,
        ..Posture::FLAT
    };
    let mut keys = vec![flat, bent, grasp(random, 0.5 * (wide + 1.0))];
    random.shuffle(&mut keys);
    keys
}

/// The thumb bends and opposes while the fingers stay, straight or in a fist.
fn thumb(random: &mut Random) -> Vec<Posture> {
    let curl = f32::from(u8::from(random.chance(0.5)));
    let bent = random.between(0.85, 1.0);
    [bent, random.between(0.0, 0.15), bent, 0.0]
        .map(|thumb| Posture {
            thumb,
            fingers: [curl; 4],
            spread: 0.0,
        })
        .to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_round_starts_and_ends_flat_and_fills_its_time() {
        for seed in 0..20 {
            let keys = round(seed, 3);
            assert_eq!(keys[0].posture, Posture::FLAT);
            let last = keys.last().unwrap();
            assert_eq!(last.posture, Posture::FLAT);
            assert!(last.arrive_s <= ROUND_S + 1e-9);
            assert!(keys.windows(2).all(|two| two[0].arrive_s <= two[1].start_s));
            assert_eq!(last.style, round(seed, 4)[0].style);
        }
    }

    #[test]
    fn a_round_holds_every_movement_of_the_protocol() {
        for seed in 0..20 {
            let keys = round(seed, 0);
            let any = |holds: fn(&Posture) -> bool| keys.iter().any(|key| holds(&key.posture));
            assert!(any(|p| *p == Posture::FIST));
            assert!(any(|p| p.spread > 0.8), "spread");
            assert!(any(|p| p.spread < -0.75), "gathered");
            assert!(any(|p| p.thumb > 0.8 && p.spread == 0.0), "thumb");
            assert!(
                any(|p| p.fingers[0] > 0.8 || p.fingers[3] < 0.2),
                "one alone"
            );
        }
    }

    #[test]
    fn no_movement_is_faster_than_a_person() {
        for seed in 0..20 {
            for key in &round(seed, 1)[1..] {
                assert!(key.arrive_s - key.start_s > 0.3, "{key:?}");
            }
        }
    }
}
