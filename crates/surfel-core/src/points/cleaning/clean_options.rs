//! Choices of cleaning: which of the points that no later step can use are dropped.

/// The choice whether duplicates are dropped: all but the first of points at one position. Points with different normals,
/// as those that the faces of an edge share, are no duplicates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Duplicates {
    /// They are dropped.
    #[default]
    Drop,
    /// They stay.
    Keep,
}

/// The choice whether points are dropped that are no measurement of a surface: those of classes of noise, those flagged
/// withheld, and many at exactly zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum NoisePoints {
    /// They are dropped, unless there are no others.
    #[default]
    Drop,
    /// They stay.
    Keep,
}

/// Choices of [`clean`].
#[derive(Clone, Copy, Debug, Default)]
pub struct CleanOptions<'a> {
    /// The choice whether duplicates are dropped.
    pub duplicates: Duplicates,
    /// The choice whether points are dropped that are no measurement of a surface.
    pub noise_points: NoisePoints,
    /// ASPRS classes of noise whose points are kept.
    pub kept_noise: &'a [u8],
}
