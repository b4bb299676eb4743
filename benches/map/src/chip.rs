//! Counts instead of times: the emulated chip's instructions and bits, and valgrind's instructions of the host kernels.

use std::process::{Command, Stdio};

use hae::image::Parameters;
use hae::{Kernel, Map, packed_len, quantized, reference};

use crate::network::{Image, meta, of_the_chip};
use crate::workload::{self, Hash, Random};

/// Runs the chip's image in QEMU, prints its counts, and compares its hashes of output bits with those of every kernel
/// here and of the references.
pub fn count(image: &str) -> Result<(), String> {
    let arguments = "-machine mps2-an386 -cpu cortex-m4 -nographic -monitor none -serial none \
                     -semihosting-config enable=on,target=native -icount shift=6 -kernel";
    let output = Command::new("timeout")
        .arg("300")
        .arg("qemu-system-arm")
        .args(arguments.split_whitespace())
        .arg(image)
        .stdin(Stdio::null())
        .output()
        .map_err(|e| format!("qemu-system-arm does not start ({e}): install QEMU 7.2 or later"))?;
    let mut text = String::from_utf8_lossy(&output.stdout).into_owned();
    text += &String::from_utf8_lossy(&output.stderr);
    if !output.status.success() || !text.lines().any(|line| line == "done") {
        return Err(format!(
            "the image did not run to its end in QEMU; it said:\n{text}"
        ));
    }
    let lines = |kind: &'static str| {
        text.lines()
            .filter_map(move |line| line.strip_prefix(kind))
            .map(str::trim)
    };
    println!(
        "Cortex-M4F in QEMU (instructions of one evaluation, its input check and call included; stack in bytes)"
    );
    lines("count").for_each(|line| println!("  {line}"));
    println!("Output bits");
    let mut differing = 0;
    for line in lines("bits") {
        let fields: Vec<&str> = line.split_whitespace().collect();
        let [element, shape, kernel, samples, hash] = fields[..] else {
            return Err(format!("not understood: {line}"));
        };
        let samples = samples
            .parse()
            .map_err(|_| format!("not understood: {line}"))?;
        let here = bits(element, shape, samples)?;
        let same = here
            .iter()
            .all(|(_, here)| format!("{:016x}", here.0) == hash);
        differing += usize::from(!same);
        let names: Vec<_> = here.iter().map(|(name, _)| name.as_str()).collect();
        let word = if same {
            "the same as"
        } else {
            "DIFFERENT from"
        };
        println!(
            "  {element} {shape} {kernel} in QEMU, {samples} samples: {word} {} here",
            names.join(", ")
        );
    }
    if differing == 0 {
        Ok(())
    } else {
        Err(format!("{differing} hashes differ"))
    }
}

fn bits(element: &str, shape: &str, samples: usize) -> Result<Vec<(String, Hash)>, String> {
    match shape {
        "25x300x4" => Ok(hashes::<25, 300, 4>(element, samples)),
        "25x300x1" => Ok(hashes::<25, 300, 1>(element, samples)),
        "3x300x2" => Ok(hashes::<3, 300, 2>(element, samples)),
        "7x33x5" => Ok(hashes::<7, 33, 5>(element, samples)),
        "1x1x1" => Ok(hashes::<1, 1, 1>(element, samples)),
        _ => Err(format!(
            "an image of unknown shape {shape}: build the chip's image and this program from one source"
        )),
    }
}

/// The hash of the chip's samples by the reference and by every kernel of this machine.
fn hashes<const Q: usize, const H: usize, const X: usize>(
    element: &str,
    samples: usize,
) -> Vec<(String, Hash)> {
    let ((w1, b1, w2, b2), mut random) = of_the_chip([Q, H, X]);
    let parameters = Parameters {
        inputs: Q,
        hidden: H,
        outputs: X,
        w1: &w1,
        b1: &b1,
        w2: &w2,
        b2: &b2,
    };
    let start = random.0;
    if element == "i16" {
        let poses: Vec<f32> = (0..workload::POSES * Q)
            .map(|_| random.signed(1.6))
            .collect();
        let mut image = Image::zeroed(quantized::encoded_len(Q, H, X));
        quantized::encode(&parameters, &poses, &meta(Q), &mut image).expect("sound parameters");
        let words: Vec<u32> = image[hae::image::HEADER_LEN..]
            .chunks_exact(4)
            .map(|word| u32::from_le_bytes(word.try_into().expect("four bytes")))
            .collect();
        let map = Map::<Q, H, X>::from_image(&image).expect("a sound image");
        let by_reference = |q: &[f32; Q]| -> [f32; X] {
            core::array::from_fn(|x| {
                quantized::reference(&words, [Q, H, X], q, x).unwrap_or(f32::NAN)
            })
        };
        return vec![
            ("reference".into(), hash(start, samples, by_reference)),
            (
                "Portable".into(),
                hash(start, samples, |q| map.eval(q).expect("in range")),
            ),
        ];
    }
    let image = Image::new(&parameters);
    let map = Map::<Q, H, X>::from_image(&image).expect("a sound image");
    let by_reference = |q: &[f32; Q]| {
        let mut y = [0.0; X];
        reference::eval(&parameters, q, &mut y).expect("matching lengths");
        y
    };
    let mut hashes = vec![("reference".to_owned(), hash(start, samples, by_reference))];
    let mut memory = vec![0.0; packed_len(Q, H, X) + 16];
    let offset = memory.as_ptr().align_offset(64);
    for kernel in Kernel::ALL {
        if let Ok(map) = map.repack_for(kernel, &mut memory[offset..]) {
            let kernel = format!("{:?}", map.kernel());
            hashes.push((
                kernel,
                hash(start, samples, |q| map.eval(q).expect("in range")),
            ));
        }
    }
    hashes
}

fn hash<const Q: usize, const X: usize>(
    start: u32,
    samples: usize,
    mut eval: impl FnMut(&[f32; Q]) -> [f32; X],
) -> Hash {
    let (mut random, mut hash) = (Random(start), Hash::new());
    for _ in 0..samples {
        let q: [f32; Q] = core::array::from_fn(|_| random.angle());
        eval(&q).iter().for_each(|&y| hash.add(y));
    }
    hash
}

/// Instructions of one evaluation of every kernel that valgrind can run, by the difference of two runs.
pub fn valgrind() -> Result<(), String> {
    if !Command::new("valgrind")
        .arg("--version")
        .output()
        .is_ok_and(|output| output.status.success())
    {
        println!("skipped: the host kernels' instructions (no valgrind here)");
        return Ok(());
    }
    let program = std::env::current_exe().map_err(|e| e.to_string())?;
    let count = |kernel: &str, times: u32| -> Result<f64, String> {
        let output = Command::new("valgrind")
            .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
            .arg(&program)
            .args(["--evaluate", kernel, &times.to_string()])
            .output()
            .map_err(|e| format!("valgrind does not start ({e}): install it"))?;
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        let collected = text
            .lines()
            .find_map(|line| line.split("Collected :").nth(1)?.trim().parse().ok());
        collected.filter(|_| output.status.success()).ok_or(text)
    };
    println!("Instructions of one evaluation, 25 -> 300 -> 4, by valgrind");
    // Valgrind has no AVX-512.
    for kernel in ["Portable", "Sse2", "Avx2"] {
        match count(kernel, 1000).and_then(|one| Ok((count(kernel, 3000)? - one) / 2000.0)) {
            Ok(instructions) => println!("  {kernel:10} {instructions:8.0}"),
            Err(error) => println!(
                "  {kernel:10} not counted: {}",
                error.lines().last().unwrap_or("no word why")
            ),
        }
    }
    Ok(())
}
