//! Copies results from a device to the CPU: into buffers that are then mapped.

use crate::device::Gpu;
use crate::error::Result;
use std::sync::mpsc;
use std::time::Instant;

/// Results on their way to the CPU. The buffer is unmapped when this is dropped, so that it can be copied to again.
#[derive(Debug)]
pub struct Readback<'a> {
    buffer: &'a wgpu::Buffer,
    n_bytes: u64,
    submission: wgpu::SubmissionIndex,
    arrival: mpsc::Receiver<(std::result::Result<(), wgpu::BufferAsyncError>, Instant)>,
}

impl<'a> Readback<'a> {
    /// Submits `copy`, which copies to the first bytes of a buffer, and asks for these.
    pub fn new(
        gpu: &Gpu,
        buffer: &'a wgpu::Buffer,
        n_bytes: u64,
        copy: impl FnOnce(&mut wgpu::CommandEncoder),
    ) -> Self {
        let description = wgpu::CommandEncoderDescriptor::default();
        let mut encoder = gpu.device.create_command_encoder(&description);
        copy(&mut encoder);
        let submission = gpu.queue.submit([encoder.finish()]);
        let (sender, arrival) = mpsc::channel();
        // If the receiver is gone, nobody wants the results any more.
        let callback = move |result| _ = sender.send((result, Instant::now()));
        buffer.slice(..n_bytes).map_async(wgpu::MapMode::Read, callback);
        Self { buffer, n_bytes, submission, arrival }
    }

    /// Waits for the results, and returns what `read` makes of them, and the time at which they were there.
    ///
    /// # Errors
    ///
    /// Fails if the device does.
    pub fn read<T>(self, gpu: &Gpu, read: impl FnOnce(&[u8]) -> T) -> Result<(T, Instant)> {
        gpu.wait_for(&self.submission)?;
        let unreadable =
            |reason: String| gpu.keep_failure(format!("results cannot be read: {reason}"));
        let arrival = self.arrival.try_recv().map_err(|error| unreadable(error.to_string()))?;
        arrival.0.map_err(|error| unreadable(error.to_string()))?;
        let slice = self.buffer.slice(..self.n_bytes);
        let view = slice.get_mapped_range().map_err(|error| unreadable(error.to_string()))?;
        Ok((read(&view), arrival.1))
    }
}

impl Drop for Readback<'_> {
    fn drop(&mut self) {
        self.buffer.unmap();
    }
}
