//! Links only if no call into the map can panic, the check of an image included.
#![no_std]
#![no_main]

use hae::{Map, image};

#[path = "../never_panics.rs"]
mod never_panics;

/// Checks, views and evaluates; returns something that depends on all of it.
///
/// # Safety
/// The pointers hold `len` bytes and 25 floats.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn reset(
    bytes: *const u8,
    len: usize,
    q: *const [f32; 25],
    y: *mut [f32; 4],
) -> u32 {
    // SAFETY: the caller's promise.
    let (bytes, q, y) = unsafe { (core::slice::from_raw_parts(bytes, len), &*q, &mut *y) };
    let Ok(checked) = image::parse(bytes) else {
        return 1;
    };
    let Some(map) = Map::<25, 300, 4>::view(bytes, &checked) else {
        return 2;
    };
    let Ok(first) = map.eval(q) else { return 3 };
    let Some(Ok(second)) = map.portable().map(|map| map.eval(q)) else {
        return 4;
    };
    for (y, (a, b)) in y.iter_mut().zip(first.iter().zip(&second)) {
        *y = a - b;
    }
    0
}
