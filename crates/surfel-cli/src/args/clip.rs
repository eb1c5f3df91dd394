//! Options that hide a part of what there is.

use super::parse;
use clap::Args;
use surfel::scene::{Clip, ClipBox, ClipPlane};

#[derive(Args)]
#[command(next_help_heading = "Surface")]
pub struct ClipArgs {
    /// Hide what lies outside, as in "([0,10],[0,10],[2,5])" in the file's own coordinates; of any height with
    /// two ranges. What stays is prepared, coloured and framed as if all were there.
    #[arg(long, value_name = "BOUNDS", value_parser = parse::clip_box)]
    clip_box: Option<ClipBox>,
    /// Hide what lies beyond a plane: on the side to which its normal points.
    #[arg(long, value_name = "X,Y,Z,NX,NY,NZ", value_parser = parse::clip_plane,
        allow_hyphen_values = true)]
    clip_plane: Option<ClipPlane>,
}

impl ClipArgs {
    pub fn clip(&self) -> Clip {
        Clip { bounds: self.clip_box, plane: self.clip_plane }
    }
}
