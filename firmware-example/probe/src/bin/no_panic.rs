//! The whole robot: controller, genome loading, slots, link and control loop. Must link.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use firmware_example::robot::Robot;
use probe::{AnyBoard, AnyFlash, read};

#[entry]
fn main() -> ! {
    match Robot::start(AnyBoard, AnyFlash, read()) {
        Ok(mut robot) => robot.run(),
        Err(_) => loop {
            read();
        },
    }
}
