"""Whether two nouns say the same."""

from dataclasses import fields, is_dataclass

import numpy as np


def assert_same(a: object, b: object, path: str = "task") -> None:
    """Every field of two dataclass instances alike, numbers to the last rounding errors."""
    assert type(a) is type(b), path
    if is_dataclass(a):
        for field in fields(a):
            if field.name != "name":  # of a wall: only words
                assert_same(getattr(a, field.name), getattr(b, field.name), f"{path}.{field.name}")
    elif isinstance(a, np.ndarray):
        np.testing.assert_allclose(a, b, atol=1e-15, err_msg=path)
    elif isinstance(a, float):
        np.testing.assert_allclose(a, b, rtol=1e-15, err_msg=path)
    elif isinstance(a, tuple) and isinstance(b, tuple):
        assert len(a) == len(b), path
        for k, (x, y) in enumerate(zip(a, b, strict=True)):
            assert_same(x, y, f"{path}[{k}]")
    else:
        assert a == b, path
