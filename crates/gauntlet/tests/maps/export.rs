//! `export`: weights images of both kinds, and what takes them.

use crate::support;

use std::path::{Path, PathBuf};

use host::hae::image::Element;
use host::hae::{Map, quantized};
use support::{Simulation, json, model, poses_file, refusal, run};

fn path(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn export(folder: &Path, name: &str, more: &[&str]) -> (PathBuf, serde_json::Value) {
    let out = folder.join(name);
    let mut arguments = vec!["export", path(model()), "--out", path(&out), "--json"];
    arguments.extend(more);
    let said = json(&run(&arguments));
    (out, said)
}

/// The file's bytes where an image must start.
#[repr(align(64))]
struct Aligned([u8; 40_000]);

fn read(file: &Path) -> (Box<Aligned>, usize) {
    let bytes = std::fs::read(file).unwrap();
    let mut aligned = Box::new(Aligned([0; 40_000]));
    aligned.0[..bytes.len()].copy_from_slice(&bytes);
    (aligned, bytes.len())
}

#[test]
fn an_image_in_16_bit_integers_is_half_as_long_and_states_its_errors() {
    let folder = tempfile::tempdir().unwrap();
    let poses = poses_file(folder.path(), 200);
    let (float, said_float) = export(folder.path(), "float.hae", &[]);
    let (integer, said) = export(folder.path(), "integer.hae", &["--int16", path(&poses)]);
    assert_eq!(
        (&said_float["bytes"], &said["bytes"]),
        (&36_736.into(), &19_584.into())
    );
    assert!(said_float["int16"].is_null());
    let (float, length) = read(&float);
    let float = Map::<25, 300, 4>::from_image(&float.0[..length]).unwrap();
    let (bytes, length) = read(&integer);
    let checked = host::hae::image::parse_exact(&bytes.0[..length]).unwrap();
    let integer = Map::<25, 300, 4>::from_image(&bytes.0[..length]).unwrap();
    assert_eq!(
        (float.element(), integer.element()),
        (Element::F32, Element::I16)
    );
    // The errors that were told are those of the image, and what both maps really differ by over the poses.
    let stated = quantized::errors(&bytes.0[..length], &checked).unwrap();
    let mut measured = [0.0f32; 4];
    let frames = host::trainer::data::read_poses(&poses, &support::JOINTS)
        .unwrap()
        .rows;
    for row in frames.iter_rows() {
        let q = row.try_into().unwrap();
        let (exact, rounded) = (float.eval(q).unwrap(), integer.eval(q).unwrap());
        for axis in 0..4 {
            measured[axis] = measured[axis].max((rounded[axis] - exact[axis]).abs());
        }
    }
    for axis in 0..4 {
        let told = said["int16"]["error_counts"][axis].as_f64().unwrap() as f32;
        assert_eq!(told, stated[axis]);
        assert!((told - measured[axis]).abs() < 1e-4, "{told} {measured:?}");
    }
    let of_range = said["int16"]["error_of_range"].as_f64().unwrap();
    assert!(of_range > 0.0 && of_range <= 1e-3, "{of_range}");
}

#[test]
fn teleop_takes_an_image_in_16_bit_integers_and_no_damaged_one() {
    let folder = tempfile::tempdir().unwrap();
    let poses = poses_file(folder.path(), 100);
    let (image, _) = export(folder.path(), "integer.hae", &["--int16", path(&poses)]);
    let mut simulation = Simulation::start(true, true);
    let (glove, gripper) = (simulation.glove(), simulation.gripper());
    let ports = ["teleop", "--glove", &glove, "--gripper", &gripper];
    let model = ["--model", path(&image), "--seconds", "1", "--json"];
    // What it then does is the bridge's, whose tests follow a hand by such a map.
    let said = json(&run(&[&ports[..], &model].concat()));
    assert!(said["run"].is_object(), "{said}");
    let mut damaged = std::fs::read(&image).unwrap();
    damaged[10_000] ^= 1;
    std::fs::write(&image, &damaged).unwrap();
    assert!(refusal(&run(&[&ports[..], &model].concat()), 1).contains("damaged"));
    assert_eq!(simulation.end(), Some(0));
}

#[test]
fn images_are_not_made_of_what_cannot_be_one() {
    let folder = tempfile::tempdir().unwrap();
    let poses = poses_file(folder.path(), 60);
    let (image, _) = export(folder.path(), "float.hae", &[]);
    // Quantised from an image: the f32 model is needed. Nobody is asked on the line before that is said.
    let bridge = "unix:/nowhere/host.sock";
    let flash = [
        "flash",
        path(&image),
        "--int16",
        path(&poses),
        "--bridge",
        bridge,
    ];
    assert!(refusal(&run(&flash), 2).contains("a weights image already"));
    let output = run(&["export", path(model()), "--out", path(&poses)]);
    assert!(refusal(&output, 2).contains("is not a weights image"));
    let output = run(&[
        "export",
        path(model()),
        "--out",
        path(&poses),
        "--int16",
        path(&poses),
    ]);
    assert!(refusal(&output, 2).contains("an input"));
    let mut damaged = std::fs::read(&image).unwrap();
    damaged[20_000] ^= 1;
    std::fs::write(&image, &damaged).unwrap();
    let output = run(&["flash", path(&image), "--bridge", bridge]);
    assert!(refusal(&output, 1).contains("damaged"));
}

#[test]
fn an_image_takes_the_place_of_an_old_one_whole() {
    let folder = tempfile::tempdir().unwrap();
    let (image, _) = export(folder.path(), "weights.hae", &[]);
    let before = std::fs::read(&image).unwrap();
    // Another name of the old file: bytes written into it would show there, a renamed file does not.
    let witness = folder.path().join("witness.hae");
    std::fs::hard_link(&image, &witness).unwrap();
    let poses = poses_file(folder.path(), 60);
    export(folder.path(), "weights.hae", &["--int16", path(&poses)]);
    assert_ne!(std::fs::read(&image).unwrap(), before);
    assert!(
        std::fs::read(&witness).unwrap() == before,
        "written in place"
    );
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 3);
}
