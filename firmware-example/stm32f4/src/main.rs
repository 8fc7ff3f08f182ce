//! The robot, on an STM32F405 or STM32F407 with 1 MiB of flash.
//!
//! **Not run on hardware yet.** The firmware builds, and the tests run its loop, its slots and its
//! line in an emulator; the code added by this package has only been built and checked against the
//! HAL's sources. `docs/robot.md` describes the wiring and the first tests.
//!
//! ```text
//! cd firmware-example/stm32f4
//! cargo run --release                # with a debug probe and probe-rs
//! ```
#![no_std]
#![no_main]

mod board;
mod faults;
mod flash;
mod interrupts;
mod wheels;

use board::{CLOCK_HZ, CONTROL_HZ, Stm32F4};
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::entry;
use firmware_example::faults::guard_stack;
use firmware_example::robot::Robot;
use flash::SlotFlash;
use stm32f4xx_hal::pac;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Config;
use stm32f4xx_hal::watchdog::IndependentWatchdog;
use wheels::{PWM_HZ, Wheel, Wheels};

/// Speed of both serial lines, in bits per second; 8 data bits, no parity, 1 stop bit.
const BAUD: u32 = 115_200;

/// The watchdog's time-out at its nominal clock. The time-out must exceed the time to erase a
/// sector (at most 4 s) even at the fastest clock: at 47 kHz instead of 32 kHz, it is 5.4 s.
const WATCHDOG_MS: u32 = 8_000;

/// SysTick's reload value; SysTick counts every eighth tick of the processor's clock.
const SYSTICK_RELOAD: u32 = CLOCK_HZ / 8 / CONTROL_HZ - 1;
const _: () = assert!(SYSTICK_RELOAD < 1 << 24, "SysTick has 24 bits");

#[entry]
fn main() -> ! {
    guard_stack();
    let peripherals = (cortex_m::Peripherals::take(), pac::Peripherals::take());
    let (Some(mut processor), Some(chip)) = peripherals else {
        faults::stand()
    };
    // Uses the chip's internal oscillator: boards have various crystals, or none.
    let mut rcc = chip.RCC.freeze(Config::hsi().sysclk(CLOCK_HZ.Hz()));
    let restarted_by_watchdog = rcc.csr().read().wdgrstf().bit_is_set();
    rcc.csr().modify(|_, w| w.rmvf().set_bit());

    // PA2, PA3: the line to the host. PB11: the range-and-bearing module. PC6, PC7: speed of the
    // left and right wheel; PC8, PC9: high if the wheel turns forwards.
    let a = chip.GPIOA.split(&mut rcc);
    let b = chip.GPIOB.split(&mut rcc);
    let c = chip.GPIOC.split(&mut rcc);

    let (_, (left, right, ..)) = chip.TIM3.pwm_hz(PWM_HZ.Hz(), &mut rcc);
    interrupts::take_wheels(Wheels {
        left: Wheel {
            speed: left.with(c.pc6).erase(),
            ahead: c.pc8.into_push_pull_output().erase(),
        },
        right: Wheel {
            speed: right.with(c.pc7).erase(),
            ahead: c.pc9.into_push_pull_output().erase(),
        },
    });

    let line = chip.USART2.serial((a.pa2, a.pa3), BAUD.bps(), &mut rcc);
    let module = chip.USART3.rx(b.pb11, BAUD.bps(), &mut rcc);
    let (Ok(line), Ok(module)) = (line, module) else {
        defmt::error!("the serial lines cannot have {=u32} baud", BAUD);
        faults::stand()
    };
    let (send, receive) = line.split();
    interrupts::listen(receive, module);

    let systick = &mut processor.SYST;
    systick.set_clock_source(SystClkSource::External);
    systick.set_reload(SYSTICK_RELOAD);
    systick.clear_current();
    systick.enable_interrupt();
    systick.enable_counter();

    // Allows a debugger to read memory while the processor sleeps, and to halt the processor for
    // any length of time.
    chip.DBGMCU.cr().modify(|_, w| w.dbg_sleep().set_bit());
    let mut watchdog = IndependentWatchdog::new(chip.IWDG);
    watchdog.stop_on_debug(&chip.DBGMCU, true);
    watchdog.start(WATCHDOG_MS.millis());

    let board = Stm32F4::new(send, watchdog, restarted_by_watchdog);
    match Robot::start(board, SlotFlash::new(chip.FLASH), 0) {
        Ok(mut robot) => robot.run(),
        Err(error) => {
            defmt::error!("{}", defmt::Debug2Format(&error));
            faults::stand()
        }
    }
}
