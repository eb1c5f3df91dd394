//! Decodes the base of points of formats from 6 on from its nine layers.

use std::io::{Cursor, Read, Result, Seek, SeekFrom};

use laz::DecompressionSelection;
use laz::decoders::ArithmeticDecoder;
use laz::decompressors::{IntegerDecompressor, IntegerDecompressorBuilder};
use laz::models::{ArithmeticModel, ArithmeticModelBuilder};
use laz::record::LayeredFieldDecompressor;

use super::gps::{Generation, GpsTimes};
use super::header::{read_u16, read_u32, read_u64};
use super::median::StreamingMedian5;

/// Bytes of the base of a point.
const SIZE: usize = 30;

/// The layers, in the order in which they are stored.
#[derive(Clone, Copy)]
enum Layer {
    Position,
    Height,
    Class,
    Flags,
    Intensity,
    ScanAngle,
    UserData,
    SourceId,
    GpsTime,
}

/// The decoder of the base of points, which replaces that of the `laz` crate because of the times (see `gps`).
pub(super) struct Point14 {
    /// True from compression version 4 on, in which the other parts keep a context for each scanner channel.
    follows_channel: bool,
    layers: [LayerDecoder; 9],
    channels: [Option<Box<Channel>>; 4],
    current: usize,
}

type Decoder = ArithmeticDecoder<Cursor<Vec<u8>>>;

/// The decoder of one layer of a chunk.
struct LayerDecoder {
    decoder: Decoder,
    /// Bytes of the layer.
    size: u32,
    is_wanted: bool,
    /// True if the layer is wanted and has bytes; a layer without bytes means that no value changes.
    is_coded: bool,
}

/// The values in the base of a record.
#[derive(Clone, Copy, Default)]
struct Point {
    x: i32,
    y: i32,
    z: i32,
    intensity: u16,
    return_number: u8,
    number_of_returns: u8,
    flags: u8,
    class: u8,
    user_data: u8,
    scan_angle: i16,
    source_id: u16,
    gps_time: i64,
}

/// The state of the decoder for one scanner channel.
struct Channel {
    /// Last point of the channel.
    last: Point,
    /// True if the time of the last point differs from that of the one before.
    has_new_time: bool,
    last_intensity: [u16; 8],
    last_z: [i32; 8],
    x_steps: [StreamingMedian5; 12],
    y_steps: [StreamingMedian5; 12],
    times: GpsTimes,
    changes: [Option<ArithmeticModel>; 8],
    channel: ArithmeticModel,
    number_of_returns: [Option<ArithmeticModel>; 16],
    return_number: [Option<ArithmeticModel>; 16],
    return_of_same_time: ArithmeticModel,
    class: [Option<ArithmeticModel>; 64],
    flags: [Option<ArithmeticModel>; 64],
    user_data: [Option<ArithmeticModel>; 64],
    x: IntegerDecompressor,
    y: IntegerDecompressor,
    z: IntegerDecompressor,
    intensity: IntegerDecompressor,
    scan_angle: IntegerDecompressor,
    source_id: IntegerDecompressor,
}

impl Point14 {
    /// A decoder for this version of the compression.
    pub fn new(version: u16) -> Self {
        let layer = |_| LayerDecoder {
            decoder: ArithmeticDecoder::new(Cursor::new(Vec::new())),
            size: 0,
            is_wanted: true,
            is_coded: false,
        };
        Self {
            follows_channel: version == 4,
            layers: [0; 9].map(layer),
            channels: [const { None }; 4],
            current: 0,
        }
    }
}

impl<R: Read + Seek> LayeredFieldDecompressor<R> for Point14 {
    fn size_of_field(&self) -> usize {
        SIZE
    }

    fn set_selection(&mut self, selection: DecompressionSelection) {
        let wanted = [
            true,
            selection.should_decompress_z(),
            selection.should_decompress_classification(),
            selection.should_decompress_flags(),
            selection.should_decompress_intensity(),
            selection.should_decompress_scan_angle(),
            selection.should_decompress_user_data(),
            selection.should_decompress_point_source_id(),
            selection.should_decompress_gps_time(),
        ];
        for (layer, is_wanted) in self.layers.iter_mut().zip(wanted) {
            layer.is_wanted = is_wanted;
        }
    }

    fn init_first_point(
        &mut self,
        source: &mut R,
        first_point: &mut [u8],
        context: &mut usize,
    ) -> Result<()> {
        source.read_exact(first_point)?;
        let point = Point::from_bytes(first_point);
        self.current = usize::from(point.flags >> 4 & 3);
        self.channels = [const { None }; 4];
        self.channels[self.current] = Some(Box::new(Channel::new(point)));
        *context = self.current;
        Ok(())
    }

    fn decompress_field_with(&mut self, out: &mut [u8], context: &mut usize) -> Result<()> {
        let Self { layers, channels, current, .. } = self;
        let last_channel =
            channels[*current].as_mut().expect("the first point has set its channel");
        let decoder = &mut layers[Layer::Position as usize].decoder;
        let changes = {
            let last = &last_channel.last;
            let is_first = last.return_number == 1;
            let is_last = last.number_of_returns <= last.return_number;
            let context = usize::from(is_first)
                | usize::from(is_last) << 1
                | usize::from(last_channel.has_new_time) << 2;
            decoder.decode_symbol(model(&mut last_channel.changes[context], 128))?
        };
        if changes & 1 << 6 != 0 {
            let step = decoder.decode_symbol(&mut last_channel.channel)? as usize;
            let last = last_channel.last;
            *current = (*current + step + 1) & 3;
            let channel = channels[*current].get_or_insert_with(|| Box::new(Channel::new(last)));
            channel.last.flags = channel.last.flags & !0x30 | (*current as u8) << 4;
            *context = *current;
        }
        if self.follows_channel {
            *context = *current;
        }
        let channel =
            channels[*current].as_mut().expect("the channel was there or was created above");
        channel.decode(layers, changes)?;
        channel.last.write(out);
        Ok(())
    }

    fn read_layers_sizes(&mut self, source: &mut R) -> Result<()> {
        for layer in &mut self.layers {
            let mut size = [0; 4];
            source.read_exact(&mut size)?;
            layer.size = u32::from_le_bytes(size);
        }
        Ok(())
    }

    fn read_layers(&mut self, source: &mut R) -> Result<()> {
        for layer in &mut self.layers {
            layer.is_coded = layer.is_wanted && layer.size != 0;
            if !layer.is_coded {
                source.seek(SeekFrom::Current(layer.size.into()))?;
                continue;
            }
            // `Chunks::check` has compared the sizes with that of the chunk.
            let mut bytes = vec![0; layer.size as usize];
            source.read_exact(&mut bytes)?;
            layer.decoder = ArithmeticDecoder::new(Cursor::new(bytes));
            layer.decoder.read_init_bytes()?;
        }
        Ok(())
    }
}

impl Channel {
    fn new(last: Point) -> Self {
        let integers = |bits, contexts| {
            IntegerDecompressorBuilder::new().bits(bits).contexts(contexts).build_initialized()
        };
        Self {
            last,
            has_new_time: false,
            last_intensity: [last.intensity; 8],
            last_z: [last.z; 8],
            x_steps: [StreamingMedian5::default(); 12],
            y_steps: [StreamingMedian5::default(); 12],
            times: GpsTimes::new(last.gps_time, Generation::Layered),
            changes: [const { None }; 8],
            channel: ArithmeticModelBuilder::new(3).build(),
            number_of_returns: [const { None }; 16],
            return_number: [const { None }; 16],
            return_of_same_time: ArithmeticModelBuilder::new(13).build(),
            class: [const { None }; 64],
            flags: [const { None }; 64],
            user_data: [const { None }; 64],
            x: integers(32, 2),
            y: integers(32, 22),
            z: integers(32, 20),
            intensity: integers(16, 4),
            scan_angle: integers(16, 2),
            source_id: integers(16, 1),
        }
    }

    /// Replaces `last` by the next point; the bits of `changes` mark the parts that differ.
    fn decode(&mut self, layers: &mut [LayerDecoder; 9], changes: u32) -> Result<()> {
        let last = &mut self.last;
        let has_new_time = changes & 1 << 4 != 0;
        let position = &mut layers[Layer::Position as usize].decoder;

        if changes & 1 << 2 != 0 {
            let model = model(&mut self.number_of_returns[usize::from(last.number_of_returns)], 16);
            last.number_of_returns = position.decode_symbol(model)? as u8;
        }
        last.return_number = match changes & 3 {
            0 => last.return_number,
            1 => (last.return_number + 1) & 15,
            2 => (last.return_number + 15) & 15,
            _ if has_new_time => {
                let model = model(&mut self.return_number[usize::from(last.return_number)], 16);
                position.decode_symbol(model)? as u8
            }
            _ => {
                let step = position.decode_symbol(&mut self.return_of_same_time)? as u8 + 2;
                (last.return_number + step) & 15
            }
        };
        let (n, r) = (last.number_of_returns, last.return_number);
        // 3: the only return, 2: the first, 1: the last, 0: between.
        let position_in_pulse = u32::from(r == 1) << 1 | u32::from(n <= r);
        let is_single = u32::from(n == 1);

        let kind = usize::from(RETURN_KINDS[usize::from(n)][usize::from(r)] - b'0');
        let steps = kind << 1 | usize::from(has_new_time);
        let step = self.x.decompress(position, self.x_steps[steps].get(), is_single)?;
        last.x = last.x.wrapping_add(step);
        self.x_steps[steps].add(step);
        let context = is_single + (self.x.k() & !1).min(20);
        let step = self.y.decompress(position, self.y_steps[steps].get(), context)?;
        last.y = last.y.wrapping_add(step);
        self.y_steps[steps].add(step);

        if let Some(decoder) = coded(layers, Layer::Height) {
            let level = usize::from(n.abs_diff(r).min(7));
            let context = is_single + (((self.x.k() + self.y.k()) / 2) & !1).min(18);
            last.z = self.z.decompress(decoder, self.last_z[level], context)?;
            self.last_z[level] = last.z;
        }
        if let Some(decoder) = coded(layers, Layer::Class) {
            let context = usize::from(last.class & 0x1f) << 1 | usize::from(position_in_pulse == 3);
            last.class = decoder.decode_symbol(model(&mut self.class[context], 256))? as u8;
        }
        if let Some(decoder) = coded(layers, Layer::Flags) {
            // The two bits of the channel lie between the coded ones.
            let context = usize::from(last.flags & 15 | last.flags >> 2 & 0x30);
            let flags = decoder.decode_symbol(model(&mut self.flags[context], 64))? as u8;
            last.flags = flags & 15 | last.flags & 0x30 | (flags & 0x30) << 2;
        }
        if let Some(decoder) = coded(layers, Layer::Intensity) {
            let at = (position_in_pulse << 1 | u32::from(has_new_time)) as usize;
            let expected = i32::from(self.last_intensity[at]);
            last.intensity =
                self.intensity.decompress(decoder, expected, position_in_pulse)? as u16;
            self.last_intensity[at] = last.intensity;
        }
        if let (true, Some(decoder)) = (changes & 1 << 3 != 0, coded(layers, Layer::ScanAngle)) {
            let expected = i32::from(last.scan_angle);
            let context = u32::from(has_new_time);
            last.scan_angle = self.scan_angle.decompress(decoder, expected, context)? as i16;
        }
        if let Some(decoder) = coded(layers, Layer::UserData) {
            let model = model(&mut self.user_data[usize::from(last.user_data / 4)], 256);
            last.user_data = decoder.decode_symbol(model)? as u8;
        }
        if let (true, Some(decoder)) = (changes & 1 << 5 != 0, coded(layers, Layer::SourceId)) {
            let expected = i32::from(last.source_id);
            last.source_id = self.source_id.decompress(decoder, expected, 0)? as u16;
        }
        if let (true, Some(decoder)) = (has_new_time, coded(layers, Layer::GpsTime)) {
            last.gps_time = self.times.next(decoder)?;
        }
        self.has_new_time = has_new_time;
        Ok(())
    }
}

impl Point {
    /// Reads a point from its record.
    fn from_bytes(bytes: &[u8]) -> Self {
        let number = |at| read_u32(bytes, at) as i32;
        Self {
            x: number(0),
            y: number(4),
            z: number(8),
            intensity: read_u16(bytes, 12),
            return_number: bytes[14] & 15,
            number_of_returns: bytes[14] >> 4,
            flags: bytes[15],
            class: bytes[16],
            user_data: bytes[17],
            scan_angle: read_u16(bytes, 18) as i16,
            source_id: read_u16(bytes, 20),
            gps_time: read_u64(bytes, 22) as i64,
        }
    }

    /// Writes the point to its record.
    fn write(&self, out: &mut [u8]) {
        out[0..4].copy_from_slice(&self.x.to_le_bytes());
        out[4..8].copy_from_slice(&self.y.to_le_bytes());
        out[8..12].copy_from_slice(&self.z.to_le_bytes());
        out[12..14].copy_from_slice(&self.intensity.to_le_bytes());
        out[14] = self.number_of_returns << 4 | self.return_number;
        out[15] = self.flags;
        out[16] = self.class;
        out[17] = self.user_data;
        out[18..20].copy_from_slice(&self.scan_angle.to_le_bytes());
        out[20..22].copy_from_slice(&self.source_id.to_le_bytes());
        out[22..30].copy_from_slice(&self.gps_time.to_le_bytes());
    }
}

/// Returns the decoder of a layer, if the layer is coded.
fn coded(layers: &mut [LayerDecoder; 9], layer: Layer) -> Option<&mut Decoder> {
    let layer = &mut layers[layer as usize];
    layer.is_coded.then_some(&mut layer.decoder)
}

/// Returns a model of `n_symbols` symbols, which is created at its first use.
fn model(model: &mut Option<ArithmeticModel>, n_symbols: u32) -> &mut ArithmeticModel {
    model.get_or_insert_with(|| ArithmeticModelBuilder::new(n_symbols).build())
}

/// Kinds of returns with similar steps, from the specification of the format: a row for each number of returns, a digit
/// for each return.
const RETURN_KINDS: [&[u8; 16]; 16] = [
    b"0123453445555555",
    b"1013333333333333",
    b"2124444444433333",
    b"3345444444444444",
    b"4344544444444444",
    b"5344454444444444",
    b"3344445444444444",
    b"4344444544444444",
    b"4344444454444444",
    b"5344444445444444",
    b"5344444444544444",
    b"5334444444455444",
    b"5334444444455544",
    b"5334444444445554",
    b"5334444444444555",
    b"5334444444444455",
];
