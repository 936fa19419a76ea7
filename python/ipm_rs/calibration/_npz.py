"""Small arrays of an ``.npz`` file, as calibration tutorials write it: nothing is unpickled, nothing large unpacked.

``numpy.load`` is not used: it allocates what a header claims, and what a damaged archive raises is not documented.
"""

from __future__ import annotations

import io
import math
import zipfile
from typing import Any

import numpy as np

from ipm_rs.errors import CalibrationError

__all__ = ["read_npz"]

MAX_ENTRIES = 1000
MAX_ENTRY_BYTES = 1 << 20
"""Of one array: a camera matrix has 72. Larger ones are no part of a calibration, and stay packed."""
MAX_SMALL_BYTES = 16 << 20
"""Of all arrays that are unpacked."""

_DIRECTORY_ENTRY = b"PK\x01\x02"
_HEADERS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}


def read_npz(data: bytes, origin: str) -> dict[str, Any]:
    """Arrays by name, scalars and words as such; pickled, large and structured ones are left out.

    Raises
    ------
    CalibrationError
        It is another archive, or damaged.
    """
    if data.count(_DIRECTORY_ENTRY) > MAX_ENTRIES:
        raise CalibrationError(f"{origin}: expected at most {MAX_ENTRIES} arrays, got more; keep those of the camera")
    found: dict[str, Any] = {}
    left = MAX_SMALL_BYTES
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            infos = archive.infolist()
            if not any(info.filename.endswith(".npy") for info in infos):
                raise CalibrationError(
                    f"{origin}: expected an .npz file of arrays, got a zip archive of other files; unpack it, and pass "
                    "the calibration file"
                )
            for info in infos:
                name = info.filename.removesuffix(".npy")
                if name == info.filename or info.file_size > min(MAX_ENTRY_BYTES, left):
                    continue
                if name in found:
                    raise CalibrationError(f"{origin}: expected every array once, got {name[:60]!r} again; keep one")
                with archive.open(info) as file:
                    content = file.read(MAX_ENTRY_BYTES + 1)
                left -= len(content)
                value = _array(content)
                if value is not None:
                    found[name] = value
    except CalibrationError:
        raise
    except MemoryError:
        raise
    except Exception as error:  # BadZipFile, zlib.error, NotImplementedError, EOFError, struct.error, RuntimeError, ...
        raise CalibrationError(
            f"{origin}: expected an .npz file, got one that cannot be unpacked: {str(error)[:200]}; it may be damaged, "
            "fetch it again"
        ) from error
    return found


def _array(content: bytes) -> Any:
    """Value of an ``.npy`` file; None where it is no plain array of numbers or words."""
    file = io.BytesIO(content)
    version = np.lib.format.read_magic(file)
    if version not in _HEADERS:  # 3.0 is for structured arrays with names in other alphabets
        return None
    shape, by_columns, dtype = _HEADERS[version](file)
    if dtype.hasobject or dtype.kind not in "biufUS":
        return None
    if any(side < 0 for side in shape):
        raise ValueError(f"a shape of {shape}")
    count, body = math.prod(shape), content[file.tell() :]
    if count * dtype.itemsize != len(body):
        raise ValueError(f"{len(body)} bytes for a shape of {shape}")
    if dtype.itemsize == 0:
        return None
    array = np.frombuffer(body, dtype).reshape(shape, order="F" if by_columns else "C")
    if dtype.kind not in "US":
        return array.item() if array.ndim == 0 else array.astype(np.float64)
    if array.size != 1:
        return None
    word = array.reshape(-1)[0]
    return word.decode("latin-1") if isinstance(word, bytes) else str(word)
