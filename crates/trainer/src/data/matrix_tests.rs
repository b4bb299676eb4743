//! Matrix, split and digest.

use super::*;

#[test]
fn the_papers_hand_splits_into_381_and_254() {
    let parts = split(635, 0.6, 1);
    assert_eq!((parts.train.len(), parts.test.len()), (381, 254));
    let mut all = [parts.train, parts.test].concat();
    all.sort_unstable();
    assert_eq!(all, (0..635).collect::<Vec<_>>());
}

#[test]
fn a_split_depends_on_its_seed_only() {
    assert_eq!(split(100, 0.5, 4), split(100, 0.5, 4));
    assert_ne!(split(100, 0.5, 4), split(100, 0.5, 5));
    assert_eq!(split(3, 2.0, 0).test.len(), 0);
    assert_eq!(split(0, 0.5, 0).train.len(), 0);
}

#[test]
fn the_digest_sees_values_and_shape() {
    let flat = Matrix::from_rows(&[[1.0, 2.0, 3.0, 4.0]]);
    let square = Matrix::from_rows(&[[1.0, 2.0], [3.0, 4.0]]);
    assert_eq!(sha256(&[&flat]).len(), 64);
    assert_ne!(sha256(&[&flat]), sha256(&[&square]));
    assert_eq!(sha256(&[&square]), sha256(&[&square.clone()]));
    // Published vector: SHA-256 of no bytes.
    assert_eq!(
        sha256(&[]),
        "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"
    );
}

#[test]
fn a_matrix_refuses_values_that_do_not_fit() {
    assert_eq!(Matrix::from_vec(2, 2, vec![0.0; 3]), None);
    assert_eq!(Matrix::from_vec(usize::MAX, 2, vec![]), None);
    let mut matrix = Matrix::default();
    assert!(matrix.push(&[1.0, 2.0]));
    assert!(!matrix.push(&[1.0]));
    assert_eq!(matrix, Matrix::from_rows(&[[1.0, 2.0]]));
}

#[test]
fn select_takes_rows_in_the_order_asked() {
    let matrix = Matrix::from_rows(&[[0.0, 1.0], [2.0, 3.0], [4.0, 5.0]]);
    let chosen = matrix.select(&[2, 0, 9]);
    assert_eq!(chosen, Matrix::from_rows(&[[4.0, 5.0], [0.0, 1.0]]));
    assert_eq!(matrix.ranges(), vec![(0.0, 4.0), (1.0, 5.0)]);
}
