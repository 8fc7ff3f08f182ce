//! The genome container (`docs/genome-format.md`): every written container can be read back,
//! invalid bytes are rejected, and nothing panics.
//!
//! The tests also assemble containers field by field, without the crate's writer, so that the
//! checksum and lengths can be correct even if a later check must fail.

use minimal_surprise_controller::codec::{
    BufferTooSmall, CONTAINER_BYTES_MAX, CRC_32C, HEADER_BYTES_MAX, container_length, encode,
};
use minimal_surprise_controller::{
    Controller, DecodeError, EncodedGenome, Genome, KERNEL_ID, KernelId, Prediction, Provenance,
    SensorModel, Template, Topology, TopologyError,
};
use proptest::collection::vec;
use proptest::prelude::{Just, ProptestConfig, Strategy, any, prop_oneof};
use proptest::sample::{Index, select};
use proptest::test_runner::{Config, RngSeed, TestCaseError};
use proptest::{prop_assert, prop_assert_eq, proptest};
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};
use std::collections::BTreeMap;

const SEED: u64 = 2020;
const PREFIX_BYTES: usize = 8;
const CRC_BYTES: usize = 4;

/// The fields of a container; each may be invalid.
#[derive(Clone, Debug)]
struct Fields {
    kernel: [u8; 8],
    model: u8,
    prediction: u8,
    template: u8,
    seed: Option<u64>,
    generation: u32,
    matched_bits: u64,
    scored_bits: u64,
    action_weights: u16,
    prediction_weights: u16,
    weights: Vec<i16>,
}

/// Encodes a number with seven bits per byte, lowest bits first; the highest bit is set in all
/// bytes but the last.
fn varint(mut value: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    while value >= 128 {
        bytes.push(value as u8 | 128);
        value >>= 7;
    }
    bytes.push(value as u8);
    bytes
}

impl Fields {
    fn of(genome: &Genome, provenance: Provenance) -> Self {
        let topology = genome.topology();
        let model = match topology.model() {
            SensorModel::A => 0,
            SensorModel::B => 1,
            SensorModel::C => 2,
        };
        let code = |template| 1 + Template::ALL.iter().position(|&t| t == template).unwrap() as u8;
        let (prediction, template) = match topology.prediction() {
            Prediction::Free => (0, 0),
            Prediction::PartlyPredefined(template) => (1, code(template)),
            Prediction::Predefined(template) => (2, code(template)),
        };
        Self {
            kernel: KERNEL_ID.0,
            model,
            prediction,
            template,
            seed: provenance.seed,
            generation: provenance.generation,
            matched_bits: provenance.matched_bits,
            scored_bits: provenance.scored_bits,
            action_weights: topology.action_weights() as u16,
            prediction_weights: topology.prediction_weights() as u16,
            weights: genome.weights().to_vec(),
        }
    }

    fn header(&self) -> Vec<u8> {
        let mut header = self.kernel.to_vec();
        header.extend([self.model, self.prediction, self.template]);
        match self.seed {
            None => header.push(0),
            Some(seed) => {
                header.push(1);
                header.extend(varint(seed));
            }
        }
        header.extend(varint(self.generation.into()));
        header.extend(varint(self.matched_bits));
        header.extend(varint(self.scored_bits));
        header.extend(varint(self.action_weights.into()));
        header.extend(varint(self.prediction_weights.into()));
        header
    }

    fn weight_bytes(&self) -> Vec<u8> {
        self.weights.iter().flat_map(|w| w.to_le_bytes()).collect()
    }

    fn container(&self) -> Vec<u8> {
        container(&self.header(), &self.weight_bytes())
    }
}

/// Assembles a container from any header and weight bytes, with matching lengths and checksum.
fn container(header: &[u8], weights: &[u8]) -> Vec<u8> {
    let mut bytes = b"MSGE\x01\0\0\0".to_vec();
    bytes[5] = header.len() as u8;
    bytes.extend(header);
    bytes.extend(weights);
    bytes.extend([0; CRC_BYTES]);
    repair_length(&mut bytes);
    repair_crc(&mut bytes);
    bytes
}

fn repair_length(bytes: &mut [u8]) {
    let length = bytes.len() as u16;
    bytes[6..8].copy_from_slice(&length.to_le_bytes());
}

fn repair_crc(bytes: &mut [u8]) {
    let (body, crc) = bytes.split_at_mut(bytes.len() - CRC_BYTES);
    crc.copy_from_slice(&CRC_32C.checksum(body).to_le_bytes());
}

fn encoded(genome: &Genome, provenance: Provenance) -> Vec<u8> {
    let mut buffer = [0xa5; CONTAINER_BYTES_MAX];
    encode(genome, provenance, &mut buffer).unwrap().to_vec()
}

fn decode(bytes: &[u8]) -> Result<EncodedGenome<'_>, DecodeError> {
    EncodedGenome::decode(bytes)
}

fn rng() -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(SEED)
}

/// Draws a provenance with numbers of every encoded length, including the largest numbers.
fn random_provenance(rng: &mut ChaCha8Rng) -> Provenance {
    let mut number = || rng.next_u64() >> (rng.next_u32() % 64);
    let seed = number();
    Provenance {
        seed: (seed % 3 != 0).then_some(seed),
        generation: number() as u32,
        matched_bits: number(),
        scored_bits: number(),
    }
}

fn largest_provenance() -> Provenance {
    Provenance {
        seed: Some(u64::MAX),
        generation: u32::MAX,
        matched_bits: u64::MAX,
        scored_bits: u64::MAX,
    }
}

fn random_genome(topology: Topology, rng: &mut ChaCha8Rng) -> Genome {
    let weights: Vec<i16> = (0..topology.weights())
        .map(|_| (rng.next_u32() as i16).max(-32767))
        .collect();
    Genome::from_weights(topology, &weights).unwrap()
}

/// Returns one container per topology.
fn containers() -> Vec<Vec<u8>> {
    let mut rng = rng();
    Topology::ALL
        .into_iter()
        .map(|topology| {
            let genome = random_genome(topology, &mut rng);
            encoded(&genome, random_provenance(&mut rng))
        })
        .collect()
}

fn largest() -> Fields {
    let genome = random_genome(Topology::default(), &mut rng());
    Fields::of(&genome, largest_provenance())
}

#[test]
fn every_topology_is_read_as_it_was_written_and_written_as_it_was_read() {
    let mut rng = rng();
    let mut lengths = (usize::MAX, 0);
    for case in 0..1200 {
        let topology = Topology::ALL[case % Topology::ALL.len()];
        let genome = random_genome(topology, &mut rng);
        let provenance = match case / Topology::ALL.len() {
            0 => Provenance::default(),
            1 => largest_provenance(),
            _ => random_provenance(&mut rng),
        };
        let bytes = encoded(&genome, provenance);
        assert_eq!(
            bytes,
            Fields::of(&genome, provenance).container(),
            "seed {SEED}, case {case}"
        );
        let read = decode(&bytes).unwrap();
        assert_eq!(read.topology(), topology, "seed {SEED}, case {case}");
        assert_eq!(read.provenance(), provenance, "seed {SEED}, case {case}");
        assert_eq!(read.to_genome(), genome, "seed {SEED}, case {case}");
        assert!(read.weights().eq(genome.weights().iter().copied()));
        assert_eq!(Controller::from_encoded(&read), Controller::new(&genome));
        assert_eq!(encoded(&read.to_genome(), read.provenance()), bytes);
        assert_eq!(container_length(&bytes), Ok(bytes.len()));
        lengths = (lengths.0.min(bytes.len()), lengths.1.max(bytes.len()));
    }
    println!("containers of {} to {} bytes", lengths.0, lengths.1);
    assert!(lengths.1 <= CONTAINER_BYTES_MAX);
}

#[test]
fn a_buffer_shorter_than_the_container_is_refused_and_left_alone() {
    for topology in Topology::ALL {
        let genome = random_genome(topology, &mut rng());
        let needed = encoded(&genome, largest_provenance()).len();
        for found in 0..needed {
            let mut buffer = vec![0xa5; found];
            assert_eq!(
                encode(&genome, largest_provenance(), &mut buffer),
                Err(BufferTooSmall { found })
            );
            assert!(buffer.iter().all(|&byte| byte == 0xa5));
        }
        let mut buffer = vec![0xa5; needed];
        assert!(encode(&genome, largest_provenance(), &mut buffer).is_ok());
    }
}

#[test]
fn every_truncation_is_refused_as_too_short() {
    let mut cases = 0;
    for bytes in containers() {
        for found in 0..bytes.len() {
            let needed = if found < PREFIX_BYTES {
                PREFIX_BYTES + CRC_BYTES
            } else {
                bytes.len()
            };
            assert_eq!(
                decode(&bytes[..found]),
                Err(DecodeError::TooShort { found, needed })
            );
            cases += 1;
        }
    }
    println!("{cases} truncations");
}

#[test]
fn every_appended_byte_is_refused_as_trailing() {
    for bytes in containers() {
        let length = bytes.len();
        let refused = |longer: &[u8]| {
            let found = longer.len();
            let error = DecodeError::TrailingBytes { found, length };
            assert_eq!(decode(longer), Err(error));
        };
        for byte in 0..=255 {
            refused(&[&bytes[..], &[byte]].concat());
        }
        refused(&[&bytes[..], &bytes[..]].concat());
        // More than a 16-bit length can express.
        refused(&[&bytes[..], &[0; 1 << 16]].concat());
    }
}

#[test]
fn every_single_bit_flip_is_refused() {
    let mut cases = 0;
    for mut bytes in containers() {
        for bit in 0..8 * bytes.len() {
            bytes[bit / 8] ^= 1 << (bit % 8);
            let result = decode(&bytes);
            assert!(result.is_err(), "bit {bit} of {} bytes", bytes.len());
            bytes[bit / 8] ^= 1 << (bit % 8);
            cases += 1;
        }
        assert!(decode(&bytes).is_ok());
    }
    println!("{cases} bit flips");
}

/// Checks that decoding fails, or that the bytes are the only encoding of the decoded genome.
fn refused_or_the_only_encoding(bytes: &[u8]) -> Result<(), TestCaseError> {
    if let Ok(read) = decode(bytes) {
        let genome = read.to_genome();
        prop_assert!(!genome.weights().contains(&i16::MIN));
        prop_assert_eq!(encoded(&genome, read.provenance()), bytes);
        prop_assert_eq!(Controller::from_encoded(&read), Controller::new(&genome));
    }
    Ok(())
}

fn config(cases: u32) -> ProptestConfig {
    Config {
        cases,
        rng_seed: RngSeed::Fixed(SEED),
        failure_persistence: None,
        ..Config::default()
    }
}

/// Generates arbitrary bytes, but often bytes that have a special meaning in some field.
fn byte() -> impl Strategy<Value = u8> {
    prop_oneof![any::<u8>(), 0_u8..6, Just(0x7f), Just(0x80), Just(0xff)]
}

/// Generates the bytes of a number; form and size may be invalid.
fn loose_varint() -> impl Strategy<Value = Vec<u8>> {
    (any::<u64>(), 0_u32..64, 0_usize..3, byte()).prop_map(|(value, shift, padding, last)| {
        let mut bytes = varint(value >> shift);
        for _ in 0..padding.saturating_sub(1) {
            *bytes.last_mut().unwrap() |= 0x80;
            bytes.push(last & 0x7f);
        }
        bytes
    })
}

proptest! {
    #![proptest_config(config(4096))]

    #[test]
    fn mutated_header_bytes_with_a_repaired_crc_are_refused_or_the_only_encoding(
        valid in select(containers()),
        edits in vec((any::<Index>(), byte()), 1..4),
    ) {
        let mut bytes = valid;
        let header_length = usize::from(bytes[5]);
        for (place, byte) in edits {
            bytes[PREFIX_BYTES + place.index(header_length)] = byte;
        }
        repair_crc(&mut bytes);
        refused_or_the_only_encoding(&bytes)?;
    }

    #[test]
    fn mutated_bytes_anywhere_with_a_repaired_crc_are_refused_or_the_only_encoding(
        valid in select(containers()),
        edits in vec((any::<Index>(), byte()), 1..9),
    ) {
        let mut bytes = valid;
        for (place, byte) in edits {
            let place = place.index(bytes.len() - CRC_BYTES);
            bytes[place] = byte;
        }
        repair_crc(&mut bytes);
        refused_or_the_only_encoding(&bytes)?;
    }

    #[test]
    fn inserted_and_removed_bytes_with_repaired_lengths_are_refused_or_the_only_encoding(
        valid in select(containers()),
        taken_out in vec(any::<Index>(), 0..3),
        put_in in vec((any::<Index>(), byte()), 0..3),
        header_length_follows in any::<bool>(),
    ) {
        let mut bytes = valid;
        let body = PREFIX_BYTES..bytes.len() - CRC_BYTES - 2;
        let header_end = PREFIX_BYTES + usize::from(bytes[5]);
        let mut header_length = i32::from(bytes[5]);
        let place_in_body = |place: Index| match header_length_follows {
            true => body.start + place.index(header_end - body.start),
            false => body.start + place.index(body.len()),
        };
        for place in taken_out {
            bytes.remove(place_in_body(place));
            header_length -= 1;
        }
        for (place, byte) in put_in {
            bytes.insert(place_in_body(place), byte);
            header_length += 1;
        }
        if header_length_follows {
            bytes[5] = header_length as u8;
        }
        repair_length(&mut bytes);
        repair_crc(&mut bytes);
        refused_or_the_only_encoding(&bytes)?;
    }

    #[test]
    fn headers_with_loosely_encoded_numbers_are_refused_or_the_only_encoding(
        topology in select(Topology::ALL.to_vec()),
        seed in (0_u8..3, loose_varint()),
        numbers in [loose_varint(), loose_varint(), loose_varint()],
        counts in (0_usize..3, 0_usize..3),
        rest in vec(byte(), 0..2),
    ) {
        let fields = Fields::of(&Genome::zeroed(topology), Provenance::default());
        let mut header = fields.header()[..11].to_vec();
        header.push(seed.0);
        if seed.0 > 0 {
            header.extend(seed.1);
        }
        for number in numbers {
            header.extend(number);
        }
        for (count, padding) in [
            (fields.action_weights, counts.0),
            (fields.prediction_weights, counts.1),
        ] {
            let mut count = varint(count.into());
            if padding == 2 {
                *count.last_mut().unwrap() |= 0x80;
                count.push(0);
            }
            header.extend(count);
        }
        header.extend(rest);
        refused_or_the_only_encoding(&container(&header, &fields.weight_bytes()))?;
    }

    #[test]
    fn fields_of_any_value_are_refused_or_the_only_encoding(
        topology in select(Topology::ALL.to_vec()),
        codes in prop_oneof![
            Just(None),
            (0_u8..4, 0_u8..4, 0_u8..6).prop_map(Some),
            any::<(u8, u8, u8)>().prop_map(Some),
        ],
        provenance in any::<(Option<u64>, u32, u64, u64)>(),
        counts in prop_oneof![Just(None), any::<(u16, u16)>().prop_map(Some)],
        kernel in prop_oneof![9 => Just(KERNEL_ID.0), 1 => any::<[u8; 8]>()],
        weights in vec(any::<i16>(), 616),
        extra_weight in any::<bool>(),
    ) {
        let mut fields = Fields::of(&Genome::zeroed(topology), Provenance::default());
        if let Some(codes) = codes {
            (fields.model, fields.prediction, fields.template) = codes;
        }
        (fields.seed, fields.generation, fields.matched_bits, fields.scored_bits) = provenance;
        if let Some(counts) = counts {
            (fields.action_weights, fields.prediction_weights) = counts;
        }
        fields.kernel = kernel;
        fields.weights = weights[..topology.weights()].to_vec();
        if extra_weight && topology.weights() < 616 {
            fields.weights.push(0);
        }
        refused_or_the_only_encoding(&fields.container())?;
    }

    #[test]
    fn any_bytes_at_all_are_refused_or_the_only_encoding(bytes in vec(any::<u8>(), 0..1400)) {
        refused_or_the_only_encoding(&bytes)?;
    }
}

/// Draws a number below `end`.
fn below(end: usize, rng: &mut ChaCha8Rng) -> usize {
    rng.next_u32() as usize % end
}

/// Returns the name of the outcome of decoding.
fn outcome(result: Result<EncodedGenome<'_>, DecodeError>) -> String {
    match result {
        Ok(_) => "accepted".to_owned(),
        Err(error) => {
            let debug = format!("{error:?}");
            let name_length = debug.find([' ', '(']).unwrap_or(debug.len());
            debug[..name_length].to_owned()
        }
    }
}

#[test]
fn half_a_million_random_containers_reach_every_outcome_and_never_panic() {
    let mut rng = rng();
    let mut outcomes = BTreeMap::<String, u32>::new();
    let valid = containers();
    for case in 0..500_000 {
        // Most containers are small, so that computing the checksums takes little time.
        let any_size = below(32, &mut rng) == 0;
        let mut bytes = loop {
            let bytes = &valid[below(valid.len(), &mut rng)];
            if any_size || bytes.len() < 200 {
                break bytes.clone();
            }
        };
        let header_end = PREFIX_BYTES + usize::from(bytes[5]);
        if below(4, &mut rng) == 0 {
            // The start of a header, then arbitrary bytes.
            let right = PREFIX_BYTES + below(20, &mut rng);
            rng.fill_bytes(&mut bytes[right..]);
        } else {
            rng.fill_bytes(&mut bytes[header_end..]);
        }
        if below(16, &mut rng) == 0 {
            bytes[header_end..header_end + 2].copy_from_slice(&i16::MIN.to_le_bytes());
        }
        if below(16, &mut rng) == 0 {
            bytes.truncate(bytes.len() - below(100, &mut rng));
            repair_length(&mut bytes);
        }
        // Up to three wrong bytes at the front, and sometimes a wrong length or checksum.
        for _ in 0..below(4, &mut rng) {
            let start = if below(8, &mut rng) == 0 {
                0
            } else {
                PREFIX_BYTES
            };
            let place = start + below(24, &mut rng);
            let end = if below(4, &mut rng) == 0 { 256 } else { 5 };
            bytes[place] = below(end, &mut rng) as u8;
        }
        if below(16, &mut rng) > 0 {
            repair_length(&mut bytes);
        }
        if below(64, &mut rng) > 0 {
            repair_crc(&mut bytes);
        }
        let result = decode(&bytes);
        if let Ok(read) = result {
            let again = encoded(&read.to_genome(), read.provenance());
            assert_eq!(again, bytes, "seed {SEED}, case {case}");
        }
        *outcomes.entry(outcome(result)).or_default() += 1;
    }
    println!("{outcomes:#?}");
    assert_eq!(outcomes.len(), 15, "seed {SEED}: {outcomes:?}");
}

/// Asserts that decoding fails with this error and that the message contains these words.
fn assert_refused(bytes: &[u8], error: DecodeError, words: &[&str]) {
    assert_eq!(decode(bytes), Err(error));
    let message = error.to_string();
    println!("{message}");
    for word in words {
        assert!(message.contains(word), "{word:?} is not in {message:?}");
    }
}

#[test]
fn refuses_bytes_that_are_too_short() {
    assert_refused(
        &[],
        DecodeError::TooShort {
            found: 0,
            needed: 12,
        },
        &["too short", "0 bytes", "12"],
    );
    let bytes = largest().container();
    assert_refused(
        &bytes[..1000],
        DecodeError::TooShort {
            found: 1000,
            needed: bytes.len(),
        },
        &["too short", "1000 bytes", "1295"],
    );
}

#[test]
fn refuses_lengths_that_no_container_has() {
    for found in [0, 11, CONTAINER_BYTES_MAX + 1, 65_535] {
        let mut bytes = largest().container();
        bytes[6..8].copy_from_slice(&(found as u16).to_le_bytes());
        repair_crc(&mut bytes);
        assert_refused(
            &bytes,
            DecodeError::ImpossibleLength { found },
            &[&found.to_string(), "12 to 1297"],
        );
        assert!(container_length(&bytes).is_err());
    }
}

#[test]
fn refuses_trailing_bytes() {
    let mut bytes = largest().container();
    bytes.extend([0, 0]);
    assert_refused(
        &bytes,
        DecodeError::TrailingBytes {
            found: 1297,
            length: 1295,
        },
        &["1297 bytes", "ends after 1295"],
    );
}

#[test]
fn refuses_another_magic() {
    let mut bytes = largest().container();
    bytes[..4].copy_from_slice(b"\x7fELF");
    repair_crc(&mut bytes);
    assert_refused(
        &bytes,
        DecodeError::WrongMagic { found: *b"\x7fELF" },
        &["[7f, 45, 4c, 46]", "[4d, 53, 47, 45]", "MSGE"],
    );
}

#[test]
fn refuses_an_unknown_version() {
    for found in [0, 2, 255] {
        let mut bytes = largest().container();
        bytes[4] = found;
        repair_crc(&mut bytes);
        assert_refused(
            &bytes,
            DecodeError::UnknownVersion { found },
            &[&format!("version {found};"), "version 1"],
        );
    }
}

#[test]
fn refuses_a_wrong_crc() {
    let mut bytes = largest().container();
    let last = bytes.len() - 1;
    let computed = CRC_32C.checksum(&bytes[..last - 3]);
    bytes[last] ^= 0xff;
    assert_refused(
        &bytes,
        DecodeError::BadCrc {
            found: computed ^ 0xff00_0000,
            computed,
        },
        &[
            "CRC-32C",
            &format!("{computed:08x}"),
            &format!("{:08x}", computed ^ 0xff00_0000),
        ],
    );
}

#[test]
fn refuses_a_header_longer_than_any_or_than_the_container() {
    let mut bytes = largest().container();
    for found in [HEADER_BYTES_MAX + 1, 255] {
        bytes[5] = found as u8;
        repair_crc(&mut bytes);
        assert_refused(
            &bytes,
            DecodeError::HeaderTooLong { found, room: 53 },
            &[&format!("header of {found} bytes"), "at most 53"],
        );
    }
    let mut bytes = container(&[], &[0; 20]);
    bytes[5] = 21;
    repair_crc(&mut bytes);
    assert_refused(
        &bytes,
        DecodeError::HeaderTooLong {
            found: 21,
            room: 20,
        },
        &["header of 21 bytes", "at most 20"],
    );
}

#[test]
fn refuses_a_header_that_does_not_decode_or_has_bytes_left_over() {
    let fields = largest();
    let header = fields.header();
    let refused = |header: &[u8]| {
        let length = header.len();
        assert_refused(
            &container(header, &fields.weight_bytes()),
            DecodeError::MalformedHeader { length },
            &[&format!("{length} bytes"), "version 1"],
        );
    };
    for length in 0..header.len() {
        refused(&header[..length]);
    }
    refused(&[&header[..], &[0]].concat());
    for tag in 2..=255 {
        let mut header = header.clone();
        header[11] = tag;
        refused(&header);
    }
    // The tenth byte of a 64-bit number holds one bit, the fifth of a 32-bit number four.
    let mut too_large = header.clone();
    too_large[21] = 2;
    refused(&too_large);
    let mut too_large = header.clone();
    too_large[26] = 0x10;
    refused(&too_large);
}

#[test]
fn refuses_numbers_that_are_not_in_their_shortest_form() {
    let genome = random_genome(Topology::default(), &mut rng());
    let provenance = Provenance {
        seed: Some(1),
        generation: 2,
        matched_bits: 3,
        scored_bits: 4,
    };
    let fields = Fields::of(&genome, provenance);
    let header = fields.header();
    assert_eq!(header[12..], [1, 2, 3, 4, 0xa6, 0x01, 0xc2, 0x03]);
    for last_byte_of_number in [12, 13, 14, 15, 17, 19] {
        let mut header = header.clone();
        header[last_byte_of_number] |= 0x80;
        header.insert(last_byte_of_number + 1, 0);
        let length = header.len();
        assert_refused(
            &container(&header, &fields.weight_bytes()),
            DecodeError::MalformedHeader { length },
            &[&format!("{length} bytes"), "shortest form"],
        );
    }
}

#[test]
fn refuses_a_genome_of_another_kernel() {
    let mut fields = largest();
    fields.kernel = *b"\x01234567\xff";
    assert_refused(
        &fields.container(),
        DecodeError::OtherKernel {
            found: KernelId(fields.kernel),
        },
        &["01323334353637ff", &KERNEL_ID.to_string()],
    );
}

#[test]
fn refuses_an_unknown_sensor_model() {
    for found in 3..=255 {
        let mut fields = largest();
        fields.model = found;
        assert_refused(
            &fields.container(),
            DecodeError::UnknownModel { found },
            &[&format!("model {found};"), "0 to 2"],
        );
    }
}

#[test]
fn refuses_unknown_prediction_schemes_and_templates() {
    for (prediction, template) in [
        (0, 1),
        (0, 255),
        (1, 0),
        (1, 5),
        (2, 0),
        (2, 5),
        (2, 255),
        (3, 0),
        (3, 1),
        (255, 4),
    ] {
        let mut fields = largest();
        fields.prediction = prediction;
        fields.template = template;
        assert_refused(
            &fields.container(),
            DecodeError::UnknownPrediction {
                prediction,
                template,
            },
            &[
                &format!("scheme {prediction} with template {template}"),
                "0 is free",
                "1 to 4",
            ],
        );
    }
}

#[test]
fn refuses_topologies_that_do_not_exist() {
    let mut refused = 0;
    for (model, model_code) in SensorModel::ALL.into_iter().zip(0..) {
        for (template, template_code) in Template::ALL.into_iter().zip(1..) {
            let mut fields = largest();
            fields.model = model_code;
            fields.template = template_code;
            let name = format!("{model:?}");
            fields.prediction = 1;
            if (model, template) != (SensorModel::C, Template::Line) {
                let error = TopologyError::NotPartly { template, model };
                assert_refused(
                    &fields.container(),
                    DecodeError::NoSuchTopology(error),
                    &[template.name(), &name, "line on sensor model C only"],
                );
                refused += 1;
            }
            fields.prediction = 2;
            if template.bits(model).is_none() {
                let error = TopologyError::NoSuchTemplate { template, model };
                assert_refused(
                    &fields.container(),
                    DecodeError::NoSuchTopology(error),
                    &[template.name(), &name, "only for C"],
                );
                refused += 1;
            }
        }
    }
    assert_eq!(refused, 11 + 4);
}

#[test]
fn refuses_numbers_of_weights_that_do_not_fit() {
    let right = largest();
    let refused = |fields: &Fields| {
        let (action, prediction) = (fields.action_weights, fields.prediction_weights);
        assert_refused(
            &fields.container(),
            DecodeError::SizesDoNotFit {
                action,
                prediction,
                bytes: 2 * fields.weights.len(),
                expected_action: 166,
                expected_prediction: 450,
            },
            &[
                &format!("{action} action and {prediction} prediction weights"),
                &format!("in {} bytes", 2 * fields.weights.len()),
                "166 and 450 in 1232",
            ],
        );
    };
    for (action, prediction) in [(166, 0), (0, 450), (450, 166), (167, 449), (65_535, 65_535)] {
        let mut fields = right.clone();
        fields.action_weights = action;
        fields.prediction_weights = prediction;
        refused(&fields);
    }
    for count in [0, 1, 166, 615] {
        let mut fields = right.clone();
        fields.weights.truncate(count);
        refused(&fields);
    }
    let mut fields = right.clone();
    fields.seed = None;
    fields.weights.push(0);
    refused(&fields);

    // Appends half a weight.
    let mut weights = right.weight_bytes();
    weights.push(0);
    assert_refused(
        &container(&right.header(), &weights),
        DecodeError::SizesDoNotFit {
            action: 166,
            prediction: 450,
            bytes: 1233,
            expected_action: 166,
            expected_prediction: 450,
        },
        &["1233", "1232"],
    );
}

#[test]
fn refuses_the_weight_minus_32768_at_any_index() {
    for index in 0..616 {
        let mut fields = largest();
        fields.weights[index] = i16::MIN;
        assert_refused(
            &fields.container(),
            DecodeError::InvalidWeight { index },
            &[&format!("weight {index} "), "−32768", "±32767"],
        );
    }
    let mut fields = largest();
    fields.weights.fill(-32767);
    assert!(decode(&fields.container()).is_ok());
}

#[test]
fn errors_are_reported_in_the_order_of_the_format() {
    // Start with every field invalid, then fix one at a time.
    let right = largest();
    let mut fields = right.clone();
    fields.kernel = [0; 8];
    fields.model = 9;
    fields.prediction = 1;
    fields.template = 7;
    fields.action_weights = 3;
    fields.weights[0] = i16::MIN;
    let mut header = fields.header();
    header[11] = 2;
    let mut bytes = container(&header, &fields.weight_bytes());
    bytes[0] = 0;
    bytes[4] = 2;
    bytes[5] = 60;
    bytes[6..8].fill(0xff);
    *bytes.last_mut().unwrap() ^= 1;
    let mut order = vec![outcome(decode(&bytes[..7])), outcome(decode(&bytes))];
    bytes[0] = b'M';
    order.push(outcome(decode(&bytes)));
    bytes[4] = 1;
    order.push(outcome(decode(&bytes)));
    repair_length(&mut bytes);
    order.push(outcome(decode(&bytes[..500])));
    order.push(outcome(decode(&[&bytes[..], &[0]].concat())));
    order.push(outcome(decode(&bytes)));
    repair_crc(&mut bytes);
    order.push(outcome(decode(&bytes)));
    order.push(outcome(decode(&container(&header, &fields.weight_bytes()))));
    let mut next = |fields: &Fields| order.push(outcome(decode(&fields.container())));
    next(&fields);
    fields.kernel = right.kernel;
    next(&fields);
    fields.model = 0;
    next(&fields);
    fields.template = 1;
    next(&fields);
    fields.model = right.model;
    fields.prediction = 0;
    fields.template = 0;
    next(&fields);
    fields.action_weights = right.action_weights;
    next(&fields);
    fields.weights[0] = 0;
    next(&fields);
    assert_eq!(
        order,
        [
            "TooShort",
            "WrongMagic",
            "UnknownVersion",
            "ImpossibleLength",
            "TooShort",
            "TrailingBytes",
            "BadCrc",
            "HeaderTooLong",
            "MalformedHeader",
            "OtherKernel",
            "UnknownModel",
            "UnknownPrediction",
            "NoSuchTopology",
            "SizesDoNotFit",
            "InvalidWeight",
            "accepted",
        ]
    );
}

/// The example in `docs/genome-format.md`.
static FIXTURE: &[u8] = include_bytes!("b-predefined-line.genome");

/// Returns the contents of the fixture: sensor model B, predefined line, weights from ChaCha8
/// seeded with 2020.
fn fixture() -> (Genome, Provenance) {
    let topology = Topology::new(SensorModel::B, Prediction::Predefined(Template::Line)).unwrap();
    let genome = Genome::random(topology, &mut rng());
    let provenance = Provenance {
        seed: Some(2020),
        generation: 99,
        matched_bits: 213_456,
        scored_bits: 300_000,
    };
    (genome, provenance)
}

#[test]
fn value_stability_encode() {
    let (genome, provenance) = fixture();
    assert_eq!(encoded(&genome, provenance), FIXTURE);
}

#[test]
fn value_stability_decode() {
    let read = decode(FIXTURE).unwrap();
    let (genome, provenance) = fixture();
    assert_eq!(read.topology(), genome.topology());
    assert_eq!(read.provenance(), provenance);
    assert_eq!(read.to_genome(), genome);
    assert_eq!(
        genome.weights()[..6],
        [-1243, -1748, 1797, 1017, -548, -866]
    );
}

#[test]
fn the_example_of_the_documentation_is_the_fixture() {
    let page = include_str!("../../docs/genome-format.md");
    for (line, bytes) in FIXTURE.chunks(16).enumerate() {
        let hex: Vec<String> = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        let (left, right) = hex.split_at(hex.len().min(8));
        let expected = format!("{line:x}0  {}  {}", left.join(" "), right.join(" "));
        let expected = expected.trim_end();
        assert!(page.lines().any(|l| l == expected), "{expected}");
    }
}

#[test]
fn the_checksum_is_the_standard_crc_32c() {
    assert_eq!(CRC_32C.checksum(b"123456789"), 0xe306_9283);
}
