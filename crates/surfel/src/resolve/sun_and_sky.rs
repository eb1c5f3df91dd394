//! Lights from settings: a sun behind the camera, a sky, and their colours.

use crate::description::{KeyedSettings, LightKind, SceneDescription, SkySettings, SunSettings};
use crate::error::Result;
use surfel_core::flat::{FlatPunctualLight, FlatScene};
use surfel_core::math::{DVec3, Vec3};
use surfel_core::points::PointCloud;
use surfel_core::progress::Progress;
use surfel_core::scene::{
    Background, Camera, Environment, InsideView, Light, Material, Sky, Sun, sunlit_fraction,
    visible_normals,
};
use surfel_core::surface::SurfaceKind;
use surfel_core::words::format_length;

/// Warm sun and bluish sky, which on level ground under the usual sun add up to white. The sky gives a third of the
/// light, more than outdoors: with a quarter, shadows of dark scans were black.
const SUN_COLOR: Vec3 = Vec3::new(1.06, 1.01, 0.94);
const SKY_COLOR: Vec3 = Vec3::new(0.325, 0.355, 0.405);

/// Light that the ground reflects: a third of what it receives, coloured by stone and soil.
const GROUND_COLOR: Vec3 = Vec3::new(0.16, 0.145, 0.125);

/// Degrees by which the sun stands to the left or right of straight behind the camera: shadows show, but do not dominate.
const SUN_OFFSET_DEG: f64 = 60.0;

/// Minimum ratio of the light that a sun on the right gives to that of one on the left, at which it stands on the right.
const MIN_GAIN_ON_RIGHT: f32 = 1.15;

/// Fraction of the scene's diagonal up to which surfaces hide the sky.
const AO_FRACTION: f32 = 0.15;

/// Radiance of the headlight on a surface that faces it.
const HEADLIGHT: f32 = 0.8;

/// Fraction of the points in view that the sun must reach to be the main light. Rooms had 0, forests 0.01 to 0.4, an
/// arcade 0.46, streets 0.6 to 1.
const MIN_SUNLIT: f64 = 0.5;

/// The scene as its lights need to know it.
pub struct LightingContext<'a> {
    /// The camera, behind which the sun stands.
    pub camera: Camera,
    /// The world's up.
    pub up: Vec3,
    /// Diagonal of the scene's bounds without stray points.
    pub diagonal: f32,
    /// True if the camera stands in a closed room, which neither sun nor sky lights.
    pub is_inside: bool,
    /// True if points have normals of their own.
    pub has_normals: bool,
    /// The points of the scene, or a sample of them.
    pub points: &'a PointCloud,
    /// The view, if the points are a scan that is shown from within.
    pub inside: Option<&'a InsideView>,
}

/// Returns the description with everything written into it that it leaves open about the lights of the whole scene.
/// Settings of lights that the scene does not have are dropped.
pub fn choose_lights(
    description: &SceneDescription,
    context: &LightingContext,
    progress: &dyn Progress,
) -> SceneDescription {
    let is_lit = is_lit(description, context.has_normals);
    let mut chosen = description.clone();
    let SceneDescription { light, sun, sky, .. } = &mut chosen;
    let is_sun_open =
        light.light.is_none() && light.environment.is_none() && *sun == SunSettings::default();
    let shows_environment = shows_environment(description);
    if is_lit && is_sun_open && context.is_inside {
        progress.choice("headlight: the camera stands in a closed room or tunnel", &["light"]);
        let sky = shows_environment.then_some(LightKind::Sky);
        light.light = Some(sky.into_iter().chain([LightKind::Headlight]).collect());
    } else if is_lit && is_sun_open && is_sun_hidden(context) {
        progress.choice("headlight: hardly any sun would reach what the scanner saw", &["light"]);
        light.light = Some(vec![LightKind::Sky, LightKind::Headlight]);
    }
    light.light = Some(light.kinds()).filter(|kinds| !kinds.is_empty());
    if is_lit && light.has(LightKind::Sun) {
        choose_sun(sun, context, progress);
    } else {
        *sun = SunSettings::default();
    }
    if is_lit && light.has(LightKind::Sky) {
        choose_sky(sky, context, progress);
    } else if !(shows_environment && light.has(LightKind::Sky)) {
        *sky = SkySettings::default();
    }
    let has_environment = (is_lit || shows_environment) && light.environment.is_some();
    light.environment_rotation = has_environment.then(|| light.environment_rotation());
    light.environment_strength = has_environment.then(|| light.environment_strength());
    chosen
}

/// Returns true if the sun at its automatic place would reach hardly anything of what is shown from within a scan, as
/// under a roof.
fn is_sun_hidden(context: &LightingContext) -> bool {
    let LightingContext { points, inside: Some(view), .. } = context else { return false };
    let azimuth_deg = automatic_azimuth_deg(context) as f32;
    let elevation_deg = SunSettings::default().elevation() as f32;
    let to_sun = Sun::direction_from_angles(azimuth_deg, elevation_deg, context.up);
    let position = (view.position - points.origin).as_vec3();
    let ahead = view.direction.as_vec3();
    sunlit_fraction(&points.positions, position, ahead, to_sun, context.up) < MIN_SUNLIT
}

/// Points as pixels are shaded by their depth alone, unless they have normals.
fn is_lit(description: &SceneDescription, has_normals: bool) -> bool {
    has_normals || description.objects_default.surface.surface() != SurfaceKind::Points
}

/// Returns true if the background is the sky or the environment map, which show there also if they light nothing.
pub fn shows_environment(description: &SceneDescription) -> bool {
    description.picture.background() == Background::Environment
}

/// Returns the lights of the whole scene by a description whose lights are chosen. `has_normals` is true if points have
/// normals, by which they are lit; of lights on others only what the background shows is left.
pub fn lights(
    chosen: &SceneDescription,
    environment: Option<&Environment>,
    up: Vec3,
    has_normals: bool,
) -> Result<Vec<Light>> {
    let settings = &chosen.light;
    let mut lights = Vec::new();
    let is_lit = is_lit(chosen, has_normals);
    if !is_lit && !shows_environment(chosen) {
        return Ok(lights);
    }
    if let Some(environment) = environment.filter(|_| settings.environment.is_some()) {
        let rotation_deg = settings.environment_rotation() as f32;
        let mut environment = environment.with_orientation(up, rotation_deg)?;
        environment.scale(settings.environment_strength() as f32);
        lights.push(Light::Environment(environment));
    }
    if is_lit && settings.has(LightKind::Sun) {
        lights.push(Light::Sun(sun(&chosen.sun, up)));
    }
    if settings.has(LightKind::Sky) {
        lights.push(Light::Sky(sky(&chosen.sky, up)));
    }
    if is_lit && settings.has(LightKind::Headlight) {
        lights.push(Light::Headlight(HEADLIGHT));
    }
    Ok(lights)
}

/// Makes all lights brighter by stops; the background stays.
pub fn expose(scene: &mut FlatScene, stops: f32) {
    let gain = stops.exp2();
    for light in &mut scene.lights {
        match light {
            Light::Sun(sun) => sun.color *= gain,
            Light::Sky(sky) => {
                sky.zenith *= gain;
                sky.ground *= gain;
            }
            Light::Environment(environment) => environment.scale(gain),
            Light::Headlight(strength) => *strength *= gain,
        }
    }
    expose_lamps(&mut scene.punctual_lights, stops);
    expose_materials(&mut scene.materials, stops);
}

/// Makes lamps brighter by stops, after the animation has set them again.
pub fn expose_lamps(lamps: &mut [FlatPunctualLight], stops: f32) {
    lamps.iter_mut().for_each(|lamp| lamp.color *= stops.exp2());
}

/// Makes emissive materials brighter by stops, after a sequence has set them again.
pub fn expose_materials(materials: &mut [Material], stops: f32) {
    materials.iter_mut().for_each(|material| {
        material.emissive *= stops.exp2();
        material.emissive_strength *= stops.exp2();
    });
}

fn choose_sun(settings: &mut SunSettings, context: &LightingContext, progress: &dyn Progress) {
    settings.fill_defaults();
    if settings.azimuth.is_none() {
        let (azimuth_deg, elevation_deg) = (automatic_azimuth_deg(context), settings.elevation());
        let line = format!(
            "sun at azimuth {azimuth_deg:.0} degrees (0 = north, 90 = east), elevation {elevation_deg:.0} degrees"
        );
        progress.choice(&line, &["sun.azimuth", "sun.elevation"]);
        settings.azimuth = Some(azimuth_deg);
    }
}

fn choose_sky(settings: &mut SkySettings, context: &LightingContext, progress: &dyn Progress) {
    settings.fill_defaults();
    if settings.ao_distance.is_none() {
        let distance = (AO_FRACTION * context.diagonal).max(f32::MIN_POSITIVE);
        // A single point darkens nothing.
        if 0.0 < context.diagonal {
            let line =
                format!("ambient occlusion by surfaces up to {} away", format_length(distance));
            progress.choice(&line, &["sky.ao_distance"]);
        }
        settings.ao_distance = Some(distance.into());
    }
}

fn sun(settings: &SunSettings, up: Vec3) -> Sun {
    let azimuth_deg = settings.azimuth.unwrap_or_default() as f32;
    Sun {
        direction: Sun::direction_from_angles(azimuth_deg, settings.elevation() as f32, up),
        color: settings.strength() as f32 * SUN_COLOR,
        angular_diameter_deg: settings.angle() as f32,
    }
}

fn sky(settings: &SkySettings, up: Vec3) -> Sky {
    let strength = settings.strength() as f32;
    let (zenith, ground) = (strength * SKY_COLOR, strength * GROUND_COLOR);
    let ao_distance = settings.ao_distance.unwrap_or(f64::INFINITY) as f32;
    Sky { up, zenith, ground, ao_distance }
}

/// Behind the camera and to its left, or to its right if what the camera shows is brighter then; from the upper left of a
/// map, as cartographers shade hills.
fn automatic_azimuth_deg(context: &LightingContext) -> f64 {
    let [_, camera_up, forward] = context.camera.axes();
    let azimuth_deg = |ahead: DVec3, turn_deg: f64| {
        let north = Sun::direction_from_angles(0.0, 0.0, context.up).as_dvec3();
        let east = Sun::direction_from_angles(90.0, 0.0, context.up).as_dvec3();
        let ahead_deg = ahead.dot(east).atan2(ahead.dot(north)).to_degrees();
        // Few digits for the command line that states it.
        (100.0 * (ahead_deg + turn_deg).rem_euclid(360.0)).round() / 100.0
    };
    if forward.dot(context.up.as_dvec3()) < -0.8 {
        return azimuth_deg(camera_up, -45.0);
    }
    let [left, right] =
        [SUN_OFFSET_DEG, -SUN_OFFSET_DEG].map(|turn| azimuth_deg(forward, 180.0 + turn));
    if context.inside.is_some() {
        return left;
    }
    let origin = context.points.origin;
    let camera = Camera {
        position: context.camera.position - origin,
        focal_point: context.camera.focal_point - origin,
        ..context.camera
    };
    let normals = visible_normals(&context.points.positions, &camera);
    let light_from = |azimuth_deg: f64| {
        let elevation_deg = SunSettings::default().elevation() as f32;
        let to_sun = Sun::direction_from_angles(azimuth_deg as f32, elevation_deg, context.up);
        normals.iter().map(|normal| normal.dot(to_sun).max(0.0)).sum::<f32>()
    };
    if MIN_GAIN_ON_RIGHT * light_from(left) < light_from(right) { right } else { left }
}

#[cfg(test)]
mod tests {
    //! The direction of the sun, where it does not shine, and the brightness of level ground.

    use super::*;
    use surfel_core::progress::NoProgress;
    use surfel_core::scene::Projection;

    fn context(forward: DVec3, points: &PointCloud) -> LightingContext<'_> {
        let camera = Camera {
            position: -forward,
            focal_point: DVec3::ZERO,
            view_up: DVec3::new(0.0, 0.1, 1.0),
            projection: Projection::Perspective { view_angle_deg: 35.0 },
        };
        LightingContext {
            camera,
            up: Vec3::Z,
            diagonal: 1.0,
            is_inside: false,
            has_normals: false,
            points,
            inside: None,
        }
    }

    #[test]
    fn the_sun_is_behind_the_camera_or_at_the_upper_left_of_a_map() {
        let none = PointCloud::default();
        let azimuth_deg = |forward: DVec3| automatic_azimuth_deg(&context(forward, &none));
        assert!((azimuth_deg(DVec3::Y) - 240.0).abs() < 1e-4);
        assert!((azimuth_deg(DVec3::X) - 330.0).abs() < 1e-4);
        assert!((azimuth_deg(-DVec3::Z) - 315.0).abs() < 1e-4);
    }

    #[test]
    fn the_sun_is_on_the_side_from_which_a_wall_is_lit() {
        // A wall before a camera that looks north. It faces south, turned counterclockwise seen from above.
        let azimuth_deg = |turn_deg: f32| {
            let (sin, cos) = turn_deg.to_radians().sin_cos();
            let point = |i: usize| {
                let along = (i % 200) as f32 / 200.0 - 0.5;
                Vec3::new(cos * along, sin * along, (i / 200) as f32 / 200.0 - 0.5)
            };
            let mut wall = PointCloud::from_positions((0..40_000).map(point).collect());
            wall.origin = DVec3::new(5e5, 4e6, 100.0);
            let camera = context(3.0 * DVec3::Y, &wall).camera;
            let camera = Camera {
                position: wall.origin + camera.position,
                focal_point: wall.origin,
                ..camera
            };
            automatic_azimuth_deg(&LightingContext { camera, ..context(DVec3::Y, &wall) }).round()
        };
        assert_eq!([-50.0, 0.0, 50.0].map(azimuth_deg), [240.0, 240.0, 120.0]);
    }

    /// Returns what a scanner 1.5 m under a ceiling and 2 m above a floor measures, or without the ceiling.
    fn scan(has_ceiling: bool) -> PointCloud {
        let directions = (0..20_000).map(|i| {
            let z = 1.0 - (2.0 * i as f32 + 1.0) / 20_000.0;
            let (sin, cos) = (2.399_963 * i as f32).sin_cos();
            Vec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z)
        });
        let hit = |direction: Vec3| match direction.z {
            z if z < 0.0 => Some(-2.0 / z * direction),
            z => has_ceiling.then(|| 1.5 / z * direction),
        };
        let points = directions.filter_map(hit).filter(|point| point.length() < 40.0);
        PointCloud::from_positions(points.collect())
    }

    #[test]
    fn a_scan_under_a_roof_is_lit_from_the_camera_unless_a_sun_is_asked_for() {
        let kinds = |has_ceiling: bool, azimuth: Option<f64>| {
            let points = scan(has_ceiling);
            let view = InsideView {
                position: DVec3::ZERO,
                direction: DVec3::Y,
                distance: 4.0,
                view_angle_deg: 60.0,
            };
            let context = LightingContext { inside: Some(&view), ..context(DVec3::Y, &points) };
            let mut description = SceneDescription::default();
            description.sun.azimuth = azimuth;
            let chosen = choose_lights(&description, &context, &NoProgress);
            (chosen.light.light.unwrap_or_default(), chosen.sun.azimuth.map(f64::round))
        };
        let from_camera = vec![LightKind::Sky, LightKind::Headlight];
        let outdoors = vec![LightKind::Sun, LightKind::Sky];
        assert_eq!(kinds(true, None), (from_camera, None));
        assert_eq!(kinds(true, Some(10.0)), (outdoors.clone(), Some(10.0)));
        assert_eq!(kinds(false, None), (outdoors, Some(240.0)));
    }

    /// Returns the lights of points as pixels without normals, before a background of the environment or none.
    fn lights_of_pixels(
        environment: Option<&Environment>,
        background: Option<Background>,
    ) -> Vec<Light> {
        let mut description = SceneDescription::default();
        description.objects_default.surface.surface = Some(SurfaceKind::Points);
        description.picture.background = background;
        description.sky.strength = Some(2.0);
        description.light.environment = environment.map(|_| "sky.hdr".into());
        let points = PointCloud::default();
        let chosen = choose_lights(&description, &context(DVec3::Y, &points), &NoProgress);
        lights(&chosen, environment, Vec3::Z, false).unwrap()
    }

    #[test]
    fn a_sky_that_lights_no_points_is_still_their_background() {
        assert_eq!(lights_of_pixels(None, None), []);
        match &lights_of_pixels(None, Some(Background::Environment))[..] {
            [Light::Sky(sky)] => assert_eq!(sky.zenith, 2.0 * SKY_COLOR),
            other => panic!("{other:?}"),
        }
        let map = Environment::new(2, 1, vec![Vec3::ONE; 2], Vec3::Z, 0.0).unwrap();
        let found = lights_of_pixels(Some(&map), Some(Background::Environment));
        assert!(matches!(found[..], [Light::Environment(_)]), "{found:?}");
    }

    #[test]
    fn the_strength_of_an_environment_multiplies_its_radiance() {
        let map = Environment::new(2, 1, vec![Vec3::new(0.5, 1.0, 2.0); 2], Vec3::Z, 0.0).unwrap();
        let radiance = |strength: Option<f64>| {
            let mut description = SceneDescription::default();
            description.light.environment = Some("sky.hdr".into());
            description.light.environment_strength = strength;
            let points = PointCloud::default();
            let chosen = choose_lights(&description, &context(DVec3::Y, &points), &NoProgress);
            match &lights(&chosen, Some(&map), Vec3::Z, false).unwrap()[..] {
                [Light::Environment(environment)] => environment.radiance(Vec3::Y),
                other => panic!("{other:?}"),
            }
        };
        assert_eq!(radiance(None), Vec3::new(0.5, 1.0, 2.0));
        assert_eq!(radiance(Some(4.0)), Vec3::new(2.0, 4.0, 8.0));
        assert_eq!(radiance(Some(0.0)), Vec3::ZERO);
    }

    #[test]
    fn the_sky_is_the_background_of_a_closed_room_if_it_is_asked_for() {
        let kinds = |background: Option<Background>| {
            let points = PointCloud::default();
            let context = LightingContext { is_inside: true, ..context(DVec3::Y, &points) };
            let mut description = SceneDescription::default();
            description.picture.background = background;
            choose_lights(&description, &context, &NoProgress).light.light.unwrap_or_default()
        };
        assert_eq!(kinds(None), [LightKind::Headlight]);
        let with_sky = [LightKind::Sky, LightKind::Headlight];
        assert_eq!(kinds(Some(Background::Environment)), with_sky);
    }

    #[test]
    fn sun_and_sky_add_up_to_white_on_level_ground() {
        let sun = Sun::direction_from_angles(10.0, 40.0, Vec3::Z).z * SUN_COLOR;
        // 96 % of the cosine-weighted sky is as bright as the zenith, the rest half way to the ground.
        let level = sun + 0.97 * SKY_COLOR + 0.03 * GROUND_COLOR;
        assert!((level - Vec3::ONE).abs().max_element() < 0.02, "{level}");
    }
}
