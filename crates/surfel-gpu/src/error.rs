//! The errors of devices.

use surfel_core::bytes::readable;

/// An error of a device.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// The machine has no device.
    #[error("no GPU was found: neither Vulkan nor Metal nor DirectX 12 has a device")]
    NoDevice,
    /// No device has this name or index.
    #[error("unknown device '{found}'; known: {known}")]
    UnknownDevice {
        /// The name or index that was asked for.
        found: String,
        /// All devices.
        known: String,
    },
    /// A device allows less than is needed.
    #[error("{device} allows {found} {limit}, {needed} are needed")]
    Limit {
        /// Name of the device.
        device: String,
        /// The limited things, in the plural.
        limit: &'static str,
        /// The limit.
        found: u64,
        /// The number that is needed.
        needed: u64,
    },
    /// A picture needs more memory than a device has.
    #[error("{device} has {} of memory, {} are needed", readable(*.found), readable(*.needed))]
    Memory {
        /// Name of the device.
        device: String,
        /// The memory of the device in bytes.
        found: u64,
        /// The number of bytes that is needed.
        needed: u64,
    },
    /// A picture needs more of a device's memory than is allowed.
    #[error("{device}: {} of memory are needed, and the limit is {} [memory_limit]", readable(*.needed), readable(*.limit))]
    MemoryLimit {
        /// Name of the device.
        device: String,
        /// The limit in bytes.
        limit: u64,
        /// The number of bytes that is needed.
        needed: u64,
    },
    /// A device ran out of memory.
    #[error("{device} is out of memory")]
    OutOfMemory {
        /// Name of the device.
        device: String,
    },
    /// A device refused or failed to do something.
    #[error("{device}: {reason}")]
    Device {
        /// Name of the device.
        device: String,
        /// The event, without a subject.
        reason: String,
    },
}

/// A result whose error is [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

impl From<Error> for surfel_core::Error {
    fn from(error: Error) -> Self {
        Self::Renderer(error.to_string())
    }
}
