//! Options of colour and background.

use super::parse;
use clap::Args;
use surfel::image::Colormap;
use surfel::math::Vec3;
use surfel::scene::Background;
use surfel::scene::color::{ColorSource, Coloring};

#[derive(Args)]
#[command(next_help_heading = "Colour")]
pub struct ColorArgs {
    /// rgb, intensity, elevation, class, normal, #RRGGBB or any column; chosen from the data if not given.
    #[arg(long, value_name = "SOURCE")]
    pub color: Option<ColorSource>,
    /// Colour map by its matplotlib name: viridis, turbo, gray, coolwarm_r ...
    #[arg(long, value_name = "NAME", value_parser = parse::colormap)]
    cmap: Option<Colormap>,
    /// Values of the first and last colour of the map; 2 % to 98 % of the values if not given.
    #[arg(long, value_name = "LOW,HIGH", value_parser = parse::range, allow_hyphen_values = true)]
    range: Option<(f64, f64)>,
    /// #RRGGBB, two of them (top,bottom), gradient, transparent, or surroundings: the sky or environment
    /// that gives light.
    #[arg(long, value_name = "COLOR", default_value = "gradient", value_parser = parse::background)]
    background: Background,
    /// The same as --background transparent.
    #[arg(long, conflicts_with = "background")]
    no_background: bool,
}

impl ColorArgs {
    pub fn coloring(&self, up: Vec3) -> Coloring {
        Coloring { source: self.color.clone(), colormap: self.cmap, range: self.range, up }
    }

    pub fn background(&self) -> Background {
        if self.no_background { Background::Transparent } else { self.background }
    }
}
