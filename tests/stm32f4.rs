//! The program, the slots and the export for debug probes agree on the layout of the chip's flash.

use firmware_example::stm32f4::{
    FLASH_ADDRESS, FLASH_BYTES, SECTOR_BYTES, SLOT_0_ADDRESS, SLOT_1_ADDRESS, SLOTS_BYTES,
};
use std::fs;
use tests::firmware;

/// Sizes of the sectors of a chip with 1 MiB, in KiB (RM0090, table 5).
const SECTORS_KIB: [u32; 12] = [16, 16, 16, 16, 64, 128, 128, 128, 128, 128, 128, 128];

#[test]
fn each_slot_is_one_of_the_last_two_sectors() {
    assert_eq!(SECTORS_KIB.iter().sum::<u32>() << 10, FLASH_BYTES);
    let from = |sector| FLASH_ADDRESS + (SECTORS_KIB[..sector].iter().sum::<u32>() << 10);
    assert_eq!([SLOT_0_ADDRESS, SLOT_1_ADDRESS], [from(10), from(11)]);
    assert_eq!(SLOTS_BYTES, 2 * SECTOR_BYTES);
}

#[test]
fn the_program_ends_where_the_slots_begin() {
    let path = firmware::directory().join("stm32f4/memory.x");
    let text = fs::read_to_string(&path).unwrap();
    let (_, flash) = text.split_once("FLASH : ORIGIN = 0x").unwrap();
    let (origin, length) = flash.split_once(", LENGTH = ").unwrap();
    let (kib, _) = length.split_once("K\n").unwrap();
    let origin = u32::from_str_radix(origin, 16).unwrap();
    let end = origin + (kib.parse::<u32>().unwrap() << 10);
    assert_eq!((origin, end), (FLASH_ADDRESS, SLOT_0_ADDRESS));
}

#[test]
fn the_documentation_of_the_robot_names_these_addresses() {
    let page = include_str!("../docs/robot.md");
    for (what, address) in [
        ("program", FLASH_ADDRESS),
        ("slot 0", SLOT_0_ADDRESS),
        ("slot 1", SLOT_1_ADDRESS),
    ] {
        let row = |line: &&str| line.starts_with(&format!("| `{address:#010x}` |"));
        let row = page.lines().find(row);
        assert!(row.is_some_and(|row| row.contains(what)), "{what}: {row:?}");
    }
}
