"""Which kernels compute products of matrices of single precision."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from torch.backends import mkldnn


@contextmanager
def widest_products() -> Iterator[None]:
    """In the block, oneDNN computes products on a CPU, where torch's own choice is MKL.

    oneDNN uses the widest registers that a processor of any maker has; MKL does not, and takes twice as long.
    torch calls oneDNN for numbers of single precision only where they may be rounded to bfloat16. Processors
    with matrix units for that do so; others compute in single precision all the same, and without AVX-512
    nothing changes.
    """
    with _precision("bf16"):
        yield


@contextmanager
def tiny_products() -> Iterator[None]:
    """In the block, within one of `widest_products`, torch chooses by itself again: for products with single
    vectors, oneDNN takes longer.
    """
    with _precision("none"):
        yield


@contextmanager
def _precision(name: str) -> Iterator[None]:
    matmul: Any = getattr(mkldnn, "matmul", None)  # since torch 2.9
    if matmul is None:
        yield
        return
    before, matmul.fp32_precision = matmul.fp32_precision, name
    try:
        yield
    finally:
        matmul.fp32_precision = before
