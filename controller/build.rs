//! Says whether the target has SMLAD: stable Rust does not let a program ask for Arm's DSP
//! extension, so it goes by the target's name. By another name the portable sums are used.

use std::env;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rustc-check-cfg=cfg(has_smlad)");
    if env::var("TARGET").is_ok_and(|target| target.starts_with("thumbv7em-")) {
        println!("cargo:rustc-cfg=has_smlad");
    }
}
