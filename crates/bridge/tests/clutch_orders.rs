//! Who may close the clutch, and what cannot: heartbeats, late requests, bytes from before a stall, faults that passed.

mod common;

use bridge::clutch::{HeartbeatRefusal, Position};
use bridge::protocol::message::{Answer, Call, Refusal, VERSION};
use bridge::{Epoch, Settings, State};
use common::bench::{Bench, MS};
use common::host::Host;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn ready() -> Host {
    let mut bench = Bench::new(Settings::default());
    bench.ready();
    bench.silent = true;
    Host::new(bench)
}

/// Closes the clutch as session 7.
fn engaged(host: &mut Host) -> Epoch {
    match host.ask(Call::Engage) {
        Ok(Answer::Engaged { epoch, .. }) => epoch,
        other => panic!("{other:?}"),
    }
}

fn following(host: &mut Host) -> Epoch {
    let epoch = engaged(host);
    while host.bench.state() != State::Following {
        assert!(host.ask(Call::Heartbeat { epoch }).is_ok());
        host.run(50 * MS);
    }
    epoch
}

#[test]
fn an_engage_gives_an_epoch_and_only_heartbeats_of_it_keep_the_clutch() {
    let mut host = ready().hello();
    let first = engaged(&mut host);
    let second = engaged(&mut host);
    assert_ne!(first, second);
    assert_eq!(
        host.ask(Call::Heartbeat { epoch: first }),
        Err(Refusal::Heartbeat(HeartbeatRefusal::OldEpoch {
            newest: second
        }))
    );
    assert!(host.ask(Call::Heartbeat { epoch: second }).is_ok());
    assert!(host.ask(Call::Release).is_ok());
    assert_eq!(
        host.ask(Call::Heartbeat { epoch: second }),
        Err(Refusal::Heartbeat(HeartbeatRefusal::Open))
    );
}

#[test]
fn a_release_is_obeyed_from_anybody_without_a_session() {
    let mut host = ready().hello();
    following(&mut host);
    assert!(matches!(
        host.ask_as(0xDEAD, Call::Release),
        Ok(Answer::Status(_))
    ));
    host.run(20 * MS);
    assert_eq!(host.bench.state(), State::Idle);
}

#[test]
fn a_release_is_obeyed_while_nobody_takes_what_the_bridge_says() {
    let mut host = ready().hello();
    following(&mut host);
    assert!(host.ask(Call::Telemetry { period_ms: 20 }).is_ok());
    host.line.block(true);
    host.run(100 * MS);
    assert!(host.bench.state().is_moving());
    host.send(7, 999, Call::Release);
    host.run(20 * MS);
    assert_eq!(host.bench.state(), State::Idle);
}

#[test]
fn an_engage_that_arrives_late_a_second_time_closes_nothing() {
    let mut host = ready().hello();
    let sequence = host.sequence + 1;
    engaged(&mut host);
    assert!(host.ask(Call::Release).is_ok());
    host.run(100 * MS);
    host.send(7, sequence, Call::Engage);
    host.run(100 * MS);
    assert!(!host.bench.app.is_engaged(), "by a line that held it back");
    // Another host's request in between makes it no younger.
    let _ = host.ask_as(9, Call::Release);
    host.send(7, sequence, Call::Engage);
    host.run(100 * MS);
    assert!(!host.bench.app.is_engaged());
}

#[test]
fn what_lay_in_the_port_while_the_bridge_stood_still_closes_and_keeps_nothing() {
    for stall in [150, 400, 900, 1_500, 10_000] {
        let mut host = ready().hello();
        let epoch = following(&mut host);
        host.send(7, host.sequence + 1, Call::Heartbeat { epoch });
        host.send(7, host.sequence + 2, Call::Engage);
        host.bench.clock.advance(rig::Duration::from_millis(stall));
        host.sequence += 2;
        host.run(30 * MS);
        // Neither counts as of now: the clutch is as old as its last heartbeat before the stall.
        let expected = match stall {
            ..200 => Position::Closed,
            200..950 => Position::Lost,
            _ => Position::Expired,
        };
        assert_eq!(host.bench.app.clutch(), expected, "{stall} ms");
        assert_eq!(
            host.bench.app.heartbeat(epoch).is_ok(),
            stall < 950,
            "{stall} ms"
        );
    }
}

#[test]
fn what_waited_behind_a_reply_while_the_bridge_stood_still_is_not_done() {
    let mut host = ready().hello();
    assert!(host.ask(Call::Telemetry { period_ms: 20 }).is_ok());
    host.line.block(true);
    host.run(100 * MS);
    host.send(7, host.sequence + 1, Call::Engage);
    host.run(10 * MS);
    host.bench.clock.advance(rig::Duration::from_millis(800));
    host.line.block(false);
    host.run(300 * MS);
    assert!(!host.bench.app.is_engaged());
}

#[test]
fn a_release_that_comes_late_makes_no_older_request_young() {
    let mut host = ready().hello();
    let first = host.sequence;
    assert!(host.ask(Call::Release).is_ok());
    engaged(&mut host);
    assert!(host.ask(Call::Release).is_ok());
    host.send(7, first + 1, Call::Release);
    host.run(50 * MS);
    host.send(7, first + 2, Call::Engage);
    host.run(100 * MS);
    assert!(!host.bench.app.is_engaged());
}

#[test]
fn a_release_among_old_bytes_is_obeyed() {
    let mut host = ready().hello();
    following(&mut host);
    host.send(7, host.sequence + 1, Call::Release);
    host.bench.clock.advance(rig::Duration::from_millis(400));
    host.run(30 * MS);
    assert_eq!(host.bench.state(), State::Idle);
}

/// Two hosts, a gripper with faults, a bridge that restarts; and what the rules say of motion.
struct Orders {
    rng: ChaCha8Rng,
    host: Host,
    epochs: [Epoch; 2],
    engaged_at: Option<u64>,
    fault_at: Option<u64>,
    moving: u64,
    faults: u64,
}

impl Orders {
    fn below(&mut self, bound: u64) -> u64 {
        self.rng.next_u64() % bound
    }

    fn run(&mut self, us: u64) {
        let end = self.host.bench.now() + us;
        while self.host.bench.now() < end {
            self.host.turn();
            while self.host.hear().is_some() {}
            self.look();
        }
    }

    fn look(&mut self) {
        let now = self.host.bench.now();
        let telemetry = self.host.bench.app.telemetry();
        if telemetry
            .status
            .is_some_and(|status| status.fault != gripper::Fault::None)
        {
            self.fault_at = Some(now);
        }
        if !telemetry.state.is_moving() {
            return;
        }
        self.moving += 1;
        let engaged = self.engaged_at.expect("motion without any closing");
        if let Some(fault) = self.fault_at {
            // The supervisor looks every 10 ms.
            assert!(
                engaged > fault || now - fault <= 15 * MS,
                "moves at {now}, fault at {fault}, closed at {engaged}"
            );
        }
    }

    fn ask(&mut self, session: u32, call: Call<'_>) -> Result<Answer, Refusal> {
        let answer = self.host.ask_as(session, call);
        self.look();
        answer
    }

    fn order(&mut self) {
        let who = self.below(2) as usize;
        let session = [7, 8][who];
        match self.below(100) {
            0..30 => {
                let epoch = self.epochs[self.rng.next_u64() as usize % 2];
                for _ in 0..self.below(12) {
                    let _ = self.ask(session, Call::Heartbeat { epoch });
                    self.run(90 * MS);
                }
            }
            30..42 => {
                let before = self.host.bench.now();
                if let Ok(Answer::Engaged { epoch, .. }) = self.ask(session, Call::Engage) {
                    self.epochs[who] = epoch;
                    self.engaged_at = Some(before);
                }
            }
            42..52 => drop(self.ask(session, Call::Release)),
            52..62 => {
                self.faults += 1;
                self.host.bench.gripper.set_fault(Some(0x0A));
                self.run(60 * MS);
                if self.below(4) > 0 {
                    self.host.bench.gripper.set_fault(None);
                }
            }
            62..72 => self.host.bench.gripper.set_fault(None),
            72..90 => drop(self.ask(session, Call::Hello { version: VERSION })),
            90 => {
                // A restart: nothing is known, the host's numbers are old.
                self.host = ready().hello();
                self.engaged_at = None;
                self.fault_at = None;
            }
            _ => {
                let pause = [20, 120, 300, 700, 1_100, 2_500][self.below(6) as usize];
                self.run(pause * MS);
            }
        }
    }
}

#[test]
fn nothing_moves_without_an_act_of_a_person_since_the_last_fault() {
    const SEED: u64 = 42;
    let mut orders = Orders {
        rng: ChaCha8Rng::seed_from_u64(SEED),
        host: ready().hello(),
        epochs: [0; 2],
        engaged_at: None,
        fault_at: None,
        moving: 0,
        faults: 0,
    };
    for _ in 0..10_000 {
        orders.order();
    }
    println!(
        "seed {SEED}: 10,000 orders, {} faults, {} steps in motion, none without a closing since the last fault",
        orders.faults, orders.moving
    );
    assert!(orders.moving > 10_000, "{} steps in motion", orders.moving);
    assert!(orders.faults > 500);
}
