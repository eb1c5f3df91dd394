//! Colours of stone, earth and leaves, sRGB-encoded.

use crate::noise::{fbm, noise, smoothstep, unit};
use surfel_core::math::DVec3;
use surfel_core::math::Vec3;

const OCHRE: Vec3 = Vec3::new(0.82, 0.69, 0.50);
const CREAM: Vec3 = Vec3::new(0.88, 0.79, 0.63);
const ROSE: Vec3 = Vec3::new(0.80, 0.66, 0.51);
const GREY: Vec3 = Vec3::new(0.70, 0.66, 0.58);
const MOSS: Vec3 = Vec3::new(0.43, 0.43, 0.25);
const LICHEN: Vec3 = Vec3::new(0.80, 0.79, 0.70);
const SOOT: Vec3 = Vec3::new(0.42, 0.37, 0.31);

/// Returns the colour of fresh sandstone. Each block has its own hue and layers in its own frame.
pub fn sandstone(point: DVec3, block: u64) -> Vec3 {
    let shift = 50.0 * unit(block ^ 0x51);
    let hue = unit(block) as f32;
    let bed = if hue < 0.5 {
        OCHRE.lerp(CREAM, 2.0 * hue)
    } else if hue < 0.8 {
        OCHRE.lerp(ROSE, (hue - 0.5) / 0.3)
    } else {
        CREAM.lerp(GREY, (hue - 0.8) / 0.2)
    };
    let brightness = 0.9 + 0.16 * unit(block ^ 0xb7);
    let layers = fbm(point * DVec3::new(0.7, 0.7, 5.0) + DVec3::splat(shift), 3);
    let grain = noise(point * 31.0);
    bed * (brightness + 0.09 * layers + 0.04 * grain) as f32
}

/// Weathers the colour of stone: dark runs on walls, lichen, moss in low flat parts.
pub fn weathered(fresh: Vec3, world: DVec3, normal: DVec3) -> Vec3 {
    let steep = 1.0 - normal.z.abs();
    let runs = fbm(world * DVec3::new(3.1, 3.1, 0.35), 3);
    let stained = fresh.lerp(SOOT, (0.5 * steep * smoothstep(0.05, 0.6, runs)) as f32);
    let spots = fbm(world * 4.3 + DVec3::splat(80.0), 3);
    let spotted = stained.lerp(LICHEN, 0.55 * smoothstep(0.25, 0.45, spots) as f32);
    let low = 1.0 - smoothstep(0.2, 2.2, world.z);
    let flat = smoothstep(0.3, 0.95, normal.z);
    let patches = fbm(world * 1.3 + DVec3::splat(40.0), 4);
    let moss = smoothstep(0.1, 0.6, patches + 0.3 * low + 0.15 * flat - 0.2);
    spotted.lerp(MOSS * (1.0 + 0.2 * noise(world * 20.0) as f32), (0.75 * moss) as f32)
}

/// Returns the colour of polished green marble with light veins.
pub fn marble(point: DVec3) -> Vec3 {
    let warp = DVec3::new(fbm(point * 1.1, 4), fbm(point * 1.1 + DVec3::splat(9.0), 3), 0.0);
    let band = (point + 0.9 * warp).dot(DVec3::new(1.3, 0.8, 1.5));
    let cloud = 0.5 + 0.5 * fbm(point * 2.3, 3);
    let width = 0.04 + 0.2 * cloud * cloud;
    let vein = 1.0 - smoothstep(0.0, width, (band - band.round()).abs());
    let ground = Vec3::new(0.15, 0.31, 0.26).lerp(Vec3::new(0.30, 0.50, 0.41), cloud as f32);
    ground.lerp(Vec3::new(0.80, 0.86, 0.80), (0.7 * vein) as f32)
}

/// Returns the colour of dry earth with patches of grass; `bare` = 1 is trodden ground.
pub fn meadow(point: DVec3, bare: f64) -> Vec3 {
    let earth = Vec3::new(0.66, 0.56, 0.41);
    let straw = Vec3::new(0.67, 0.61, 0.37);
    let grass = Vec3::new(0.45, 0.47, 0.26);
    let patches = fbm(point * 0.33, 4) - 0.8 * bare;
    let growth =
        straw.lerp(grass, smoothstep(-0.1, 0.4, patches + 0.3 * noise(point * 2.1)) as f32);
    let covered = earth.lerp(growth, smoothstep(-0.35, 0.0, patches) as f32);
    let fine = 0.09 * fbm(point * 7.0, 2) + 0.07 * noise(point * 23.0);
    covered * (1.0 + fine) as f32
}

/// Returns the colour of leaves, light at the tips and dark inside. `depth` goes from -1 outermost to 1 innermost.
pub fn leaves(point: DVec3, depth: f64, tone: f64) -> Vec3 {
    let dark = Vec3::new(0.13, 0.19, 0.10);
    let light = Vec3::new(0.36, 0.43, 0.20).lerp(Vec3::new(0.48, 0.52, 0.30), tone as f32);
    let fraction = 0.5 - 0.5 * depth + 0.2 * noise(point * 11.0);
    dark.lerp(light, fraction.clamp(0.0, 1.0) as f32)
}
