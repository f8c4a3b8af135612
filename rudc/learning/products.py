"""How products of matrices are computed: by which kernels, and how precisely."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import torch
from torch.backends import mkldnn

from rudc.learning.config import Precision


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


def products_in(precision: Precision, device: str) -> torch.autocast:
    """In the block, networks' products on `device` are of that precision. `bfloat16` rounds what goes into
    them and comes out to 8 bits, and sums in single precision; weights, losses and optimisers stay single.
    """
    kind = torch.device(device).type
    return torch.autocast(kind, dtype=torch.bfloat16, enabled=precision == "bfloat16")


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
