//! Fault handling: in every fault, the wheels stop first.
//!
//! A fault may occur while the program holds a lock, or because the stack is full. Therefore, the
//! handlers of [`fault_handlers`](crate::fault_handlers) take no lock, and use neither stack nor
//! variables until they have written the few registers of the board's [`WheelsOff`]. Then they
//! reset the stack pointer to the top of the stack, whose contents are no longer needed, and report
//! the fault.
//!
//! **Stack guard.** `memory.x` places the stack below all variables, at the start of RAM, and
//! [`guard_stack`] forbids access below RAM. Therefore, a stack overflow causes a fault
//! immediately, and no variable is overwritten.
//!
//! Uses `unsafe` to access registers by address and for handlers written in assembly.
#![allow(unsafe_code)]

use core::{fmt, ptr};

/// The processor's register that holds the number of the current exception.
const INTERRUPT_STATE: *const u32 = 0xe000_ed04 as *const u32;
/// The bits of [`INTERRUPT_STATE`] that hold the number.
const EXCEPTION: u32 = 0x1ff;
/// Number of the hard fault exception.
const HARD_FAULT: u32 = 3;
/// Number of the non-maskable interrupt.
const NON_MASKABLE: u32 = 2;
/// Offset from the stack pointer at which an exception stores the address of the interrupted
/// instruction.
const PC_AT: u32 = 24;

/// Registers of the memory protection unit.
mod mpu {
    pub(super) const CONTROL: *mut u32 = 0xe000_ed94 as *mut u32;
    /// Protection on, except during faults; default access to addresses outside all regions.
    pub(super) const CONTROL_ON: u32 = 0b101;
    pub(super) const REGION: *mut u32 = 0xe000_ed98 as *mut u32;
    pub(super) const START: *mut u32 = 0xe000_ed9c as *mut u32;
    pub(super) const ATTRIBUTES: *mut u32 = 0xe000_eda0 as *mut u32;
    /// An enabled region of 2¹⁵ bytes, without access and execution.
    pub(super) const FORBIDDEN_32_KIB: u32 = 1 << 28 | 14 << 1 | 1;
}

/// Start of the 32 KiB below RAM; every function's frame is smaller than that.
const BELOW_RAM: u32 = 0x1fff_8000;

/// Forbids access to the addresses below RAM, which begins at 0x20000000. Without this guard, the
/// effect of writes to unmapped addresses depends on the chip; QEMU's `mps2-an386` ignores such
/// writes.
pub fn guard_stack() {
    // SAFETY: accesses registers of the processor. No variable is in the region.
    unsafe {
        ptr::write_volatile(mpu::REGION, 0);
        ptr::write_volatile(mpu::START, BELOW_RAM);
        ptr::write_volatile(mpu::ATTRIBUTES, mpu::FORBIDDEN_32_KIB);
        ptr::write_volatile(mpu::CONTROL, mpu::CONTROL_ON);
        core::arch::asm!("dsb", "isb");
    }
}

/// List of register writes that stop the wheels in any state of the program.
#[derive(Debug)]
#[repr(C)]
pub struct WheelsOff<const N: usize> {
    /// Addresses and values.
    writes: [[u32; 2]; N],
    /// End marker of the list, for the handlers.
    end: u32,
}

impl<const N: usize> WheelsOff<N> {
    /// Creates the list from pairs of a register address and the value to write to it, in order.
    ///
    /// # Safety
    /// The addresses are registers of the chip, not 0, and the values may be written at any time.
    #[must_use]
    pub const unsafe fn new(writes: [[u32; 2]; N]) -> Self {
        Self { writes, end: 0 }
    }

    /// Stops the wheels.
    pub fn write(&self) {
        for [address, value] in self.writes {
            // SAFETY: guaranteed by the caller of `new`.
            unsafe { ptr::write_volatile(address as *mut u32, value) };
        }
    }
}

/// A fault after which the program cannot continue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The stack is full.
    StackOverflow,
    /// A hard fault at this address.
    HardFault(u32),
    /// The non-maskable interrupt at this address.
    NonMaskable(u32),
    /// An exception or interrupt that has this number and no handler, at this address.
    Unexpected(u32, u32),
}

impl Fault {
    /// Determines the current fault from the stack pointer at the start of its handler.
    #[must_use]
    pub fn from_stack_pointer(stack_pointer: u32) -> Self {
        unsafe extern "C" {
            static _stack_start: u32;
            static _stack_end: u32;
        }
        let stack = (&raw const _stack_end) as u32..(&raw const _stack_start) as u32 - PC_AT;
        if !stack.contains(&stack_pointer) {
            return Self::StackOverflow;
        }
        // SAFETY: reads registers that the exception has saved on the stack, and a register of the
        // processor.
        let (pc, exception) = unsafe {
            let pc = ptr::read_volatile((stack_pointer + PC_AT) as *const u32);
            (pc, ptr::read_volatile(INTERRUPT_STATE) & EXCEPTION)
        };
        match exception {
            HARD_FAULT => Self::HardFault(pc),
            NON_MASKABLE => Self::NonMaskable(pc),
            exception => Self::Unexpected(exception, pc),
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::StackOverflow => write!(f, "stack overflow"),
            Self::HardFault(pc) => write!(f, "hard fault at {pc:#010x}"),
            Self::NonMaskable(pc) => write!(f, "non-maskable interrupt at {pc:#010x}"),
            Self::Unexpected(exception, pc) => {
                write!(f, "unexpected exception {exception} at {pc:#010x}")
            }
        }
    }
}

/// Defines the handlers of hard faults, to which other faults escalate, and of all exceptions and
/// interrupts without a separate handler. The handlers write a static [`WheelsOff`] and then call a
/// `fn(Fault) -> !`.
#[macro_export]
macro_rules! fault_handlers {
    ($wheels_off:ident, $then:path) => {
        extern "C" fn fault(stack_pointer: u32) -> ! {
            $then($crate::faults::Fault::from_stack_pointer(stack_pointer))
        }

        ::core::arch::global_asm!(
            ".pushsection .text.fault_handlers, \"ax\", %progbits",
            ".balign 4",
            ".global HardFault",
            ".type HardFault, %function",
            ".thumb_func",
            "HardFault:",
            ".global DefaultHandler",
            ".type DefaultHandler, %function",
            ".thumb_func",
            "DefaultHandler:",
            "cpsid i",
            "movw r0, #:lower16:{wheels_off}",
            "movt r0, #:upper16:{wheels_off}",
            "0:",
            "ldr r1, [r0], #4",
            "cbz r1, 1f",
            "ldr r2, [r0], #4",
            "str r2, [r1]",
            "b 0b",
            "1:",
            "dsb",
            // Cancels the lazy saving of floating-point registers to a stack that may be full.
            "movw r1, #0xef34",
            "movt r1, #0xe000",
            "ldr r2, [r1]",
            "bic r2, r2, #1",
            "str r2, [r1]",
            "mov r0, sp",
            "movw r1, #:lower16:_stack_start",
            "movt r1, #:upper16:_stack_start",
            "mov sp, r1",
            "b {fault}",
            ".popsection",
            wheels_off = sym $wheels_off,
            fault = sym fault,
        );
    };
}
