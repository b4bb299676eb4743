//! As much of ELF and of the Thumb-2 instruction set as it takes to follow calls through a linked program.
//!
//! Source: "ELF for the Arm Architecture" (mapping symbols `$t`, `$d`), Armv7-M Architecture Reference Manual (A5, A7.7).

use std::collections::{BTreeMap, BTreeSet};

/// A linked program.
pub struct Program {
    bytes: Vec<u8>,
    sections: Vec<Section>,
    /// Functions by address.
    pub functions: BTreeMap<u32, Function>,
    /// Where data begins (true) or code goes on (false) inside the text.
    marks: BTreeMap<u32, bool>,
}

struct Section {
    name: String,
    kind: u32,
    address: u32,
    offset: usize,
    size: usize,
    link: usize,
}

/// A function and what it leads to.
pub struct Function {
    /// Its mangled name, the first where several share the address.
    pub name: String,
    end: u32,
}

/// Where a function goes.
#[derive(Default)]
pub struct Leads {
    /// Addresses that it calls, jumps to, or takes.
    pub to: BTreeSet<u32>,
    /// Whether it calls what a register holds.
    pub indirect: bool,
}

const NOBITS: u32 = 8;
const SYMBOLS: u32 = 2;
const FUNCTION: u8 = 2;

impl Program {
    /// Reads a little-endian 32-bit ELF file.
    pub fn parse(bytes: Vec<u8>) -> Option<Self> {
        if bytes.get(..6)? != b"\x7fELF\x01\x01" {
            return None;
        }
        let start = word(&bytes, 0x20)? as usize;
        let (size, count) = (half(&bytes, 0x2e)?, half(&bytes, 0x30)?);
        let names = half(&bytes, 0x32)?;
        let header = |index: u16, field: usize| {
            let at = start + usize::from(index) * usize::from(size) + 4 * field;
            word(&bytes, at)
        };
        let names_at = header(names, 4)? as usize;
        let sections = (0..count)
            .map(|index| {
                Some(Section {
                    name: text(&bytes, names_at + header(index, 0)? as usize)?,
                    kind: header(index, 1)?,
                    address: header(index, 3)?,
                    offset: header(index, 4)? as usize,
                    size: header(index, 5)? as usize,
                    link: header(index, 6)? as usize,
                })
            })
            .collect::<Option<Vec<_>>>()?;
        let mut program = Self {
            bytes,
            sections,
            functions: BTreeMap::new(),
            marks: BTreeMap::new(),
        };
        program.read_symbols()?;
        Some(program)
    }

    fn read_symbols(&mut self) -> Option<()> {
        let table = self.sections.iter().find(|s| s.kind == SYMBOLS)?;
        let names = self.sections.get(table.link)?.offset;
        for at in (table.offset..table.offset + table.size).step_by(16) {
            let name = text(&self.bytes, names + word(&self.bytes, at)? as usize)?;
            let (value, size) = (word(&self.bytes, at + 4)?, word(&self.bytes, at + 8)?);
            let address = value & !1;
            if *self.bytes.get(at + 12)? & 0xf == FUNCTION {
                let end = address + size;
                let function = self
                    .functions
                    .entry(address)
                    .or_insert(Function { name, end });
                function.end = function.end.max(end);
            } else if name.starts_with("$d") {
                self.marks.insert(address, true);
            } else if name.starts_with("$t") {
                self.marks.insert(address, false);
            }
        }
        Some(())
    }

    /// Bytes of a section; 0 where there is none.
    pub fn size_of(&self, section: &str) -> u64 {
        let sections = self.sections.iter().filter(|s| s.name == section);
        sections.map(|section| section.size as u64).sum()
    }

    /// The function that holds `address`.
    pub fn function_at(&self, address: u32) -> Option<u32> {
        let (&start, function) = self.functions.range(..=address).next_back()?;
        (address < function.end.max(start + 2)).then_some(start)
    }

    /// Functions whose address stands in the constants or in the initialised data: what a call through a register can
    /// reach.
    pub fn pointed_at(&self) -> BTreeSet<u32> {
        let constants = self
            .sections
            .iter()
            .filter(|s| [".rodata", ".data"].contains(&s.name.as_str()) && s.kind != NOBITS);
        let words = constants.flat_map(|section| {
            let all = self
                .bytes
                .get(section.offset..section.offset + section.size);
            all.unwrap_or_default().as_chunks::<4>().0
        });
        words
            .filter_map(|bytes| self.pointer(u32::from_le_bytes(*bytes)))
            .collect()
    }

    /// The function that a word is a pointer to: its address with the Thumb bit.
    fn pointer(&self, word: u32) -> Option<u32> {
        (word & 1 == 1 && self.functions.contains_key(&(word & !1))).then_some(word & !1)
    }

    fn offset_of(&self, address: u32) -> Option<usize> {
        let section = self.sections.iter().find(|s| {
            s.kind != NOBITS
                && s.address <= address
                && ((address - s.address) as usize) < s.size
                && !s.name.starts_with(".debug")
        })?;
        Some(section.offset + (address - section.address) as usize)
    }

    /// Whether data stands at `address` of the text.
    fn is_data(&self, address: u32) -> bool {
        self.marks
            .range(..=address)
            .next_back()
            .is_some_and(|(_, data)| *data)
    }

    /// What the function that begins at `start` leads to.
    pub fn leads(&self, start: u32) -> Option<Leads> {
        let end = self.functions.get(&start)?.end;
        let mut leads = Leads::default();
        let mut low_halves = [None::<u16>; 16];
        let mut at = start;
        while at < end {
            let offset = self.offset_of(at)?;
            if self.is_data(at) {
                // A constant of the code: perhaps a function's address.
                if at.is_multiple_of(4) {
                    leads.to.extend(self.pointer(word(&self.bytes, offset)?));
                }
                at += 2;
                continue;
            }
            let first = half(&self.bytes, offset)?;
            if first >> 11 < 0b11101 {
                self.narrow(at, first, &mut leads);
                at += 2;
            } else {
                let second = half(&self.bytes, offset + 2)?;
                self.wide(at, [first, second], &mut low_halves, &mut leads);
                at += 4;
            }
        }
        leads.to.remove(&start);
        Some(leads)
    }

    /// B, and the jumps through a register.
    fn narrow(&self, at: u32, code: u16, leads: &mut Leads) {
        const LR: u16 = 14;
        let distance = match code >> 12 {
            0b1101 if code >> 8 & 0xf < 14 => Some(i32::from(code as i8) * 2),
            0b1110 if code & 0x0800 == 0 => Some((i32::from(code << 5) << 16 >> 21) * 2),
            _ => None,
        };
        if let Some(distance) = distance {
            self.jump(at, distance, leads);
        }
        let register = code >> 3 & 0xf;
        let calls = code & 0xff87 == 0x4780;
        let jumps = code & 0xff87 == 0x4700 && register != LR;
        leads.indirect |= calls || jumps;
    }

    /// BL, B.W, and the pairs MOVW, MOVT.
    fn wide(
        &self,
        at: u32,
        [first, second]: [u16; 2],
        low: &mut [Option<u16>; 16],
        leads: &mut Leads,
    ) {
        let (f, s) = (u32::from(first), u32::from(second));
        if first & 0xf800 == 0xf000 && second & 0x8000 != 0 {
            let sign = f >> 10 & 1;
            let (j1, j2) = (s >> 13 & 1, s >> 11 & 1);
            let always = second & 0x1000 != 0;
            if always {
                let (i1, i2) = (!(j1 ^ sign) & 1, !(j2 ^ sign) & 1);
                let value = sign << 24 | i1 << 23 | i2 << 22 | (f & 0x3ff) << 12 | (s & 0x7ff) << 1;
                self.jump(at, (value << 7) as i32 >> 7, leads);
            } else if f >> 7 & 0b111 != 0b111 {
                let value = sign << 20 | j2 << 19 | j1 << 18 | (f & 0x3f) << 12 | (s & 0x7ff) << 1;
                self.jump(at, (value << 11) as i32 >> 11, leads);
            }
            return;
        }
        let register = usize::from(second >> 8 & 0xf);
        let constant = (f & 0xf) << 12 | (f >> 10 & 1) << 11 | (s >> 12 & 7) << 8 | s & 0xff;
        if first & 0xfbf0 == 0xf240 && second & 0x8000 == 0 {
            low[register] = Some(constant as u16);
        } else if first & 0xfbf0 == 0xf2c0
            && second & 0x8000 == 0
            && let Some(low) = low[register]
        {
            leads
                .to
                .extend(self.pointer(constant << 16 | u32::from(low)));
        }
    }

    fn jump(&self, at: u32, distance: i32, leads: &mut Leads) {
        let target = at.wrapping_add(4).wrapping_add_signed(distance);
        leads.to.extend(self.function_at(target));
    }
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?))
}

fn half(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_le_bytes(bytes.get(at..at + 2)?.try_into().ok()?))
}

fn text(bytes: &[u8], at: usize) -> Option<String> {
    let rest = bytes.get(at..)?;
    let length = rest.iter().position(|&byte| byte == 0)?;
    Some(String::from_utf8_lossy(&rest[..length]).into_owned())
}
