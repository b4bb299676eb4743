use super::*;
use crate::lines::i2c::Port;
use rig::glove::VirtualGlove;

#[test]
fn a_glove_on_an_i2c_port_is_read_as_one_behind_a_serial_bridge_is() {
    // Real time: the virtual bus waits as a real one does.
    let clock = rig::Clock::system();
    let config = rig::glove::Config::default();
    let glove = VirtualGlove::new(Box::new(|_: f64| [0.1; 25]), config);
    let port = Port::over("i2c:/dev/i2c-9".into(), glove.i2c(&clock, 400_000)).expect("a thread");
    let interrupt = Interrupt::never().expect("a pipe");
    let line = GloveLine::I2c(port);
    let mut scanning =
        Scanning::start(line, Settings::default(), Clock::start(), &interrupt).expect("a thread");
    let whole = |seen: &Snapshot| seen.frames > 20 && seen.good() == 16;
    assert!(scanning.wait(Duration::from_secs(30), &interrupt, whole));
    let seen = scanning.snapshot().expect("one");
    assert_eq!((seen.baud, seen.link), (None, None));
    // No more than the sensors have new samples, and a busy computer may be slower.
    assert!(seen.rate < 110.0, "{}", seen.rate);
    assert!(seen.ids().iter().all(Option::is_some));
    scanning.stop().expect("it ran until now");
}
