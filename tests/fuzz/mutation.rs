//! Mutates bytes at random to imitate damaged or hostile files and messages.

use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};

/// Maximum size of an input, in bytes.
const BYTES_MAX: usize = 1 << 16;

/// Tokens that often cause readers to fail.
const TOKENS: [&[u8]; 24] = [
    b"0",
    b"-1",
    b"1e999",
    b"-0.0",
    b"NaN",
    b"inf",
    b"0.5",
    b"65535",
    b"16384",
    b"4294967295",
    b"18446744073709551616",
    b"\"",
    b"\n",
    b"\r\n",
    b",",
    b" ",
    b"[]",
    b"{}",
    b"null",
    b"\0",
    b"\xff\xff\xff\xff",
    b"\x80\x80\x80\x80\x10",
    b"\xef\xbb\xbf",
    b"\xff\xfe",
];

/// Returns mutant `number` of a series: one of the seeds, changed in a few places.
pub(crate) fn mutant(seeds: &[Vec<u8>], series: u64, number: u64) -> Vec<u8> {
    let mut rng = ChaCha8Rng::seed_from_u64(series);
    rng.set_stream(number);
    let mut below = |end: usize| (rng.next_u64() % end.max(1) as u64) as usize;
    let mut bytes = seeds[below(seeds.len())].clone();
    for _ in 0..1 << below(4) {
        let at = below(bytes.len() + 1);
        let length = 1 << below(10);
        let end = (at + 1 + below(length)).min(bytes.len());
        match below(8) {
            0 => bytes
                .iter_mut()
                .skip(at)
                .take(1)
                .for_each(|b| *b ^= 1 << below(8)),
            1 => bytes
                .iter_mut()
                .skip(at)
                .take(1)
                .for_each(|byte| *byte = below(256) as u8),
            2 => drop(bytes.drain(at.min(end)..end)),
            3 => bytes.truncate(at),
            4 => insert(&mut bytes, at..at, TOKENS[below(TOKENS.len())]),
            5 => {
                // Replaces a word or a number.
                let is_word = |b: &&u8| b.is_ascii_alphanumeric() || b"+-._".contains(b);
                let length = bytes[at..].iter().take_while(is_word).count();
                insert(&mut bytes, at..at + length, TOKENS[below(TOKENS.len())]);
            }
            6 => {
                let part = bytes[at.min(end)..end].to_vec();
                let to = below(bytes.len() + 1);
                insert(&mut bytes, to..to, &part);
            }
            _ => {
                let other = &seeds[below(seeds.len())];
                let from = below(other.len() + 1);
                let to = (from + 1 + below(length)).min(other.len());
                insert(&mut bytes, at.min(end)..end, &other[from.min(to)..to]);
            }
        }
    }
    bytes.truncate(BYTES_MAX);
    bytes
}

fn insert(bytes: &mut Vec<u8>, at: core::ops::Range<usize>, new: &[u8]) {
    bytes.splice(at, new.iter().copied());
}
