//! The CSV files: what they carry, and that every fault is named with file, place, value and next step.

use super::*;
use crate::remedy::Remedy;
use std::path::Path;

const JOINTS: [&str; 2] = ["index_mcp_flex", "index_pip_flex"];

fn poses(text: &str) -> Result<Poses, Error> {
    poses_from(text.as_bytes(), Path::new("hand.csv"), &JOINTS)
}

fn fault(text: &str) -> String {
    poses(text).unwrap_err().told()
}

#[test]
fn poses_are_read_by_name_and_clip_is_passed_over() {
    let read = poses(
        "time_s,clip,index_pip_flex,index_mcp_flex\n0,fist,0.5,1\n0.1,\"a, b\",-0.25, 1e-1\n",
    )
    .unwrap();
    assert_eq!(read.time_s, Some(vec![0.0, 0.1]));
    assert_eq!(read.rows, Matrix::from_rows(&[[1.0, 0.5], [0.1, -0.25]]));
}

#[test]
fn poses_without_time_and_with_a_byte_order_mark_are_read() {
    let read = poses("\u{feff}index_mcp_flex,index_pip_flex\r\n1,2\r\n").unwrap();
    assert_eq!(read.time_s, None);
    assert_eq!(read.rows.data, vec![1.0, 2.0]);
}

#[test]
fn a_missing_column_is_named_with_the_header_as_it_stands() {
    let said = fault("time_s,index_mcp_flex\n0,1\n");
    assert!(
        said.starts_with("hand.csv: column `index_pip_flex` is missing"),
        "{said}"
    );
    assert!(said.contains("time_s, index_mcp_flex"), "{said}");
}

#[test]
fn nan_infinity_and_too_large_numbers_are_named_with_row_and_column() {
    for value in ["NaN", "inf", "-inf", "1e39"] {
        let said = fault(&format!(
            "index_mcp_flex,index_pip_flex\n1,2\n\n3,{value}\n"
        ));
        assert!(
            said.contains("line 4 (row 2), column `index_pip_flex`"),
            "{said}"
        );
        assert!(said.contains(value), "{said}");
    }
}

#[test]
fn a_word_an_empty_field_and_a_decimal_comma_are_named() {
    let said = fault("index_mcp_flex,index_pip_flex\n1,open\n");
    assert!(
        said.contains("line 2 (row 1), column `index_pip_flex`: `open` is not a number"),
        "{said}"
    );
    assert!(fault("index_mcp_flex,index_pip_flex\n1,\n").contains("`` is not a number"));
    let said = fault("index_mcp_flex,index_pip_flex\n1,5,2,5\n");
    assert!(
        said.contains("line 2 (row 1): 4 fields, the header has 2"),
        "{said}"
    );
}

#[test]
fn a_short_row_and_a_doubled_column_are_refused() {
    let said = fault("index_mcp_flex,index_pip_flex\n1,2\n3\n");
    assert!(
        said.contains("line 3 (row 2): 1 fields, the header has 2"),
        "{said}"
    );
    let said = fault("index_mcp_flex,index_pip_flex,index_mcp_flex\n1,2,3\n");
    assert!(
        said.contains("`index_mcp_flex` is in the header twice"),
        "{said}"
    );
}

#[test]
fn an_empty_file_and_one_without_rows_are_different_faults() {
    assert!(fault("").contains("hand.csv is empty"));
    assert!(fault("index_mcp_flex,index_pip_flex\n").contains("0 rows, at least 1"));
    let few = require_rows(Path::new("hand.csv"), 5, 10).unwrap_err();
    assert!(few.to_string().contains("5 rows, at least 10 are needed"));
}

#[test]
fn times_that_stand_still_or_go_back_are_refused() {
    for second in ["0.5", "0.4"] {
        let said = fault(&format!(
            "time_s,index_mcp_flex,index_pip_flex\n0.5,1,2\n{second},1,2.5\n"
        ));
        assert!(
            said.contains("line 3 (row 2), column `time_s`") && said.contains("0.5"),
            "{said}"
        );
        assert!(!said.contains("sort"), "{said}");
    }
}

#[test]
fn a_file_in_degrees_is_refused_with_its_first_impossible_angle() {
    let said = fault("index_mcp_flex,index_pip_flex\n1,2\n6.2,-85.5\n");
    assert!(
        said.contains("line 3 (row 2), column `index_pip_flex`: -85.5") && said.contains("radians"),
        "{said}"
    );
    assert!(poses("index_mcp_flex,index_pip_flex\n6.28,-6.28\n").is_ok());
}

#[test]
fn bytes_that_are_no_text_are_refused_with_their_line() {
    let bytes = b"index_mcp_flex,index_pip_flex\n1,\xff\xfe\n";
    let said = poses_from(&bytes[..], Path::new("hand.csv"), &JOINTS).unwrap_err();
    assert!(matches!(said, Error::NotCsv { line: 2, .. }), "{said}");
}

#[test]
fn a_file_that_is_not_there_is_named() {
    let said = read_poses("/nowhere/hand.csv", &JOINTS).unwrap_err();
    assert!(
        said.to_string().contains("cannot read /nowhere/hand.csv"),
        "{said}"
    );
}

#[test]
fn written_poses_pairs_and_samples_are_read_back_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("file.csv");
    let rows = Matrix::from_rows(&[[0.1, -1.0e-7], [1.0 / 3.0, 2.5]]);
    let poses = Poses {
        time_s: Some(vec![0.0, 0.1087]),
        rows: rows.clone(),
    };
    write_poses(&path, &poses, &JOINTS).unwrap();
    assert_eq!(read_poses(&path, &JOINTS).unwrap(), poses);
    let pairs = Pairs {
        inputs: rows.clone(),
        targets: Matrix::from_rows(&[[255.0], [0.0]]),
    };
    write_pairs(&path, &pairs, &JOINTS, &["finger_a"]).unwrap();
    assert_eq!(read_pairs(&path, &JOINTS, &["finger_a"]).unwrap(), pairs);
    write_samples(&path, &rows, "x").unwrap();
    assert_eq!(read_samples(&path, "x").unwrap(), rows);
}

#[test]
fn numbered_columns_end_at_the_highest_number_and_a_gap_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("truth.csv");
    std::fs::write(&path, "x0,q1,q0,note\n7,2,1,9\n").unwrap();
    let truth = read_truth(&path).unwrap();
    assert_eq!(truth.inputs, Matrix::from_rows(&[[1.0, 2.0]]));
    assert_eq!(truth.targets, Matrix::from_rows(&[[7.0]]));
    std::fs::write(&path, "q0,q2\n1,2\n").unwrap();
    let said = read_samples(&path, "q").unwrap_err().told();
    assert!(said.contains("column `q1` is missing"), "{said}");
    std::fs::write(&path, "q18446744073709551615,a\n1,2\n").unwrap();
    let said = read_samples(&path, "q").unwrap_err().told();
    assert!(said.contains("column `q0` is missing"), "{said}");
}

#[test]
fn a_recording_of_a_real_hand_is_read() {
    let Some(text) = rig::skip::shared("hand/recorded_hand_30hz.csv") else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("recorded.csv");
    std::fs::write(&path, text).unwrap();
    let poses = read_poses(&path, &glove::hand::JOINT_NAMES).unwrap();
    assert_eq!((poses.rows.rows, poses.rows.cols), (621, 25));
    // First and last value of the first row of the file.
    assert_eq!(poses.rows.row(0)[0], -0.232_703);
    assert_eq!(poses.rows.row(0)[24], 0.289_022);
    let times = poses.time_s.unwrap();
    assert!((times[620] - 20.67).abs() < 0.02, "{}", times[620]);
}

/// round(i·M/L) of M = 10, L = 4: 2.5, 5, 7.5 and 10, halves up, the ring's last being its first.
#[test]
fn spaced_pairs_stand_at_equal_distances_around_their_ring() {
    let rows: Vec<[f32; 1]> = (0..10).map(|i| [i as f32]).collect();
    let ring = Pairs {
        inputs: Matrix::from_rows(&rows),
        targets: Matrix::from_rows(&rows),
    };
    assert_eq!(ring.spaced(4).inputs.data, [3.0, 5.0, 8.0, 0.0]);
    assert_eq!(ring.spaced(1).targets.data, [0.0]);
    assert_eq!(Pairs::default().spaced(3).inputs.rows, 0);
}
