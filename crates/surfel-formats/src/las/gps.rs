//! GPS times of LAZ files, decoded with a bound on how often one value may change between time sequences.

use std::io::{Error, ErrorKind, Read, Result};

use laz::decoders::ArithmeticDecoder;
use laz::decompressors::{IntegerDecompressor, IntegerDecompressorBuilder};
use laz::models::{ArithmeticModel, ArithmeticModelBuilder};
use laz::record::FieldDecompressor;

/// Multiples of the last difference that have a symbol of their own.
const MOST: i32 = 500;
const LEAST: i32 = -10;
/// Symbols of multiples; behind them, the first one says that the whole time follows.
const WHOLE: i32 = MOST - LEAST + 1;
/// An encoder changes the sequence once a value at most. The decoder of the `laz` crate has no limit
/// and recurses: 1.6 KB of broken data overflow its stack, which nothing can catch.
const MOST_CHANGES: usize = 8;

/// The two generations of the code differ in a symbol for a time that stays the same.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Generation {
    /// LAZ of point formats up to 5.
    Pointwise,
    /// LAZ of point formats from 6 on, where another layer says it.
    Layered,
}

/// Four sequences of times, each predicted from its own last difference.
pub(super) struct GpsTimes {
    generation: Generation,
    first_symbols: ArithmeticModel,
    multiples: ArithmeticModel,
    integers: IntegerDecompressor,
    sequences: [Sequence; 4],
    current: usize,
    newest: usize,
}

#[derive(Clone, Copy, Default)]
struct Sequence {
    /// The bits of an f64.
    time: i64,
    difference: i32,
    n_extremes: u32,
}

impl GpsTimes {
    pub fn new(first: i64, generation: Generation) -> Self {
        let n_unchanged = u32::from(generation == Generation::Pointwise);
        let mut sequences = [Sequence::default(); 4];
        sequences[0].time = first;
        Self {
            generation,
            first_symbols: ArithmeticModelBuilder::new(5 + n_unchanged).build(),
            multiples: ArithmeticModelBuilder::new(WHOLE as u32 + 4 + n_unchanged).build(),
            integers: IntegerDecompressorBuilder::new().bits(32).contexts(9).build_initialized(),
            sequences,
            current: 0,
            newest: 0,
        }
    }

    /// The bits of the next time.
    pub fn next<R: Read>(&mut self, decoder: &mut ArithmeticDecoder<R>) -> Result<i64> {
        for _ in 0..=MOST_CHANGES {
            let has_difference = self.sequences[self.current].difference != 0;
            let step = if has_difference {
                self.next_by_multiple(decoder)?
            } else {
                self.next_by_difference(decoder)?
            };
            // The step is that to another sequence, which has the time.
            if step == 0 {
                return Ok(self.sequences[self.current].time);
            }
            self.current = (self.current + step) & 3;
        }
        Err(Error::new(ErrorKind::InvalidData, "times that change between sequences endlessly"))
    }

    fn next_by_difference<R: Read>(&mut self, decoder: &mut ArithmeticDecoder<R>) -> Result<usize> {
        let mut symbol = decoder.decode_symbol(&mut self.first_symbols)? as usize;
        if self.generation == Generation::Pointwise {
            if symbol == 0 {
                return Ok(0);
            }
            symbol -= 1;
        }
        match symbol {
            0 => {
                let difference = self.integers.decompress(decoder, 0, 0)?;
                let sequence = &mut self.sequences[self.current];
                sequence.difference = difference;
                sequence.n_extremes = 0;
                sequence.time = sequence.time.wrapping_add(difference.into());
            }
            1 => self.begin_sequence(decoder)?,
            _ => return Ok(symbol - 1),
        }
        Ok(0)
    }

    fn next_by_multiple<R: Read>(&mut self, decoder: &mut ArithmeticDecoder<R>) -> Result<usize> {
        let mut symbol = decoder.decode_symbol(&mut self.multiples)? as i32;
        if self.generation == Generation::Pointwise {
            if symbol == WHOLE {
                return Ok(0);
            }
            symbol -= i32::from(WHOLE < symbol);
        }
        if symbol == WHOLE {
            self.begin_sequence(decoder)?;
            return Ok(0);
        }
        if WHOLE < symbol {
            return Ok((symbol - WHOLE) as usize);
        }
        let multiple = if symbol <= MOST { symbol } else { MOST - symbol };
        let context = match multiple {
            0 => 7,
            1 => 1,
            2..10 => 2,
            MOST => 4,
            10.. => 3,
            ..=LEAST => 6,
            _ => 5,
        };
        let expected = self.sequences[self.current].difference.wrapping_mul(multiple);
        let difference = self.integers.decompress(decoder, expected, context)?;
        let sequence = &mut self.sequences[self.current];
        sequence.time = sequence.time.wrapping_add(difference.into());
        if multiple == 1 {
            sequence.n_extremes = 0;
        } else if matches!(multiple, 0 | MOST | LEAST) {
            sequence.n_extremes += 1;
            // The old difference has ceased to be a good measure.
            if 3 < sequence.n_extremes {
                sequence.difference = difference;
                sequence.n_extremes = 0;
            }
        }
        Ok(0)
    }

    /// A time without relation to the others takes the place of the oldest sequence.
    fn begin_sequence<R: Read>(&mut self, decoder: &mut ArithmeticDecoder<R>) -> Result<()> {
        let last = self.sequences[self.current].time;
        let upper = self.integers.decompress(decoder, (last >> 32) as i32, 8)?;
        let time = i64::from(upper) << 32 | i64::from(decoder.read_int()?);
        self.newest = (self.newest + 1) & 3;
        self.current = self.newest;
        self.sequences[self.current] = Sequence { time, ..Sequence::default() };
        Ok(())
    }
}

/// The GPS time as a part of pointwise records.
pub(super) struct GpsTimeField(GpsTimes);

impl Default for GpsTimeField {
    fn default() -> Self {
        Self(GpsTimes::new(0, Generation::Pointwise))
    }
}

impl<R: Read> FieldDecompressor<R> for GpsTimeField {
    fn size_of_field(&self) -> usize {
        8
    }

    fn decompress_first(&mut self, source: &mut R, first_point: &mut [u8]) -> Result<()> {
        source.read_exact(first_point)?;
        let bits = i64::from_le_bytes(first_point.first_chunk().copied().unwrap_or_default());
        *self = Self(GpsTimes::new(bits, Generation::Pointwise));
        Ok(())
    }

    fn decompress_with(
        &mut self,
        decoder: &mut ArithmeticDecoder<R>,
        point: &mut [u8],
    ) -> Result<()> {
        point.copy_from_slice(&self.0.next(decoder)?.to_le_bytes());
        Ok(())
    }
}
