//! Nothing but a view of a checked image and an evaluation, as the bridge's loop does them: what the map costs a chip in
//! code and static memory. Never run; `map-bench --chip` reads its symbols. It links only if no panic can be reached.
#![no_std]
#![no_main]

use hae::Map;
use hae::image::Checked;

#[path = "../never_panics.rs"]
mod never_panics;

/// The linker's start: an image that was checked before, either kind, at `bytes`; true if there are outputs in `y`.
///
/// # Safety
/// `bytes` points to `len` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn reset(
    bytes: *const u8,
    len: usize,
    checked: &Checked,
    q: &[f32; 25],
    y: &mut [f32; 4],
) -> bool {
    // SAFETY: the caller's promise.
    let bytes = unsafe { core::slice::from_raw_parts(bytes, len) };
    let map = Map::<25, 300, 4>::view(bytes, checked);
    let Some(Ok(outputs)) = map.map(|map| map.eval(q)) else {
        return false;
    };
    *y = outputs;
    true
}
