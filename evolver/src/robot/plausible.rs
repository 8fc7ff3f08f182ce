//! Checks that the values reported by a robot are possible, before they are used.
//!
//! Some values are not checked, since nothing is computed from them: the write count in the reply
//! to a commit, because the robot is then asked for the genome in use; the counters of the line,
//! which can have any value and are shown unchanged; and the expected offset in the rejection of a
//! chunk, which is only shown in the message.

use minimal_surprise_controller::codec::CONTAINER_BYTES_MAX;
use minimal_surprise_controller::{KERNEL_ID, Surprise};
use minimal_surprise_link::{FIRMWARE_BYTES_MAX, GenomeInUse, Identity, Report, VERSION_BYTES_MAX};

/// Maximum number of bits sensed in a step: the number of bits in a reading.
const BITS_A_STEP_MAX: u64 = u16::BITS as u64;
/// Number of bytes in the CRC; every container is longer.
const CRC_BYTES: u16 = 4;

/// Rejects an impossible identity, with the reason.
pub(super) fn check_identity(identity: &Identity<'_>) -> Result<(), String> {
    for (what, text, most) in [
        ("firmware name", identity.firmware, FIRMWARE_BYTES_MAX),
        ("firmware version", identity.version, VERSION_BYTES_MAX),
    ] {
        if text.len() > most {
            let found = text.len();
            return Err(format!(
                "{what}: {found} bytes, but at most {most} are allowed"
            ));
        }
    }
    let GenomeInUse::Slot {
        slot,
        write_count,
        length,
        ..
    } = identity.genome
    else {
        return Ok(());
    };
    // The maximum genome length of a different kernel is unknown.
    let most = match identity.kernel {
        KERNEL_ID => CONTAINER_BYTES_MAX as u16,
        _ => u16::MAX,
    };
    if slot > 1 {
        Err(format!("slot: {slot}, but a robot has slots 0 and 1"))
    } else if write_count == 0 {
        Err("write count: 0, but the first genome is number 1".to_owned())
    } else if !(CRC_BYTES + 1..=most).contains(&length) {
        Err(format!("length of a genome: {length} bytes"))
    } else {
        Ok(())
    }
}

/// Rejects an impossible surprise, with the reason; `steps` is the number of steps, if known.
pub(super) fn check_surprise(surprise: Surprise, steps: Option<u64>) -> Result<(), String> {
    let Surprise {
        mispredicted_bits: mispredicted,
        seen_bits: seen,
    } = surprise;
    if mispredicted > seen {
        return Err(format!(
            "counts: {mispredicted} of {seen} bits mispredicted"
        ));
    }
    match steps {
        Some(steps) if seen > steps.saturating_mul(BITS_A_STEP_MAX) => {
            Err(format!("counts: {seen} bits seen in {steps} steps"))
        }
        _ => Ok(()),
    }
}

/// Rejects an impossible report, with the reason.
pub(super) fn check_report(report: &Report) -> Result<(), String> {
    let counts = [report.straight, report.turned_left, report.turned_right];
    // A counter at its maximum may have missed steps.
    let steps = (!counts.contains(&u32::MAX)).then(|| counts.map(u64::from).iter().sum());
    check_surprise(report.surprise, steps)?;
    if report.held_back > report.straight {
        let Report {
            held_back,
            straight,
            ..
        } = report;
        return Err(format!(
            "counts: {held_back} of {straight} steps ahead held back"
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn surprise(mispredicted_bits: u64, seen_bits: u64) -> Surprise {
        Surprise {
            mispredicted_bits,
            seen_bits,
        }
    }

    #[test]
    fn bits_mispredicted_cannot_exceed_bits_seen_nor_those_the_bits_sensed() {
        for possible in [(0, 0), (16, 16), (0, 48)] {
            assert_eq!(
                check_surprise(surprise(possible.0, possible.1), Some(3)),
                Ok(())
            );
        }
        for impossible in [(1, 0), (u64::MAX, 3), (0, 49), (u64::MAX, u64::MAX)] {
            let impossible = surprise(impossible.0, impossible.1);
            assert!(
                check_surprise(impossible, Some(3)).is_err(),
                "{impossible:?}"
            );
        }
        assert_eq!(check_surprise(surprise(0, u64::MAX), None), Ok(()));
    }

    #[test]
    fn a_report_of_counters_that_have_stopped_is_possible() {
        let mut report = Report {
            surprise: surprise(0, u64::from(u32::MAX) * 28),
            straight: u32::MAX - 1,
            held_back: u32::MAX - 1,
            ..Report::default()
        };
        assert!(check_report(&report).is_err());
        report.straight = u32::MAX;
        assert_eq!(check_report(&report), Ok(()));
        report.straight = 7;
        report.surprise = surprise(0, 7);
        assert!(check_report(&report).is_err());
    }

    #[test]
    fn an_identity_has_known_slots_and_lengths() {
        let identity = |slot, write_count, length| Identity {
            firmware: "robot",
            version: "1",
            kernel: KERNEL_ID,
            genome: GenomeInUse::Slot {
                slot,
                write_count,
                length,
                crc: 0,
            },
            running: false,
            faults: minimal_surprise_link::Faults::NONE,
        };
        assert_eq!(check_identity(&identity(1, 1, 100)), Ok(()));
        for impossible in [
            identity(2, 1, 100),
            identity(0, 0, 100),
            identity(0, 1, 4),
            identity(0, 1, u16::MAX),
            Identity {
                firmware: "a name that no robot may have on a line",
                ..identity(0, 1, 100)
            },
        ] {
            assert!(check_identity(&impossible).is_err(), "{impossible:?}");
        }
    }
}
