//! The robot, on the board of QEMU's `mps2-an386`.
//!
//! ```text
//! cargo build --release --bin robot
//! qemu-system-arm -cpu cortex-m4 -machine mps2-an386 -nographic -monitor none -serial pty \
//!     -semihosting-config enable=on,target=native -kernel target/thumbv7em-none-eabihf/release/robot
//! ```
//!
//! QEMU's first line of output names the serial port. The rest is the robot's `defmt` log. Genomes
//! are stored in `flash.bin` in the directory where QEMU is started; delete the file to reset the
//! robot to its factory state.
#![no_std]
#![no_main]

use cortex_m::Peripherals;
use cortex_m_rt::entry;
use firmware_example::emulator;
use firmware_example::mps2::{FileFlash, Mps2};
use firmware_example::robot::Robot;

#[entry]
fn main() -> ! {
    let peripherals = Peripherals::take().expect("first call");
    let flash = match FileFlash::open() {
        Ok(flash) => flash,
        Err(error) => {
            defmt::error!("flash.bin: {}", error);
            emulator::fail()
        }
    };
    match Robot::start(Mps2::new(peripherals.SYST), flash, 0) {
        Ok(mut robot) => robot.run(),
        Err(error) => {
            defmt::error!("{}", defmt::Debug2Format(&error));
            emulator::fail()
        }
    }
}
