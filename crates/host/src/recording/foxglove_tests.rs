//! Descriptors and messages read back by a reader of their own, that knows nothing but the encoding.

use super::*;

/// A field as the wire has it.
#[derive(Debug, Clone, PartialEq)]
enum Wire<'b> {
    Varint(u64),
    Fixed(u64),
    Block(&'b [u8]),
}

fn varint(bytes: &mut &[u8]) -> u64 {
    let mut value = 0;
    for place in 0.. {
        let (byte, rest) = bytes.split_first().unwrap();
        *bytes = rest;
        value |= u64::from(byte & 0x7f) << (7 * place);
        if byte & 0x80 == 0 {
            break;
        }
    }
    value
}

fn read(mut bytes: &[u8]) -> Vec<(u64, Wire<'_>)> {
    let mut found = Vec::new();
    while !bytes.is_empty() {
        let tag = varint(&mut bytes);
        let wire = match tag & 7 {
            0 => Wire::Varint(varint(&mut bytes)),
            1 => {
                let (value, rest) = bytes.split_first_chunk::<8>().unwrap();
                bytes = rest;
                Wire::Fixed(u64::from_le_bytes(*value))
            }
            2 => {
                let length = varint(&mut bytes) as usize;
                let (block, rest) = bytes.split_at(length);
                bytes = rest;
                Wire::Block(block)
            }
            other => panic!("wire type {other}"),
        };
        found.push((tag >> 3, wire));
    }
    found
}

fn blocks<'b>(message: &[(u64, Wire<'b>)], field: u64) -> Vec<&'b [u8]> {
    let of_field = message.iter().filter(|(number, _)| *number == field);
    let block = |wire: &Wire<'b>| match wire {
        Wire::Block(block) => *block,
        other => panic!("{other:?}"),
    };
    of_field.map(|(_, wire)| block(wire)).collect()
}

fn text(message: &[(u64, Wire<'_>)], field: u64) -> String {
    let block = blocks(message, field);
    String::from_utf8(block.concat()).unwrap()
}

fn double(bytes: &[u8], field: u64) -> f64 {
    let found = read(bytes).into_iter().find(|(number, _)| *number == field);
    match found {
        Some((_, Wire::Fixed(bits))) => f64::from_bits(bits),
        None => 0.0,
        other => panic!("{other:?}"),
    }
}

#[test]
fn descriptors_name_every_file_once_after_those_it_imports_and_every_field_by_its_place() {
    for root in [
        "foxglove.FrameTransforms",
        "foxglove.SceneUpdate",
        "foxglove.Log",
    ] {
        let set = descriptors(root);
        let files = blocks(&read(&set), 1);
        let mut known: Vec<String> = Vec::new();
        let mut messages: Vec<String> = Vec::new();
        for file in files {
            let file = read(file);
            for import in blocks(&file, 3) {
                let import = String::from_utf8(import.to_vec()).unwrap();
                assert!(known.contains(&import), "{import}");
            }
            known.push(text(&file, 1));
            assert_eq!(text(&file, 12), "proto3");
            let message = read(blocks(&file, 4)[0]);
            messages.push(format!(".{}.{}", text(&file, 2), text(&message, 1)));
            for (place, field) in (1..).zip(blocks(&message, 2)) {
                let field = read(field);
                assert!(field.contains(&(3, Wire::Varint(place))));
                let of = text(&field, 6);
                // A message was defined before; an enum is in its message.
                let own = messages.last().unwrap().clone();
                assert!(
                    of.is_empty() || messages.contains(&of) || of.starts_with(&own),
                    "{of}"
                );
            }
        }
        let count = known.len();
        known.sort_unstable();
        known.dedup();
        assert_eq!(known.len(), count);
        assert!(messages.contains(&format!(".{root}")));
    }
    assert_eq!(
        blocks(&read(&descriptors("foxglove.FrameTransforms")), 1).len(),
        5
    );
}

#[test]
fn transforms_come_back_with_their_frames_numbers_and_time() {
    let pose = Pose {
        position: [0.1, -0.25, 0.0],
        rotation: [0.0, 0.6, 0.0, 0.8],
    };
    let transform = Transform {
        parent: "hand",
        child: "index_proximal",
        pose,
    };
    let message = frame_transforms(1_700_000_000_123_456_789, &[transform, transform]);
    let all = read(&message);
    assert_eq!(all.len(), 2);
    let one = read(blocks(&all, 1)[1]);
    let time = read(blocks(&one, 1)[0]);
    assert_eq!(
        time,
        [
            (1, Wire::Varint(1_700_000_000)),
            (2, Wire::Varint(123_456_789))
        ]
    );
    assert_eq!(
        (text(&one, 2), text(&one, 3)),
        ("hand".to_owned(), "index_proximal".to_owned())
    );
    let (place, turn) = (blocks(&one, 4)[0], blocks(&one, 5)[0]);
    assert_eq!([1, 2, 3].map(|k| double(place, k)), pose.position);
    assert_eq!([1, 2, 3, 4].map(|k| double(turn, k)), pose.rotation);
}

#[test]
fn a_number_that_is_none_stays_one() {
    let mut pose = Pose::at([f64::NAN, f64::INFINITY, 0.0]);
    pose.rotation[0] = f64::NEG_INFINITY;
    let message = frame_transforms(
        1,
        &[Transform {
            parent: "a",
            child: "b",
            pose,
        }],
    );
    let all = read(&message);
    let one = read(blocks(&all, 1)[0]);
    let place = blocks(&one, 4)[0];
    assert!(double(place, 1).is_nan());
    assert_eq!(double(place, 2), f64::INFINITY);
    assert_eq!(double(blocks(&one, 5)[0], 1), f64::NEG_INFINITY);
}

#[test]
fn a_scene_has_an_entity_for_each_frame_that_moves_with_it() {
    let shapes = vec![
        Primitive::Sphere {
            centre: [0.0, 0.0, 0.03],
            thickness: 0.02,
        },
        Primitive::Cylinder {
            pose: Pose::at([0.0, 0.0, 0.015]),
            thickness: 0.02,
            length: 0.03,
        },
    ];
    let entity = Entity {
        frame: "thumb_distal",
        colour: [0.5, 0.25, 1.0],
        shapes,
    };
    let message = scene_update(5, &[entity]);
    let all = read(&message);
    let entity = read(blocks(&all, 2)[0]);
    assert_eq!(text(&entity, 2), "thumb_distal");
    assert!(
        entity.contains(&(5, Wire::Varint(1))),
        "it is locked to its frame"
    );
    let cylinder = read(blocks(&entity, 10)[0]);
    assert_eq!(double(blocks(&cylinder, 2)[0], 3), 0.03);
    assert_eq!(double(blocks(&cylinder, 5)[0], 2), 0.25);
    assert_eq!(blocks(&entity, 9).len(), 1);
}

#[test]
fn an_event_has_its_level_and_text() {
    let message = log(7, Level::Error, "glove answers no more");
    let log = read(&message);
    assert!(log.contains(&(2, Wire::Varint(4))));
    assert_eq!(text(&log, 3), "glove answers no more");
}

#[test]
fn names_in_json_are_in_one_word() {
    assert_eq!(json_name("parent_frame_id"), "parentFrameId");
    assert_eq!(json_name("x"), "x");
}
