//! GPUs: the list of devices, and what is said where a GPU cannot do what it is told.

use super::common::{Folder, command, dome, fail, succeed};
use crate::skipped::report_skipped;

/// Returns true if a run found no GPU, of which it wrote these lines; the test then says that it is skipped.
fn lacks_gpu(stderr: &str) -> bool {
    let error = stderr.lines().find(|line| line.contains("no GPU was found"));
    if let Some(error) = error {
        report_skipped(error);
    }
    error.is_some()
}

/// Runs the program on a machine whose Vulkan has no device.
#[cfg(target_os = "linux")]
fn without_devices(arguments: &[&str]) -> std::process::Output {
    let nowhere = [("VK_DRIVER_FILES", "/nowhere"), ("VK_ICD_FILENAMES", "/nowhere")];
    command(arguments).envs(nowhere).output().unwrap()
}

#[test]
fn devices_lists_the_processor_first() {
    let text = succeed(&["devices"]);
    assert!(text.starts_with("cpu  ") && 2 <= text.lines().count(), "{text}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_demanded_gpu_that_is_absent_is_an_error_and_auto_takes_the_cpu() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(10));
    let picture = folder.path("out.png");
    let run = |backend| {
        let size = ["--resolution", "32x24", "--spp", "1"];
        let words = ["render", &cloud, "-o", &picture, "--backend", backend];
        without_devices(&[&words[..], &size].concat())
    };
    let refused = run("gpu");
    let text = String::from_utf8_lossy(&refused.stderr);
    let expected =
        "error: no GPU was found: neither Vulkan nor Metal nor DirectX 12 has a device\n";
    assert_eq!((refused.status.code(), &*text), (Some(1), expected));
    assert_eq!(folder.names(), ["dome.ply"]);
    assert!(run("auto").status.success());
}

#[cfg(target_os = "linux")]
#[test]
fn a_named_device_demands_a_gpu_unless_the_backend_is_auto() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(10));
    let picture = folder.path("out.png");
    let render = ["render", &cloud, "-o", &picture, "--resolution", "32x24", "--spp", "1"];
    for command in [&render[..], &["bench", &cloud]] {
        let refused = without_devices(&[command, &["--device", "nvidai"]].concat());
        let text = String::from_utf8_lossy(&refused.stderr);
        assert!(text.starts_with("error: no GPU was found"), "{text}");
        assert_eq!(refused.status.code(), Some(1), "{command:?}");
    }
    let text = fail(&[&render[..], &["--backend", "cpu", "--device", "0"]].concat(), 2);
    let expected = "error: --device: names a GPU, and the backend is cpu; leave out one of them\n";
    assert_eq!((&*text, folder.names()), (expected, vec!["dome.ply".to_owned()]));
    let automatic = [&render[..], &["--backend", "auto", "--device", "nvidai"]].concat();
    assert!(without_devices(&automatic).status.success());
}

#[test]
fn gpus_refuse_what_they_do_not_render() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(10));
    let picture = folder.path("out.png");
    let render = ["render", &cloud, "-o", &picture, "--backend", "gpu", "--resolution", "32x24"];
    let text = fail(&[&render[..], &["--device", "nobody's"]].concat(), 1);
    if lacks_gpu(&text) {
        return;
    }
    assert!(text.contains("unknown device 'nobody's'; known: 0 ("), "{text}");
    let text = fail(&[&render[..], &["--surface", "points"]].concat(), 1);
    assert!(text.contains("the GPU does not render the surface points yet"), "{text}");
    assert_eq!(folder.names(), ["dome.ply"]);
    succeed(&render);
    assert_eq!(folder.names(), ["dome.ply", "out.png"]);
}

#[test]
fn the_memory_limit_holds_for_the_memory_of_a_gpu() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(10));
    let picture = folder.path("out.png");
    // The queues of a picture take more than the picture, for which the limit is enough on the CPU.
    let render = |backend, resolution, limit| {
        let size = ["--resolution", resolution, "--spp", "1", "--memory-limit", limit];
        let words = ["render", &cloud, "-o", &picture, "--backend", backend];
        command(&[&words[..], &size].concat()).output().unwrap()
    };
    let refused = render("gpu", "120x120", "2M");
    let text = String::from_utf8_lossy(&refused.stderr);
    assert_eq!(refused.status.code(), Some(1), "{text}");
    if lacks_gpu(&text) {
        return;
    }
    // Lines about what was chosen come before.
    let error = text.lines().last().unwrap_or_default();
    let expected = " of memory are needed, and the limit is 2.0 MiB [--memory-limit]";
    assert!(error.starts_with("error: ") && error.ends_with(expected), "{text}");
    assert_eq!(folder.names(), ["dome.ply"]);
    assert!(render("cpu", "120x120", "2M").status.success());
    // Under this limit the queues are shorter than the picture.
    assert!(render("gpu", "200x150", "11M").status.success());
}

#[test]
fn bench_traces_the_rays_of_the_cpu_on_a_gpu() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(30));
    let size = ["--resolution", "48x48", "--runs", "2", "--json", "--quiet"];
    let kinds = ["--rays", "primary,shadow,bounce-any,bounce,gather,surface"];
    let bench = |backend: &str| {
        let words = [&["bench", &cloud, "--backend", backend][..], &size, &kinds].concat();
        command(&words).output().unwrap()
    };
    let [cpu, gpu] = ["cpu", "gpu"].map(bench);
    let text = String::from_utf8_lossy(&gpu.stderr);
    if lacks_gpu(&text) {
        return;
    }
    assert!(gpu.status.success(), "{text}");
    let [cpu, gpu] = [cpu, gpu]
        .map(|output| serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap());
    assert_eq!((&cpu["backend"], &gpu["backend"]), (&"cpu".into(), &"gpu".into()));
    for (kind, of_cpu) in cpu["rays"].as_object().unwrap() {
        let of_gpu = &gpu["rays"][kind];
        assert_eq!(of_cpu["rays"], of_gpu["rays"], "{kind}");
        let [cpu, gpu] = [of_cpu, of_gpu].map(|row| row["hits"].as_u64().unwrap());
        // A ray within a rounding error of a rim hits on one of them only.
        assert!(cpu.abs_diff(gpu) <= 1 + cpu / 1000, "{kind}: {cpu} {gpu}");
        assert!(0.0 < of_gpu["median_mrays_per_s"].as_f64().unwrap(), "{kind}");
    }
}
