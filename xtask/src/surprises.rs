//! No surprises in the linked firmware: no way to a panic from the loop or an interrupt, no allocator anywhere.

use crate::elf::Program;
use crate::step::Failure;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::path::Path;

/// Parts of mangled names at which the loop and the interrupts begin.
const ROOTS: [&str; 5] = [
    "8firmware4turn",
    "interrupts4host",
    "interrupts5glove",
    "interrupts7gripper",
    "SysTick",
];
/// The panic handler; every panic ends here.
const PANIC: &str = "rust_begin_unwind";
/// Parts of the names that an allocator has.
const ALLOCATORS: [&str; 5] = [
    "__rust_alloc",
    "__rg_alloc",
    "__rdl_alloc",
    "malloc",
    "5alloc5alloc",
];

/// Holds the program against the facts; prints what was looked at.
pub fn check(elf: &Path, program: &Program) -> Result<(), Failure> {
    let name = elf.display();
    let named = |part: &str| -> Vec<u32> {
        let found = program.functions.iter();
        let found = found.filter(|(_, function)| function.name.contains(part));
        found.map(|(address, _)| *address).collect()
    };
    let allocators: Vec<u32> = ALLOCATORS.iter().flat_map(|part| named(part)).collect();
    if let Some(found) = allocators.first() {
        return Err(format!(
            "{name}: an allocator is linked: {}",
            plain(program, *found)
        ));
    }
    let mut roots = BTreeSet::new();
    for part in ROOTS {
        let found = named(part);
        if found.is_empty() {
            return Err(format!(
                "{name}: no function {part:?}; keep it from being inlined"
            ));
        }
        roots.extend(found);
    }
    let graph = graph(program)?;
    let reached = reach(program, &graph, &roots);
    let panics: BTreeSet<u32> = named(PANIC).into_iter().collect();
    if let Some(panic) = panics.iter().find(|panic| reached.contains_key(panic)) {
        return Err(format!(
            "{name}: the loop can panic:\n{}",
            path(program, &reached, *panic)
        ));
    }
    println!(
        "no surprises: {} functions, {} reachable from the loop and the interrupts, no panic among them, no allocator",
        program.functions.len(),
        reached.len()
    );
    let start_up = program.functions.keys().filter(|function| {
        !reached.contains_key(function)
            && !plain(program, **function).contains("panicking")
            && graph
                .get(function)
                .is_some_and(|(to, _)| to.iter().any(|to| panics.contains(to)))
    });
    for function in start_up {
        println!(
            "  ends in the panic handler, which resets; not reachable from the loop: {}",
            plain(program, *function)
        );
    }
    Ok(())
}

type Graph = BTreeMap<u32, (BTreeSet<u32>, bool)>;

fn graph(program: &Program) -> Result<Graph, Failure> {
    program
        .functions
        .keys()
        .map(|&start| {
            let leads = program
                .leads(start)
                .ok_or_else(|| format!("{}: no code found", plain(program, start)))?;
            Ok((start, (leads.to, leads.indirect)))
        })
        .collect()
}

/// Everything reachable, each with whom it was first reached from. A call through a register is taken to reach every
/// function whose address stands in the constants.
fn reach(program: &Program, graph: &Graph, roots: &BTreeSet<u32>) -> BTreeMap<u32, Option<u32>> {
    let pointed_at = program.pointed_at();
    let mut reached: BTreeMap<u32, Option<u32>> = roots.iter().map(|root| (*root, None)).collect();
    let mut queue: VecDeque<u32> = roots.iter().copied().collect();
    while let Some(function) = queue.pop_front() {
        let Some((to, indirect)) = graph.get(&function) else {
            continue;
        };
        let through_register = pointed_at.iter().filter(|_| *indirect);
        for &next in to.iter().chain(through_register) {
            reached.entry(next).or_insert_with(|| {
                queue.push_back(next);
                Some(function)
            });
        }
    }
    reached
}

/// The way to `end`, a function a line.
fn path(program: &Program, reached: &BTreeMap<u32, Option<u32>>, end: u32) -> String {
    let mut lines = Vec::new();
    let mut at = Some(end);
    while let Some(function) = at {
        lines.push(format!("  {}", plain(program, function)));
        at = reached.get(&function).copied().flatten();
    }
    lines.reverse();
    lines.join("\n")
}

fn plain(program: &Program, function: u32) -> String {
    let name = program.functions.get(&function).map(|f| f.name.as_str());
    name.unwrap_or("?").to_owned()
}
