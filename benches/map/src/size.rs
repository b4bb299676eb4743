//! What the map costs a chip: the sizes of the functions and of the static memory of the image `footprint`.

use std::path::Path;

/// Start of a Cortex-M's static memory (ARMv7-M ARM, B3.1: SRAM).
const SRAM: u32 = 0x2000_0000;
const SRAM_END: u32 = 0x4000_0000;

/// A symbol with a size.
struct Symbol {
    name: String,
    address: u32,
    size: u32,
}

/// Prints the sizes.
pub fn print(elf: &Path) -> Result<(), String> {
    let bytes = std::fs::read(elf).map_err(|error| {
        format!(
            "{}: {error}: build crates/hae/qemu-count as a whole",
            elf.display()
        )
    })?;
    let symbols = symbols(&bytes).ok_or_else(|| {
        format!(
            "{}: not a 32-bit little-endian ELF with symbols",
            elf.display()
        )
    })?;
    let of = |name: &str| {
        symbols
            .iter()
            .filter(|symbol| symbol.name == name)
            .map(|symbol| symbol.size)
            .sum::<u32>()
    };
    let (float, integer, check) = (of("hae_m4f_f32"), of("hae_m4f_i16"), of("hae_m4f_beyond"));
    let in_sram = |symbol: &&Symbol| (SRAM..SRAM_END).contains(&symbol.address);
    let data: u32 = symbols.iter().filter(in_sram).map(|s| s.size).sum();
    let all: u32 = symbols.iter().map(|s| s.size).sum::<u32>() - data;
    let rest = all - float - integer - check;
    println!("Code of a map 25 -> 300 -> 4, in bytes");
    println!(
        "  f32 kernel {float}, check of the inputs {check}, view of the image and choice {rest}: {}",
        float + check + rest
    );
    println!("  the 16-bit kernel {integer}; for images of both kinds {all}");
    println!("Static memory: {data}");
    Ok(())
}

/// The symbol table of a 32-bit little-endian ELF (System V ABI, chapter 4).
fn symbols(elf: &[u8]) -> Option<Vec<Symbol>> {
    const SYMTAB: u32 = 2;
    const SECTION: usize = 40;
    if !elf.starts_with(b"\x7fELF\x01\x01") {
        return None;
    }
    let word = |at: usize| Some(u32::from_le_bytes(elf.get(at..at + 4)?.try_into().ok()?));
    let half = |at: usize| Some(u16::from_le_bytes(elf.get(at..at + 2)?.try_into().ok()?));
    let sections = word(32)? as usize;
    let count = usize::from(half(48)?);
    let header = |index: usize| sections + index * SECTION;
    let table = (0..count).find(|&index| word(header(index) + 4) == Some(SYMTAB))?;
    let (start, size) = (word(header(table) + 16)?, word(header(table) + 20)?);
    let names = word(header(word(header(table) + 24)? as usize) + 16)? as usize;
    (0..size as usize / 16)
        .map(|index| {
            let at = start as usize + index * 16;
            let name = elf.get(names + word(at)? as usize..)?;
            let end = name.iter().position(|&byte| byte == 0)?;
            Some(Symbol {
                name: String::from_utf8_lossy(&name[..end]).into_owned(),
                address: word(at + 4)?,
                size: word(at + 8)?,
            })
        })
        .collect()
}
