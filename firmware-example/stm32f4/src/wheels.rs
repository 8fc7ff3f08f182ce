//! Two wheels, driven by a motor driver with a speed input (PWM) and a direction input for each
//! wheel.
//!
//! The rotation of the wheels is not measured: the length of a move depends only on the constants
//! in this file, which a builder must set first.

use firmware_example::robot::Motion;
use stm32f4xx_hal::gpio::{ErasedPin, Output};
use stm32f4xx_hal::pac::TIM3;
use stm32f4xx_hal::timer::pwm::ErasedChannel;

use crate::board::{CELL_MM, CONTROL_HZ};

/// Frequency of the PWM, above the audible range.
pub(crate) const PWM_HZ: u32 = 20_000;

/// Speed of a wheel on the ground at full duty, in mm/s.
const FULL_MM_PER_S: f32 = 130.0;
/// Distance between the two wheels, in mm.
const TRACK_MM: f32 = 53.0;

/// Duty of a move of one cell ahead, in 1/1000. A move takes one control period.
const AHEAD: i16 = permille(CELL_MM * CONTROL_HZ as f32);
/// Duty of a quarter turn on the spot, in 1/1000: each wheel travels a quarter of a circle whose
/// diameter is the track.
const TURN: i16 = permille(core::f32::consts::FRAC_PI_4 * TRACK_MM * CONTROL_HZ as f32);

/// Returns the duty for a speed in mm/s, in 1/1000.
const fn permille(mm_per_s: f32) -> i16 {
    let duty = 1000.0 * mm_per_s / FULL_MM_PER_S;
    assert!(
        duty > 0.0 && duty <= 1000.0,
        "the wheels cannot turn that fast"
    );
    duty as i16
}

/// One wheel.
pub(crate) struct Wheel {
    /// PWM channel of the wheel.
    pub(crate) speed: ErasedChannel<TIM3>,
    /// Output that is high if the wheel turns forwards.
    pub(crate) ahead: ErasedPin<Output>,
}

impl Wheel {
    fn turn(&mut self, permille: i16) {
        self.ahead.set_state((permille >= 0).into());
        let most = u32::from(self.speed.get_max_duty());
        let duty = most * u32::from(permille.unsigned_abs()) / 1000;
        self.speed.set_duty(duty as u16);
        self.speed.enable();
    }
}

/// Both wheels.
pub(crate) struct Wheels {
    pub(crate) left: Wheel,
    pub(crate) right: Wheel,
}

impl Wheels {
    pub(crate) fn drive(&mut self, motion: Motion) {
        let (left, right) = match motion {
            Motion::Stop => (0, 0),
            Motion::Ahead => (AHEAD, AHEAD),
            Motion::Left => (-TURN, TURN),
            Motion::Right => (TURN, -TURN),
        };
        self.left.turn(left);
        self.right.turn(right);
    }
}
