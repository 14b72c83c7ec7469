//! Compression of chunks, outside HDF5 and its lock, in the format of HDF5's own shuffle and deflate filters.
//!
//! A shuffled chunk of numbers is a sequence of planes, the lowest byte of every number first. In measured
//! data the low bytes are noise, and deflate spends most of its time on them without compressing them; the
//! high ones (exponents, the leading digits of a time, of an index) are not. So the low planes go into the
//! stream as stored blocks, and only the rest is deflated. Any inflater reads the result.

use hdf5::H5Type;
use libdeflater::{CompressionLvl, Compressor, adler32};

/// Level of libdeflate. 2 and 3 make an event log 0.2 % smaller and take a third more time.
const LEVEL: i32 = 1;
/// Start of a zlib stream: deflate with a window of 32 KiB.
const ZLIB: [u8; 2] = [0x78, 0x01];
/// Largest number of bytes in a stored block.
const STORED: usize = 0xFFFF;
/// Bytes of a plane that are sampled.
const SAMPLE: usize = 1024;

/// A number that chunks can contain.
pub(crate) trait Number: H5Type + Copy {
    /// Size of a number [bytes].
    const SIZE: usize;
    /// Its bytes, the lowest first, and zeros.
    fn bytes(self) -> [u8; 8];
}

macro_rules! number {
    ($type:ty, $size:literal, $bits:expr) => {
        impl Number for $type {
            const SIZE: usize = $size;
            fn bytes(self) -> [u8; 8] {
                let bits: fn($type) -> u64 = $bits;
                bits(self).to_le_bytes()
            }
        }
    };
}

number!(f64, 8, f64::to_bits);
number!(u8, 1, u64::from);
number!(u32, 4, u64::from);
number!(i32, 4, |value| u64::from(value as u32));

/// Compresses chunks; reuses its buffers.
pub(crate) struct Packer {
    compressor: Compressor,
    planes: Vec<u8>,
    stream: Vec<u8>,
}

impl std::fmt::Debug for Packer {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.debug_struct("Packer").finish_non_exhaustive()
    }
}

impl Packer {
    pub fn new() -> Self {
        let level = CompressionLvl::new(LEVEL).unwrap_or_default();
        Self { compressor: Compressor::new(level), planes: Vec::new(), stream: Vec::new() }
    }

    /// A shuffled and compressed chunk of `volume` numbers: `values`, and zeros after them.
    pub fn pack<T: Number>(&mut self, values: impl Iterator<Item = T>, volume: usize) -> hdf5::Result<&[u8]> {
        let count = self.shuffle(values, volume);
        // A chunk that is not full is the last one: its zeros are compressed, too.
        let stored = if count == volume { self.noise(T::SIZE, volume) } else { 0 } * volume;
        let (low, high) = self.planes.split_at(stored);
        let stream = &mut self.stream;
        stream.clear();
        stream.extend(ZLIB);
        for block in low.chunks(STORED) {
            let length = block.len() as u16;
            stream.push(0);
            stream.extend(length.to_le_bytes());
            stream.extend((!length).to_le_bytes());
            stream.extend_from_slice(block);
        }
        // The last block, which ends the stream, comes from libdeflate, also if no bytes are left.
        let start = stream.len();
        stream.resize(start + self.compressor.deflate_compress_bound(high.len()), 0);
        let length = self
            .compressor
            .deflate_compress(high, &mut stream[start..])
            .map_err(|error| format!("a chunk cannot be compressed: {error}"))?;
        stream.truncate(start + length);
        stream.extend(adler32(&self.planes).to_be_bytes());
        Ok(stream)
    }

    /// Splits numbers into planes; returns their number.
    fn shuffle<T: Number>(&mut self, values: impl Iterator<Item = T>, volume: usize) -> usize {
        self.planes.clear();
        self.planes.resize(T::SIZE * volume, 0);
        let mut rest = &mut self.planes[..];
        let mut planes: [&mut [u8]; 8] = Default::default();
        for plane in planes.iter_mut().take(T::SIZE) {
            (*plane, rest) = rest.split_at_mut(volume);
        }
        let mut count = 0;
        for value in values.take(volume) {
            let bytes = value.bytes();
            for (plane, byte) in planes.iter_mut().zip(bytes).take(T::SIZE) {
                plane[count] = byte;
            }
            count += 1;
        }
        count
    }

    /// Number of the lowest planes up to the last one that is noise.
    fn noise(&self, size: usize, volume: usize) -> usize {
        (0..size).rev().find(|&k| is_noise(&self.planes[k * volume..(k + 1) * volume])).map_or(0, |k| k + 1)
    }
}

/// Whether deflate would gain little on these bytes: their values are nearly equally frequent. Estimated from
/// pairs of equal bytes in a sample: one pair in 256 for random bytes; bytes with one in 170 or more are
/// compressed.
fn is_noise(plane: &[u8]) -> bool {
    let mut counts = [0_u32; 256];
    let mut sample = 0_u32;
    for &byte in plane.iter().step_by(plane.len().div_ceil(SAMPLE).max(1)) {
        counts[usize::from(byte)] += 1;
        sample += 1;
    }
    let pairs: u64 = counts.iter().map(|&count| u64::from(count) * u64::from(count.saturating_sub(1))).sum();
    2 * 256 * pairs < 3 * u64::from(sample) * u64::from(sample.saturating_sub(1))
}

#[cfg(test)]
mod tests {
    use libdeflater::Decompressor;

    use super::*;

    /// A number in [0, 1) with a full mantissa (SplitMix64).
    fn number(k: u64) -> f64 {
        let mut z = k.wrapping_mul(0x9E37_79B9_7F4A_7C15);
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// The bytes of a packed chunk after zlib and HDF5's shuffle.
    fn unpack(stream: &[u8], size: usize, volume: usize) -> Vec<u8> {
        let mut planes = vec![0; size * volume];
        let length = Decompressor::new().zlib_decompress(stream, &mut planes).expect("a zlib stream");
        assert_eq!(length, planes.len());
        (0..volume)
            .flat_map(|k| (0..size).map(move |b| (k, b)))
            .map(|(k, b)| planes[b * volume + k])
            .collect()
    }

    fn check<T: Number>(values: &[T], volume: usize) -> usize {
        let mut packer = Packer::new();
        let stream = packer.pack(values.iter().copied(), volume).expect("a chunk");
        let mut expected: Vec<u8> =
            values.iter().flat_map(|value| value.bytes().into_iter().take(T::SIZE)).collect();
        expected.resize(T::SIZE * volume, 0);
        assert!(unpack(stream, T::SIZE, volume) == expected, "{} of {volume} numbers differ", values.len());
        stream.len()
    }

    #[test]
    fn inflating_and_unshuffling_restores_every_chunk() {
        // Lengths beyond a stored block, and chunks that are not full.
        for (count, volume) in [(1, 1), (0, 7), (5, 7), (4096, 4096), (4000, 4096), (3 * 65_536, 3 * 65_536)]
        {
            let reals: Vec<f64> = (0..count).map(|k| number(k) - 0.5).collect();
            check(&reals, volume);
            check(&vec![0.0; count as usize], volume);
            check(&(0..count).map(|k| k as f64).collect::<Vec<_>>(), volume);
            // All bits: nothing can be compressed.
            check(
                &reals.iter().map(|x| f64::from_bits((x * 1e19) as i64 as u64)).collect::<Vec<_>>(),
                volume,
            );
            check(&(0..count as u32).map(|k| k.wrapping_mul(0x9E37_79B9)).collect::<Vec<_>>(), volume);
            check(&(0..count as i32).map(|k| k % 3 - 1).collect::<Vec<_>>(), volume);
            check(&vec![crate::events::Kind::from(haff_engine::EventKind::Wall); count as usize], volume);
        }
    }

    #[test]
    fn exponents_and_repetitions_are_compressed_and_mantissas_are_stored_without_overhead() {
        let n = 8192;
        let reals: Vec<f64> = (0..n).map(|k| number(k) - 0.5).collect();
        let size = check(&reals, n as usize) as f64 / n as f64;
        // Of 64 bits, 52 and a sign are random, and the exponent has 2 bits of information: 55 of 64 at best.
        assert!((6.8..7.3).contains(&size), "{size} bytes a random real");
        let times: Vec<f64> = (0..n).map(|k| 1000.0 + k as f64 * 1e-5 + 1e-5 * number(k)).collect();
        let size = check(&times, n as usize) as f64 / n as f64;
        assert!(size < 6.0, "{size} bytes an increasing time");
        assert!(check(&vec![0.0; n as usize], n as usize) < 200);
    }
}
