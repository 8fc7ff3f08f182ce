//! A controller with its activation tables, and the code that loads its genome from the slots.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use minimal_surprise_controller::{SensorBits, State};
use minimal_surprise_slots::{Buffer, Slots};
use probe::{AnyFlash, read, use_memory, write};

#[entry]
fn main() -> ! {
    use_memory();
    let mut room = Buffer::new();
    let Ok(mut slots) = Slots::open(AnyFlash, 0, &mut room) else {
        loop {
            read();
        }
    };
    let controller = slots.in_use(&mut room).controller();
    let mut state = State::new(&controller);
    loop {
        let decision = controller.step(&mut state, SensorBits::new(read() as u16));
        write(decision.action as u32);
        write(decision.turn as u32);
        write(decision.prediction.bits().into());
    }
}
