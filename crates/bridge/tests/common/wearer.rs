//! An honest virtual glove on a virtual person's hand, and the profile that a guided session gives of it.

use glove::Instant;
use glove::calibration::{Align, Bound, Finger, Reads, Session, Step};
use rig::glove::{Honest, VirtualGlove};
use rig::person::{Person, Task, Traits, guided};

/// Who wears what.
#[derive(Debug, Clone, Default)]
pub struct Wearer {
    /// The person.
    pub traits: Traits,
    /// The glove.
    pub honest: Honest,
}

impl Wearer {
    /// A person and a glove of this seed.
    pub fn new(seed: u64) -> Self {
        Self {
            traits: Traits {
                seed,
                ..Traits::default()
            },
            honest: Honest {
                seed: seed + 10_000,
                ..Honest::default()
            },
        }
    }

    /// The glove on this person's hand.
    pub fn glove(&self, person: Person) -> VirtualGlove {
        let config = rig::glove::Config {
            honest: Some(self.honest.clone()),
            ..rig::glove::Config::at_baud(115_200)
        };
        VirtualGlove::new(Box::new(person), config)
    }

    /// Guided through a calibration on another day, from the bytes of the sensors' registers.
    ///
    /// # Panics
    /// Where that is not calibrated.
    pub fn profile(&self) -> Bound {
        const BEGINS: f64 = 3.0;
        let mut person = Person::new(self.traits.clone());
        for prompt in guided() {
            person.ask(prompt.task, BEGINS + prompt.told);
        }
        let glove = self.glove(person);
        let at = |seconds: f64| Instant::from_ticks((seconds * 1e6).round() as u64);
        glove.bring_up(usize::MAX, at(BEGINS - 0.1));
        let (mut reads, mut align) = (Reads::new(), Align::new());
        let mut session = Session::new();
        let mut flats = [Step::FirstFlat, Step::SecondFlat, Step::LastFlat].into_iter();
        let mut scan = 0.0;
        for prompt in guided() {
            let step = match prompt.task {
                Task::Flat => flats.next().expect("three"),
                Task::Turn => Step::Turn,
                Task::Alone(finger) => Step::Alone(Finger::ALL[finger]),
                Task::Fists => Step::Fists,
                Task::Thumb => Step::Thumb,
                _ => Step::Free,
            };
            let mut begun = false;
            while scan / 35.0 < prompt.to {
                let t = BEGINS + scan / 35.0;
                let row = std::array::from_fn(|k| {
                    let stamp = at(t + 1.8e-3 * k as f64);
                    (glove.read_sample(k, stamp), stamp)
                });
                let aligned = align.take(&reads.frame(&row));
                if scan / 35.0 >= prompt.from {
                    if !begun {
                        session.begin(step);
                        begun = true;
                    }
                    session.take(&aligned);
                }
                scan += 1.0;
            }
            session.end();
        }
        let ids = std::array::from_fn(|k| {
            std::array::from_fn(|i| glove.sensor_register(k, 1, 0x50 + i as u8))
        });
        Bound {
            profile: session.finish().expect("all steps").profile,
            ids,
        }
    }
}
