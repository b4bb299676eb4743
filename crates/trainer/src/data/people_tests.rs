//! Tables as people have them: each taken as what it is and said, or refused with what it is.

use super::*;
use crate::remedy::Remedy;
use std::path::Path;

const JOINTS: [&str; 4] = [
    "index_mcp_flex",
    "index_pip_flex",
    "ring_mcp_flex",
    "ring_pip_flex",
];

/// The poses and what is said of them.
fn read(bytes: &[u8]) -> Result<(Poses, String), Error> {
    let mut table = Table::read(bytes, Path::new("hand.csv"), Columns::Named(&JOINTS))?;
    let poses = table.poses(&JOINTS)?;
    Ok((poses, table.notes().join("\n")))
}

fn fault(text: &str) -> String {
    read(text.as_bytes()).unwrap_err().told()
}

/// Motion of `count` frames that differ; `time` and `angle` write the numbers.
fn table(
    header: &str,
    separator: &str,
    count: usize,
    time: impl Fn(usize) -> String,
    angle: impl Fn(f64) -> String,
) -> String {
    let row = |k: usize| {
        let value = |j: usize| 0.6 + 0.5 * (0.3 * k as f64 + j as f64).sin();
        let mut fields = vec![time(k)];
        fields.extend((0..4).map(|j| angle(value(j))));
        fields.retain(|field| !field.is_empty());
        fields.join(separator)
    };
    let rows: Vec<String> = (0..count).map(row).collect();
    format!("{}\n{}\n", header.replace(',', separator), rows.join("\n"))
}

const HEADER: &str = "time_s,index_mcp_flex,index_pip_flex,ring_mcp_flex,ring_pip_flex";

fn seconds(k: usize) -> String {
    format!("{:.4}", k as f64 / 30.0)
}
fn radians(value: f64) -> String {
    format!("{value:.5}")
}
fn comma(value: f64) -> String {
    radians(value).replace('.', ",")
}

/// The motion in the house's own form.
fn plain() -> Poses {
    read(table(HEADER, ",", 40, seconds, radians).as_bytes())
        .unwrap()
        .0
}

fn near(found: &Poses, wanted: &Poses) {
    assert_eq!(found.rows.rows, wanted.rows.rows);
    for (a, b) in found.rows.data.iter().zip(&wanted.rows.data) {
        assert!((a - b).abs() < 2e-5, "{a} {b}");
    }
    let times = |poses: &Poses| poses.time_s.clone().unwrap();
    for (a, b) in times(found).iter().zip(times(wanted)) {
        assert!((a - b).abs() < 1e-3, "{a} {b}");
    }
}

#[test]
fn the_house_s_own_form_is_taken_without_a_word() {
    let (_, said) = read(table(HEADER, ",", 40, seconds, radians).as_bytes()).unwrap();
    assert_eq!(said, "");
}

#[test]
fn separators_and_decimal_commas_of_other_countries_are_taken() {
    let comma_time = |k: usize| seconds(k).replace('.', ",");
    for (separator, said) in [
        (";", "semicolons"),
        ("\t", "tabs"),
        ("|", "strokes"),
        ("  ", "spaces"),
    ] {
        let (poses, notes) =
            read(table(HEADER, separator, 40, seconds, radians).as_bytes()).unwrap();
        near(&poses, &plain());
        assert!(notes.contains(said), "{notes}");
        let (poses, notes) =
            read(table(HEADER, separator, 40, comma_time, comma).as_bytes()).unwrap();
        near(&poses, &plain());
        assert!(notes.contains("decimal marks"), "{notes}");
    }
    // Quoted, the commas of numbers are not those between fields.
    let quoted = |value: f64| format!("\"{}\"", comma(value));
    let text = table(HEADER, ",", 40, seconds, quoted);
    let text: String = (text.lines())
        .map(|line| {
            line.split_once(',')
                .map_or(String::new(), |(_, rest)| format!("{rest}\n"))
        })
        .collect();
    let (poses, _) = read(text.as_bytes()).unwrap();
    assert_eq!(poses.rows, plain().rows);
    let said = fault(&table(HEADER, ",", 3, |k| k.to_string(), comma));
    assert!(said.contains("decimal commas cannot be told"), "{said}");
    let mixed = table(HEADER, ";", 40, seconds, comma);
    assert!(
        fault(&mixed).contains("decimal commas"),
        "{}",
        fault(&mixed)
    );
}

#[test]
fn lines_around_the_table_are_passed_over() {
    let body = table(HEADER, ",", 40, seconds, radians);
    for (text, said) in [
        (format!("sep=,\n{body}"), "one line above"),
        (
            format!("Recorded by M., index_mcp_flex and others\nrate,30\n\n{body}"),
            "2 lines above",
        ),
        (format!("# {body}# the end\n"), "begin with #"),
        (format!("{body},,,,\n,,,,\n"), "empty rows at the end"),
        (
            body.replacen('\n', "\ns,rad,rad,rad,rad\n", 1),
            "taken as units",
        ),
        (
            body.replacen("index_mcp_flex", "\"Index MCP flex [rad]\"", 1)
                .replace("[rad]\"", "\""),
            "spelled otherwise",
        ),
    ] {
        let (poses, notes) = read(text.as_bytes()).unwrap();
        near(&poses, &plain());
        assert!(notes.contains(said), "{said}: {notes}");
    }
    // A separator at the end of each line.
    let open = body.replace('\n', ",\n");
    near(&read(open.as_bytes()).unwrap().0, &plain());
    let open = body
        .lines()
        .skip(1)
        .fold(format!("{HEADER}\n"), |all, line| all + line + ",\n");
    near(&read(open.as_bytes()).unwrap().0, &plain());
}

#[test]
fn other_line_ends_and_a_byte_order_mark_are_taken_without_a_word() {
    let body = table(HEADER, ",", 40, seconds, radians);
    for end in ["\r", "\r\n"] {
        let text = format!("\u{feff}{}", body.replace('\n', end));
        let (poses, said) = read(text.as_bytes()).unwrap();
        assert_eq!((poses, said.as_str()), (plain(), ""), "{end:?}");
        let broken = body.replacen("1.", "x.", 1).replace('\n', end);
        let line = body.lines().position(|line| line.contains("1.")).unwrap() + 1;
        assert!(
            fault(&broken).contains(&format!("line {line} ")),
            "{}",
            fault(&broken)
        );
    }
}

#[test]
fn another_encoding_is_refused_by_its_name_with_the_way_out() {
    let text = table(HEADER, ",", 40, seconds, radians);
    let wide = |little: bool| -> Vec<u8> {
        let bytes = |unit: u16| {
            if little {
                unit.to_le_bytes()
            } else {
                unit.to_be_bytes()
            }
        };
        text.encode_utf16().flat_map(bytes).collect()
    };
    for (mark, little) in [
        (&[0xff_u8, 0xfe][..], true),
        (&[0xfe, 0xff], false),
        (&[], true),
        (&[], false),
    ] {
        let said = read(&[mark, &wide(little)].concat()).unwrap_err().told();
        assert!(
            said.contains("UTF-16") && said.contains("UTF-8") && said.contains("iconv -f UTF-16"),
            "{said}"
        );
    }
    for (start, name) in [
        (&b"PK\x03\x04"[..], "spreadsheet"),
        (b"\x1f\x8b\x08", "gunzip"),
    ] {
        let said = read(start).unwrap_err().told();
        assert!(said.contains(name), "{said}");
    }
}

#[test]
fn milliseconds_and_numbers_of_frames_are_times() {
    let ms = |k: usize| format!("{:.1}", 1000.0 * k as f64 / 30.0);
    let frame = |k: usize| (k + 17).to_string();
    for (header, time, said) in [
        (HEADER.to_owned(), ms as fn(usize) -> String, "milliseconds"),
        (HEADER.replace("time_s", "Time [ms]"), ms, "milliseconds"),
        (HEADER.replace("time_s", "time_ms"), ms, "milliseconds"),
        (HEADER.replace("time_s", "frame"), frame, "counts frames"),
        (HEADER.to_owned(), frame, "counts frames"),
        (HEADER.replace("time_s", "timestamp"), seconds, ""),
    ] {
        let (poses, notes) = read(table(&header, ",", 40, time, radians).as_bytes()).unwrap();
        assert!(notes.contains(said), "{header}: {notes}");
        let times = poses.time_s.unwrap();
        let length = times.last().unwrap() - times[0];
        assert!((length - 1.3).abs() < 0.01, "{header}: {length}");
    }
    // What was passed over still is, when it is no time.
    let word = |k: usize| format!("2024-05-01T10:00:{k:02}");
    let header = HEADER.replace("time_s", "timestamp");
    let (poses, notes) = read(table(&header, ",", 40, word, radians).as_bytes()).unwrap();
    assert!(
        poses.time_s.is_none() && notes.contains("passed over"),
        "{notes}"
    );
}

#[test]
fn a_clip_whose_time_starts_anew_comes_after_the_one_before() {
    let anew = |k: usize| seconds(k % 20);
    let text = table(HEADER, ",", 40, anew, radians);
    // With a column that names the clips, without one, and with the header again where files were put together.
    let named: String = (text.lines().enumerate())
        .map(|(k, line)| {
            let clip = ["clip", "first", "second"][usize::from(k > 0) + usize::from(k > 20)];
            format!("{line},{clip}\n")
        })
        .collect();
    let mut joined: Vec<&str> = text.lines().collect();
    joined.insert(21, HEADER);
    for text in [text.clone(), named, joined.join("\n")] {
        let (poses, notes) = read(text.as_bytes()).unwrap();
        assert_eq!(poses.rows, plain().rows);
        let times = poses.time_s.unwrap();
        assert!(times.windows(2).all(|pair| pair[0] < pair[1]), "{times:?}");
        assert!((times[20] - times[19] - 1.0).abs() < 1e-9, "{times:?}");
        assert!(notes.contains("starts anew"), "{notes}");
    }
    // Rows out of order are no clips.
    let shuffled = |k: usize| seconds(if k == 30 { 3 } else { k });
    let said = fault(&table(HEADER, ",", 40, shuffled, radians));
    assert!(said.contains("row 31") && !said.contains("sort"), "{said}");
    let backwards = |k: usize| seconds(40 - k);
    fault(&table(HEADER, ",", 40, backwards, radians));
}

#[test]
fn a_frame_that_stands_there_twice_counts_once() {
    let body = table(HEADER, ",", 40, seconds, radians);
    let fifth = body.lines().nth(5).unwrap();
    let text = body.replace(fifth, &format!("{fifth}\n{fifth}\n{fifth}"));
    let (poses, notes) = read(text.as_bytes()).unwrap();
    assert_eq!(poses, plain());
    assert!(notes.contains("2 rows repeat"), "{notes}");
}

#[test]
fn degrees_are_taken_where_the_header_says_so_or_nothing_else_is_possible() {
    let degrees = |value: f64| format!("{:.3}", value.to_degrees());
    for (header, said) in [
        (HEADER.to_owned(), "can only be degrees"),
        (HEADER.replace("flex", "flex [deg]"), "the header says"),
        (HEADER.replace("flex", "flex (°)"), "the header says"),
        (HEADER.replace("flex", "flex_deg"), "the header says"),
        (format!("{HEADER}\ns,deg,deg,deg,deg"), "the header says"),
    ] {
        let (poses, notes) = read(table(&header, ",", 40, seconds, degrees).as_bytes()).unwrap();
        near(&poses, &plain());
        assert!(notes.contains(said), "{header}: {notes}");
    }
    // Modulo 360 as well.
    let modulo = |value: f64| format!("{:.3}", (value - 0.6).to_degrees().rem_euclid(360.0));
    let (poses, notes) = read(table(HEADER, ",", 40, seconds, modulo).as_bytes()).unwrap();
    assert!(
        poses.rows.data.iter().all(|angle| angle.abs() < 0.6),
        "{notes}"
    );
    // Some of the columns only, or another unit.
    let said = fault(&table(
        &HEADER.replacen("flex", "flex_deg", 1),
        ",",
        40,
        seconds,
        degrees,
    ));
    assert!(said.contains("not said to be in degrees"), "{said}");
    let said = fault(&table(
        &HEADER.replace("flex", "flex [turns]"),
        ",",
        40,
        seconds,
        radians,
    ));
    assert!(said.contains("turns"), "{said}");
    // One wild value is none.
    let wild = table(HEADER, ",", 40, seconds, radians).replacen(",1.", ",81.", 1);
    assert!(fault(&wild).contains("radians"), "{}", fault(&wild));
}

#[test]
fn angles_modulo_a_full_turn_are_brought_back_and_told_with_their_place() {
    let shifted = |value: f64| value - 0.6;
    let signed = table(HEADER, ",", 40, seconds, |v| radians(shifted(v)));
    let modulo = table(HEADER, ",", 40, seconds, |v| {
        radians(shifted(v).rem_euclid(core::f64::consts::TAU))
    });
    let (poses, notes) = read(modulo.as_bytes()).unwrap();
    near(&poses, &read(signed.as_bytes()).unwrap().0);
    assert!(
        notes.contains("(row ") && notes.contains("column `") && notes.contains("2π"),
        "{notes}"
    );
}

#[test]
fn a_table_without_a_header_and_one_without_end_are_told() {
    let body = table(HEADER, ",", 40, seconds, radians);
    let headless = body.split_once('\n').unwrap().1;
    let said = fault(headless);
    assert!(
        said.contains("header is missing") && said.contains("5 fields"),
        "{said}"
    );
    let said = Table::read(
        std::io::repeat(b'1'),
        Path::new("x"),
        Columns::Named(&JOINTS),
    );
    assert!(said.unwrap_err().told().contains("longer than"));
}
