"""Rays of cameras, as Open3D makes them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from surfel._errors import InvalidArray

if TYPE_CHECKING:
    # numpy is imported where it is needed first, which makes `import surfel` fast.
    import numpy
    from numpy.typing import ArrayLike, NDArray


def create_rays_pinhole(
    fov_deg: float, center: ArrayLike, eye: ArrayLike, up: ArrayLike, width_px: int, height_px: int
) -> NDArray[numpy.float64]:
    """Rays through the centres of a pinhole camera's pixels: float64, (height_px, width_px, 6).

    `fov_deg` is the horizontal angle of view in degrees; `eye` looks at `center` in world coordinates, `up` points upward
    in the picture. Row 0 is the top. Directions have the length 1 along the view axis, so that `t_hit` is the depth.

    Raises `InvalidArray` for a camera that looks nowhere.
    """
    import numpy

    eye, center, up = (numpy.asarray(vector, dtype=float) for vector in (eye, center, up))
    if any(vector.shape != (3,) or not numpy.isfinite(vector).all() for vector in (eye, center, up)):
        raise InvalidArray("center, eye, up: expected three finite numbers each")
    if not (0 < fov_deg < 180 and 0 < width_px and 0 < height_px):
        raise InvalidArray("expected fov_deg between 0 and 180, width_px and height_px above 0")
    forward = center - eye
    right = numpy.cross(forward, up)
    if not right.any():
        raise InvalidArray("up: is parallel to the view from eye to center; choose another direction")
    forward = forward / numpy.linalg.norm(forward)
    right = right / numpy.linalg.norm(right)
    down = numpy.cross(forward, right)
    step = 2 * math.tan(math.radians(fov_deg) / 2) / width_px
    x = (numpy.arange(width_px) + 0.5 - width_px / 2) * step
    y = (numpy.arange(height_px) + 0.5 - height_px / 2) * step
    rays = numpy.empty((height_px, width_px, 6))
    rays[..., :3] = eye
    rays[..., 3:] = forward + x[None, :, None] * right + y[:, None, None] * down
    return rays
