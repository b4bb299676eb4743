//! The driver against the virtual gripper behind a pseudo-terminal, in real time, with spells in
//! which one of the two does not come to its work. No speed is judged: only that it goes on.
#![allow(clippy::unwrap_used)]

mod port;

use gripper::driver::{Config, ThreeFinger};
use gripper::{Duration, Gripper, Motion};
use port::{Port, Timer};
use rig::gripper::{Config as Virtual, VirtualGripper};
use rig::pty::PtyDevice;
use tokio_serial::SerialStream;

/// Far more than any spell of a busy machine.
const PATIENCE: std::time::Duration = std::time::Duration::from_secs(20);

async fn until(
    driver: &mut ThreeFinger<Port>,
    timer: &Timer,
    what: &str,
    mut done: impl FnMut(&ThreeFinger<Port>) -> bool,
) {
    let start = std::time::Instant::now();
    while !done(driver) {
        let motion = Motion {
            position: [60; 4],
            speed: [255; 4],
            force: [100; 4],
        };
        driver.set_motion(Some(motion), timer.now());
        while driver.poll(timer.now()).is_some() {}
        timer.rest().await;
        assert!(
            start.elapsed() < PATIENCE,
            "{what}: {:?}",
            driver.counters()
        );
    }
}

#[test]
fn spells_of_lateness_on_either_side_do_not_end_the_link() {
    let truth = VirtualGripper::new(Virtual::default());
    let device = PtyDevice::spawn(Box::new(truth.clone()), None).unwrap();
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .unwrap();
    runtime.block_on(async {
        let path = device.path().display().to_string();
        let stream = SerialStream::open(&tokio_serial::new(path, 115_200)).unwrap();
        let timer = Timer::start();
        let mut driver = ThreeFinger::new(Port::new(stream), Config::for_pc());
        driver.activate();
        until(&mut driver, &timer, "activation", |driver| {
            driver.outcome().is_some()
        })
        .await;
        for spell in [0, 15, 40, 90] {
            let writes = truth.writes();
            until(&mut driver, &timer, "commands", |_| {
                truth.writes() > writes + 5
            })
            .await;
            // The program sleeps with a request out; then the gripper answers late for a while.
            std::thread::sleep(std::time::Duration::from_millis(spell));
            truth.set_reply_delay(Duration::from_millis(spell));
            let late = timer.now() + Duration::from_millis(100);
            until(&mut driver, &timer, "late", |_| timer.now() > late).await;
            truth.set_reply_delay(Duration::from_millis(0));
            let writes = truth.writes();
            until(&mut driver, &timer, "commands again", |_| {
                truth.writes() > writes + 5
            })
            .await;
        }
        until(&mut driver, &timer, "acceptance", ThreeFinger::accepted).await;
        println!("{:?}", driver.counters());
    });
}
