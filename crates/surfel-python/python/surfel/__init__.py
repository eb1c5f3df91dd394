"""Pictures of point clouds, ray traced from the points themselves.

    import surfel
    scene = surfel.load("scan.laz", surface="smooth")
    image = scene.render(resolution=(1920, 1080), sun="2026-06-21T15:00+02:00")
    image.save("scan.png")

Keywords are the keys of scene files (docs/scenes.md); a dot in a key is an underscore here.
"""

from surfel._errors import (
    EncoderError,
    Error,
    InaccessibleFile,
    InvalidArray,
    InvalidFile,
    InvalidScene,
    InvalidSetting,
    MissingFile,
    OutOfMemory,
)
from surfel._native import (
    Cloud,
    Movie,
    HeightMap,
    Image,
    Mesh,
    Scene,
    Viewer,
    __version__,
    animate,
    load,
    prepare,
    read_cloud,
    view,
)
from surfel._rays import create_rays_pinhole

__all__ = [
    "Cloud",
    "EncoderError",
    "Error",
    "Movie",
    "HeightMap",
    "Image",
    "InaccessibleFile",
    "InvalidArray",
    "InvalidFile",
    "InvalidScene",
    "InvalidSetting",
    "Mesh",
    "MissingFile",
    "OutOfMemory",
    "Scene",
    "Viewer",
    "__version__",
    "animate",
    "create_rays_pinhole",
    "load",
    "prepare",
    "read_cloud",
    "view",
]
