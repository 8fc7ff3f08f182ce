//! Scans of a range-and-bearing module: invalid frames change nothing.

use firmware_example::range_bearing::RangeBearing;
use firmware_example::robot::NEIGHBOURS_MAX;
use minimal_surprise_controller::neighbours::{Detection, Neighbours};
use minimal_surprise_link::{WIRE_BYTES_MAX, encode};
use proptest::prelude::*;
use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};

/// Encodes a frame with exactly these bytes as its message.
fn frame(message: &[u8]) -> Vec<u8> {
    let mut wire = [0; WIRE_BYTES_MAX];
    let length = encode(&Raw(message), &mut wire).unwrap();
    wire[..length].to_vec()
}

/// Bytes that are serialised without their length.
struct Raw<'a>(&'a [u8]);

impl serde::Serialize for Raw<'_> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        use serde::ser::SerializeTuple;
        let mut tuple = serializer.serialize_tuple(self.0.len())?;
        for byte in self.0 {
            tuple.serialize_element(byte)?;
        }
        tuple.end()
    }
}

fn message(found: &[(u16, i16)]) -> Vec<u8> {
    let mut message = vec![found.len() as u8];
    for (range, bearing) in found {
        message.extend(range.to_le_bytes());
        message.extend(bearing.to_le_bytes());
    }
    message
}

/// Feeds the bytes; returns the number of completed scans and the resulting neighbours.
fn feed(bytes: &[u8]) -> (usize, Vec<Detection>) {
    let mut module = RangeBearing::new();
    let mut neighbours = Neighbours::<NEIGHBOURS_MAX>::new();
    let scans = bytes
        .iter()
        .filter(|byte| module.feed(**byte, &mut neighbours));
    let scans = scans.count();
    (scans, neighbours.detections().to_vec())
}

#[test]
fn a_scan_is_read_byte_for_byte_as_documented() {
    // Two neighbours: one 258 mm to the left, one 100 mm behind on the right. CRC-32C, low byte
    // first.
    let bytes = [2, 2, 1, 0, 0x40, 100, 0, 0, 0xa0];
    let expected = [(258.0, FRAC_PI_2), (100.0, -3.0 * FRAC_PI_4)];
    let expected = expected.map(|(range_mm, bearing_rad)| Detection {
        range_mm,
        bearing_rad,
    });
    assert_eq!(feed(&frame(&bytes)), (1, expected.to_vec()));
    assert_eq!(message(&[(258, 1 << 14), (100, -3 << 13)]), bytes);
    let words = frame(&bytes)
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect::<Vec<_>>();
    let page = include_str!("../docs/robot.md");
    assert!(
        page.lines().any(|line| line == words.join(" ")),
        "{words:?}"
    );
    let (_, behind) = feed(&frame(&message(&[(1, i16::MIN)])));
    assert_eq!(behind[0].bearing_rad, -PI);
}

#[test]
fn a_scan_without_neighbours_is_a_scan() {
    assert_eq!(feed(&frame(&[0])), (1, vec![]));
}

#[test]
fn the_newest_of_several_scans_counts() {
    let scans = [[(100, 0), (200, 0)], [(300, 0), (400, 0)]];
    let bytes: Vec<u8> = scans
        .iter()
        .flat_map(|scan| frame(&message(scan)))
        .collect();
    let (count, found) = feed(&bytes);
    assert_eq!(count, 2);
    assert_eq!(found.iter().map(|found| found.range_mm).sum::<f32>(), 700.0);
}

#[test]
fn a_frame_whose_count_does_not_match_its_neighbours_is_not_a_scan() {
    for count in [0, 1, 3, 255] {
        let mut message = message(&[(1, 1), (2, 2)]);
        message[0] = count;
        assert_eq!(feed(&frame(&message)), (0, vec![]));
    }
    for length in 2..9 {
        let message = &message(&[(1, 1), (2, 2)])[..length];
        assert_eq!(feed(&frame(message)), (0, vec![]), "{length}");
    }
}

proptest! {
    #[test]
    fn a_flipped_bit_never_makes_another_scan(
        found in prop::collection::vec(any::<(u16, i16)>(), 0..NEIGHBOURS_MAX),
        bit in any::<prop::sample::Index>(),
    ) {
        let mut bytes = frame(&message(&found));
        let bit = bit.index(8 * bytes.len());
        bytes[bit / 8] ^= 1 << (bit % 8);
        let (scans, detections) = feed(&bytes);
        // A zero before the frame only ends the bytes that precede it.
        prop_assert!(scans == 0 && detections.is_empty() || scans == 1 && bit < 8);
    }

    #[test]
    fn any_bytes_may_arrive(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        feed(&bytes);
    }
}
