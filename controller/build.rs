//! Detects targets with SMLAD. Stable Rust cannot query Arm's DSP extension, so detection uses the
//! target's name; all other targets use the portable sums.

use std::env;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rustc-check-cfg=cfg(has_smlad)");
    if env::var("TARGET").is_ok_and(|target| target.starts_with("thumbv7em-")) {
        println!("cargo:rustc-cfg=has_smlad");
    }
}
