"""`Adam`: torch's, without what it does for torch.compile only.

torch's methods import torch._dynamo, and sympy with it, when they are first called: more than a second in
each process that trains, and nothing here is compiled. Steps are the same to the last bit.
"""

from __future__ import annotations

import inspect

import torch

_Adam = torch.optim.Adam


class Adam(_Adam):
    """torch.optim.Adam, as its methods are written."""

    step = torch.no_grad()(inspect.unwrap(_Adam.step))
    zero_grad = inspect.unwrap(_Adam.zero_grad)
    state_dict = inspect.unwrap(_Adam.state_dict)
    load_state_dict = inspect.unwrap(_Adam.load_state_dict)
    add_param_group = inspect.unwrap(_Adam.add_param_group)
