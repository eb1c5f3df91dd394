//! Devices: the list of them, and one opened for work.

use crate::error::{Error, Result};
use crate::numbers::{
    MAX_QUEUE_ENTRIES, N_BLOCK_PAGES, N_NODE_PAGES, VECTOR_BYTES, WORKGROUP_SIZE,
};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// A device on which pictures can be rendered.
#[derive(Clone, Debug, PartialEq)]
pub struct DeviceInfo {
    /// Name of the device.
    pub name: String,
    /// The kind of device.
    pub kind: DeviceKind,
    /// The interface by which it is used: Vulkan, Metal or Dx12.
    pub api: String,
    /// Name and version of the driver.
    pub driver: String,
    /// Size of the largest array that a kernel can read, in bytes.
    pub max_array_bytes: u64,
    /// Size of the device's own memory in bytes; none if it has none, or if only Metal or DirectX 12 know it.
    pub memory_bytes: Option<u64>,
}

/// The kind of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceKind {
    /// A GPU with memory of its own.
    Discrete,
    /// A GPU that shares the processor's memory.
    Integrated,
    /// A GPU of a virtual machine.
    Virtual,
    /// A device of an unknown kind.
    Other,
    /// A driver that runs kernels on the processor.
    Software,
}

impl DeviceKind {
    /// Returns the kind in words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Discrete => "discrete GPU",
            Self::Integrated => "integrated GPU",
            Self::Virtual => "virtual GPU",
            Self::Other => "other device",
            Self::Software => "software on the CPU",
        }
    }
}

/// Number of storage buffers that a kernel uses at most, where trees are whole.
const N_STORAGE_BUFFERS: u64 = 11;
/// The features by which the time of each pass can be measured.
const TIMING: wgpu::Features =
    wgpu::Features::TIMESTAMP_QUERY.union(wgpu::Features::TIMESTAMP_QUERY_INSIDE_PASSES);
/// Time after which a device that does not finish a piece of work counts as hung. Pieces take far less than a second.
const WAIT_TIMEOUT: Duration = Duration::from_secs(60);
/// Time for devices of software, whose pieces take seconds, and longer beside other work.
const SOFTWARE_WAIT_TIMEOUT: Duration = Duration::from_secs(1200);

/// Returns all devices, those first that are preferred.
pub fn devices() -> Vec<DeviceInfo> {
    adapters().iter().map(info).collect()
}

fn adapters() -> Vec<wgpu::Adapter> {
    let mut description = wgpu::InstanceDescriptor::new_without_display_handle();
    description.backends = wgpu::Backends::PRIMARY;
    // The sizes of indirect dispatches come from kernels that keep the limits; their check would be one more dispatch.
    description.flags.remove(wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL);
    let instance = wgpu::Instance::new(description);
    let mut adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY));
    // The sort is stable: equal devices keep the order of the system.
    adapters.sort_by_key(|adapter| kind(adapter) as u32);
    adapters
}

fn kind(adapter: &wgpu::Adapter) -> DeviceKind {
    match adapter.get_info().device_type {
        wgpu::DeviceType::DiscreteGpu => DeviceKind::Discrete,
        wgpu::DeviceType::IntegratedGpu => DeviceKind::Integrated,
        wgpu::DeviceType::VirtualGpu => DeviceKind::Virtual,
        wgpu::DeviceType::Other => DeviceKind::Other,
        wgpu::DeviceType::Cpu => DeviceKind::Software,
    }
}

fn info(adapter: &wgpu::Adapter) -> DeviceInfo {
    let info = adapter.get_info();
    let limits = adapter.limits();
    DeviceInfo {
        name: info.name,
        kind: kind(adapter),
        api: format!("{:?}", info.backend),
        driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
        max_array_bytes: limits.max_storage_buffer_binding_size.min(limits.max_buffer_size),
        // Drivers on the processor state a fixed number, which is not their limit.
        memory_bytes: (kind(adapter) != DeviceKind::Software)
            .then(|| memory_bytes(adapter))
            .flatten(),
    }
}

/// Returns the size of the largest heap of a device's own memory, as Vulkan reports it.
#[cfg(any(windows, target_os = "linux", target_os = "android", target_os = "freebsd"))]
fn memory_bytes(adapter: &wgpu::Adapter) -> Option<u64> {
    /// The bit `VK_MEMORY_HEAP_DEVICE_LOCAL_BIT`.
    const DEVICE_LOCAL: u32 = 1;
    // SAFETY: the adapter is only asked for its properties, while wgpu holds it and its instance.
    let heaps = unsafe {
        let adapter = adapter.as_hal::<wgpu::hal::api::Vulkan>()?;
        let instance = adapter.shared_instance().raw_instance();
        instance.get_physical_device_memory_properties(adapter.raw_physical_device())
    };
    let heaps = heaps.memory_heaps.iter().take(heaps.memory_heap_count as usize);
    let own = heaps.filter(|heap| heap.flags.as_raw() & DEVICE_LOCAL != 0);
    own.map(|heap| heap.size).max()
}

#[cfg(not(any(windows, target_os = "linux", target_os = "android", target_os = "freebsd")))]
fn memory_bytes(_: &wgpu::Adapter) -> Option<u64> {
    None
}

/// Returns the index of the device with this index, or with this text in its name, whatever its case; without a
/// selector the first one.
fn select(devices: &[DeviceInfo], selector: Option<&str>) -> Result<usize> {
    if devices.is_empty() {
        return Err(Error::NoDevice);
    }
    let Some(selector) = selector else { return Ok(0) };
    let by_index = selector.parse().ok().filter(|index| *index < devices.len());
    let text = selector.to_lowercase();
    let by_name = || devices.iter().position(|device| device.name.to_lowercase().contains(&text));
    let is_number = selector.parse::<usize>().is_ok();
    by_index.or_else(|| if is_number { None } else { by_name() }).ok_or_else(|| {
        let known = devices.iter().enumerate().map(|(i, device)| format!("{i} ({})", device.name));
        Error::UnknownDevice {
            found: selector.to_owned(),
            known: known.collect::<Vec<_>>().join(", "),
        }
    })
}

/// An opened device.
#[derive(Debug)]
pub struct Gpu {
    /// The device.
    pub info: DeviceInfo,
    /// Makes buffers and kernels.
    pub device: wgpu::Device,
    /// Takes work.
    pub queue: wgpu::Queue,
    /// Binary logarithm of the number of vectors of four words in a page of a tree.
    pub page_shift: u32,
    /// Maximum number of bytes to hold in the device's memory.
    pub memory_limit: Option<u64>,
    /// The first failure, after which the device is not used any more.
    failure: Arc<Mutex<Option<Error>>>,
}

impl Gpu {
    /// Opens the device with this index or name, or the first one. Trees larger than `max_page_bytes`, or than the device's
    /// arrays, are split.
    ///
    /// # Errors
    ///
    /// Fails if there is no such device, if it allows less than is needed, or if its driver refuses to open it.
    pub fn open(selector: Option<&str>, max_page_bytes: u64) -> Result<Self> {
        let adapters = adapters();
        let devices: Vec<DeviceInfo> = adapters.iter().map(info).collect();
        let chosen = select(&devices, selector)?;
        let (adapter, info) = (&adapters[chosen], devices[chosen].clone());
        let limits = adapter.limits();
        check_limits(&info, &limits)?;
        let description = wgpu::DeviceDescriptor {
            label: Some("surfel"),
            required_features: adapter.features() & TIMING,
            required_limits: limits,
            memory_hints: wgpu::MemoryHints::Performance,
            ..wgpu::DeviceDescriptor::default()
        };
        let opened = pollster::block_on(adapter.request_device(&description));
        let (device, queue) = opened.map_err(|error| Error::Device {
            device: info.name.clone(),
            reason: format!("cannot be opened: {error}"),
        })?;
        let failure = Arc::new(Mutex::new(None));
        let (name, first) = (info.name.clone(), Arc::clone(&failure));
        device
            .on_uncaptured_error(Arc::new(move |error| keep_first(&first, of_wgpu(&name, error))));
        let (name, first) = (info.name.clone(), Arc::clone(&failure));
        device.set_device_lost_callback(move |_, reason| {
            let reason = format!("was lost: {reason}");
            keep_first(&first, Error::Device { device: name.clone(), reason });
        });
        let page_shift = page_shift(info.max_array_bytes.min(max_page_bytes));
        Ok(Self { info, device, queue, page_shift, memory_limit: None, failure })
    }

    /// Returns the number of bytes in a page of a tree.
    pub fn page_bytes(&self) -> usize {
        VECTOR_BYTES << self.page_shift
    }

    /// Returns true if the device allows kernels that read a tree in pages.
    pub fn has_pages(&self) -> bool {
        let n_pages = (N_NODE_PAGES + N_BLOCK_PAGES - 2) as u64;
        let n_allowed = self.device.limits().max_storage_buffers_per_shader_stage;
        N_STORAGE_BUFFERS - 1 + n_pages <= u64::from(n_allowed)
    }

    /// Fails if the device has less memory than is needed, or if the limit is lower.
    pub fn check_memory(&self, needed: u64) -> Result<()> {
        let device = || self.info.name.clone();
        match (self.info.memory_bytes, self.memory_limit) {
            (_, Some(limit)) if limit < needed => {
                Err(Error::MemoryLimit { device: device(), limit, needed })
            }
            (Some(found), _) if found < needed => {
                Err(Error::Memory { device: device(), found, needed })
            }
            _ => Ok(()),
        }
    }

    /// Returns true if the time of each pass can be measured.
    pub fn has_timestamps(&self) -> bool {
        self.device.features().contains(TIMING)
    }

    /// Fails if the device has failed since it was opened.
    pub fn check(&self) -> Result<()> {
        let failure = self.failure.lock().unwrap_or_else(PoisonError::into_inner);
        failure.clone().map_or(Ok(()), Err)
    }

    /// Waits until the device has done what it was told.
    pub fn wait(&self) -> Result<()> {
        self.wait_until(None)
    }

    /// Waits until the device has done a submission and all before it.
    pub fn wait_for(&self, submission: &wgpu::SubmissionIndex) -> Result<()> {
        self.wait_until(Some(submission.clone()))
    }

    fn wait_until(&self, submission_index: Option<wgpu::SubmissionIndex>) -> Result<()> {
        let timeout = match self.info.kind {
            DeviceKind::Software => SOFTWARE_WAIT_TIMEOUT,
            _ => WAIT_TIMEOUT,
        };
        let wait = wgpu::PollType::Wait { submission_index, timeout: Some(timeout) };
        self.finish_wait(timeout, || self.device.poll(wait))
    }

    /// Runs `poll`, which waits this long at most.
    fn finish_wait(
        &self,
        timeout: Duration,
        poll: impl FnOnce() -> std::result::Result<wgpu::PollStatus, wgpu::PollError>,
    ) -> Result<()> {
        // wgpu panics if a device is lost while it waits, or has no memory then. Its callback has kept the reason before.
        let polled = catch_unwind(AssertUnwindSafe(poll));
        self.check()?;
        match polled {
            Ok(Ok(_)) => Ok(()),
            Ok(Err(_)) => {
                let secs = timeout.as_secs();
                Err(self.keep_failure(format!("did not finish within {secs} seconds")))
            }
            Err(_) => Err(self.keep_failure("was lost".to_owned())),
        }
    }

    /// Runs `work` and returns its result, or the error that it caused.
    pub fn catch<T>(&self, what: &str, work: impl FnOnce() -> T) -> Result<T> {
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let internal = self.device.push_error_scope(wgpu::ErrorFilter::Internal);
        let validation = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let result = work();
        let errors = [validation.pop(), internal.pop(), memory.pop()].map(pollster::block_on);
        match errors.into_iter().flatten().next() {
            None => Ok(result),
            Some(wgpu::Error::OutOfMemory { .. }) => {
                Err(Error::OutOfMemory { device: self.info.name.clone() })
            }
            Some(error) => Err(Error::Device {
                device: self.info.name.clone(),
                reason: format!("refused {what}: {error}"),
            }),
        }
    }

    /// Makes a buffer.
    pub fn buffer(
        &self,
        label: &str,
        size: u64,
        usage: wgpu::BufferUsages,
    ) -> Result<wgpu::Buffer> {
        let description =
            wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
        self.catch(label, || self.device.create_buffer(&description))
    }

    /// Keeps a failure of the device, and returns it.
    pub fn keep_failure(&self, reason: String) -> Error {
        let error = Error::Device { device: self.info.name.clone(), reason };
        keep_first(&self.failure, error.clone());
        error
    }
}

/// Returns the binary logarithm of the number of vectors in the largest page of at most `max_bytes`.
fn page_shift(max_bytes: u64) -> u32 {
    (max_bytes / VECTOR_BYTES as u64).max(1).ilog2()
}

fn keep_first(first: &Mutex<Option<Error>>, error: Error) {
    first.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
}

fn of_wgpu(device: &str, error: wgpu::Error) -> Error {
    let device = device.to_owned();
    match error {
        wgpu::Error::OutOfMemory { .. } => Error::OutOfMemory { device },
        error => Error::Device { device, reason: error.to_string() },
    }
}

fn check_limits(info: &DeviceInfo, limits: &wgpu::Limits) -> Result<()> {
    let n_buffers = u64::from(limits.max_storage_buffers_per_shader_stage);
    let n_invocations = u64::from(limits.max_compute_invocations_per_workgroup);
    let n_workgroups = u64::from(limits.max_compute_workgroups_per_dimension);
    for (limit, found, needed) in [
        ("storage buffers a kernel", n_buffers, N_STORAGE_BUFFERS),
        ("invocations a workgroup", n_invocations, u64::from(WORKGROUP_SIZE)),
        ("workgroups along an axis", n_workgroups, (MAX_QUEUE_ENTRIES / WORKGROUP_SIZE).into()),
    ] {
        if found < needed {
            return Err(Error::Limit { device: info.name.clone(), limit, found, needed });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    //! Devices are chosen by index and by name, limits are checked, and failures are errors.

    use super::*;
    use crate::test_support::open_gpu;

    fn device(name: &str, kind: DeviceKind) -> DeviceInfo {
        DeviceInfo {
            name: name.into(),
            kind,
            api: "Vulkan".into(),
            driver: String::new(),
            max_array_bytes: 1 << 27,
            memory_bytes: None,
        }
    }

    #[test]
    fn devices_are_chosen_by_index_and_by_name() {
        let devices = [
            device("NVIDIA H100", DeviceKind::Discrete),
            device("llvmpipe (LLVM 15)", DeviceKind::Software),
        ];
        assert_eq!(select(&devices, None), Ok(0));
        assert_eq!(select(&devices, Some("1")), Ok(1));
        assert_eq!(select(&devices, Some("LLVMpipe")), Ok(1));
        assert_eq!(select(&[], None), Err(Error::NoDevice));
        // A number is an index, also where a name has it.
        for unknown in ["2", "100", "radeon"] {
            let known = "0 (NVIDIA H100), 1 (llvmpipe (LLVM 15))".to_owned();
            let error = Error::UnknownDevice { found: unknown.into(), known };
            assert_eq!(select(&devices, Some(unknown)), Err(error));
        }
    }

    #[test]
    fn devices_that_allow_too_little_are_refused() {
        let info = device("small", DeviceKind::Integrated);
        let enough =
            wgpu::Limits { max_storage_buffers_per_shader_stage: 11, ..wgpu::Limits::default() };
        assert_eq!(check_limits(&info, &enough), Ok(()));
        let limits = wgpu::Limits { max_storage_buffers_per_shader_stage: 4, ..enough };
        let error = check_limits(&info, &limits).unwrap_err();
        assert_eq!(error.to_string(), "small allows 4 storage buffers a kernel, 11 are needed");
    }

    #[test]
    fn pages_hold_a_hundred_million_points() {
        // Devices whose arrays end at 2 GiB - 1 have pages of 1 GiB.
        let page_bytes = (VECTOR_BYTES as u64) << page_shift(i32::MAX as u64);
        assert_eq!(page_bytes, 1 << 30);
        assert!(100_000_000 / 8 * 128 <= N_BLOCK_PAGES as u64 * page_bytes);
        assert_eq!(VECTOR_BYTES << page_shift(1 << 27), 1 << 27);
    }

    #[test]
    fn memory_is_checked_against_the_device_and_the_limit() {
        let Some(mut gpu) = open_gpu() else { return };
        gpu.info.memory_bytes = None;
        assert_eq!(gpu.check_memory(u64::MAX), Ok(()));
        gpu.info.memory_bytes = Some(2 << 30);
        assert_eq!(gpu.check_memory(2 << 30), Ok(()));
        let message = |gpu: &Gpu, needed| gpu.check_memory(needed).unwrap_err().to_string();
        let name = gpu.info.name.clone();
        let expected = format!("{name} has 2.0 GiB of memory, 3.0 GiB are needed");
        assert_eq!(message(&gpu, 3 << 30), expected);
        gpu.memory_limit = Some(1 << 20);
        assert_eq!(gpu.check_memory(1 << 20), Ok(()));
        let expected = format!(
            "{name}: 1.5 MiB of memory are needed, and the limit is 1.0 MiB [memory_limit]"
        );
        assert_eq!(message(&gpu, 3 << 19), expected);
    }

    #[test]
    fn what_a_driver_refuses_is_an_error_with_its_name() {
        let Some(gpu) = open_gpu() else { return };
        let source = wgpu::ShaderSource::Wgsl("fn f() -> u32 { return 1.5; }".into());
        let description = wgpu::ShaderModuleDescriptor { label: None, source };
        let error =
            gpu.catch("a kernel", || gpu.device.create_shader_module(description)).unwrap_err();
        let expected = format!("{}: refused a kernel: ", gpu.info.name);
        assert!(error.to_string().starts_with(&expected), "{error}");
        // The device is still good for other work.
        assert_eq!((gpu.check(), gpu.wait()), (Ok(()), Ok(())));
    }

    #[test]
    fn a_panic_of_a_wait_is_the_loss_of_the_device() {
        let wait = |gpu: &Gpu| gpu.finish_wait(WAIT_TIMEOUT, || panic!("Error in Device::poll"));
        let Some(gpu) = open_gpu() else { return };
        let error = wait(&gpu).unwrap_err();
        assert_eq!(error.to_string(), format!("{}: was lost", gpu.info.name));
        // Its callback knows more.
        let Some(gpu) = open_gpu() else { return };
        let known = gpu.keep_failure("was lost: no power".to_owned());
        assert_eq!(wait(&gpu), Err(known.clone()));
        assert_eq!(gpu.check(), Err(known));
    }

    #[test]
    fn a_device_without_memory_says_so() {
        let source = "no memory".into();
        let error = of_wgpu("small", wgpu::Error::OutOfMemory { source });
        assert_eq!(error.to_string(), "small is out of memory");
    }
}
