//! The transfer of payloads to arrays of a device, chunk by chunk.

use crate::device::Gpu;
use crate::error::{Error, Result};
use crate::payload::{Payload, PayloadPart};
use crate::threads::for_each;
use surfel_core::progress::Progress;

/// Bytes of a chunk.
const CHUNK_BYTES: usize = 1 << 24;
/// Maximum number of bytes on their way to the device: one chunk is filled while the device copies the one before.
pub const MAX_STAGING_BYTES: usize = 2 * CHUNK_BYTES;
/// Bytes of a piece of a chunk: for one, a thread is worth its start, which takes some ten microseconds.
const PIECE_BYTES: usize = 1 << 20;

/// Copies bytes of a payload from `offset` on in several threads.
fn copy_in_parallel(payload: &Payload, offset: usize, target: wgpu::WriteOnly<[u8]>) {
    let (pieces, rest) = target.into_chunks::<PIECE_BYTES>();
    let pieces: Vec<_> = pieces.into_iter().enumerate().collect();
    let end = offset + pieces.len() * PIECE_BYTES;
    for_each(pieces, |(i, piece)| payload.copy(offset + i * PIECE_BYTES, piece.into()));
    payload.copy(end, rest);
}

/// A transfer of which at most two chunks are on their way.
pub struct Transfer<'a> {
    gpu: &'a Gpu,
    progress: &'a dyn Progress,
    /// The chunk that the device copies.
    in_flight: Option<wgpu::SubmissionIndex>,
}

impl<'a> Transfer<'a> {
    /// Makes a transfer of nothing yet.
    pub fn new(gpu: &'a Gpu, progress: &'a dyn Progress) -> Self {
        Self { gpu, progress, in_flight: None }
    }

    /// Fills an array with the bytes from `start` on.
    ///
    /// # Errors
    ///
    /// Fails if the device does, or once `progress` is cancelled.
    pub fn fill(
        &mut self,
        buffer: &wgpu::Buffer,
        payload: &Payload,
        start: usize,
    ) -> surfel_core::Result<()> {
        let size = buffer.size() as usize;
        for offset in (0..size).step_by(CHUNK_BYTES) {
            self.progress.check()?;
            let n_bytes = CHUNK_BYTES.min(size - offset);
            let submitted = self.gpu.catch("points", || {
                let n_bytes = wgpu::BufferSize::new(n_bytes as u64)?;
                let queue = &self.gpu.queue;
                let mut staging = queue.write_buffer_with(buffer, offset as u64, n_bytes)?;
                copy_in_parallel(payload, start + offset, staging.slice(..));
                drop(staging);
                Some(queue.submit([]))
            })?;
            let submitted = submitted.ok_or_else(|| self.refusal())?;
            if let Some(previous) = self.in_flight.replace(submitted) {
                self.gpu.wait_for(&previous)?;
            }
        }
        Ok(())
    }

    /// Waits until all is on the device.
    pub fn finish(self) -> Result<()> {
        self.in_flight.map_or(Ok(()), |last| self.gpu.wait_for(&last))
    }

    /// Returns the error of a device that gives no memory for a chunk, and no other error: it was lost.
    fn refusal(&self) -> Error {
        let lost = self.gpu.check().err();
        lost.unwrap_or_else(|| self.gpu.keep_failure("gives no memory for points".to_owned()))
    }
}

/// Fills an array.
///
/// # Errors
///
/// Fails if the device does, or once `progress` is cancelled.
pub fn write(
    gpu: &Gpu,
    buffer: &wgpu::Buffer,
    bytes: &[u8],
    progress: &dyn Progress,
) -> surfel_core::Result<()> {
    let mut transfer = Transfer::new(gpu, progress);
    transfer.fill(buffer, &Payload(vec![PayloadPart::Bytes(bytes)]), 0)?;
    Ok(transfer.finish()?)
}

#[cfg(test)]
mod tests {
    //! Bytes arrive as they were sent, also in arrays that begin amid a node.

    use super::*;
    use crate::numbers::{NODE_VECTORS, VECTOR_BYTES};
    use crate::test_support::{CancelledAfter, open_gpu};
    use bytemuck::Zeroable;
    use std::sync::mpsc;
    use surfel_core::bvh::BvhNode;
    use surfel_core::progress::NoProgress;
    use wgpu::BufferUsages as Usage;

    fn read(gpu: &Gpu, buffer: &wgpu::Buffer) -> Vec<u8> {
        let target = gpu.buffer("read", buffer.size(), Usage::MAP_READ | Usage::COPY_DST).unwrap();
        let mut encoder =
            gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(buffer, 0, &target, 0, buffer.size());
        gpu.queue.submit([encoder.finish()]);
        let (sender, receiver) = mpsc::channel();
        target.slice(..).map_async(wgpu::MapMode::Read, move |result| sender.send(result).unwrap());
        gpu.wait().unwrap();
        receiver.recv().unwrap().unwrap();
        target.slice(..).get_mapped_range().unwrap().to_vec()
    }

    #[test]
    fn arrays_hold_what_was_sent() {
        const NODE_BYTES: usize = VECTOR_BYTES * NODE_VECTORS;
        let Some(gpu) = open_gpu() else { return };
        let node = |i: u32| {
            let mut node = BvhNode::zeroed();
            bytemuck::bytes_of_mut(&mut node).fill(i as u8);
            node
        };
        // More than two chunks, so that memory is used again.
        let nodes: Vec<BvhNode> = (0..400_000).map(node).collect();
        let bytes: Vec<u8> = (0..CHUNK_BYTES + 160).map(|i| (i / 16) as u8).collect();
        let mut expected: Vec<u8> = Vec::new();
        for node in &nodes {
            expected.extend_from_slice(bytemuck::bytes_of(node));
            expected.resize(expected.len().next_multiple_of(NODE_BYTES), 0);
        }
        expected.extend_from_slice(&bytes);
        let payload = Payload(vec![
            PayloadPart::nodes(nodes.len(), |i| nodes[i]),
            PayloadPart::Bytes(&bytes),
        ]);
        assert_eq!(payload.len(), expected.len());
        // The second array begins amid a node, the third one amid the bytes.
        let starts = [0, 16 * 1001, 400_000 * NODE_BYTES + 32];
        let mut transfer = Transfer::new(&gpu, &NoProgress);
        let usage = Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC;
        let arrays = starts.map(|start| {
            let buffer = gpu.buffer("test", (expected.len() - start) as u64, usage).unwrap();
            transfer.fill(&buffer, &payload, start).unwrap();
            buffer
        });
        transfer.finish().unwrap();
        for (start, array) in starts.into_iter().zip(&arrays) {
            assert!(read(&gpu, array) == expected[start..], "{start}");
        }
    }

    #[test]
    fn a_device_lost_amid_a_transfer_is_an_error() {
        let Some(gpu) = open_gpu() else { return };
        let bytes = vec![0; 2 * CHUNK_BYTES];
        let usage = Usage::STORAGE | Usage::COPY_DST;
        let buffer = gpu.buffer("test", bytes.len() as u64, usage).unwrap();
        gpu.device.destroy();
        let error = write(&gpu, &buffer, &bytes, &NoProgress).unwrap_err();
        assert!(error.to_string().contains(&gpu.info.name), "{error}");
        assert!(gpu.check().is_err());
    }

    #[test]
    fn a_transfer_is_cancelled_between_chunks() {
        let Some(gpu) = open_gpu() else { return };
        let bytes = vec![0; 3 * CHUNK_BYTES];
        let usage = Usage::STORAGE | Usage::COPY_DST;
        let buffer = gpu.buffer("test", bytes.len() as u64, usage).unwrap();
        let write = |n| write(&gpu, &buffer, &bytes, &CancelledAfter::new(n));
        for n in 0..3 {
            assert_eq!(write(n), Err(surfel_core::Error::Cancelled));
        }
        assert_eq!(write(3), Ok(()));
    }
}
