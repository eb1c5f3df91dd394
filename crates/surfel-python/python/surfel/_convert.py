"""Clouds and meshes of other packages, recognised by what they have; none of the packages is imported."""

import os

from surfel._arrays import as_array, contiguous
from surfel._errors import InvalidArray

_PACKAGES = "laspy, Open3D, PyVista, trimesh, pandas or xarray"
_POSITIONS = ("x", "y", "z")
_COLORS = ("red", "green", "blue")


def cloud_columns(source):
    """The columns of a cloud as keywords of `Cloud`, or `None` if `source` is an array of positions."""
    if isinstance(source, (str, os.PathLike)):
        raise InvalidArray(f"points: found the path {os.fspath(source)}, expected an array (N, 3); surfel.read_cloud reads files")
    _refuse_blocks(source)
    for reader in (_surfel, _laspy, _open3d, _open3d_tensor, _pyvista, _trimesh, _table):
        columns = reader(source)
        if columns is not None:
            return {name: values for name, values in columns.items() if values is not None}
    # What has a length may be long, and becomes an array later.
    if not hasattr(source, "__len__") and as_array("points", source).shape == ():
        found = f"found an object of type {type(source).__name__}"
        raise InvalidArray(f"points: {found}, expected an array (N, 3), or what {_PACKAGES} hold")
    return None


def mesh_columns(source):
    """The vertices and triangles of a mesh as keywords of `Mesh`, or `None` if `source` is none.

    Raises `InvalidArray` for grids of PyVista, of which it is not clear what is to be shown.
    """
    _refuse_blocks(source)
    if _has(source, "n_cells", "point_data", "extract_surface") and not hasattr(source, "faces") and source.n_cells:
        advice = "`.extract_surface()` makes the mesh of its surface, surfel.Cloud(grid) takes its points"
        raise InvalidArray(f"found a {type(source).__name__}, expected a mesh of triangles; {advice}")
    if _has(source, "vertices", "triangles", "has_triangles"):
        columns = {"vertices": source.vertices, "triangles": source.triangles}
        return columns | _if_filled(normals=source.vertex_normals, colors=source.vertex_colors)
    if _has(source, "vertex", "triangle") and "positions" in source.vertex and "indices" in source.triangle:
        vertex, triangle = _tensors(source.vertex), _tensors(source.triangle)
        columns = {"vertices": vertex["positions"], "triangles": triangle["indices"]}
        return columns | _if_filled(normals=vertex.get("normals"), colors=vertex.get("colors"))
    if _has(source, "vertices", "faces") and len(source.faces):
        # Normals are computed for any mesh, and would round its edges; colours too, unless they are those of vertices.
        visual = getattr(source, "visual", None)
        colors = visual.vertex_colors if getattr(visual, "kind", None) == "vertex" else None
        return {"vertices": source.vertices, "triangles": source.faces} | _if_filled(colors=colors)
    if _has(source, "points", "faces", "n_cells") and len(source.faces):
        mesh = source if source.is_all_triangles else source.triangulate()
        triangles = as_array("faces", mesh.faces).reshape(-1, 4)[:, 1:]
        normals, colors, _ = _point_data(mesh)
        return {"vertices": mesh.points, "triangles": triangles} | _if_filled(normals=normals, colors=colors)
    return None


def crs_text(crs):
    """A coordinate system as a code or as WKT: that of pyproj, others as they are."""
    if _has(crs, "to_epsg", "to_wkt"):
        code = crs.to_epsg()
        return f"EPSG:{code}" if code else crs.to_wkt("WKT1_GDAL")
    return str(crs) if hasattr(crs, "__index__") else crs


def _has(source, *names):
    return all(hasattr(source, name) for name in names)


def _if_filled(**columns):
    return {name: values for name, values in columns.items() if values is not None and len(values)}


def _refuse_blocks(source):
    if _has(source, "combine", "n_blocks"):
        advice = "`.extract_surface()` makes one mesh of the surfaces of its blocks; or add each block by itself"
        raise InvalidArray(f"found a {type(source).__name__} of {source.n_blocks} blocks, expected one cloud or mesh; {advice}")


def _surfel(cloud):
    if not _has(cloud, "local_points", "origin"):
        return None
    names = ("points", "normals", "radii", "colors", "intensity", "classification", "scalars", "crs")
    return {name: getattr(cloud, name) for name in names}


def _laspy(las):
    if not _has(las, "X", "Y", "Z", "point_format"):
        return None
    # A record of points holds scales and offsets itself, a file in its header.
    placed = getattr(las, "header", las)
    names = [name for name in las.point_format.dimension_names if name not in ("X", "Y", "Z", *_COLORS)]
    columns = {name: as_array(name, las[name]) for name in names}
    result = {
        "points": tuple(_integers(axis) for axis in (las.X, las.Y, las.Z)),
        "scales": placed.scales,
        "offsets": placed.offsets,
        "intensity": columns.pop("intensity", None),
        "classification": columns.pop("classification", None),
        "scalars": {name: values for name, values in columns.items() if values.ndim == 1},
        "crs": _laspy_crs(placed),
    }
    if all(name in las.point_format.dimension_names for name in _COLORS):
        colors = _stacked([as_array(name, las[name]) for name in _COLORS])
        # Files whose colours have eight bits hold nothing above 255.
        result["colors"] = colors.astype("u1") if colors.size and colors.max() <= 255 else colors
    return result


def _laspy_crs(header):
    """The coordinate system as the file has it in WKT, or by its GeoTIFF keys where pyproj is installed."""
    records = [*getattr(header, "vlrs", ()), *(getattr(header, "evlrs", None) or ())]
    texts = [record.string.rstrip("\0") for record in records if type(record).__name__ == "WktCoordinateSystemVlr"]
    if texts:
        return texts[0]
    try:
        return crs_text(header.parse_crs())
    except Exception:
        # Without pyproj, of a record of points, or for keys that it does not understand.
        return None


def _integers(axis):
    return contiguous(axis, "i4")


def _open3d(cloud):
    if not _has(cloud, "points", "has_normals", "has_colors"):
        return None
    normals = cloud.normals if cloud.has_normals() else None
    colors = cloud.colors if cloud.has_colors() else None
    return {"points": as_array("points", cloud.points), "normals": normals, "colors": colors}


def _open3d_tensor(cloud):
    point = getattr(cloud, "point", None)
    if point is None or "positions" not in point:
        return None
    columns = _tensors(point)
    result = {name: columns.pop(key, None) for name, key in (("points", "positions"), ("normals", "normals"), ("colors", "colors"))}
    # Attributes of one number have the shape (N, 1).
    columns = {name: values.reshape(len(values)) for name, values in columns.items() if values.size == len(values)}
    result["intensity"] = columns.pop("intensity", columns.pop("intensities", None))
    return result | {"scalars": columns}


def _tensors(attributes):
    """The attributes of a tensor geometry as arrays."""
    return {name: attributes[name].cpu().numpy() for name in attributes}


def _pyvista(data):
    if not _has(data, "points", "point_data"):
        return None
    normals, colors, scalars = _point_data(data)
    return {"points": data.points, "normals": normals, "colors": colors, "scalars": scalars}


def _point_data(data):
    """The normals, the colours, and the other columns of the points of a data set of PyVista."""
    columns = {name: as_array(name, data.point_data[name]) for name in data.point_data.keys()}
    colors = next((columns.pop(name) for name in ("RGB", "RGBA", "rgb", "rgba", "colors") if name in columns), None)
    normals = next((columns.pop(name) for name in ("Normals", "normals") if name in columns), None)
    return normals, colors, {name: values for name, values in columns.items() if values.ndim == 1}


def _trimesh(cloud):
    if not _has(cloud, "vertices", "colors") or hasattr(cloud, "faces"):
        return None
    colors = cloud.colors if cloud.colors is not None and len(cloud.colors) else None
    return {"points": cloud.vertices, "colors": colors}


def _table(table):
    """A DataFrame or Dataset with the columns x, y and z in any case."""
    if not hasattr(table, "columns") and not hasattr(table, "data_vars"):
        return None
    names = [*getattr(table, "columns", ()), *getattr(table, "data_vars", ()), *getattr(table, "coords", ())]
    columns = {str(name).lower(): (str(name), as_array(str(name), table[name])) for name in names}
    if not all(axis in columns for axis in _POSITIONS):
        return None
    take = lambda name: columns.pop(name, (None, None))[1]
    result = {"points": _stacked([take(axis) for axis in _POSITIONS])}
    if all(color in columns for color in _COLORS):
        result["colors"] = _stacked([take(color) for color in _COLORS])
    result |= {name: take(name) for name in ("intensity", "classification")}
    result["scalars"] = {name: values for name, values in columns.values() if values.dtype.kind in "fiub"}
    return result


def _stacked(columns):
    import numpy

    return numpy.stack(columns, axis=1)
