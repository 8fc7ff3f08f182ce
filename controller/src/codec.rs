//! Genome container, version 1. `docs/genome-format.md` describes it byte by byte.
//!
//! ```text
//! 0     4  magic "MSGE"
//! 4     1  format version, 1
//! 5     1  header length h
//! 6     2  length of the whole container
//! 8     h  header: kernel, topology, provenance, counts (postcard)
//! 8+h  2w  weights, little-endian i16, Q3.12
//! end   4  CRC-32C of everything before
//! ```
//!
//! Decoding borrows the bytes. Every accepted container is the only valid encoding of its contents:
//! encoding them again yields the same bytes.

use crate::activation::{KERNEL_ID, KernelId};
use crate::genome::Genome;
use crate::sensor::SensorModel;
use crate::topology::{MAX_WEIGHTS, Prediction, Template, Topology, TopologyError};
use crc::{CRC_32_ISCSI, Crc, Table};
use serde::{Deserialize, Serialize};

/// First bytes of every container.
pub const MAGIC: [u8; 4] = *b"MSGE";
/// Format version that this crate reads and writes.
pub const FORMAT_VERSION: u8 = 1;
/// Number of bytes before the header.
pub const PREFIX_BYTES: usize = 8;
/// Maximum size of a header, in bytes.
pub const HEADER_BYTES_MAX: usize = 53;
/// Size of the checksum, in bytes.
pub const CRC_BYTES: usize = 4;
/// Maximum size of a container, in bytes; a buffer of this size holds any genome.
pub const CONTAINER_BYTES_MAX: usize =
    PREFIX_BYTES + HEADER_BYTES_MAX + 2 * MAX_WEIGHTS + CRC_BYTES;
/// Minimum size of a container, in bytes.
const CONTAINER_BYTES_MIN: usize = PREFIX_BYTES + CRC_BYTES;

const _: () = assert!(HEADER_BYTES_MAX <= u8::MAX as usize);
const _: () = assert!(CONTAINER_BYTES_MAX <= u16::MAX as usize);

/// CRC-32C (Castagnoli): the checksum of the container.
pub static CRC_32C: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISCSI);

/// Origin of a genome.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Provenance {
    /// Seed of the evolutionary run, if known.
    pub seed: Option<u64>,
    /// Generation that the genome belongs to, counted from 0.
    pub generation: u32,
    /// Number of correctly predicted bits in the repetition that determined the genome's fitness.
    pub matched_bits: u64,
    /// Number of bits sensed in that repetition; 0 if unknown. Fitness is
    /// `matched_bits / scored_bits`.
    pub scored_bits: u64,
}

/// The header, as serialised.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Header {
    kernel: KernelId,
    model: u8,
    prediction: u8,
    template: u8,
    provenance: Provenance,
    action_weights: u16,
    prediction_weights: u16,
}

/// Error: the bytes are not a genome that this controller can run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum DecodeError {
    /// The bytes end before the end of the container.
    #[error("too short: {found} bytes; at least {needed} are needed")]
    TooShort {
        /// Number of bytes given.
        found: usize,
        /// Number of bytes needed, as far as known.
        needed: usize,
    },
    /// The length field is outside the valid range.
    #[error(
        "a length of {found} bytes; containers have {CONTAINER_BYTES_MIN} to {CONTAINER_BYTES_MAX}"
    )]
    ImpossibleLength {
        /// The length field.
        found: usize,
    },
    /// Bytes follow the container.
    #[error("{found} bytes, but the container ends after {length}")]
    TrailingBytes {
        /// Number of bytes given.
        found: usize,
        /// Length of the container, in bytes.
        length: usize,
    },
    /// The bytes do not start with [`MAGIC`].
    #[error("not a genome: it starts with {found:02x?} instead of {MAGIC:02x?} (\"MSGE\")")]
    WrongMagic {
        /// The first four bytes.
        found: [u8; 4],
    },
    /// The format version is not supported.
    #[error("format version {found}; this program reads version {FORMAT_VERSION}")]
    UnknownVersion {
        /// The version byte.
        found: u8,
    },
    /// The checksum does not match: the bytes were damaged.
    #[error("damaged: the stored CRC-32C is {found:08x}, the computed one {computed:08x}")]
    BadCrc {
        /// The stored checksum.
        found: u32,
        /// The checksum computed from the bytes.
        computed: u32,
    },
    /// The header length byte is too large.
    #[error("a header of {found} bytes; at most {room} fit")]
    HeaderTooLong {
        /// The header length byte.
        found: usize,
        /// Maximum size of a header in this container, in bytes.
        room: usize,
    },
    /// The header does not decode, or is not in its canonical form.
    #[error(
        "malformed header: its {length} bytes are not exactly the fields of format version \
         {FORMAT_VERSION}, each in its shortest form"
    )]
    MalformedHeader {
        /// Length of the header, in bytes.
        length: usize,
    },
    /// The genome was evolved for a different kernel.
    #[error("evolved for kernel {found}; this controller is kernel {KERNEL_ID}")]
    OtherKernel {
        /// The kernel of the genome.
        found: KernelId,
    },
    /// The sensor model is unknown.
    #[error("unknown sensor model {found}; 0 to 2 stand for A to C")]
    UnknownModel {
        /// The model byte.
        found: u8,
    },
    /// The kind of prediction or the template is unknown.
    #[error(
        "unknown prediction scheme {prediction} with template {template}; \
         0 is free (template 0), 1 partly predefined, 2 predefined (template 1 to 4)"
    )]
    UnknownPrediction {
        /// The byte for the kind of prediction.
        prediction: u8,
        /// The byte for the template.
        template: u8,
    },
    /// The sensor model cannot be combined with the predictions.
    #[error(transparent)]
    NoSuchTopology(#[from] TopologyError),
    /// The numbers of weights do not match the topology or the length of the weight block.
    #[error(
        "{action} action and {prediction} prediction weights in {bytes} bytes; the topology has \
         {expected_action} and {expected_prediction} in {}", 2 * (expected_action + expected_prediction)
    )]
    SizesDoNotFit {
        /// Number of action weights stated in the header.
        action: u16,
        /// Number of prediction weights stated in the header.
        prediction: u16,
        /// Length of the weight block, in bytes.
        bytes: usize,
        /// Number of action weights of the topology.
        expected_action: usize,
        /// Number of prediction weights of the topology.
        expected_prediction: usize,
    },
    /// A weight is −32768, which is not a valid value.
    #[error("weight {index} is −32768; weights are within ±32767")]
    InvalidWeight {
        /// Index of the weight.
        index: usize,
    },
}

/// Error: the buffer is too small for the container.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[error("a buffer of {found} bytes; at most {CONTAINER_BYTES_MAX} are needed")]
pub struct BufferTooSmall {
    /// Size of the buffer, in bytes.
    pub found: usize,
}

/// A container that has passed every check; the bytes are borrowed.
///
/// ```
/// use minimal_surprise_controller::{EncodedGenome, Genome, Provenance, Topology, codec};
///
/// let genome = Genome::zeroed(Topology::default());
/// let mut buffer = [0; codec::CONTAINER_BYTES_MAX];
/// let container = codec::encode(&genome, Provenance::default(), &mut buffer)?;
///
/// let encoded = EncodedGenome::decode(container)?;
/// assert_eq!(encoded.to_genome(), genome);
///
/// let mut damaged = container.to_vec();
/// damaged[100] ^= 1;
/// assert!(EncodedGenome::decode(&damaged).is_err());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct EncodedGenome<'a> {
    topology: Topology,
    provenance: Provenance,
    /// Weights as little-endian pairs of bytes.
    weights: &'a [[u8; 2]],
}

impl<'a> EncodedGenome<'a> {
    /// Checks every part of a container.
    ///
    /// # Errors
    /// [`DecodeError`] if a check fails. The first error is reported, in the order magic, version,
    /// length, checksum, header, kernel, topology, sizes, weights. Input shorter than
    /// [`PREFIX_BYTES`] is reported before all other errors.
    pub fn decode(bytes: &'a [u8]) -> Result<Self, DecodeError> {
        let prefix = Prefix::read(bytes)?;
        let block = checked_block(bytes, prefix.container_bytes)?;
        let too_long = DecodeError::HeaderTooLong {
            found: prefix.header_bytes,
            room: block.len().min(HEADER_BYTES_MAX),
        };
        if prefix.header_bytes > HEADER_BYTES_MAX {
            return Err(too_long);
        }
        let (header, weights) = block
            .split_at_checked(prefix.header_bytes)
            .ok_or(too_long)?;
        let header = decode_header(header)?;
        if header.kernel != KERNEL_ID {
            return Err(DecodeError::OtherKernel {
                found: header.kernel,
            });
        }
        let topology = topology_from_codes(header.model, header.prediction, header.template)?;
        if usize::from(header.action_weights) != topology.action_weights()
            || usize::from(header.prediction_weights) != topology.prediction_weights()
            || weights.len() != 2 * topology.weights()
        {
            return Err(DecodeError::SizesDoNotFit {
                action: header.action_weights,
                prediction: header.prediction_weights,
                bytes: weights.len(),
                expected_action: topology.action_weights(),
                expected_prediction: topology.prediction_weights(),
            });
        }
        let genome = Self {
            topology,
            provenance: header.provenance,
            weights: weights.as_chunks().0,
        };
        match genome.weights().position(|weight| weight == i16::MIN) {
            Some(index) => Err(DecodeError::InvalidWeight { index }),
            None => Ok(genome),
        }
    }

    /// Returns the topology.
    #[must_use]
    pub fn topology(&self) -> Topology {
        self.topology
    }

    /// Returns the origin of the genome.
    #[must_use]
    pub fn provenance(&self) -> Provenance {
        self.provenance
    }

    /// Returns the weights, Q3.12, in genome order.
    pub fn weights(&self) -> impl ExactSizeIterator<Item = i16> + use<'a> {
        self.weights.iter().map(|pair| i16::from_le_bytes(*pair))
    }

    /// Copies the weights into a [`Genome`].
    #[must_use]
    pub fn to_genome(&self) -> Genome {
        Genome::from_iter(self.topology, self.weights())
    }
}

/// Writes the container to the front of `buffer` and returns that part of it.
///
/// # Errors
/// [`BufferTooSmall`] if the container does not fit; [`CONTAINER_BYTES_MAX`] bytes are always
/// enough.
pub fn encode<'b>(
    genome: &Genome,
    provenance: Provenance,
    buffer: &'b mut [u8],
) -> Result<&'b [u8], BufferTooSmall> {
    let found = buffer.len();
    let too_small = BufferTooSmall { found };
    let topology = genome.topology();
    let (model, prediction, template) = codes_of_topology(topology);
    let header = Header {
        kernel: KERNEL_ID,
        model,
        prediction,
        template,
        provenance,
        action_weights: topology.action_weights() as u16,
        prediction_weights: topology.prediction_weights() as u16,
    };
    let mut header_buffer = [0; HEADER_BYTES_MAX];
    let header = postcard::to_slice(&header, &mut header_buffer).map_err(|_| too_small)?;
    let length = PREFIX_BYTES + header.len() + 2 * topology.weights() + CRC_BYTES;
    let container = buffer.get_mut(..length).ok_or(too_small)?;
    let (body, crc) = container.split_last_chunk_mut().ok_or(too_small)?;
    let prefix = Prefix {
        header_bytes: header.len(),
        container_bytes: length,
    };
    let weights = genome.weights().iter().flat_map(|w| w.to_le_bytes());
    let bytes = prefix.to_bytes().into_iter();
    let bytes = bytes.chain(header.iter().copied()).chain(weights);
    for (place, byte) in body.iter_mut().zip(bytes) {
        *place = byte;
    }
    *crc = CRC_32C.checksum(body).to_le_bytes();
    Ok(container)
}

/// Returns the length of the container that starts with these bytes, at most
/// [`CONTAINER_BYTES_MAX`]. The first [`PREFIX_BYTES`] are sufficient.
///
/// # Errors
/// [`DecodeError::TooShort`] if the prefix is incomplete; [`DecodeError::WrongMagic`],
/// [`DecodeError::UnknownVersion`] or [`DecodeError::ImpossibleLength`] if one of its fields is
/// invalid.
pub fn container_length(bytes: &[u8]) -> Result<usize, DecodeError> {
    Ok(Prefix::read(bytes)?.container_bytes)
}

/// The first bytes: magic, version and the two lengths.
struct Prefix {
    header_bytes: usize,
    container_bytes: usize,
}

impl Prefix {
    fn read(bytes: &[u8]) -> Result<Self, DecodeError> {
        let Some(prefix) = bytes.first_chunk::<PREFIX_BYTES>() else {
            return Err(DecodeError::TooShort {
                found: bytes.len(),
                needed: CONTAINER_BYTES_MIN,
            });
        };
        let [m0, m1, m2, m3, version, header_bytes, low, high] = *prefix;
        let magic = [m0, m1, m2, m3];
        if magic != MAGIC {
            return Err(DecodeError::WrongMagic { found: magic });
        }
        if version != FORMAT_VERSION {
            return Err(DecodeError::UnknownVersion { found: version });
        }
        let container_bytes = usize::from(u16::from_le_bytes([low, high]));
        if !(CONTAINER_BYTES_MIN..=CONTAINER_BYTES_MAX).contains(&container_bytes) {
            return Err(DecodeError::ImpossibleLength {
                found: container_bytes,
            });
        }
        Ok(Self {
            header_bytes: usize::from(header_bytes),
            container_bytes,
        })
    }

    fn to_bytes(&self) -> [u8; PREFIX_BYTES] {
        let [m0, m1, m2, m3] = MAGIC;
        let [low, high] = (self.container_bytes as u16).to_le_bytes();
        let header_bytes = self.header_bytes as u8;
        [m0, m1, m2, m3, FORMAT_VERSION, header_bytes, low, high]
    }
}

/// Checks length and checksum; returns the bytes between the prefix and the checksum.
fn checked_block(bytes: &[u8], length: usize) -> Result<&[u8], DecodeError> {
    let found = bytes.len();
    if found > length {
        return Err(DecodeError::TrailingBytes { found, length });
    }
    let too_short = DecodeError::TooShort {
        found,
        needed: length,
    };
    if found < length {
        return Err(too_short);
    }
    let (body, crc) = bytes.split_last_chunk::<CRC_BYTES>().ok_or(too_short)?;
    let found = u32::from_le_bytes(*crc);
    let computed = CRC_32C.checksum(body);
    if found != computed {
        return Err(DecodeError::BadCrc { found, computed });
    }
    body.get(PREFIX_BYTES..).ok_or(too_short)
}

/// Decodes a header and checks that it is in its canonical form.
///
/// Postcard accepts several encodings of a number, and bytes after the last field. Both only make
/// the header longer, so a header of minimum length is canonical.
fn decode_header(bytes: &[u8]) -> Result<Header, DecodeError> {
    match postcard::from_bytes::<Header>(bytes) {
        Ok(header) if header.shortest_bytes() == bytes.len() => Ok(header),
        _ => Err(DecodeError::MalformedHeader {
            length: bytes.len(),
        }),
    }
}

impl Header {
    /// Returns the length of the header in its shortest form, which is the form that postcard
    /// writes.
    fn shortest_bytes(&self) -> usize {
        let Provenance {
            seed,
            generation,
            matched_bits,
            scored_bits,
        } = self.provenance;
        let kernel_codes_and_seed_tag = size_of::<KernelId>() + 3 + 1;
        kernel_codes_and_seed_tag
            + seed.map_or(0, varint_bytes)
            + varint_bytes(generation.into())
            + varint_bytes(matched_bits)
            + varint_bytes(scored_bits)
            + varint_bytes(self.action_weights.into())
            + varint_bytes(self.prediction_weights.into())
    }
}

/// Returns the length of a number encoded with seven bits per byte.
fn varint_bytes(value: u64) -> usize {
    let bits = u64::BITS - (value | 1).leading_zeros();
    bits.div_ceil(7) as usize
}

fn codes_of_topology(topology: Topology) -> (u8, u8, u8) {
    let model = match topology.model() {
        SensorModel::A => 0,
        SensorModel::B => 1,
        SensorModel::C => 2,
    };
    let (prediction, template) = match topology.prediction() {
        Prediction::Free => (0, None),
        Prediction::PartlyPredefined(template) => (1, Some(template)),
        Prediction::Predefined(template) => (2, Some(template)),
    };
    let template = match template {
        None => 0,
        Some(Template::Line) => 1,
        Some(Template::Pair) => 2,
        Some(Template::Square) => 3,
        Some(Template::TriangularLattice) => 4,
    };
    (model, prediction, template)
}

fn topology_from_codes(model: u8, prediction: u8, template: u8) -> Result<Topology, DecodeError> {
    let model = match model {
        0 => SensorModel::A,
        1 => SensorModel::B,
        2 => SensorModel::C,
        found => return Err(DecodeError::UnknownModel { found }),
    };
    let prediction = match (prediction, template) {
        (0, 0) => Prediction::Free,
        (1 | 2, 1..=4) => {
            let template = match template {
                1 => Template::Line,
                2 => Template::Pair,
                3 => Template::Square,
                _ => Template::TriangularLattice,
            };
            if prediction == 1 {
                Prediction::PartlyPredefined(template)
            } else {
                Prediction::Predefined(template)
            }
        }
        _ => {
            return Err(DecodeError::UnknownPrediction {
                prediction,
                template,
            });
        }
    };
    Ok(Topology::new(model, prediction)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_header_fits() {
        let header = Header {
            kernel: KERNEL_ID,
            model: 2,
            prediction: 2,
            template: 4,
            provenance: Provenance {
                seed: Some(u64::MAX),
                generation: u32::MAX,
                matched_bits: u64::MAX,
                scored_bits: u64::MAX,
            },
            action_weights: u16::MAX,
            prediction_weights: u16::MAX,
        };
        let mut buffer = [0; HEADER_BYTES_MAX];
        let bytes = postcard::to_slice(&header, &mut buffer).unwrap();
        assert_eq!(bytes.len(), HEADER_BYTES_MAX);
    }

    #[test]
    fn the_shortest_length_of_a_header_is_that_of_the_encoded_header() {
        let ends = [0, 7, 14, 16, 21, 28, 32, 35, 42, 49, 56, 63].map(|bits| 1_u64 << bits);
        for value in ends.into_iter().flat_map(|end| [end - 1, end]) {
            let header = Header {
                kernel: KERNEL_ID,
                model: 0,
                prediction: 0,
                template: 0,
                provenance: Provenance {
                    seed: Some(value),
                    generation: value as u32,
                    matched_bits: value,
                    scored_bits: u64::MAX - value,
                },
                action_weights: value as u16,
                prediction_weights: u16::MAX - value as u16,
            };
            let no_seed = Header {
                provenance: Provenance {
                    seed: None,
                    ..header.provenance
                },
                ..header
            };
            for header in [header, no_seed] {
                let mut buffer = [0; HEADER_BYTES_MAX];
                let bytes = postcard::to_slice(&header, &mut buffer).unwrap();
                assert_eq!(bytes.len(), header.shortest_bytes(), "{header:?}");
            }
        }
    }

    #[test]
    fn topologies_and_their_codes_correspond() {
        for topology in Topology::ALL {
            let (model, prediction, template) = codes_of_topology(topology);
            assert_eq!(
                topology_from_codes(model, prediction, template),
                Ok(topology)
            );
        }
    }
}
