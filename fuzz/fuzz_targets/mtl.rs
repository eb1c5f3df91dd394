//! Fuzzes the MTL reader with the material file of a triangle.
#![no_main]

#[path = "../mesh_checks.rs"]
mod mesh_checks;

use std::fs;

use libfuzzer_sys::fuzz_target;
use surfel_core::progress::NoProgress;
use surfel_formats::{LoadOptions, load_graph};

const OBJ: &str = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 1\nusemtl m\nf 1/1 2/1 3/1\n";

fuzz_target!(|bytes: &[u8]| {
    let folder = std::env::temp_dir().join(format!("surfel-fuzz-mtl-{}", std::process::id()));
    let obj = folder.join("a.obj");
    if !obj.exists() {
        fs::create_dir_all(&folder).unwrap();
        fs::write(&obj, OBJ).unwrap();
    }
    fs::write(folder.join("a.mtl"), bytes).unwrap();
    let (graph, _) = load_graph(&obj, &LoadOptions::default(), &NoProgress).unwrap();
    assert_eq!(mesh_checks::check_graph(&graph), 1);
    let material = &graph.materials[0];
    let non_negative =
        [material.base_color.max_element(), material.emissive.max_element(), material.ior];
    assert!(non_negative.iter().all(|number| number.is_finite() && 0.0 <= *number));
    let fractions = [material.alpha, material.metallic, material.roughness, material.transmission];
    assert!(fractions.iter().all(|fraction| (0.0..=1.0).contains(fraction)));
});
