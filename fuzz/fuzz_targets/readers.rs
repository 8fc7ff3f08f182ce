//! Runs the target of `tests/fuzz/targets.rs` named by `FUZZ_TARGET`, with coverage guidance.
#![no_main]

#[path = "../../tests/fuzz/targets.rs"]
mod targets;

use libfuzzer_sys::{Corpus, fuzz_target};
use std::sync::LazyLock;
use targets::{TARGETS, Target, check};

static TARGET: LazyLock<Target> = LazyLock::new(|| {
    let name = std::env::var("FUZZ_TARGET").unwrap_or_default();
    let target = TARGETS.into_iter().find(|target| target.0 == name);
    target.unwrap_or_else(|| panic!("FUZZ_TARGET is one of {:?}", TARGETS.map(|t| t.0)))
});

fuzz_target!(|bytes: &[u8]| -> Corpus {
    check(*TARGET, bytes);
    Corpus::Keep
});
