use embedded_io::{Read, ReadReady, Write};
use std::os::fd::OwnedFd;
use std::time::Instant;

use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

use super::*;
use crate::failure::Failure;
use glove::sc18im::SetBaud as _;

/// A master side and the path of its slave.
fn pair() -> (OwnedFd, PathBuf) {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
    grantpt(&master).unwrap();
    unlockpt(&master).unwrap();
    let name = ptsname(&master, Vec::new()).unwrap();
    (master, PathBuf::from(name.into_string().unwrap()))
}

fn until(mut condition: impl FnMut() -> bool) -> bool {
    let end = Instant::now() + Duration::from_secs(5);
    while Instant::now() < end {
        if condition() {
            return true;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    false
}

#[test]
fn bytes_pass_both_ways_and_an_empty_port_is_not_ready() {
    let (master, path) = pair();
    let mut port = Port::open(&path, BAUD).unwrap();
    assert_eq!(port.read_ready(), Ok(false));
    assert_eq!(port.read(&mut [0; 4]), Err(Error::Empty));
    assert_eq!(port.write(&[0x03, 0x0a, 0xff]), Ok(3));
    let mut got = [0; 8];
    assert_eq!(rustix::io::read(&master, &mut got), Ok(3));
    assert_eq!(&got[..3], [0x03, 0x0a, 0xff]);
    rustix::io::write(&master, &[0x11, 0x13, 0x0d]).unwrap();
    assert!(until(|| port.read_ready() == Ok(true)));
    assert_eq!(port.read(&mut got), Ok(3));
    assert_eq!(&got[..3], [0x11, 0x13, 0x0d]);
}

#[test]
fn a_far_side_that_takes_nothing_is_an_error_not_a_wait() {
    let (_master, path) = pair();
    let mut port = Port::open(&path, BAUD).unwrap();
    let mut result = Ok(0);
    for _ in 0..10_000 {
        result = port.write(&[0; 64]);
        if result.is_err() {
            break;
        }
    }
    assert_eq!(result, Err(Error::Full));
}

#[test]
fn input_left_by_an_earlier_user_is_thrown_away() {
    let (master, path) = pair();
    drop(Port::open(&path, BAUD).unwrap());
    rustix::io::write(&master, b"late").unwrap();
    std::thread::sleep(Duration::from_millis(5));
    let mut port = Port::open(&path, BAUD).unwrap();
    assert_eq!(port.read_ready(), Ok(false));
}

#[test]
fn an_unplugged_port_says_so_and_comes_back_by_its_path() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("glove");
    let (master, path) = pair();
    std::os::unix::fs::symlink(&path, &link).unwrap();
    let mut port = Port::open(&link, BAUD).unwrap();
    let watch = port.watch();
    drop(master);
    assert!(until(|| port.write(&[1]) == Err(Error::Unplugged)));
    assert_eq!(port.read_ready(), Ok(false));
    assert!(watch.descriptor().is_none());
    assert_eq!(watch.losses(), 1);

    let (master, path) = pair();
    std::fs::remove_file(&link).unwrap();
    std::os::unix::fs::symlink(&path, &link).unwrap();
    assert!(until(|| port.write(&[7]) == Ok(1)));
    let mut got = [0; 1];
    rustix::io::read(&master, &mut got).unwrap();
    assert_eq!(got, [7]);
    assert!(watch.descriptor().is_some());
}

#[test]
fn a_second_opener_is_told_the_port_is_in_use() {
    let (_master, path) = pair();
    let _port = Port::open(&path, BAUD).unwrap();
    assert!(matches!(
        Port::open(&path, BAUD),
        Err(OpenError::Busy { .. })
    ));
}

#[test]
fn a_name_nobody_has_and_a_dangling_link_are_told_apart() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("ttyUSB7");
    assert!(matches!(
        Port::open(&missing, BAUD),
        Err(OpenError::Missing { target: None, .. })
    ));
    let link = folder.path().join("glove");
    std::os::unix::fs::symlink("/dev/pts/none", &link).unwrap();
    let error = Port::open(&link, BAUD).unwrap_err();
    assert!(error.to_string().contains("/dev/pts/none"), "{error}");
}

#[test]
fn files_folders_and_other_devices_are_named_for_what_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("poses.csv");
    std::fs::write(&file, "x").unwrap();
    for (path, word) in [
        (file.as_path(), "a file"),
        (folder.path(), "a folder"),
        (Path::new("/dev/null"), "a device"),
    ] {
        let error = Port::open(path, BAUD).unwrap_err();
        assert!(
            matches!(&error, OpenError::NotSerial { kind, .. } if kind.starts_with(word)),
            "{error:?}"
        );
    }
}

#[test]
fn every_reason_comes_with_a_next_step() {
    let path = PathBuf::from("/dev/ttyUSB0");
    let failure = Failure::from(OpenError::Permission {
        path,
        group: "dialout".to_owned(),
    });
    assert!(failure.to_string().contains("/dev/ttyUSB0"));
    assert!(failure.next_step().contains("usermod -aG dialout"));
}

#[test]
fn the_speed_changes_on_the_open_port_and_survives_its_return() {
    let (master, path) = pair();
    let mut port = Port::open(&path, BAUD).unwrap();
    let seen = || rustix::termios::tcgetattr(&master).unwrap().output_speed();
    port.set_baud(9_600).unwrap();
    assert_eq!(seen(), 9_600);
    rustix::io::write(&master, &[7]).unwrap();
    assert!(until(|| port.read_ready() == Ok(true)));
    port.set_baud(BAUD).unwrap();
    assert_eq!(seen(), BAUD);
    assert_eq!(
        port.read_ready(),
        Ok(false),
        "what came at the old speed is noise"
    );
    port.set_baud(9_600).unwrap();
    drop(master);
    assert!(until(|| port.write(&[1]) == Err(Error::Unplugged)));
    port.set_baud(19_200).expect("a port that is away keeps it");
    assert_eq!(
        port.shared.baud.load(std::sync::atomic::Ordering::Relaxed),
        19_200
    );
}
