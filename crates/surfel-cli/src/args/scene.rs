//! All that says what is seen: files or a scene file, and the options of their picture.

use super::{
    CameraArgs, ColorArgs, LightArgs, MaterialArgs, PictureArgs, PreparationArgs, SurfaceArgs,
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
    pub camera: CameraArgs,
    #[command(flatten)]
    pub material: MaterialArgs,
    #[command(flatten)]
    pub light: LightArgs,
    #[command(flatten)]
    pub color: ColorArgs,
    #[command(flatten)]
    pub preparation: PreparationArgs,
}

impl SceneArgs {
    /// What is wrong whatever the files hold.
    pub fn check(&self) -> Result<(), super::Usage> {
        self.camera.check()?;
        self.light.check()
    }
}
