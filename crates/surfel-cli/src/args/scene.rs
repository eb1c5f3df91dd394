//! All that says what is seen: files or a scene file, and the options of their picture.

use super::{
    CAMERA, CameraArgs, ClipArgs, ColorArgs, LightArgs, MaterialArgs, PictureArgs, PreparationArgs,
    SurfaceArgs,
};
use clap::Args;
use std::path::PathBuf;

#[derive(Args)]
pub struct SceneArgs {
    /// Point clouds (.ply, .las, .laz, .copc.laz, .xyz, .txt, .csv, .asc, .pts, .bin), meshes (.ply, .obj,
    /// .stl), glTF scenes (.gltf, .glb) and scene files (.toml, .json); several make one scene.
    #[arg(value_name = "FILE", required = true)]
    pub files: Vec<PathBuf>,
    #[command(flatten)]
    pub picture: PictureArgs,
    #[command(flatten)]
    pub surface: SurfaceArgs,
    #[command(flatten)]
    pub clip: ClipArgs,
    #[command(flatten)]
    pub camera: CameraArgs,
    /// Look by the camera of this name in a glTF file [default: the first].
    #[arg(long, value_name = "NAME", help_heading = CAMERA, conflicts_with_all = ["camera_position",
        "camera_focal_point", "camera_view_up", "camera_orthographic", "camera_panorama", "camera_direction",
        "camera_azimuth_angle", "camera_elevation_angle", "camera_zoom_factor"])]
    pub camera_name: Option<String>,
    #[command(flatten)]
    pub material: MaterialArgs,
    #[command(flatten)]
    pub light: LightArgs,
    #[command(flatten)]
    pub color: ColorArgs,
    #[command(flatten)]
    pub preparation: PreparationArgs,
    /// Play the animation of this name of glTF files that have any [default: the first].
    #[arg(long, value_name = "NAME", help_heading = "Preparation")]
    pub animation_name: Option<String>,
}

impl SceneArgs {
    /// What is wrong whatever the files hold.
    pub fn check(&self) -> Result<(), super::Usage> {
        self.camera.check()?;
        self.light.check()
    }
}
