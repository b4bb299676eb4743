//! No kernel reads or writes past its buffers: each buffer ends at, or starts at, a page that cannot be touched.
#![cfg(all(unix, not(miri)))]

mod common;

use common::{Network, rng, vector};
use hae::{Kernel, Map, packed_len, quantized};

use pages::Pages;

/// Memory of whole pages between two pages without access.
mod pages {
    use rustix::mm::{MapFlags, MprotectFlags, ProtFlags, mmap_anonymous, mprotect, munmap};

    pub struct Pages {
        base: *mut u8,
        len: usize,
    }

    const PAGE: usize = 4096;

    impl Pages {
        pub fn new(len: usize) -> Self {
            let len = len.next_multiple_of(PAGE);
            // SAFETY: a new mapping that nothing else knows; the two outer pages are never used.
            let base = unsafe {
                let whole = len + 2 * PAGE;
                let base = mmap_anonymous(
                    core::ptr::null_mut(),
                    whole,
                    ProtFlags::READ | ProtFlags::WRITE,
                    MapFlags::PRIVATE,
                )
                .expect("memory");
                mprotect(base, PAGE, MprotectFlags::empty()).expect("a guard page");
                mprotect(base.byte_add(PAGE + len), PAGE, MprotectFlags::empty())
                    .expect("a guard page");
                base.cast::<u8>()
            };
            Self { base, len }
        }

        /// The last `len` bytes before the upper guard page.
        pub fn at_end(&mut self, len: usize) -> &mut [u8] {
            assert!(len <= self.len);
            // SAFETY: inside the mapping, which lives as long as the borrow.
            unsafe { core::slice::from_raw_parts_mut(self.base.add(PAGE + self.len - len), len) }
        }

        /// The first `len` bytes after the lower guard page.
        pub fn at_start(&mut self, len: usize) -> &mut [u8] {
            assert!(len <= self.len);
            // SAFETY: as above.
            unsafe { core::slice::from_raw_parts_mut(self.base.add(PAGE), len) }
        }
    }

    impl Drop for Pages {
        fn drop(&mut self) {
            // SAFETY: the mapping made in `new`.
            unsafe { munmap(self.base.cast(), self.len + 2 * PAGE).expect("the mapping") };
        }
    }
}

fn check<const Q: usize, const H: usize, const X: usize>(seed: u64) {
    let network = Network::random(seed, [Q, H, X]);
    let image = network.image();
    let poses = vector(&mut rng(seed), 10 * Q, -1.5, 1.5);
    let mut integer = vec![0; quantized::encoded_len(Q, H, X)];
    quantized::encode(
        &network.parameters(),
        &poses,
        &common::meta(Q),
        &mut integer,
    )
    .expect("a sound network");
    let q: [f32; Q] = poses[..Q].try_into().expect("Q values");
    let expected = Map::<Q, H, X>::from_image(&image)
        .expect("a sound image")
        .eval(&q);

    let (mut of_image, mut of_integer) = (Pages::new(image.len()), Pages::new(integer.len()));
    let (mut of_q, mut of_buffer) = (Pages::new(4 * Q), Pages::new(4 * packed_len(Q, H, X) + 64));
    for at_end in [true, false] {
        let place = |pages: &'_ mut Pages, bytes: &[u8]| -> *mut [u8] {
            let slice = if at_end {
                pages.at_end(bytes.len())
            } else {
                pages.at_start(bytes.len())
            };
            slice.copy_from_slice(bytes);
            slice
        };
        // SAFETY: the slices live in mappings that outlive this block and are used nowhere else.
        let (image, integer) = unsafe {
            (
                &*place(&mut of_image, &image),
                &*place(&mut of_integer, &integer),
            )
        };
        let values = place(&mut of_q, bytemuck::cast_slice(&q));
        // SAFETY: as above; Q floats were just written there, at a multiple of four bytes.
        let q = unsafe { &*values.cast::<[f32; Q]>() };
        let map = Map::<Q, H, X>::from_image(image).expect("a sound image");
        assert_eq!(map.eval(q), expected);
        let small = Map::<Q, H, X>::from_image(integer).expect("a sound image");
        assert!(small.eval(q).is_ok());
        for kernel in Kernel::ALL {
            // The buffer's last value is the last before the page, as far as 64-byte alignment allows.
            let len = (4 * packed_len(Q, H, X)).next_multiple_of(64);
            let buffer = if at_end {
                of_buffer.at_end(len)
            } else {
                of_buffer.at_start(len)
            };
            if let Ok(map) = map.repack_for(kernel, bytemuck::cast_slice_mut(buffer)) {
                assert_eq!(map.eval(q), expected, "{kernel:?}");
            }
        }
    }
}

#[test]
fn no_kernel_leaves_its_buffers() {
    check::<25, 300, 4>(1);
    check::<25, 300, 1>(2);
    check::<3, 300, 2>(3);
    check::<7, 33, 5>(4);
    check::<1, 1, 1>(5);
    check::<25, 304, 16>(6);
}
