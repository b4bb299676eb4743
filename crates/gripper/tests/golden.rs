//! The worked examples printed in Robotiq's manuals, byte for byte, both directions.
#![allow(clippy::unwrap_used)]

use gripper::registers::{COMMAND, STATUS};
use gripper::rtu::{Error, Exception, Registers, Request, Response, crc16};

/// One line of bytes written as hex.
fn hex(text: &str) -> Vec<u8> {
    text.split_whitespace()
        .map(|byte| u8::from_str_radix(byte, 16).unwrap())
        .collect()
}

fn values(bytes: &[u8]) -> Registers<'_> {
    Registers::from_bytes(bytes).unwrap()
}

fn check_request(text: &str, unit: u8, request: Request<'_>) {
    let bytes = hex(text);
    assert_eq!(Request::parse(&bytes), Ok((unit, request)), "{text}");
    assert_eq!(Request::frame_len(&bytes), Ok(Some(bytes.len())), "{text}");
    let mut out = [0; 64];
    let length = request.emit(unit, &mut out).unwrap();
    assert_eq!(
        (&out[..length], request.buffer_len()),
        (&bytes[..], bytes.len()),
        "{text}"
    );
}

fn check_response(text: &str, request: Option<Request<'_>>, response: Response<'_>) {
    let bytes = hex(text);
    assert_eq!(Response::parse(&bytes), Ok((9, response)), "{text}");
    let mut out = [0; 64];
    let length = response.emit(9, &mut out).unwrap();
    assert_eq!(
        (&out[..length], response.buffer_len()),
        (&bytes[..], bytes.len()),
        "{text}"
    );
    if let Some(request) = request {
        assert_eq!(request.reply_len(), bytes.len(), "{text}");
    }
}

fn read(quantity: u16) -> Request<'static> {
    Request::ReadHolding {
        address: STATUS,
        quantity,
    }
}

fn read_input(quantity: u16) -> Request<'static> {
    Request::ReadInput {
        address: STATUS,
        quantity,
    }
}

#[test]
fn rtu_requests_are_the_manuals() {
    let write = |address, bytes: &'static [u8]| Request::WriteMultiple {
        address,
        values: values(bytes),
    };
    check_request(
        "09 10 03 E8 00 03 06 00 00 00 00 00 00 73 30",
        9,
        write(COMMAND, &[0; 6]),
    );
    check_request(
        "09 10 03 E8 00 03 06 01 00 00 00 00 00 72 E1",
        9,
        write(COMMAND, &[1, 0, 0, 0, 0, 0]),
    );
    check_request("09 03 07 D0 00 01 85 CF", 9, read(1));
    check_request(
        "09 10 03 E8 00 03 06 09 00 00 FF FF FF 42 29",
        9,
        write(COMMAND, &[9, 0, 0, 255, 255, 255]),
    );
    check_request("09 03 07 D0 00 08 45 C9", 9, read(8));
    check_request(
        "09 10 03 E8 00 03 06 09 00 00 00 FF FF 72 19",
        9,
        write(COMMAND, &[9, 0, 0, 0, 255, 255]),
    );
    check_request(
        "09 10 03 E9 00 02 04 60 E6 3C C8 EC 7C",
        9,
        write(0x03E9, &[0x60, 0xE6, 0x3C, 0xC8]),
    );
    check_request("09 03 07 D0 00 03 04 0E", 9, read(3));
    check_request("09 04 07 D0 00 03 B1 CE", 9, read_input(3));
    let exchange = Request::ReadWrite {
        read_address: STATUS,
        read_quantity: 2,
        write_address: 0x03E9,
        values: values(&[0x00, 0xE6, 0x3C, 0xC8]),
    };
    check_request(
        "09 17 07 D0 00 02 03 E9 00 02 04 00 E6 3C C8 2D 0C",
        9,
        exchange,
    );
    check_request(
        "09 10 03 E8 00 08 10 09 0C 00 80 FF 96 80 FF 96 80 FF 96 80 FF 96 00 DB BA",
        9,
        write(
            COMMAND,
            &[
                9, 12, 0, 0x80, 255, 0x96, 0x80, 255, 0x96, 0x80, 255, 0x96, 0x80, 255, 0x96, 0,
            ],
        ),
    );
    check_request(
        "09 10 03 E8 00 01 02 11 00 E9 E8",
        9,
        write(COMMAND, &[0x11, 0]),
    );
}

#[test]
fn rtu_replies_are_the_manuals() {
    let wrote = |address, quantity| Response::WriteMultiple { address, quantity };
    check_response("09 10 03 E8 00 03 01 30", None, wrote(COMMAND, 3));
    check_response("09 10 03 E9 00 02 91 30", None, wrote(0x03E9, 2));
    check_response("09 10 03 E8 00 08 40 F7", None, wrote(COMMAND, 8));
    let held = |bytes: &'static [u8]| Response::ReadHolding(values(bytes));
    check_response("09 03 02 11 00 55 D5", Some(read(1)), held(&[0x11, 0]));
    check_response("09 03 02 31 00 4C 15", Some(read(1)), held(&[0x31, 0]));
    for (text, status) in [
        (
            "09 03 10 39 C0 00 FF 08 0F 00 08 10 00 08 0F 00 89 00 00 73 70",
            [
                0x39, 0xC0, 0, 0xFF, 8, 15, 0, 8, 16, 0, 8, 15, 0, 0x89, 0, 0,
            ],
        ),
        (
            "09 03 10 B9 EA 00 FF BC 00 00 C1 00 00 BD 00 00 89 00 00 4E 17",
            [
                0xB9, 0xEA, 0, 0xFF, 188, 0, 0, 193, 0, 0, 189, 0, 0, 137, 0, 0,
            ],
        ),
        (
            "09 03 10 39 C0 00 00 B8 0B 00 BD 0E 00 BA 0B 00 89 00 00 10 85",
            [
                0x39, 0xC0, 0, 0, 184, 11, 0, 189, 14, 0, 186, 11, 0, 137, 0, 0,
            ],
        ),
        (
            "09 03 10 F9 FF 00 00 07 00 00 06 00 00 06 00 00 89 00 00 34 8D",
            [0xF9, 0xFF, 0, 0, 7, 0, 0, 6, 0, 0, 6, 0, 0, 137, 0, 0],
        ),
    ] {
        check_response(text, Some(read(8)), Response::ReadHolding(values(&status)));
    }
    check_response(
        "09 17 04 E0 00 00 00 47 27",
        None,
        Response::ReadWrite(values(&[0xE0, 0, 0, 0])),
    );
    check_response(
        "09 03 06 39 00 00 FF 0E 0A F7 8B",
        Some(read(3)),
        held(&[0x39, 0, 0, 0xFF, 0x0E, 0x0A]),
    );
    let input = |bytes: &'static [u8]| Response::ReadInput(values(bytes));
    check_response(
        "09 04 06 B9 00 00 FF BD 00 5C 9A",
        Some(read_input(3)),
        input(&[0xB9, 0, 0, 0xFF, 0xBD, 0]),
    );
    check_response(
        "09 04 06 F9 00 00 00 0D 00 17 AA",
        Some(read_input(3)),
        input(&[0xF9, 0, 0, 0, 0x0D, 0]),
    );
    check_response(
        "09 03 06 F9 00 00 00 0D 00 56 4C",
        Some(read(3)),
        held(&[0xF9, 0, 0, 0, 0x0D, 0]),
    );
    check_response(
        "09 17 04 01 00 09 E6 F6 C1",
        None,
        Response::ReadWrite(values(&[1, 0, 9, 0xE6])),
    );
}

/// Every line of the shared list, so that none is forgotten above.
#[test]
fn every_line_of_the_golden_list_is_parsed_and_produced_again() {
    let Some(text) = rig::skip::shared("robotiq/golden_frames.txt") else {
        return;
    };
    let (mut requests, mut replies, mut pdus, mut misprinted) = (0, 0, 0, 0);
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let (head, _) = line.split_once(';').expect("a meaning");
        let mut words = head.splitn(3, ' ');
        let (tag, way) = (words.next().unwrap(), words.next().unwrap());
        let bytes = words.next().unwrap();
        let frame = hex(bytes);
        let mut out = [0; 64];
        let (length, count) = match (tag, way) {
            ("RTU" | "RTU2F" | "RTUD", "req") => {
                let (unit, request) = Request::parse(&frame).expect(line);
                (request.emit(unit, &mut out), &mut requests)
            }
            ("RTU" | "RTU2F" | "RTUD", "rsp") => {
                let (unit, response) = Response::parse(&frame).expect(line);
                (response.emit(unit, &mut out), &mut replies)
            }
            ("TCP", way) => {
                let pdu = tcp_pdu(bytes).expect(line);
                let length = if way == "req" {
                    Request::parse_pdu(&pdu).expect(line).emit_pdu(&mut out)
                } else {
                    Response::parse_pdu(&pdu).expect(line).emit_pdu(&mut out)
                };
                assert_eq!(&out[..length.unwrap()], &pdu[..], "{line}");
                pdus += 1;
                continue;
            }
            ("TCPX", "rsp") => {
                assert_eq!(tcp_pdu(bytes), None);
                misprinted += 1;
                continue;
            }
            _ => panic!("a line of no known kind: {line}"),
        };
        assert_eq!(&out[..length.unwrap()], &frame[..], "{line}");
        *count += 1;
    }
    println!(
        "golden list: {requests} RTU requests, {replies} RTU replies, {pdus} TCP PDUs parsed and produced again; {misprinted} misprinted one refused"
    );
    let lines = text.lines().filter(|line| !line.starts_with('#')).count();
    assert_eq!(requests + replies + pdus + misprinted, lines);
    assert_eq!(misprinted, 1);
}

/// The PDU of a Modbus TCP frame whose length field is right.
fn tcp_pdu(text: &str) -> Option<Vec<u8>> {
    let bytes = hex(text);
    let length = usize::from(u16::from_be_bytes([bytes[4], bytes[5]]));
    (bytes[2..4] == [0, 0] && bytes.len() == 6 + length && bytes[6] == 2)
        .then(|| bytes[7..].to_vec())
}

#[test]
fn tcp_pdus_are_the_same_codec() {
    let close = [9, 0, 0, 255, 255, 255];
    let open = [9, 0, 0, 0, 255, 255];
    for (text, request) in [
        (
            "71 EE 00 00 00 0D 02 10 03 E8 00 03 06 09 00 00 FF FF FF",
            Request::WriteMultiple {
                address: COMMAND,
                values: values(&close),
            },
        ),
        ("45 33 00 00 00 06 02 03 07 D0 00 01", read(1)),
        ("77 6B 00 00 00 06 02 04 07 D0 00 08", read_input(8)),
        (
            "34 AB 00 00 00 0D 02 10 03 E8 00 03 06 09 00 00 00 FF FF",
            Request::WriteMultiple {
                address: COMMAND,
                values: values(&open),
            },
        ),
        ("D6 05 00 00 00 06 02 04 07 D0 00 08", read_input(8)),
    ] {
        let pdu = tcp_pdu(text).unwrap();
        assert_eq!(Request::parse_pdu(&pdu), Ok(request), "{text}");
        let mut out = [0; 32];
        let length = request.emit_pdu(&mut out).unwrap();
        assert_eq!(&out[..length], &pdu[..], "{text}");
    }
    let moving = [
        0x39, 0xC0, 0, 0xFF, 8, 15, 0, 8, 16, 0, 8, 15, 0, 0x89, 0, 0,
    ];
    for (text, response) in [
        (
            "71 EE 00 00 00 06 02 10 03 E8 00 03",
            Response::WriteMultiple {
                address: COMMAND,
                quantity: 3,
            },
        ),
        (
            "33 9A 00 00 00 06 02 10 03 E8 00 03",
            Response::WriteMultiple {
                address: COMMAND,
                quantity: 3,
            },
        ),
        (
            "45 33 00 00 00 05 02 04 02 11 00",
            Response::ReadInput(values(&[0x11, 0])),
        ),
        (
            "77 6B 00 00 00 13 02 04 10 39 C0 00 FF 08 0F 00 08 10 00 08 0F 00 89 00 00",
            Response::ReadInput(values(&moving)),
        ),
        (
            "34 AB 00 00 00 06 02 10 03 E8 00 03",
            Response::WriteMultiple {
                address: COMMAND,
                quantity: 3,
            },
        ),
    ] {
        let pdu = tcp_pdu(text).unwrap();
        assert_eq!(Response::parse_pdu(&pdu), Ok(response), "{text}");
        let mut out = [0; 32];
        let length = response.emit_pdu(&mut out).unwrap();
        assert_eq!(&out[..length], &pdu[..], "{text}");
    }
}

#[test]
fn the_misprinted_tcp_reply_is_refused() {
    let text = "D6 05 00 00 00 0D 02 04 10 39 C0 00 00 B8 0B 00 BD 0E 00 BA 0B 00 89 00 00";
    assert_eq!(tcp_pdu(text), None);
    // Taken at its word (13 bytes after the length field), the byte count does not fit.
    let bytes = hex(text);
    assert_eq!(
        Response::parse_pdu(&bytes[7..6 + 0x0D]),
        Err(Error::Short {
            needed: 18,
            found: 12
        })
    );
}

#[test]
fn exceptions_are_frames_of_five_bytes() {
    // A worked example in circulation: slave 0A refuses function 01.
    let bytes = [0x0A, 0x81, 0x02, 0xB0, 0x53];
    let refused = Response::Exception {
        function: 1,
        code: Exception::ILLEGAL_ADDRESS,
    };
    assert_eq!(Response::parse(&bytes), Ok((10, refused)));
    let mut out = [0; 5];
    assert_eq!(refused.emit(10, &mut out), Ok(5));
    assert_eq!(out, bytes);
}

#[test]
fn the_crc_is_the_standards() {
    // Published check value of CRC-16/MODBUS, and a bitwise computation as the standard prints it.
    assert_eq!(crc16(b"123456789"), 0x4B37);
    let bitwise = |bytes: &[u8]| {
        bytes.iter().fold(0xFFFF_u16, |crc, &byte| {
            (0..8).fold(crc ^ u16::from(byte), |crc, _| {
                if crc & 1 == 1 {
                    crc >> 1 ^ 0xA001
                } else {
                    crc >> 1
                }
            })
        })
    };
    for length in 0..64_u8 {
        let bytes: Vec<u8> = (0..length)
            .map(|k| k.wrapping_mul(37).wrapping_add(length))
            .collect();
        assert_eq!(crc16(&bytes), bitwise(&bytes));
    }
}

#[test]
fn wrong_lengths_counts_and_codes_are_named() {
    let frame = |pdu: &[u8]| {
        let mut bytes = vec![9];
        bytes.extend_from_slice(pdu);
        bytes.extend_from_slice(&crc16(&bytes).to_le_bytes());
        bytes
    };
    assert_eq!(
        Request::parse(&[9, 3]),
        Err(Error::Short {
            needed: 4,
            found: 2
        })
    );
    assert_eq!(
        Request::parse(&frame(&[0x2B, 1])),
        Err(Error::Function(0x2B))
    );
    assert_eq!(
        Request::parse(&frame(&[3, 7, 0xD0, 0, 126])),
        Err(Error::Quantity(126))
    );
    assert_eq!(
        Request::parse(&frame(&[3, 7, 0xD0, 0, 0])),
        Err(Error::Quantity(0))
    );
    assert_eq!(
        Request::parse(&frame(&[3, 7, 0xD0, 0])),
        Err(Error::Short {
            needed: 5,
            found: 4
        })
    );
    assert_eq!(
        Request::parse(&frame(&[16, 3, 0xE8, 0, 1, 4, 0, 0])),
        Err(Error::ByteCount(4))
    );
    assert_eq!(
        Request::parse(&frame(&[16, 3, 0xE8, 0, 1, 2, 0])),
        Err(Error::Short {
            needed: 8,
            found: 7
        })
    );
    assert_eq!(
        Response::parse(&frame(&[3, 3, 0, 0, 0])),
        Err(Error::ByteCount(3))
    );
    assert_eq!(
        Response::parse(&frame(&[3, 2, 0, 0, 0])),
        Err(Error::Long {
            expected: 4,
            found: 5
        })
    );
    let mut bad = frame(&[3, 7, 0xD0, 0, 1]);
    bad[3] ^= 1;
    assert!(matches!(Request::parse(&bad), Err(Error::Crc { .. })));
    assert_eq!(Request::frame_len(&[9]), Ok(None));
    assert_eq!(Request::frame_len(&[9, 16, 3, 0xE8, 0, 8]), Ok(None));
    assert_eq!(Request::frame_len(&[9, 0x55]), Err(Error::Function(0x55)));
    let short = read(8).emit(9, &mut [0; 7]);
    assert_eq!(
        short,
        Err(Error::Buffer {
            needed: 8,
            given: 7
        })
    );
}
