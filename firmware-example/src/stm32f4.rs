//! The layout of the flash of an STM32F405 or STM32F407 with 1 MiB.
//!
//! The last two sectors are the genome slots; the program uses the sectors before them
//! (`stm32f4/memory.x`).

use minimal_surprise_slots::slot_bytes;

/// First address of the flash.
pub const FLASH_ADDRESS: u32 = 0x0800_0000;
/// Size of the flash, in bytes.
pub const FLASH_BYTES: u32 = 1 << 20;
/// Size in bytes of each sector from 0x08020000 upwards, the chip's erase unit.
pub const SECTOR_BYTES: u32 = 128 << 10;
/// Address of slot 0.
pub const SLOT_0_ADDRESS: u32 = 0x080c_0000;
/// Address of slot 1.
pub const SLOT_1_ADDRESS: u32 = SLOT_0_ADDRESS + slot_bytes(SECTOR_BYTES as usize) as u32;
/// Size of both slots, in bytes.
pub const SLOTS_BYTES: u32 = 2 * slot_bytes(SECTOR_BYTES as usize) as u32;

const _: () = assert!(SLOT_0_ADDRESS + SLOTS_BYTES == FLASH_ADDRESS + FLASH_BYTES);
const _: () = assert!((SLOT_0_ADDRESS - FLASH_ADDRESS).is_multiple_of(SECTOR_BYTES));
