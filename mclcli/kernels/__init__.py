"""The compiled inner loops: arrays in, arrays out, no random numbers, no objects, nothing of ours imported.

They allocate nothing and return nothing: results and scratch space are arrays from outside. So their machine code runs
without the compiler (``mclcli.native.machine_code``). Get a module's kernels with
``mclcli.native.backend.load``; a name that begins with an underscore is inlined into others.
"""

from __future__ import annotations

from typing import Any

OPTIONS: Any = {"nogil": True, "error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
