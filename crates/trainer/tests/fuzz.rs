//! The fuzz target of `common/fuzz.rs` over the kept corpus and seeded input. `cargo xtask fuzz` runs the same function
//! under a coverage-guided fuzzer; what breaks it is kept in `tests/corpus`.

#[path = "common/fuzz.rs"]
mod fuzz;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::path::Path;
use trainer::data::{Columns, Table};

/// What is kept: starting points, and every input that ever broke the target.
fn corpus() -> Vec<Vec<u8>> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/corpus/table");
    let files = std::fs::read_dir(folder).expect("the corpus");
    files
        .map(|file| std::fs::read(file.expect("a file").path()).expect("its bytes"))
        .collect()
}

/// What people's files are made of.
const WORDS: [&str; 24] = [
    ",",
    ";",
    "\t",
    " ",
    "\n",
    "\r\n",
    "\"",
    "#",
    ".",
    "-",
    "e",
    "0",
    "1",
    "3,5",
    "1e300",
    "nan",
    "time_s",
    "clip",
    "thumb_flex",
    "index_flex",
    "finger_a",
    "q0",
    "x0",
    "[deg]",
];

fn mutated(rng: &mut ChaCha8Rng, kept: &[Vec<u8>]) -> Vec<u8> {
    let mut file = kept[rng.next_u64() as usize % kept.len()].clone();
    for _ in 0..rng.next_u64() % 6 {
        let at = rng.next_u64() as usize % file.len();
        let to = (at + rng.next_u64() as usize % 8).min(file.len());
        match rng.next_u64() % 4 {
            0 => file[at] = rng.next_u64() as u8,
            1 => drop(file.splice(at..to, [])),
            2 => {
                let part = file[at..to].to_vec();
                drop(file.splice(at..at, part));
            }
            _ => {
                let word = WORDS[rng.next_u64() as usize % WORDS.len()];
                drop(file.splice(at..at, word.bytes()));
            }
        }
        if file.is_empty() {
            file.push(0);
        }
    }
    file
}

#[test]
fn tables_of_any_bytes_are_read_whole_or_refused() {
    const SEED: u64 = 19;
    let kept = corpus();
    assert!(kept.iter().all(|file| fuzz::table(file)), "the corpus");
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let read = (0..30_000)
        .filter(|_| fuzz::table(&mutated(&mut rng, &kept)))
        .count();
    println!("seed {SEED}: {read} of 30,000 were read");
    assert!((5_000..29_000).contains(&read), "{read}");
}

/// As many comparisons as rows, not as their square: this did not end.
#[test]
fn a_header_before_every_row_of_a_million_is_read() {
    let rows: String = (0..1_000_000)
        .map(|i| format!("time_s,q\n{i},0\n"))
        .collect();
    let mut table = Table::read(
        rows.as_bytes(),
        Path::new("many.csv"),
        Columns::Named(&["q"]),
    )
    .expect("a table");
    let poses = table.poses(&["q"]).expect("poses");
    assert_eq!(poses.rows.rows, 1_000_000);
}

/// Each name was looked for among all: this did not end.
#[test]
fn a_header_of_a_hundred_thousand_fields_and_a_line_without_end_are_refused() {
    let names: Vec<String> = (0..100_000).map(|i| format!("q{i}")).collect();
    let numbers = "1,".repeat(100_000);
    for (text, word) in [
        (format!("{}\n{numbers}\n", names.join(",")), "100000 fields"),
        (format!("q0,q1\n{}\n", "1,".repeat(1_000_000)), "line 2"),
    ] {
        let columns = Columns::Numbered(&["q"]);
        let said = Table::read(text.as_bytes(), Path::new("wide.csv"), columns)
            .and_then(|mut table| table.samples("q"))
            .expect_err(word)
            .to_string();
        assert!(said.contains("wide.csv") && said.contains(word), "{said}");
    }
}
