//! E57: the exchange format of laser scanners (ASTM E2807), with the pose of each scan.

mod pages;
mod streams;
mod values;
mod partial_xml;
mod undescribed;
mod document;
mod columns;
mod scan;
mod images;
mod read;

pub(crate) use read::{inspect, read};
