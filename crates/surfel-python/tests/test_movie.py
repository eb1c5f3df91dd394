"""Movies: frames, refusals, and the program's movie beside them."""

import shutil
import subprocess
import sys

import pytest
import surfel

SMALL = {"resolution": (32, 24), "spp": 1, "light_samples": 1}


def test_frames_are_those_of_the_program(hill, tmp_path):
    ours, theirs = tmp_path / "ours", tmp_path / "theirs"
    ours.mkdir()
    theirs.mkdir()
    scene = surfel.load(hill, turntable=2, **SMALL)
    surfel.animate(scene, ours / "f_####.png", frames=range(3))
    words = ["animate", hill, "-o", theirs / "f_####.png", "--frames", 3, "--turntable", 2]
    words += ["--resolution", "32x24", "--spp", 1, "--light-samples", 1, "--quiet"]
    subprocess.run([sys.executable, "-m", "surfel", *map(str, words)], check=True)
    names = sorted(file.name for file in ours.glob("*.png"))
    assert len(names) == 3 and names == sorted(file.name for file in theirs.glob("*.png"))
    for name in names:
        assert (ours / name).read_bytes() == (theirs / name).read_bytes(), name


def test_settings_by_name_hold_for_movies(hill):
    by_name = surfel.load(hill, object_settings=["hill.xyz:color=#ff0000"], turntable=2, **SMALL)
    of_all = surfel.load(hill, color="#ff0000", turntable=2, **SMALL)
    frames = [surfel.Movie(scene, frames=2).render(1) for scene in (by_name, of_all)]
    assert (frames[0].color == frames[1].color).all() and frames[0].coverage.any()


def test_clouds_of_arrays_turn(points, tmp_path):
    scene = surfel.Scene(**SMALL)
    scene.add(surfel.Cloud(points))
    reports = []
    surfel.animate(scene, tmp_path / "turn.gif", frames=4, turntable=1, progress=lambda *report: reports.append(report))
    assert (tmp_path / "turn.gif").read_bytes().startswith(b"GIF89a")
    assert reports


def test_interrupted_movies_are_continued(hill, tmp_path):
    # Large enough that the work is stopped before its end.
    scene = surfel.load(hill, turntable=1, resolution=(160, 120), spp=4, light_samples=4)
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    whole.mkdir()
    cut.mkdir()
    surfel.animate(scene, whole / "f_##.png", frames=30)

    def stop(*_):
        if len(list(cut.glob("f_*.png"))) >= 2:
            raise RuntimeError("stopped")

    with pytest.raises(RuntimeError, match="stopped"):
        surfel.animate(scene, cut / "f_##.png", frames=30, progress=stop)
    kept = {file: file.stat().st_mtime_ns for file in cut.glob("f_*.png")}
    assert 2 <= len(kept) < 30
    with pytest.raises(surfel.InvalidFile, match=r"\[resume\]$"):
        surfel.animate(scene, cut / "f_##.png", frames=30, resume=True, spp=2)
    surfel.animate(scene, cut / "f_##.png", frames=30, resume=True)
    assert all(file.stat().st_mtime_ns == time for file, time in kept.items())
    for i in range(1, 31):
        assert (cut / f"f_{i:02}.png").read_bytes() == (whole / f"f_{i:02}.png").read_bytes(), i


@pytest.mark.parametrize("frames", [range(2, 5), range(0, 6, 2), "many", -1, 0])
def test_other_frames_are_refused(hill, tmp_path, frames):
    with pytest.raises(surfel.InvalidSetting, match="frames: found"):
        surfel.animate(surfel.load(hill), tmp_path / "turn.gif", frames=frames)


def test_still_scenes_need_a_number_of_frames(hill, tmp_path):
    with pytest.raises(surfel.InvalidSetting, match="nothing moves"):
        surfel.animate(surfel.load(hill), tmp_path / "still.gif")


def test_other_files_are_refused(hill, tmp_path):
    with pytest.raises(surfel.InvalidFile, match="extension"):
        surfel.animate(surfel.load(hill), tmp_path / "turn.doc", frames=2)


def test_videos_are_encoded(hill, tmp_path):
    if shutil.which("ffmpeg") is None:
        pytest.skip("ffmpeg is not installed")
    surfel.animate(surfel.load(hill, **SMALL), tmp_path / "turn.mp4", frames=5, turntable=1)
    assert 500 < (tmp_path / "turn.mp4").stat().st_size


def test_frames_are_rendered_one_by_one(hill, tmp_path):
    scene = surfel.load(hill, turntable=1, fps=5, **SMALL)
    movie = surfel.Movie(scene)
    assert len(movie) == 5
    surfel.animate(scene, tmp_path / "f_#.png")
    for index in (3, 0, 4):
        assert movie.render(index)._repr_png_() == (tmp_path / f"f_{index + 1}.png").read_bytes()
    with pytest.raises(IndexError, match="frame 5: expected 0 to 4"):
        movie.render(5)
    with pytest.raises(ValueError, match="^index: found -1, expected 0 to 4"):
        movie.render(-1)
    with pytest.raises(surfel.InvalidSetting, match="nothing moves"):
        surfel.Movie(surfel.load(hill))


def test_movies_are_sequences_of_pictures(hill):
    movie = surfel.Movie(surfel.load(hill, turntable=1, fps=3, **SMALL))
    pictures = [movie.render(i).color for i in range(3)]
    assert [(image.color == picture).all() for image, picture in zip(movie, pictures)] == [True] * 3
    assert len(list(movie)) == 3
    assert (movie[0].color == pictures[0]).all() and (movie[-1].color == pictures[2]).all()
    for index in (3, -4):
        with pytest.raises(IndexError):
            movie[index]
