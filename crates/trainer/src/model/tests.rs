//! The model file against the format's own reader, its errors, and the weights image against the map.

use super::*;
use crate::random::Random;
use crate::remedy::Remedy;
use std::path::Path;

fn model(inputs: usize, hidden: usize, outputs: usize) -> Model {
    let mut random = Random::new(11, 0);
    let mut network = |inputs: usize, outputs: usize| {
        let mut network = Network::zeros(inputs, hidden, outputs);
        for array in network.arrays_mut() {
            for value in array.iter_mut() {
                *value = random.between(-0.3, 0.3);
            }
        }
        network
    };
    Model {
        f: network(inputs, outputs),
        g: network(outputs, inputs),
        q: Normalisation {
            offset: (0..inputs).map(|i| 0.05 * i as f32).collect(),
            scale: (0..inputs).map(|i| 0.8 + 0.03 * i as f32).collect(),
        },
        x: Normalisation::gripper(outputs),
        metadata: [("cost", "hae"), ("vo", "0.949")]
            .map(|(key, value)| (key.to_owned(), value.to_owned()))
            .into(),
    }
}

fn fault(bytes: &[u8]) -> String {
    Model::from_bytes(bytes, Path::new("m.safetensors"))
        .unwrap_err()
        .told()
}

#[test]
fn a_saved_model_loads_unchanged_and_saves_to_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.safetensors");
    let model = model(25, 300, 4);
    model.save(&path).unwrap();
    let loaded = Model::load(&path).unwrap();
    assert_eq!(loaded, model);
    assert_eq!(loaded.to_bytes(), std::fs::read(&path).unwrap());
    assert_eq!(loaded.number("vo"), Some(0.949));
    assert_eq!(loaded.number("cost"), None);
}

#[test]
fn the_format_s_own_reader_finds_every_tensor_under_its_name() {
    let model = model(25, 30, 4);
    let bytes = model.to_bytes();
    let read = safetensors::SafeTensors::deserialize(&bytes).unwrap();
    for (name, shape) in [
        ("f.w1", vec![30, 25]),
        ("f.b1", vec![30]),
        ("f.w2", vec![4, 30]),
        ("f.b2", vec![4]),
        ("g.w1", vec![30, 4]),
        ("g.b1", vec![30]),
        ("g.w2", vec![25, 30]),
        ("g.b2", vec![25]),
        ("q.offset", vec![25]),
        ("q.scale", vec![25]),
        ("x.offset", vec![4]),
        ("x.scale", vec![4]),
    ] {
        let tensor = read.tensor(name).unwrap();
        assert_eq!(tensor.shape(), shape, "{name}");
        assert_eq!(tensor.dtype(), safetensors::Dtype::F32);
    }
    assert_eq!(read.len(), 12);
    let first: [u8; 4] = read.tensor("f.w2").unwrap().data()[..4].try_into().unwrap();
    assert_eq!(f32::from_le_bytes(first), model.f.w2[0]);
}

#[test]
fn a_file_of_another_kind_is_refused_by_name() {
    for bytes in [&b""[..], b"time_s,clip\n0,1\n", &[0xff; 64], &[0; 64]] {
        let said = fault(bytes);
        assert!(
            said.contains("m.safetensors is not a safetensors file"),
            "{said}"
        );
        assert!(said.contains("gauntlet train"), "{said}");
    }
}

#[test]
fn every_cut_of_a_model_file_is_refused_without_a_panic() {
    let bytes = model(3, 5, 2).to_bytes();
    for length in 0..bytes.len() {
        assert!(fault(&bytes[..length]).contains("not a safetensors file"));
    }
}

/// The file with one text in its header replaced by another of the same length.
fn with_header(model: &Model, from: &str, to: &str) -> Vec<u8> {
    assert_eq!(from.len(), to.len());
    let mut bytes = model.to_bytes();
    let place = bytes
        .windows(from.len())
        .position(|window| window == from.as_bytes())
        .unwrap();
    bytes[place..place + to.len()].copy_from_slice(to.as_bytes());
    bytes
}

#[test]
fn a_missing_tensor_and_a_wrong_shape_or_type_are_named() {
    let model = model(3, 5, 2);
    let said = fault(&with_header(&model, "\"g.b1\"", "\"gXb1\""));
    assert!(said.contains("tensor `g.b1` is missing"), "{said}");
    let said = fault(&with_header(&model, "[5,3]", "[3,5]"));
    assert!(
        said.contains("`f.b1` has shape [5], expected [3]"),
        "{said}"
    );
    let said = fault(&with_header(&model, "[2,5]", "[5,2]"));
    assert!(
        said.contains("`f.w2` has shape [5, 2], expected [5, 5]"),
        "{said}"
    );
    let said = fault(&with_header(&model, "\"F32\"", "\"I32\""));
    assert!(said.contains("I32 numbers, expected F32"), "{said}");
}

/// Whether its bytes are left behind or taken out with it.
#[test]
fn a_tensor_taken_out_is_named_whatever_is_done_with_its_bytes() {
    let model = model(3, 5, 2);
    let bytes = model.to_bytes();
    let read = safetensors::SafeTensors::deserialize(&bytes).unwrap();
    let others = read
        .tensors()
        .into_iter()
        .filter(|(name, _)| name != "g.b1");
    let without = safetensors::serialize(others, None).unwrap();
    assert!(fault(&without).contains("tensor `g.b1` is missing"));
    let mut length = [0; 8];
    length.copy_from_slice(&bytes[..8]);
    let end = 8 + u64::from_le_bytes(length) as usize;
    let mut header: serde_json::Value = serde_json::from_slice(&bytes[8..end]).unwrap();
    header.as_object_mut().unwrap().remove("g.b1");
    let text = header.to_string();
    let mut gap = (text.len() as u64).to_le_bytes().to_vec();
    gap.extend_from_slice(text.as_bytes());
    gap.extend_from_slice(&bytes[end..]);
    assert!(
        fault(&gap).contains("tensor `g.b1` is missing"),
        "{}",
        fault(&gap)
    );
}

#[test]
fn a_value_that_is_not_finite_and_a_zero_scale_are_named() {
    let mut bad = model(3, 5, 2);
    bad.g.w2[7] = f32::NAN;
    let said = fault(&bad.to_bytes());
    assert!(said.contains("`g.w2`, element 7 is NaN"), "{said}");
    let mut bad = model(3, 5, 2);
    bad.q.scale[2] = 0.0;
    let said = fault(&bad.to_bytes());
    assert!(said.contains("`q.scale`, element 2 is 0"), "{said}");
}

#[test]
fn an_unsound_model_is_not_written_and_the_old_file_stays() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.safetensors");
    let sound = model(3, 5, 2);
    sound.save(&path).unwrap();
    let mut bad = sound.clone();
    bad.f.b2[0] = f32::INFINITY;
    assert!(matches!(bad.save(&path), Err(Error::BadValue { .. })));
    let mut bad = sound.clone();
    bad.f.b1.pop();
    assert!(bad.save(&path).is_err());
    assert_eq!(Model::load(&path).unwrap(), sound);
}

#[test]
fn a_model_of_other_domains_is_refused_with_both_shapes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.safetensors");
    model(3, 5, 2).save(&path).unwrap();
    let said = Model::load_for(&path, 25, 4).unwrap_err().to_string();
    assert!(said.contains("maps 3 values to 2, here 25 to 4"), "{said}");
    let said = Model::load(folder.path().join("none")).unwrap_err();
    assert!(said.to_string().contains("cannot read"), "{said}");
}

#[test]
fn no_flipped_bit_of_a_model_file_is_taken() {
    let mut bytes = model(3, 5, 2).to_bytes();
    for bit in 0..8 * bytes.len() {
        bytes[bit / 8] ^= 1 << (bit % 8);
        let taken = Model::from_bytes(&bytes, Path::new("m.safetensors"));
        assert!(taken.is_err(), "bit {} of byte {}", bit % 8, bit / 8);
        bytes[bit / 8] ^= 1 << (bit % 8);
    }
    assert!(Model::from_bytes(&bytes, Path::new("m")).is_ok() && has_digest(&bytes));
}

#[test]
fn a_model_of_an_earlier_version_has_no_digest_and_is_taken() {
    let model = model(3, 5, 2);
    let bytes = model.to_bytes();
    let read = safetensors::SafeTensors::deserialize(&bytes).unwrap();
    let metadata = model.metadata.clone().into_iter().collect();
    let earlier = safetensors::serialize(read.tensors(), Some(metadata)).unwrap();
    assert_eq!(Model::from_bytes(&earlier, Path::new("m")).unwrap(), model);
    assert!(!has_digest(&earlier));
    assert!(!has_digest(b"no model"));
}

#[test]
fn the_weights_image_gives_the_counts_of_the_map() {
    #[repr(align(64))]
    struct Aligned([u8; 40_000]);
    let model = model(25, 300, 4);
    let meta = hae::image::Meta {
        model_id: 7,
        version: 1,
        joint_order: hae::image::JointOrder::Hand25,
    };
    let image = model.to_image(&meta).unwrap();
    let mut store = Box::new(Aligned([0; 40_000]));
    store.0[..image.len()].copy_from_slice(&image);
    let map = hae::Map::<25, 300, 4>::from_image(&store.0[..image.len()]).unwrap();
    let mut random = Random::new(2, 0);
    for _ in 0..500 {
        let q: [f32; 25] = core::array::from_fn(|_| random.between(-0.6, 1.8));
        let counts = map.eval(&q).unwrap();
        for (a, b) in counts.iter().zip(model.map(&q)) {
            assert!((a - b).abs() < 1e-3, "{a} {b}");
        }
    }
}

#[test]
fn normalisation_goes_there_and_back() {
    let gripper = Normalisation::gripper(4);
    let units = gripper.apply(&[0.0, 255.0, 127.5, 130.0]);
    assert!((units[0] + 0.7).abs() < 1e-6 && (units[1] - 0.7).abs() < 1e-6);
    let back = gripper.invert(&units);
    assert!((back[3] - 130.0).abs() < 1e-4);
    let samples = crate::data::Matrix::from_rows(&[[1.0, 5.0], [3.0, 5.0]]);
    let standard = Normalisation::standard(&samples);
    let all = standard.apply_all(&samples);
    assert_eq!(all.data, vec![-1.0, 0.0, 1.0, 0.0]);
}
