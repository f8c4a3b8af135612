"""What the server of worker processes imports before they start (see starting.py)."""

from __future__ import annotations

import contextlib
import gc
from importlib import import_module

gc.disable()  # imports make no garbage, and looking for it would take a tenth of their time
with contextlib.suppress(Exception):  # a worker that needs what cannot be imported says so itself
    for _module in ("rudc.evaluation.runner", "rudc.evaluation.sweep", "rudc.evaluation.compiled"):
        import_module(_module)
    import_module("rudc.evaluation.compiled").compile_kernels()
    import_module("rudc.evaluation.code").code_digest()  # a worker then reads what was written since
gc.freeze()  # workers need not look through it, nor copy its pages
gc.enable()
