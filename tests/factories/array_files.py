"""Files of arrays with names: HDF5 and MATLAB; and Draco files."""

from __future__ import annotations

import io
from typing import Any

import DracoPy
import h5py
import numpy as np
import scipy.io

from tests.factories.cloud_files import NORMALS, POINTS

Arrays = dict[str, Any]


def hdf5(arrays: Arrays, **settings: Any) -> bytes:
    content = io.BytesIO()
    with h5py.File(content, "w") as file:
        for name, array in arrays.items():
            file.create_dataset(name, data=array, **settings)
    return content.getvalue()


def matlab_73(arrays: Arrays) -> bytes:
    content = io.BytesIO()
    with h5py.File(content, "w", userblock_size=512) as file:
        for name, array in arrays.items():
            table = np.atleast_2d(np.asarray(array, np.float64))
            file.create_dataset(name, data=table if np.ndim(array) == 1 else table.T)
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
    return b"MATLAB 7.3 MAT-file".ljust(512, b" ") + content.getvalue()[512:]


def matlab(arrays: Arrays, *, compressed: bool = False) -> bytes:
    content = io.BytesIO()
    scipy.io.savemat(content, arrays, do_compression=compressed)
    return content.getvalue()


def packed(arrays: Arrays) -> bytes:
    return hdf5(arrays, compression="gzip")


def draco() -> bytes:
    return bytes(DracoPy.encode(np.asarray(POINTS, np.float32), quantization_bits=0))


def array_seeds() -> dict[str, bytes]:
    arrays = {"points": POINTS, "normals": NORMALS}
    return {
        "hdf5": hdf5(arrays),
        "hdf5 packed": packed(arrays),
        "matlab 7.3": matlab_73(arrays),
        "matlab": matlab(arrays),
        "matlab packed": matlab(arrays, compressed=True),
        "draco": draco(),
    }
