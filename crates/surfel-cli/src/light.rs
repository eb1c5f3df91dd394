//! From the options of the light to lights: a sun behind the camera, a sky, and their colours.

use crate::args::{LightArgs, LightKind};
use crate::report::Report;
use anyhow::Context;
use surfel::flat::{FlatLamp, FlatScene};
use surfel::math::Vec3;
use surfel::progress::Progress;
use surfel::scene::{Camera, Environment, Light, Sky, Sun};
use surfel_formats::LinearPicture;

/// Warm sun and bluish sky, which on level ground under the usual sun add up to white. With a third of
/// it the sky gives more than outdoors: with a quarter, shadows of dark scans were black.
const SUN_COLOR: Vec3 = Vec3::new(1.06, 1.01, 0.94);
const SKY_COLOR: Vec3 = Vec3::new(0.325, 0.355, 0.405);
/// What the ground throws back: a third of its light, by stone and soil.
const GROUND_COLOR: Vec3 = Vec3::new(0.16, 0.145, 0.125);
/// The sun stands this much to the left of straight behind the camera: shadows show, but do not rule.
const SUN_BESIDE_DEG: f64 = 60.0;
/// Share of the cloud's diagonal beyond which things do not dim the sky.
const REACH: f32 = 0.15;

/// The cloud as its lights see it.
pub struct Lit {
    pub camera: Camera,
    pub up: Vec3,
    /// Diagonal of the cloud's usual bounds.
    pub diagonal: f32,
}

/// The picture that the options name as light, upright as in files.
pub fn environment(args: &LightArgs, report: &Report) -> anyhow::Result<Option<Environment>> {
    let Some(file) = &args.environment else { return Ok(None) };
    let picture = surfel_formats::load_environment_picture(file, report)?;
    report.end_stage();
    let LinearPicture { width, height, pixels } = picture;
    let environment = Environment::new(width, height, pixels, Vec3::Z, 0.0)
        .with_context(|| file.display().to_string())?;
    if 0 < environment.n_repaired() {
        let what = "pixels with values that are no light (negative, infinite, NaN) mended";
        report.note(&format!("{}: {} {what}", file.display(), environment.n_repaired()));
    }
    Ok(Some(environment))
}

pub fn lights(
    args: &LightArgs,
    environment: Option<&Environment>,
    lit: &Lit,
    report: &Report,
) -> anyhow::Result<Vec<Light>> {
    let mut lights = Vec::new();
    if let Some(environment) = environment.filter(|_| args.environment.is_some()) {
        let mut environment = environment.facing(lit.up, args.environment_rotation as f32)?;
        environment.gain(args.environment_strength as f32);
        lights.push(Light::Environment(environment));
    }
    if args.has(LightKind::Sun) {
        lights.push(Light::Sun(sun(args, lit, report)));
    }
    if args.has(LightKind::Sky) {
        lights.push(Light::Sky(sky(args, lit, report)));
    }
    if args.has(LightKind::Headlight) {
        lights.push(Light::Headlight(0.8));
    }
    Ok(lights)
}

/// All lights this many stops brighter; the background stays.
pub fn expose(scene: &mut FlatScene, stops: f32) {
    let gain = stops.exp2();
    for light in &mut scene.lights {
        match light {
            Light::Sun(sun) => sun.color *= gain,
            Light::Sky(sky) => {
                sky.zenith *= gain;
                sky.ground *= gain;
            }
            Light::Environment(environment) => environment.gain(gain),
            Light::Headlight(strength) => *strength *= gain,
        }
    }
    expose_lamps(&mut scene.lamps, stops);
    scene.materials.iter_mut().for_each(|material| {
        material.emissive *= gain;
        material.glow *= gain;
    });
}

/// The same for lamps that have been placed anew.
pub fn expose_lamps(lamps: &mut [FlatLamp], stops: f32) {
    lamps.iter_mut().for_each(|lamp| lamp.color *= stops.exp2());
}

/// Clockwise from north.
pub fn sun_azimuth_deg(args: &LightArgs, lit: &Lit) -> f64 {
    args.sun_azimuth.unwrap_or_else(|| automatic_azimuth_deg(lit))
}

fn sun(args: &LightArgs, lit: &Lit, report: &Report) -> Sun {
    let azimuth_deg = sun_azimuth_deg(args, lit);
    if args.sun_azimuth.is_none() {
        let elevation_deg = args.sun_elevation;
        report.choice(
            &format!(
                "sun from {azimuth_deg:.0} degrees (0 = north, 90 = east), {elevation_deg:.0} high"
            ),
            "--sun-azimuth, --sun-elevation",
        );
    }
    Sun {
        direction: Sun::toward(azimuth_deg as f32, args.sun_elevation as f32, lit.up),
        color: args.sun_strength as f32 * SUN_COLOR,
        angular_diameter_deg: args.sun_angle as f32,
    }
}

fn sky(args: &LightArgs, lit: &Lit, report: &Report) -> Sky {
    let reach = args.sky_reach.map(|reach| reach as f32).unwrap_or_else(|| {
        let reach = (REACH * lit.diagonal).max(f32::MIN_POSITIVE);
        report.choice(&format!("things up to {reach:.3} away dim the sky"), "--sky-reach");
        reach
    });
    let strength = args.sky_strength as f32;
    Sky { up: lit.up, zenith: strength * SKY_COLOR, ground: strength * GROUND_COLOR, reach }
}

/// Behind the camera and to its left; from the upper left of a map, as cartographers shade hills.
fn automatic_azimuth_deg(lit: &Lit) -> f64 {
    let [_, camera_up, forward] = lit.camera.axes();
    let up = lit.up.as_dvec3();
    let looks_down = forward.dot(up) < -0.8;
    let (ahead, turn_deg) =
        if looks_down { (camera_up, -45.0) } else { (forward, 180.0 + SUN_BESIDE_DEG) };
    let north = Sun::toward(0.0, 0.0, lit.up).as_dvec3();
    let east = Sun::toward(90.0, 0.0, lit.up).as_dvec3();
    let ahead_deg = ahead.dot(east).atan2(ahead.dot(north)).to_degrees();
    (ahead_deg + turn_deg).rem_euclid(360.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use surfel::math::DVec3;
    use surfel::scene::Projection;

    fn lit(forward: DVec3) -> Lit {
        let camera = Camera {
            position: -forward,
            focal_point: DVec3::ZERO,
            view_up: DVec3::new(0.0, 0.1, 1.0),
            projection: Projection::Perspective { view_angle_deg: 35.0 },
        };
        Lit { camera, up: Vec3::Z, diagonal: 1.0 }
    }

    #[test]
    fn the_sun_is_behind_the_camera_or_at_the_upper_left_of_a_map() {
        assert!((automatic_azimuth_deg(&lit(DVec3::Y)) - 240.0).abs() < 1e-4);
        assert!((automatic_azimuth_deg(&lit(DVec3::X)) - 330.0).abs() < 1e-4);
        assert!((automatic_azimuth_deg(&lit(-DVec3::Z)) - 315.0).abs() < 1e-4);
    }

    #[test]
    fn sun_and_sky_add_up_to_white_on_level_ground() {
        let sun = Sun::toward(10.0, 40.0, Vec3::Z).z * SUN_COLOR;
        // 96 % of the cosine-weighted sky is as bright as the zenith, the rest half way to the ground.
        let level = sun + 0.97 * SKY_COLOR + 0.03 * GROUND_COLOR;
        assert!((level - Vec3::ONE).abs().max_element() < 0.02, "{level}");
    }
}
