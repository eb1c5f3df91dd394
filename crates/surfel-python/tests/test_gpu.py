"""Pictures of a GPU, and the exception where there is none."""

import numpy
import pytest
import surfel

SMALL = {"resolution": (32, 24), "spp": 1, "light_samples": 1, "exposure": 0, "surface": "disc"}


def test_unknown_devices_are_named(hill):
    # Either the devices are listed, or there is none at all.
    words = r"unknown device 'no such device'; known: 0 \(|no GPU was found"
    with pytest.raises(surfel.InvalidScene, match=words):
        surfel.load(hill, device="no such device")


def test_pictures_of_a_gpu_are_those_of_the_cpu(hill):
    try:
        scene = surfel.load(hill, backend="gpu", **SMALL)
    except surfel.InvalidScene as error:
        if "no GPU was found" not in str(error):
            raise
        pytest.skip(str(error))
    picture = scene.render()
    expected = surfel.load(hill, backend="cpu", **SMALL).render()
    # A ray within a rounding error of a rim hits on one of them only; so do rays toward lights.
    differs = 1e-3 < numpy.abs(picture.color - expected.color).max(axis=2)
    assert differs.mean() < 0.02
    # A picture may be rendered elsewhere than those before it.
    again = scene.render(backend="cpu")
    numpy.testing.assert_array_equal(again.color, expected.color)
