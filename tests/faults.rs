//! Every fault stops the wheels first. QEMU's trace shows the writes to the wheels' registers.

use std::fs;
use tests::firmware::{self, Faulted, fault_on_mps2, fault_on_stm32f4};
use tests::tools::require;

/// A fault, the emulated robot's log of it, and QEMU's report of it for the STM32F405.
const FAULTS: [(&str, &str, &str); 8] = [
    ("panic", "on purpose", ""),
    (
        "undefined-instruction",
        "hard fault at",
        "[Undefined Instruction]",
    ),
    ("write-below-ram", "hard fault at", "[Data Abort]"),
    (
        "jump-to-no-program",
        "hard fault at 0xe0000000",
        "[Prefetch Abort]",
    ),
    (
        "non-maskable-interrupt",
        "non-maskable interrupt at",
        "taking pending nonsecure exception 2",
    ),
    (
        "unexpected-interrupt",
        "unexpected exception 36 at",
        "taking pending nonsecure exception 36",
    ),
    ("deep-recursion", "stack overflow", "STKERR"),
    ("large-frames", "stack overflow", "STKERR"),
];

#[test]
fn the_emulated_robot_stops_its_wheels_first_in_every_fault() {
    let Some(firmware) = require(firmware::build()) else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    for (fault, says, _) in FAULTS {
        let trace = folder.path().join(fault);
        let Some(faulted) = require(fault_on_mps2(&firmware.elf("faults"), fault, &trace)) else {
            return;
        };
        let Faulted { wheels, log } = faulted;
        assert!(log.contains(says), "{fault}: {log}");
        // First both lights are on, then none.
        let [on, off] = &wheels[..] else {
            panic!("{fault}: {wheels:?}");
        };
        assert!(on.contains("data 0x3 "), "{fault}: {wheels:?}");
        assert!(off.contains("data 0x0 "), "{fault}: {wheels:?}");
    }
}

#[test]
fn the_stm32f4_stops_its_wheels_first_in_every_fault() {
    let Some(linked) = require(firmware::link("robot-stm32f4", "faults-stm32f4")) else {
        return;
    };
    assert!(linked.success, "{}", linked.messages);
    let folder = tempfile::tempdir().unwrap();
    for (fault, _, says) in FAULTS {
        let trace = folder.path().join(fault);
        let elf = firmware::elf("faults-stm32f4");
        let Some(faulted) = require(fault_on_stm32f4(&elf, fault, &trace)) else {
            return;
        };
        let Faulted { wheels, log } = faulted;
        // PC6 to PC9 are set high, then low, then become outputs controlled by the program instead
        // of the timer.
        for (written, place) in wheels.iter().zip([
            "offset 0x018, value 0x000003c0)",
            "offset 0x018, value 0x03c00000)",
            "offset 0x000, value 0x00055000)",
        ]) {
            assert!(written.contains(place), "{fault}: {log}");
        }
        assert!(wheels.len() >= 3, "{fault}: {log}");
        assert!(log.contains(says), "{fault}: {log}");
    }
}

/// The stack is at the bottom of RAM, and [`firmware_example::faults`] makes accesses below RAM
/// fail.
#[test]
fn the_stack_of_both_boards_is_at_the_start_of_ram() {
    for name in ["memory.x", "stm32f4/memory.x"] {
        let text = fs::read_to_string(firmware::directory().join(name)).unwrap();
        assert!(text.contains("STACK : ORIGIN = 0x20000000,"), "{name}");
        let end = "_stack_end = ORIGIN(STACK);";
        let start = "_stack_start = ORIGIN(STACK) + LENGTH(STACK);";
        assert!(text.contains(end) && text.contains(start), "{name}");
    }
}
