"""Values as tables, lists and numbers of JSON, for all files of that format."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np


def plain(value: Any) -> Any:
    """Return a value without arrays and numbers of numpy, and None for numbers that are not finite.

    JSON has no such numbers.

    Parameters
    ----------
    value : object
        Number, text, None, array, or mappings and sequences of these.

    Returns
    -------
    object
        Dictionaries, lists, numbers and texts.
    """
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
