"""Columns of lists, as Arrow, pandas and polars have them, as arrays."""

from typing import Any

import numpy as np
from numpy.typing import NDArray


def dense(given: Any) -> NDArray[Any] | None:
    """Lists of one length as an array with a row each; None for anything else.

    Parameters
    ----------
    given
        A list array of Arrow, or a column of lists of pandas or polars.
    """
    combine = getattr(given, "combine_chunks", None)
    if combine is not None:
        given = combine()
    if hasattr(given, "flatten") and hasattr(getattr(given, "type", None), "value_type"):
        return _of_arrow(given)
    if not hasattr(given, "to_list"):
        return None
    rows = given.to_list()
    try:
        array = np.array(rows)
    except ValueError:
        return None
    return array if array.ndim == 2 and array.dtype.kind in "iuf" else None


def _of_arrow(lists: Any) -> NDArray[Any] | None:
    count = len(lists)
    flat = lists.flatten()
    width = getattr(lists.type, "list_size", None)
    if width is None:
        lengths = np.asarray(lists.value_lengths())
        if count == 0 or lengths.dtype.kind not in "iu" or (lengths != lengths[0]).any():
            return None
        width = int(lengths[0])
    numbers = flat.to_numpy(zero_copy_only=False)
    return numbers.reshape(count, width) if numbers.size == count * width else None
