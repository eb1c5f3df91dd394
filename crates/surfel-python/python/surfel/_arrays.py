"""Arrays as numpy has them: what users hand over is looked at here, and refused with the reason."""

from surfel._errors import InvalidArray


def as_array(name, values):
    """Anything that is an array or can be one: numpy, `__array_interface__`, buffers, `__dlpack__`, sequences.

    Masked numbers become NaN.
    """
    import numpy

    if isinstance(values, numpy.ma.MaskedArray):
        return _nan_where_masked(values)
    known = ("__array_interface__", "__array__", "__array_struct__")
    try:
        if hasattr(values, "__dlpack__") and not any(hasattr(values, way) for way in known):
            return numpy.from_dlpack(values)
        return _nan_where_missing(values, numpy.asarray(values))
    except (TypeError, ValueError, BufferError, RuntimeError) as error:
        message = f"{name}: found {_kind(values)} that is no array of this machine's memory: {error}"
        raise InvalidArray(message) from error


def contiguous(array, dtype):
    """The array of this type in rows one after the other, at addresses that the machine reads as such numbers."""
    import numpy

    return numpy.require(array, dtype, ["C", "A", "E"])


def numbers(name, values, shape):
    """An array of float32 or float64 in rows one after the other; `None` in `shape` stands for any length."""
    array = _shaped(name, as_array(name, values), shape)
    return _contiguous(name, array, ("f4", "f8"))


def rays(values):
    """Rays as rows of six numbers, and the shape of what is said of each."""
    array = as_array("rays", values)
    if array.ndim < 1 or array.shape[-1] != 6:
        raise InvalidArray(f"rays: found shape {array.shape}, expected (..., 6): x, y, z, dx, dy, dz")
    return _contiguous("rays", array.reshape(-1, 6), ("f4", "f8")), array.shape[:-1]


def scalars(name, values, n_points):
    """A column of one of the types that clouds hold: uint8, uint16, int32, float32 or float64."""
    array = _shaped(name, as_array(name, values), (n_points,))
    types = {"b1": "u1", "i1": "i4", "i2": "i4", "u4": "f8", "f2": "f4"}
    code = types.get(array.dtype.str[1:])
    return _contiguous(name, array.astype(code) if code else array, ("u1", "u2", "i4", "f4", "f8"))


def named_columns(columns):
    """Columns by their names, as a dict: of any mapping, or of a table.

    Raises `TypeError` for anything else.
    """
    if not hasattr(columns, "keys"):
        raise TypeError(f"scalars: found {_kind(columns)}, expected names with columns, as {{'age': age}}")
    named = dict(columns)
    for name in named:
        if not isinstance(name, str):
            raise TypeError(f"scalars: found the name {name!r}, expected text, as in {{'age': age}}")
    return named


def classes(values, n_points):
    """ASPRS classes from 0 to 255."""
    import numpy

    array = _shaped("classification", _unmasked("classification", values), (n_points,))
    if array.dtype.kind not in "iub":
        raise InvalidArray(f"classification: found dtype {array.dtype}, expected integers from 0 to 255")
    if array.size and not 0 <= array.min() <= array.max() <= 255:
        raise InvalidArray(f"classification: found {array.min()} to {array.max()}, expected 0 to 255")
    return contiguous(array, numpy.uint8)


def indices(name, values, n_columns, limit):
    """Rows of indices below `limit`, as uint32."""
    import numpy

    array = _shaped(name, _unmasked(name, values), (None, n_columns))
    if array.dtype.kind not in "iu":
        raise InvalidArray(f"{name}: found dtype {array.dtype}, expected integers")
    if array.size and not 0 <= array.min() <= array.max() < limit:
        message = f"{name}: found indices {array.min()} to {array.max()}, expected 0 to {limit - 1}"
        raise InvalidArray(message)
    return contiguous(array, numpy.uint32)


def colors(values, n_points):
    """sRGB colours of 16 bits a channel, from uint8, uint16 or numbers from 0 to 1; alpha is left out."""
    import numpy

    array = _unmasked("colors", values)
    if array.ndim != 2 or len(array) != n_points or array.shape[1] not in (3, 4):
        raise InvalidArray(f"colors: found shape {array.shape}, expected ({n_points}, 3) or ({n_points}, 4)")
    array = array[:, :3]
    # Tables hold all integers as int64; those up to 255 are of eight bits.
    if array.dtype.kind in "iu" and array.dtype.itemsize > 2 and array.size and 0 <= array.min() and array.max() <= 65535:
        array = array.astype(numpy.uint8 if array.max() <= 255 else numpy.uint16)
    if array.dtype == numpy.uint8:
        return contiguous(array, numpy.uint16) * numpy.uint16(257)
    if array.dtype.kind == "f":
        # Numbers that are not finite fail here too.
        if array.size and not (0 <= array.min() and array.max() <= 1):
            raise InvalidArray(f"colors: found {array.min()} to {array.max()}, expected 0 to 1 in {array.dtype}")
        # The largest number of float16 is 65504.
        wide = array.astype("f4") if array.dtype.itemsize < 4 else array
        return numpy.rint(wide * 65535).astype(numpy.uint16)
    if array.dtype != numpy.uint16:
        expected = "integers from 0 to 255 or 65535, or numbers from 0 to 1"
        found = f"{array.min()} to {array.max()}" if array.size and array.dtype.kind in "iu" else "numbers"
        raise InvalidArray(f"colors: found {found} of dtype {array.dtype}, expected {expected}")
    return contiguous(array, numpy.uint16)


def _nan_where_missing(values, array):
    """The numbers of columns of pandas that may lack some, which are no numbers of numpy otherwise."""
    import numpy

    if array.dtype.kind != "O" or not hasattr(values, "to_numpy"):
        return array
    types = getattr(values, "dtypes", getattr(values, "dtype", None))
    kinds = {getattr(one, "kind", "O") for one in (types if hasattr(types, "__iter__") else (types,))}
    return values.to_numpy("f8", na_value=numpy.nan) if kinds <= set("fiub") else array


def _nan_where_masked(values):
    import numpy

    mask = numpy.ma.getmaskarray(values)
    if not mask.any() or values.dtype.kind not in "fiub":
        return numpy.asarray(values.data)
    wide = values.data.astype(values.dtype if values.dtype.kind == "f" else "f8")
    wide[mask] = numpy.nan
    return wide


def _unmasked(name, values):
    """An array of what has no NaN, which masked values would become."""
    import numpy

    n_masked = numpy.ma.getmaskarray(values).sum() if isinstance(values, numpy.ma.MaskedArray) else 0
    if n_masked:
        raise InvalidArray(f"{name}: found {n_masked} masked values, expected none; fill them first, as by `{name}.filled(0)`")
    return as_array(name, values)


def _shaped(name, array, shape):
    fits = array.ndim == len(shape) and all(want in (None, have) for want, have in zip(shape, array.shape))
    if not fits:
        expected = ", ".join("N" if length is None else str(length) for length in shape)
        expected = f"({expected},)" if len(shape) == 1 else f"({expected})"
        raise InvalidArray(f"{name}: found shape {array.shape}, expected {expected}")
    return array


def _contiguous(name, array, codes):
    """The array in one of these types, or else as float64, in rows one after the other and in native byte order."""
    import numpy

    if array.dtype.kind not in "fiub":
        raise InvalidArray(f"{name}: found dtype {array.dtype}, expected numbers")
    code = array.dtype.str[1:]
    return contiguous(array, code if code in codes else "f8")


def _kind(values):
    return f"an object of type {type(values).__name__}"
