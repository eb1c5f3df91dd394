//! Slices of a cloud's columns that threads fill in parallel.

use std::ops::Range;

use surfel_core::math::Vec3;
use surfel_core::points::{PointCloud, Values};

use crate::error::{Error, Result};
use crate::file::Input;

/// Slices of all columns of a cloud, for one range of points.
#[derive(Default)]
pub(crate) struct ColumnSlices<'a> {
    /// Positions.
    pub positions: &'a mut [Vec3],
    /// Normals.
    pub normals: Option<&'a mut [Vec3]>,
    /// Radii.
    pub radii: Option<&'a mut [f32]>,
    /// Colours.
    pub colors: Option<&'a mut [[u16; 3]]>,
    /// Intensities.
    pub intensity: Option<&'a mut [f32]>,
    /// Classes.
    pub classification: Option<&'a mut [u8]>,
    /// Named columns.
    pub scalars: Vec<ValuesMut<'a>>,
}

/// A slice of a scalar column.
pub(crate) enum ValuesMut<'a> {
    U8(&'a mut [u8]),
    U16(&'a mut [u16]),
    I32(&'a mut [i32]),
    F32(&'a mut [f32]),
    F64(&'a mut [f64]),
}

impl<'a> ColumnSlices<'a> {
    /// Slices of the columns of `cloud` from point `start` on.
    pub fn from_cloud(cloud: &'a mut PointCloud, start: usize) -> Self {
        Self {
            positions: &mut cloud.positions[start..],
            normals: cloud.normals.as_mut().map(|column| &mut column[start..]),
            radii: cloud.radii.as_mut().map(|column| &mut column[start..]),
            colors: cloud.colors.as_mut().map(|column| &mut column[start..]),
            intensity: cloud.intensity.as_mut().map(|column| &mut column[start..]),
            classification: cloud.classification.as_mut().map(|column| &mut column[start..]),
            scalars: cloud
                .scalars
                .iter_mut()
                .map(|scalar| match &mut scalar.values {
                    Values::U8(v) => ValuesMut::U8(&mut v[start..]),
                    Values::U16(v) => ValuesMut::U16(&mut v[start..]),
                    Values::I32(v) => ValuesMut::I32(&mut v[start..]),
                    Values::F32(v) => ValuesMut::F32(&mut v[start..]),
                    Values::F64(v) => ValuesMut::F64(&mut v[start..]),
                })
                .collect(),
        }
    }

    /// Returns the number of points.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Splits off the first `n` points.
    pub fn split_off_front(&mut self, n: usize) -> Self {
        Self {
            positions: front(&mut self.positions, n),
            normals: self.normals.as_mut().map(|column| front(column, n)),
            radii: self.radii.as_mut().map(|column| front(column, n)),
            colors: self.colors.as_mut().map(|column| front(column, n)),
            intensity: self.intensity.as_mut().map(|column| front(column, n)),
            classification: self.classification.as_mut().map(|column| front(column, n)),
            scalars: self
                .scalars
                .iter_mut()
                .map(|values| match values {
                    ValuesMut::U8(v) => ValuesMut::U8(front(v, n)),
                    ValuesMut::U16(v) => ValuesMut::U16(front(v, n)),
                    ValuesMut::I32(v) => ValuesMut::I32(front(v, n)),
                    ValuesMut::F32(v) => ValuesMut::F32(front(v, n)),
                    ValuesMut::F64(v) => ValuesMut::F64(front(v, n)),
                })
                .collect(),
        }
    }

    /// Copies ranges of points to the first points of these slices, one after the other.
    pub fn copy_ranges(&mut self, from: &ColumnSlices, ranges: &[Range<usize>]) {
        copy(self.positions, from.positions, ranges);
        copy_if_present(&mut self.normals, &from.normals, ranges);
        copy_if_present(&mut self.radii, &from.radii, ranges);
        copy_if_present(&mut self.colors, &from.colors, ranges);
        copy_if_present(&mut self.intensity, &from.intensity, ranges);
        copy_if_present(&mut self.classification, &from.classification, ranges);
        for (to, from) in self.scalars.iter_mut().zip(&from.scalars) {
            match (to, from) {
                (ValuesMut::U8(to), ValuesMut::U8(from)) => copy(to, from, ranges),
                (ValuesMut::U16(to), ValuesMut::U16(from)) => copy(to, from, ranges),
                (ValuesMut::I32(to), ValuesMut::I32(from)) => copy(to, from, ranges),
                (ValuesMut::F32(to), ValuesMut::F32(from)) => copy(to, from, ranges),
                (ValuesMut::F64(to), ValuesMut::F64(from)) => copy(to, from, ranges),
                _ => unreachable!("both have the same columns"),
            }
        }
    }
}

/// Cuts every column to `n` points, or extends it by zeros; returns false if they do not fit in memory.
pub(crate) fn resize(cloud: &mut PointCloud, n: usize) -> bool {
    fn column<T: Copy + Default>(column: &mut Vec<T>, n: usize) -> bool {
        if column.is_empty() {
            // Fresh zeros come from the system as untouched pages, which the threads that fill them page in.
            let fits = Vec::<T>::new().try_reserve_exact(n).is_ok();
            if fits {
                *column = vec![T::default(); n];
            }
            return fits;
        }
        let fits = column.try_reserve(n.saturating_sub(column.len())).is_ok();
        if fits {
            column.resize(n, T::default());
        }
        fits
    }
    column(&mut cloud.positions, n)
        && cloud.normals.as_mut().is_none_or(|c| column(c, n))
        && cloud.radii.as_mut().is_none_or(|c| column(c, n))
        && cloud.colors.as_mut().is_none_or(|c| column(c, n))
        && cloud.intensity.as_mut().is_none_or(|c| column(c, n))
        && cloud.classification.as_mut().is_none_or(|c| column(c, n))
        && cloud.scalars.iter_mut().all(|scalar| match &mut scalar.values {
            Values::U8(v) => column(v, n),
            Values::U16(v) => column(v, n),
            Values::I32(v) => column(v, n),
            Values::F32(v) => column(v, n),
            Values::F64(v) => column(v, n),
        })
}

/// Gives the columns of `cloud` `n` points: cuts them, or extends them by zeros.
pub(crate) fn resize_checked(cloud: &mut PointCloud, n: usize, input: &Input) -> Result<()> {
    if resize(cloud, n) {
        return Ok(());
    }
    Err(Error::OutOfMemory { file: input.name.to_string(), n_points: n as u64 })
}

/// Releases the memory that columns reserved and do not use.
pub(crate) fn shrink(cloud: &mut PointCloud) {
    cloud.positions.shrink_to_fit();
    cloud.normals.iter_mut().for_each(Vec::shrink_to_fit);
    cloud.radii.iter_mut().for_each(Vec::shrink_to_fit);
    cloud.colors.iter_mut().for_each(Vec::shrink_to_fit);
    cloud.intensity.iter_mut().for_each(Vec::shrink_to_fit);
    cloud.classification.iter_mut().for_each(Vec::shrink_to_fit);
    for scalar in &mut cloud.scalars {
        match &mut scalar.values {
            Values::U8(v) => v.shrink_to_fit(),
            Values::U16(v) => v.shrink_to_fit(),
            Values::I32(v) => v.shrink_to_fit(),
            Values::F32(v) => v.shrink_to_fit(),
            Values::F64(v) => v.shrink_to_fit(),
        }
    }
}

fn copy_if_present<T: Copy>(
    to: &mut Option<&mut [T]>,
    from: &Option<&mut [T]>,
    ranges: &[Range<usize>],
) {
    if let (Some(to), Some(from)) = (to, from) {
        copy(to, from, ranges);
    }
}

/// Copies ranges of `from` to the front of `to`, one after the other.
fn copy<T: Copy>(to: &mut [T], from: &[T], ranges: &[Range<usize>]) {
    let mut end = 0;
    for range in ranges {
        let start = end;
        end += range.len();
        to[start..end].copy_from_slice(&from[range.clone()]);
    }
}

fn front<'a, T>(column: &mut &'a mut [T], n: usize) -> &'a mut [T] {
    column.split_off_mut(..n).unwrap_or_default()
}
