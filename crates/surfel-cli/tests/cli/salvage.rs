//! Damaged files: errors name the option that reads what is whole, and each command has it.

use crate::common::{Folder, fail, stderr, succeed, surfel};
use crate::viewer::Server;
use serde_json::Value;

/// Writes a LAS file of 400 points that is cut within the 301st, and returns its name.
fn cut_scan(folder: &Folder) -> String {
    let lines: String = (0..400).map(|i| format!("{} {} {}\n", i % 20, i / 20, i % 3)).collect();
    let whole = folder.path("whole.las");
    succeed(&["prepare", &folder.write("a.xyz", lines), "-o", &whole, "--subsample", "first:400"]);
    let bytes = std::fs::read(&whole).unwrap();
    let start = u32::from_le_bytes(bytes[96..100].try_into().unwrap()) as usize;
    let record = usize::from(u16::from_le_bytes([bytes[105], bytes[106]]));
    folder.write("cut.las", &bytes[..start + 300 * record + record / 2])
}

#[test]
fn every_command_salvages_what_is_whole() {
    let folder = Folder::new();
    let cut = cut_scan(&folder);
    let refused = fail(&["info", &cut], 1);
    assert!(refused.contains("300 of 400 points are complete"), "{refused}");
    assert!(refused.trim_end().ends_with("what is whole can be read [--salvage]"), "{refused}");

    let info = succeed(&["info", "--json", "--salvage", &cut]);
    assert_eq!(serde_json::from_str::<Value>(&info).unwrap()["points"], 300);
    let note = "cut.las: salvaged 300 of 400 points; the file ends at byte";
    let (picture, cloud) = (folder.path("a.png"), folder.path("a.ply"));
    let movie = folder.path("a_####.png");
    let small = ["--salvage", "--resolution", "16x12", "--spp", "1"];
    let commands = [
        [&["render", &cut, "-o", &picture][..], &small].concat(),
        [&["animate", &cut, "-o", &movie, "--turntable", "1", "--frames", "1"][..], &small]
            .concat(),
        vec!["prepare", &cut, "-o", &cloud, "--salvage"],
    ];
    for arguments in commands {
        let output = surfel(&arguments);
        let text = stderr(&output);
        assert!(output.status.success() && text.contains(note), "{arguments:?}: {text}");
    }
    let server = Server::start(&["--salvage", &cut, "--spp", "1"]);
    let served = server.get("/render?resolution=16x12");
    assert!(served == (200, std::fs::read(&picture).unwrap()));
}

#[test]
fn a_scene_file_salvages_one_object() {
    let folder = Folder::new();
    cut_scan(&folder);
    let scene = folder.write("scene.toml", "[[object]]\nfile = \"cut.las\"\nsalvage = true\n");
    let picture = folder.path("a.png");
    let options = ["--resolution", "16x12", "--spp", "1"];
    succeed(&[&["render", &scene, "-o", &picture][..], &options].concat());
    let scene = folder.write("whole.toml", "[[object]]\nfile = \"cut.las\"\n");
    let refused = fail(&[&["render", &scene, "-o", &picture][..], &options].concat(), 1);
    assert!(refused.contains("what is whole can be read [--salvage]"), "{refused}");
}
