"""MATLAB's MAT files: up to version 7 by scipy, version 7.3, which is HDF5, by h5py."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
from scipy import sparse
from scipy.io import loadmat


def read_mat(path: Path) -> dict[str, Any]:
    """Variables by name, indexed as in MATLAB; structures are dictionaries, arrays of them lists."""
    if h5py.is_hdf5(path):
        with h5py.File(path, "r", locking=False) as file:
            return {name: _of_hdf5(item, file) for name, item in file.items() if not name.startswith("#")}
    found = loadmat(path, simplify_cells=True)
    return {name: _of_scipy(value) for name, value in found.items() if not name.startswith("__")}


def _of_scipy(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _of_scipy(item) for name, item in value.items()}
    if sparse.issparse(value):
        return value.toarray()
    if isinstance(value, list) or (isinstance(value, np.ndarray) and value.dtype == object):
        return [_of_scipy(item) for item in np.ravel(np.array(value, dtype=object))]
    return value if isinstance(value, str) else np.asarray(value)


def _of_hdf5(item: h5py.Group | h5py.Dataset, file: h5py.File) -> Any:
    if isinstance(item, h5py.Group):
        if "MATLAB_sparse" in item.attrs:
            return _sparse(item)
        return _structures({name: _of_hdf5(child, file) for name, child in item.items()}, item)
    if item.dtype == h5py.ref_dtype:
        # MATLAB writes column by column: the order of h5py's transpose.
        return [_of_hdf5(file[reference], file) for reference in item[()].T.ravel(order="F")]
    if "MATLAB_empty" in item.attrs:
        return np.zeros((0, 0))
    if item.attrs.get("MATLAB_class") == b"char":
        return "".join(chr(code) for code in item[()].T.ravel(order="F"))
    return np.squeeze(item[()].T)


def _structures(fields: dict[str, Any], group: h5py.Group) -> Any:
    """A structure, or a list where every field holds a reference for each element of an array of structures."""
    arrays = [
        isinstance(group[name], h5py.Dataset)
        and group[name].dtype == h5py.ref_dtype
        and "MATLAB_class" not in group[name].attrs
        for name in fields
    ]
    if not fields or not all(arrays):
        return fields
    count = len(next(iter(fields.values())))
    return [{name: values[k] for name, values in fields.items()} for k in range(count)]


def _sparse(group: h5py.Group) -> Any:
    rows, start = int(group.attrs["MATLAB_sparse"]), group["jc"][()]
    values = group["data"][()] if "data" in group else np.zeros(0)
    index = group["ir"][()] if "ir" in group else np.zeros(0, dtype=int)
    return sparse.csc_matrix((values, index, start), shape=(rows, len(start) - 1)).toarray()
