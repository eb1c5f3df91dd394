//! The parts of a description, and the sections of help texts that list their keys.

/// A section of the help texts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Section {
    /// Files that are written, and movies.
    Output,
    /// Size and quality of pictures.
    Picture,
    /// The shape that is given to points.
    Surface,
    /// Plans to scale, which only pictures have.
    Plans,
    /// The camera.
    Camera,
    /// Up, and the place on Earth.
    World,
    /// Lights.
    Light,
    /// Colours of points.
    Color,
    /// The reduction and completion of points.
    Preparation,
    /// Threads, memory and device, which all commands have.
    Everywhere,
    /// Materials, and settings by name.
    Materials,
    /// Cameras by name.
    Views,
}

impl Section {
    /// Returns the heading.
    pub fn heading(self) -> &'static str {
        match self {
            Self::Output => "Output",
            Self::Picture => "Picture",
            Self::Surface => "Surface",
            Self::Plans => "Plans to scale",
            Self::Camera => "Camera (in the file's own coordinates)",
            Self::World => "World",
            Self::Light => "Light",
            Self::Color => "Colour",
            Self::Preparation => "Preparation",
            Self::Everywhere => "Everywhere",
            Self::Materials => "Materials",
            Self::Views => "Views",
        }
    }
}

/// A part of a description: the section of its keys, the table that they stand in, and the settings.
#[derive(Clone, Copy, Debug)]
pub struct Part<S> {
    /// Section of its keys.
    pub section: Section,
    /// Name of its table with a dot, as in `camera.`, or empty.
    pub prefix: &'static str,
    /// The settings.
    pub settings: S,
}
