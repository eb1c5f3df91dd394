//! Help texts, completions, the manual page, and advice on unknown options.

use super::common::{Folder, dome, fail, succeed};

const COMMANDS: [&str; 7] = ["render", "animate", "view", "info", "prepare", "demo", "bench"];

/// Returns the long names of the options that a help text lists. Descriptions are indented further.
fn listed_options(help: &str) -> Vec<&str> {
    let lines = help.lines().filter(|line| line.find("--").is_some_and(|start| start <= 6));
    let names =
        lines.filter_map(|line| line.split([' ', '=', '[']).find(|word| word.starts_with("--")));
    names.collect()
}

#[test]
fn help_has_examples() {
    for command in COMMANDS {
        let help = succeed(&[command, "--help"]);
        assert!(help.contains("Examples:") && help.contains("--threads"), "{help}");
    }
}

#[test]
fn short_help_lists_at_most_fifteen_options() {
    for command in COMMANDS {
        let (short, long) = (succeed(&[command, "-h"]), succeed(&[command, "--help"]));
        let everywhere = ["--help", "--version", "--quiet"];
        let listed = listed_options(&short);
        let own: Vec<&&str> = listed.iter().filter(|name| !everywhere.contains(name)).collect();
        assert!(own.len() <= 15, "{command}: {own:?}");
        assert!(short.len() < long.len(), "{command}");
        let all = listed_options(&long);
        assert!(listed.len() < all.len(), "{command}");
        assert!(listed.iter().all(|name| all.contains(name)), "{command}: {listed:?} {all:?}");
    }
    let own = listed_options(&succeed(&["render", "-h"])).len();
    assert!(10 < own, "{own}");
}

#[test]
fn completions_name_commands_and_options() {
    let bash = succeed(&["completions", "bash"]);
    assert!(bash.contains("complete -F _surfel") && bash.contains("--camera-position"), "{bash}");
    for shell in ["zsh", "fish", "elvish", "powershell"] {
        let text = succeed(&["completions", shell]);
        for word in COMMANDS.iter().chain(&["camera-position", "turntable"]) {
            assert!(text.contains(word), "{shell}: {word}");
        }
    }
    assert!(fail(&["completions", "tcsh"], 2).contains("bash"));
}

#[test]
fn the_manual_page_describes_all_commands() {
    let page = succeed(&["man"]);
    assert!(page.contains(".TH surfel 1") && page.contains(".SH OPTIONS"), "{page}");
    for command in COMMANDS {
        assert!(page.contains(&format!("surfel\\-{command}")), "{command}");
    }
    for option in ["camera\\-position", "turntable", "normals\\-k"] {
        assert!(page.contains(option), "{option}");
    }
}

#[test]
fn unknown_options_and_commands_are_answered_with_the_nearest() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(10));
    let picture = folder.path("no.png");
    for (option, nearest) in [
        ("--camera-positoin=1,2,3", "'--camera-position'"),
        ("--sun-azimut=3", "'--sun-azimuth'"),
        ("--backgruond=red", "'--background'"),
    ] {
        let text = fail(&["render", &cloud, "-o", &picture, option], 2);
        assert!(text.contains("unexpected argument") && text.contains(nearest), "{text}");
    }
    assert!(fail(&["redner", &cloud], 2).contains("'render'"));
}

#[test]
fn words_of_other_programs_are_answered_with_the_options_of_the_command() {
    for (option, tip) in [
        ("--fov=60", "tip: here it is '--camera-view-angle'"),
        ("--scalars=z", "tip: here it is '--color'"),
        ("--window-size=640x480", "tip: here it is '--resolution'"),
    ] {
        let text = fail(&["render", "scan.laz", "-o", "no.png", option], 2);
        assert!(text.contains(tip) && text.matches("tip:").count() == 1, "{text}");
    }
    assert!(!fail(&["info", "scan.laz", "--fov", "60"], 2).contains("here it is"));
}

#[test]
fn a_file_without_a_command_is_answered_with_commands() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(10));
    let text = fail(&[&cloud], 2);
    assert!(text.contains(&format!("`surfel render {cloud} -o picture.png`")), "{text}");
    assert!(text.contains(&format!("`surfel view {cloud}`")), "{text}");
    assert!(!fail(&["absent.ply"], 2).contains("surfel render"));
}

#[test]
fn commands_of_other_programs_are_answered_with_those_of_surfel() {
    for (word, tip) in [
        ("convert", "tip: `surfel prepare scan.laz -o scan.ply"),
        ("show", "tip: here it is 'surfel view'"),
        ("movie", "tip: here it is 'surfel animate'"),
    ] {
        let text = fail(&[word, "in.laz", "out.ply"], 2);
        assert!(text.contains(tip) && text.matches("tip:").count() == 1, "{text}");
    }
    assert!(succeed(&["help"]).contains("prepare"));
}

#[test]
fn commands_have_no_options_that_they_do_not_read() {
    for (command, option) in [
        ("view", "--bit-depth=16"),
        ("bench", "--camera-station=1"),
        ("bench", "--camera-interior=on"),
    ] {
        let text = fail(&[command, "scan.laz", option], 2);
        assert!(text.contains("unexpected argument"), "{command}: {text}");
    }
}

#[test]
fn invalid_values_name_the_option_and_what_was_expected() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(10));
    for (options, expected) in [
        (
            &["--camera-position", "1,2"][..],
            "error: --camera-position: found \"1,2\", expected three numbers as in [1.5, -2, 0]",
        ),
        (
            &["--orient", "statoin"],
            "error: --orient: found \"statoin\", expected auto, none, station, scan-angle, up, mst or \
             viewpoint:x,y,z; the nearest known one is `station`",
        ),
        (
            &["--class", "high vegetatoin"],
            "error: --class: found \"high vegetatoin\", expected numbers or names of ASPRS classes, as in 2,6 or \
             ground,building; the nearest known one is `high vegetation`",
        ),
        (&["--spp", "0"], "error: --spp: found \"0\", expected a whole number from 1 to 65536"),
        (
            &["--camera-panorama", "--camera-view-angle", "60"],
            "error: --camera-panorama: excludes --camera-view-angle; leave out one of them",
        ),
        (
            &["--normals-k", "8", "--normals-radius", "1"],
            "error: --normals-k: excludes --normals-radius; leave out one of them",
        ),
        (
            &["--material", "glass:ior=9"],
            "error: --material: ior: found \"9\", expected a number from 1 to 4",
        ),
        (
            &["--material", "glass:glow=9"],
            "error: --material: glow: unknown key; known: kind, color, alpha, metallic, roughness, ior, \
             transmission, attenuation_color, attenuation_distance, thin, emissive, emissive_strength",
        ),
    ] {
        let text = fail(&[&["render", &cloud, "-o", &folder.path("no.png")], options].concat(), 2);
        assert_eq!(text.lines().next(), Some(expected));
    }
}
