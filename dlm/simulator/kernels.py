"""How the simulator's functions are compiled.

Numba counts references to every array that a call passes, also to those inside tuples.  A step of a microsecond passes
hundreds: counting takes longer than the arithmetic, and compiling it takes minutes.  So the functions of the inner loop only
borrow their arrays, and count nothing.
"""

from functools import partial
from typing import Any

from numba import njit

_kernel: Any = partial(njit, cache=True, error_model="numpy", no_cfunc_wrapper=True)

compiled: Any = partial(_kernel, _nrt=True, forceinline=False)
"""For functions that make arrays, or return some."""
borrowing: Any = partial(_kernel, _nrt=False, forceinline=False)
"""For functions that work on their callers' arrays: they make none, and return none, nor tuples with arrays."""
inlined: Any = partial(_kernel, _nrt=False, forceinline=True, no_cpython_wrapper=True)
"""The same, as a part of the machine code of whoever calls: a call hands over every array of every tuple, one by one.

Python cannot call them."""
