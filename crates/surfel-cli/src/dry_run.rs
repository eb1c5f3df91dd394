//! What `surfel render --dry-run` tells: every choice, resolved.

use crate::args::Exposure;
use crate::assemble::Assembly;
use crate::picture::Choices;
use crate::render::Args;
use serde_json::{Value, json};
use surfel::scene::color::choose;
use surfel::scene::{Light, Projection};
use surfel::trace::Simd;

pub fn resolved(assembly: &Assembly, choices: &Choices, args: &Args) -> String {
    let preparation = args.preparation.preparation(args.picture.seed, args.color.color.as_ref());
    let chosen = || assembly.clouds().next().map(|cloud| choose(cloud).0);
    let color = args.color.color.clone().or_else(chosen);
    let (n_points, n_triangles) = assembly.graph.counts();
    let exposure = match args.light.exposure {
        Exposure::Auto => json!("auto"),
        Exposure::Stops(stops) => json!(stops),
    };
    let choices = json!({
        "files": args.files,
        "output": args.output,
        "points": n_points,
        "triangles": n_triangles,
        "surface": args.surface.surface.name(),
        "boundary": format!("{:?}", args.surface.boundary).to_lowercase(),
        "resolution": [args.picture.resolution.0, args.picture.resolution.1],
        "spp": args.picture.spp,
        "samples": args.picture.samples,
        "seed": args.picture.seed,
        "up": choices.up.to_array(),
        "camera": camera(choices),
        "lights": choices.lights.iter().map(light).collect::<Vec<_>>(),
        "exposure": exposure,
        "color": color.map(|color| color.to_string()),
        "background": format!("{:?}", args.color.background()),
        "preparation": format!("{preparation:?}"),
        "threads": rayon::current_num_threads(),
        "simd": Simd::detect().name(),
        "backend": "cpu",
    });
    format!("{choices:#}")
}

fn camera(choices: &Choices) -> Value {
    let camera = &choices.camera;
    let (name, value) = match camera.projection {
        Projection::Perspective { view_angle_deg } => ("view_angle", json!(view_angle_deg)),
        Projection::Orthographic { height } => ("orthographic", json!(height)),
        Projection::Panorama => ("panorama", json!(true)),
    };
    json!({
        "position": camera.position.to_array(),
        "focal_point": camera.focal_point.to_array(),
        "view_up": camera.view_up.to_array(),
        name: value,
    })
}

fn light(light: &Light) -> Value {
    match light {
        Light::Sun(sun) => json!({
            "sun": {
                "direction": sun.direction.to_array(),
                "color": sun.color.to_array(),
                "angle": sun.angular_diameter_deg,
            }
        }),
        Light::Sky(sky) => json!({
            "sky": {
                "zenith": sky.zenith.to_array(),
                "ground": sky.ground.to_array(),
                "reach": sky.reach,
            }
        }),
        Light::Environment(environment) => json!({
            "environment": { "average": environment.average().to_array() }
        }),
        Light::Headlight(strength) => json!({ "headlight": strength }),
    }
}
