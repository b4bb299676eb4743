//! Runs on QEMU's mps2-an386 (Cortex-M4F), without ports or interrupts: counts instructions with SysTick, which under
//! `-icount shift=6` advances 1.6 ticks an instruction (64 ns at 25 MHz), measures the stack, hashes output bits, prints
//! through semihosting.
#![no_std]
#![no_main]

use core::arch::{asm, global_asm};
use core::fmt::Write;
use core::hint::black_box;

use hae::image::{JointOrder, Meta, Parameters, encode};
use hae::{Kernel, Map, quantized};

#[path = "../workload.rs"]
mod workload;
use workload::{Hash, Random};

global_asm!(
    ".section .vectors, \"a\"",
    ".word stack_top, reset",
    ".rept 14",
    ".word fault",
    ".endr",
    ".text",
    ".thumb_func",
    "reset:",
    "ldr r0, =0xe000ed88", // CPACR: the float unit on
    "mov r1, #0x00f00000",
    "str r1, [r0]",
    "dsb",
    "isb",
    "bl run",
    "b .",
    ".thumb_func",
    "fault:",
    "bl on_fault",
    "b .",
);

/// Semihosting call.
fn host(operation: usize, argument: usize) {
    // SAFETY: the debugger reads memory at the argument and returns a value in r0.
    unsafe { asm!("bkpt #0xab", inout("r0") operation => _, in("r1") argument) };
}

struct Console;

impl Write for Console {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        // SYS_WRITE0 wants a zero at the end: in pieces.
        for piece in text.as_bytes().chunks(63) {
            let mut buffer = [0u8; 64];
            buffer[..piece.len()].copy_from_slice(piece);
            host(0x04, buffer.as_ptr() as usize);
        }
        Ok(())
    }
}

fn exit(ok: bool) -> ! {
    // SYS_EXIT with ADP_Stopped_ApplicationExit or …RunTimeErrorUnknown.
    host(0x18, if ok { 0x20026 } else { 0x20023 });
    loop {}
}

#[unsafe(no_mangle)]
extern "C" fn on_fault() -> ! {
    let _ = writeln!(Console, "fault");
    exit(false)
}

#[panic_handler]
fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
    let _ = writeln!(Console, "{info}");
    exit(false)
}

/// Instructions of `work`, that of an empty closure subtracted.
#[inline(never)]
fn count(mut work: impl FnMut()) -> u32 {
    const CONTROL: *mut u32 = 0xe000_e010 as *mut u32;
    const RELOAD: *mut u32 = 0xe000_e014 as *mut u32;
    const VALUE: *mut u32 = 0xe000_e018 as *mut u32;
    // SAFETY: SysTick's registers; nobody else uses them.
    unsafe {
        RELOAD.write_volatile(0x00ff_ffff);
        VALUE.write_volatile(0);
        CONTROL.write_volatile(0b101);
        asm!("isb");
        let start = VALUE.read_volatile();
        work();
        let end = VALUE.read_volatile();
        CONTROL.write_volatile(0);
        (start.wrapping_sub(end) & 0x00ff_ffff) * 10 / 16
    }
}

/// Bytes of stack that `work` used below the caller's.
#[inline(never)]
fn stack(mut work: impl FnMut()) -> usize {
    const DEPTH: usize = 8192;
    let top: *mut u32;
    // SAFETY: reads the stack pointer; the memory below it is free.
    unsafe {
        asm!("mov {}, sp", out(reg) top);
        let bottom = top.sub(DEPTH / 4);
        for n in 0..DEPTH / 4 - 16 {
            bottom.add(n).write_volatile(0xa5a5_5a5a);
        }
        work();
        let untouched = (0..DEPTH / 4)
            .take_while(|&n| bottom.add(n).read_volatile() == 0xa5a5_5a5a)
            .count();
        DEPTH - 4 * untouched
    }
}

#[repr(C, align(64))]
struct Store([u8; 40_000]);

static mut IMAGE: Store = Store([0; 40_000]);
static mut POSES: [f32; 1_000] = [0.0; 1_000];
static mut FLOATS: [f32; 10_000] = [0.0; 10_000];

/// Counts one shape: its image in place, the kernel the map chooses and the portable one.
fn shape<const Q: usize, const H: usize, const X: usize>(samples: usize) {
    // SAFETY: one thread, no interrupts, and each call is done with them before the next.
    let (Store(bytes), floats) = unsafe { (&mut *(&raw mut IMAGE), &mut *(&raw mut FLOATS)) };
    let mut random = Random(0x9e37_79b9 ^ (Q * 1_000_000 + H * 1000 + X) as u32);
    let (w1, rest) = floats.split_at_mut(Q * H);
    let (b1, rest) = rest.split_at_mut(H);
    let (w2, rest) = rest.split_at_mut(X * H);
    let b2 = &mut rest[..X];
    workload::parameters(&mut random, w1, b1, w2, b2);
    let parameters = Parameters {
        inputs: Q,
        hidden: H,
        outputs: X,
        w1,
        b1,
        w2,
        b2,
    };
    let meta = Meta {
        model_id: 1,
        version: 1,
        joint_order: JointOrder::natural(Q),
    };
    encode(&parameters, &meta, bytes).expect("sound parameters");
    let parse = count(|| {
        let _ = black_box(hae::image::parse(black_box(bytes)));
    });
    let _ = writeln!(Console, "count f32 {Q}x{H}x{X} parse {parse}");
    let map = Map::<Q, H, X>::from_image(bytes).expect("a sound image");
    measure("f32", &map, random.0, samples);
    if map.kernel() != Kernel::Portable {
        measure(
            "f32",
            &map.portable().expect("an image in place"),
            random.0,
            samples,
        );
    }

    let seed = random.0;
    // SAFETY: as above.
    let poses = unsafe { &mut *(&raw mut POSES) };
    let poses = &mut poses[..workload::POSES * Q];
    poses.iter_mut().for_each(|q| *q = random.signed(1.6));
    quantized::encode(&parameters, poses, &meta, bytes).expect("sound parameters");
    let parse = count(|| {
        let _ = black_box(hae::image::parse(black_box(bytes)));
    });
    let _ = writeln!(Console, "count i16 {Q}x{H}x{X} parse {parse}");
    let map = Map::<Q, H, X>::from_image(bytes).expect("a sound image");
    refuses(&map);
    measure("i16", &map, seed, samples);
    if map.kernel() != Kernel::Portable {
        measure(
            "i16",
            &map.portable().expect("an image in place"),
            seed,
            samples,
        );
    }
}

/// No hidden unit is active and every product is −0: each lane sum starts at +0, so the outputs are +0 to the bit.
fn sums_of_nothing() {
    // SAFETY: as in `shape`.
    let (Store(bytes), floats) = unsafe { (&mut *(&raw mut IMAGE), &mut *(&raw mut FLOATS)) };
    let (w1, rest) = floats.split_at_mut(25 * 300);
    let (minus_one, rest) = rest.split_at_mut(4 * 300);
    let b2 = &mut rest[..4];
    w1.fill(0.0);
    minus_one.fill(-1.0);
    b2.fill(-0.0);
    let parameters = Parameters {
        inputs: 25,
        hidden: 300,
        outputs: 4,
        w1,
        b1: &minus_one[..300],
        w2: minus_one,
        b2,
    };
    let meta = Meta {
        model_id: 1,
        version: 1,
        joint_order: JointOrder::natural(25),
    };
    encode(&parameters, &meta, bytes).expect("sound parameters");
    let map = Map::<25, 300, 4>::from_image(bytes).expect("a sound image");
    for map in [map, map.portable().expect("an image in place")] {
        let outputs = map.eval(black_box(&[0.5; 25])).expect("in range");
        assert_eq!(outputs.map(f32::to_bits), [0; 4], "{:?}", map.kernel());
    }
}

/// Every input that is not an angle within ±2π is refused by name, all others are taken.
fn refuses<const Q: usize, const H: usize, const X: usize>(map: &Map<'_, Q, H, X>) {
    let limit = hae::INPUT_LIMIT;
    for input in 0..Q {
        for value in [
            f32::NAN,
            -f32::NAN,
            f32::INFINITY,
            f32::NEG_INFINITY,
            limit.next_up(),
            -limit.next_up(),
        ] {
            let mut q = [0.5; Q];
            q[input] = value;
            let error = map.eval(black_box(&q)).expect_err("a refusal");
            assert_eq!(
                (error.input, error.value.to_bits()),
                (input, value.to_bits())
            );
        }
        for value in [limit, -limit, 0.0, -0.0, 1e-45] {
            let mut q = [-0.5; Q];
            q[input] = value;
            assert!(map.eval(black_box(&q)).is_ok());
        }
    }
}

fn measure<const Q: usize, const H: usize, const X: usize>(
    element: &str,
    map: &Map<'_, Q, H, X>,
    seed: u32,
    samples: usize,
) {
    let kernel = map.kernel();
    let mut random = Random(seed);
    let mut q = [0.0; Q];
    let mut hash = Hash::new();
    let empty = count(|| {
        black_box(black_box(&q));
    });
    let (mut least, mut most) = (u32::MAX, 0);
    for n in 0..samples {
        q.iter_mut().for_each(|q| *q = random.angle());
        if n < 100 {
            let instructions = count(|| {
                black_box(evaluate(black_box(map), black_box(&q)));
            }) - empty;
            (least, most) = (least.min(instructions), most.max(instructions));
        }
        evaluate(map, &q).iter().for_each(|&y| hash.add(y));
    }
    let stack = stack(|| {
        black_box(evaluate(black_box(map), black_box(&q)));
    }) - stack(|| {});
    let _ = writeln!(
        Console,
        "count {element} {Q}x{H}x{X} {kernel:?} {most} least {least} stack {stack}"
    );
    let _ = writeln!(
        Console,
        "bits {element} {Q}x{H}x{X} {kernel:?} {samples} {:016x}",
        hash.0
    );
}

/// The call as the bridge makes it; a function of its own, so that its size and stack can be told.
#[inline(never)]
fn evaluate<const Q: usize, const H: usize, const X: usize>(
    map: &Map<'_, Q, H, X>,
    q: &[f32; Q],
) -> [f32; X] {
    map.eval(q).unwrap_or([f32::NAN; X])
}

#[unsafe(no_mangle)]
extern "C" fn run() -> ! {
    sums_of_nothing();
    shape::<25, 300, 4>(20_000);
    shape::<25, 300, 1>(2_000);
    shape::<3, 300, 2>(2_000);
    shape::<7, 33, 5>(2_000);
    shape::<1, 1, 1>(2_000);
    let _ = writeln!(Console, "done");
    exit(true)
}
