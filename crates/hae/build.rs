//! Tells the crate whether it is built for a Cortex-M4F or M7: stable Rust has no `cfg` that shows the float unit.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rustc-check-cfg=cfg(cortex_m4f)");
    if std::env::var("TARGET").as_deref() == Ok("thumbv7em-none-eabihf") {
        println!("cargo:rustc-cfg=cortex_m4f");
    }
}
