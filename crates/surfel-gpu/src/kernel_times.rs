//! The times that kernels take on a device, by its own clock.

use crate::device::Gpu;
use crate::error::Result;
use crate::readback::Readback;
use crate::shader::Kernel;
use std::collections::BTreeMap;
use wgpu::BufferUsages as Usage;

/// The work of a kernel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct KernelTime {
    /// Number of passes.
    pub n_runs: u64,
    /// Seconds that they took together.
    pub secs: f64,
}

/// The times of all kernels, while they are measured.
#[derive(Debug, Default)]
pub struct KernelTimes {
    /// True if they are measured.
    pub is_measured: bool,
    by_kernel: BTreeMap<Kernel, KernelTime>,
}

impl KernelTimes {
    /// Adds a pass.
    pub fn add(&mut self, kernel: Kernel, secs: f64) {
        let time = self.by_kernel.entry(kernel).or_default();
        time.n_runs += 1;
        time.secs += secs;
    }

    /// Forgets all passes.
    pub fn reset(&mut self) {
        self.by_kernel.clear();
    }

    /// Returns the kernels' names and times.
    pub fn named(&self) -> Vec<(String, KernelTime)> {
        self.by_kernel.iter().map(|(kernel, time)| (name(*kernel), *time)).collect()
    }
}

/// Returns the name of a kernel in lower-case words.
fn name(kernel: Kernel) -> String {
    let mut words = String::new();
    for letter in format!("{kernel:?}").chars().filter(|letter| *letter != ')') {
        if letter == '(' || letter.is_uppercase() && !words.is_empty() && !words.ends_with(' ') {
            words.push(' ');
        }
        words.extend(letter.to_lowercase().filter(|letter| *letter != '('));
    }
    words
}

/// The clock readings before and after the passes of a submission.
#[derive(Debug)]
pub struct Timestamps {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    readback: wgpu::Buffer,
}

/// Bytes of a clock reading.
const TIMESTAMP_BYTES: u64 = 8;

impl Timestamps {
    /// Makes the buffers for up to `max_passes` passes.
    ///
    /// # Errors
    ///
    /// Fails if the device does.
    pub fn new(gpu: &Gpu, max_passes: u32) -> Result<Self> {
        let count = max_passes + 1;
        let n_bytes = TIMESTAMP_BYTES * u64::from(count);
        let description =
            wgpu::QuerySetDescriptor { label: None, ty: wgpu::QueryType::Timestamp, count };
        Ok(Self {
            queries: gpu.catch("timestamps", || gpu.device.create_query_set(&description))?,
            resolved: gpu.buffer("times", n_bytes, Usage::QUERY_RESOLVE | Usage::COPY_SRC)?,
            readback: gpu.buffer("read times", n_bytes, Usage::MAP_READ | Usage::COPY_DST)?,
        })
    }

    /// Writes the time after `n_passes` passes of a submission.
    pub fn write(&self, encoder: &mut wgpu::ComputePass, n_passes: usize) {
        encoder.write_timestamp(&self.queries, n_passes as u32);
    }

    /// Waits for the passes of a submission, and returns the seconds that each of them took.
    ///
    /// # Errors
    ///
    /// Fails if the device does.
    pub fn read(&self, gpu: &Gpu, n_passes: usize) -> Result<Vec<f64>> {
        let n = n_passes as u32 + 1;
        let n_bytes = TIMESTAMP_BYTES * u64::from(n);
        let readback = Readback::new(gpu, &self.readback, n_bytes, |encoder| {
            encoder.resolve_query_set(&self.queries, 0..n, &self.resolved, 0);
            encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.readback, 0, n_bytes);
        });
        let (ticks, _) = readback.read(gpu, bytemuck::pod_collect_to_vec::<_, u64>)?;
        let secs_of_tick = 1e-9 * f64::from(gpu.queue.get_timestamp_period());
        let passes = ticks.windows(2);
        Ok(passes.map(|pair| pair[1].saturating_sub(pair[0]) as f64 * secs_of_tick).collect())
    }
}

#[cfg(test)]
mod tests {
    //! Kernels have names in words, and their times are sums.

    use super::*;
    use crate::surface::Surface;

    #[test]
    fn names_are_words() {
        assert_eq!(name(Kernel::TakeQueue), "take queue");
        assert_eq!(name(Kernel::Closest(Surface::SplatFit)), "closest splat fit");
        assert_eq!(name(Kernel::Any(Surface::Mls(3))), "any mls 3");
    }

    #[test]
    fn times_are_summed_up_by_kernel() {
        let mut times = KernelTimes::default();
        for secs in [1.0, 2.5] {
            times.add(Kernel::Shade, secs);
        }
        times.add(Kernel::Generate, 0.5);
        let shade = ("shade".to_owned(), KernelTime { n_runs: 2, secs: 3.5 });
        let generate = ("generate".to_owned(), KernelTime { n_runs: 1, secs: 0.5 });
        assert_eq!(times.named(), [generate, shade]);
        times.reset();
        assert_eq!(times.named(), []);
    }
}
