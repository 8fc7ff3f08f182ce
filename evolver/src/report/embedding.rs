//! Genomes as source code that is linked into firmware, and as images that are written to a chip.

use crate::robot::length_and_crc;
use ihex::{Record, create_object_file_representation};
use minimal_surprise_evolution::genome_file::GenomeFile;
use minimal_surprise_evolution::settings::describe;
use minimal_surprise_evolution::text::{identifier, shell_path, shell_word};
use minimal_surprise_slots::Header;
use std::path::Path;

/// Number of bytes per line, in source code and Intel HEX.
const LINE_BYTES: usize = 16;

/// Returns a genome's name in source code, from its file or run and its CRC, so that one program
/// can contain several genomes.
#[must_use]
pub fn symbol(name: &str, container: &[u8]) -> String {
    let crc = length_and_crc(container).map_or(0, |(_, crc)| crc);
    format!("minimal_surprise_genome_{}_{crc:08x}", identifier(name)).replace("__", "_")
}

/// Generates a C header that contains the container as an array with this name.
#[must_use]
pub fn c_header(genome: &GenomeFile, symbol: &str) -> String {
    let container = genome.bytes();
    // Keep upper and lower case, since names that differ only in case are different.
    let guard = format!("{symbol}_INCLUDED");
    format!(
        "/* A minimal-surprise genome: {}. */\n\
         #ifndef {guard}\n\
         #define {guard}\n\n\
         #include <stdint.h>\n\n\
         static const uint8_t {symbol}[{}] = {{\n{}}};\n\n\
         #endif\n",
        describe(genome.topology()),
        container.len(),
        hex_lines(container)
    )
}

/// Generates Rust source that contains the container as a static with this name.
#[must_use]
pub fn rust_source(genome: &GenomeFile, symbol: &str) -> String {
    let container = genome.bytes();
    format!(
        "/// A minimal-surprise genome: {}.\n\
         pub static {symbol}: [u8; {}] = [\n{}];\n",
        describe(genome.topology()),
        container.len(),
        hex_lines(container)
    )
}

fn hex_lines(container: &[u8]) -> String {
    let line = |bytes: &[u8]| {
        let numbers: Vec<String> = bytes.iter().map(|byte| format!("{byte:#04x}")).collect();
        format!("    {},\n", numbers.join(", "))
    };
    container.chunks(LINE_BYTES).map(line).collect()
}

/// Encodes the container as Intel HEX at this address; `None` if an address would exceed 32 bits.
#[must_use]
pub fn intel_hex(container: &[u8], address: u32) -> Option<String> {
    let mut records = Vec::new();
    let mut upper = None;
    let mut at = address;
    let mut rest = container;
    while !rest.is_empty() {
        // A record has a 16-bit address and must not cross a 64 KiB boundary.
        let until_carry = 0x1_0000 - (at as usize & 0xffff);
        let (value, after) = rest.split_at(rest.len().min(LINE_BYTES).min(until_carry));
        let high = (at >> 16) as u16;
        if upper != Some(high) {
            records.push(Record::ExtendedLinearAddress(high));
            upper = Some(high);
        }
        records.push(Record::Data {
            offset: at as u16,
            value: value.to_vec(),
        });
        let next = u64::from(at) + value.len() as u64;
        rest = after;
        at = match u32::try_from(next) {
            Ok(next) => next,
            Err(_) if rest.is_empty() => 0,
            Err(_) => return None,
        };
    }
    records.push(Record::EndOfFile);
    create_object_file_representation(&records).ok()
}

/// Creates a committed genome slot up to the end of the container, for a robot with genome slots.
/// The robot uses the slot with the larger `write_count`, which is 1 or more.
///
/// # Panics
/// If `container` has at most four bytes, or 64 KiB or more.
#[must_use]
pub fn slot(container: &[u8], write_count: u32) -> Vec<u8> {
    let (length, crc) = length_and_crc(container).expect("a container has a CRC");
    let header = Header {
        write_count,
        length,
        crc,
    };
    [&header.front(), container].concat()
}

/// Returns the command that writes a file to a chip through a debug probe.
#[must_use]
pub fn probe_rs_line(file: &Path, chip: &str, address: u32) -> String {
    format!(
        "probe-rs download --chip {} --binary-format bin --base-address {address:#010x} {}",
        shell_word(chip),
        shell_path(file)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intel_hex_goes_across_a_carry_and_ends_at_the_last_address() {
        let text = intel_hex(&[1, 2, 3], 0x0800_fffe).unwrap();
        let expected = ":020000040800F2\n:02FFFE000102FE\n:020000040801F1\n:0100000003FC\n\
            :00000001FF\n";
        assert_eq!(text, expected);
        assert!(intel_hex(&[0; 4], 0xffff_fffc).is_some());
        assert_eq!(intel_hex(&[0; 5], 0xffff_fffc), None);
    }

    #[test]
    fn the_probe_rs_line_quotes_what_a_shell_would_split() {
        assert_eq!(
            probe_rs_line(Path::new("my robot's.bin"), "STM32F407VGTx", 0x0800_c000),
            "probe-rs download --chip STM32F407VGTx --binary-format bin \
             --base-address 0x0800c000 'my robot'\\''s.bin'"
        );
    }
}
