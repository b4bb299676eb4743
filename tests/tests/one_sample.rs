//! docs/one-sample.md names files and functions: they are there, and the README's picture has the same names.

use std::path::{Path, PathBuf};

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("the workspace")
        .to_owned()
}

#[test]
fn the_boxes_of_the_picture_are_the_modules_of_the_way() {
    let page = std::fs::read_to_string(workspace().join("docs/one-sample.md")).expect("the page");
    let picture = std::fs::read_to_string(workspace().join("docs/path.svg")).expect("the picture");
    let titles: Vec<&str> = picture
        .lines()
        .filter(|line| line.contains("font-weight=\"bold\""))
        .filter_map(|line| line.split('>').nth(1)?.split('<').next())
        .collect();
    let outside = ["Glove", "Gripper", "Host tool: gauntlet"];
    let inside: Vec<&str> = titles
        .into_iter()
        .filter(|title| !outside.contains(title) && !title.starts_with("Bridge"))
        .collect();
    assert!(inside.len() >= 5, "{inside:?}");
    for module in inside {
        let module = module.to_lowercase();
        assert!(
            page.contains(&format!("/src/{module}/"))
                || page.contains(&format!("/src/{module}.rs")),
            "the picture's {module} is no module of docs/one-sample.md"
        );
    }
}

#[test]
fn every_arrow_of_the_way_of_one_sample_names_a_file_and_a_function_that_are_there() {
    let root = workspace();
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
