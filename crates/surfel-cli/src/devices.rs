//! `surfel devices`: the devices that can render.

use crate::report::print;
use crate::stats;
use rayon::current_num_threads;
#[cfg(feature = "gpu")]
use surfel_core::bytes::readable;
use surfel_core::words::counted;

/// Arguments of `surfel devices`.
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct Args {}

const EXAMPLES: &str = "\
Examples:
  surfel devices
  surfel render scan.laz -o scan.png --backend gpu --device 0
  surfel render scan.laz -o scan.png --backend gpu --device nvidia";

/// Lists the processor and all GPUs.
pub fn run(_: &Args) -> anyhow::Result<()> {
    let mut lines =
        vec![format!("cpu  {}, {}", stats::device(), counted(current_num_threads(), "thread"))];
    lines.extend(gpu_lines());
    Ok(print(&lines.join("\n"))?)
}

#[cfg(feature = "gpu")]
fn gpu_lines() -> Vec<String> {
    let devices = surfel::surfel_gpu::devices();
    if devices.is_empty() {
        return vec!["no GPU: neither Vulkan nor Metal nor DirectX 12 has a device".into()];
    }
    let lines = devices.iter().enumerate().map(|(index, device)| {
        let (kind, arrays) = (device.kind.name(), readable(device.max_array_bytes));
        let surfel::surfel_gpu::DeviceInfo { name, api, driver, .. } = device;
        let memory = device
            .memory_bytes
            .map_or_else(String::new, |bytes| format!(", {} of memory", readable(bytes)));
        format!(
            "{index:<4} {name}, {kind}, {api}, driver {driver}{memory}, arrays of up to {arrays}"
        )
    });
    lines.collect()
}

#[cfg(not(feature = "gpu"))]
fn gpu_lines() -> Vec<String> {
    vec!["no GPU: this build has no GPU support (feature gpu)".into()]
}
