//! docs/one-sample.md names files and functions: they are there.

use std::path::Path;

#[test]
fn every_arrow_of_the_way_of_one_sample_names_a_file_and_a_function_that_are_there() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("the workspace");
    let page = std::fs::read_to_string(root.join("docs/one-sample.md")).expect("the page");
    let rows = page
        .lines()
        .filter(|line| line.starts_with("| ") && line.contains(".rs"));
    let mut arrows = 0;
    for row in rows {
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        let (file, function) = (cells[2], cells[3].trim_matches('`'));
        let text =
            std::fs::read_to_string(root.join(file)).unwrap_or_else(|e| panic!("{file}: {e}"));
        let declared = format!("fn {function}");
        let is_there = text
            .match_indices(&declared)
            .any(|(at, _)| text[at + declared.len()..].starts_with(['(', '<']));
        assert!(is_there, "{file} has no `{declared}`");
        arrows += 1;
    }
    assert!(arrows > 15, "{arrows}");
}
