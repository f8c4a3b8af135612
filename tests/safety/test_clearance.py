"""h and its derivatives, and the rows made of them, against automatic and symbolic differentiation."""

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
import torch

from rudc.arrays import Array
from rudc.safety.clearance import EPSILON, Bodies, clearance_terms
from rudc.safety.rows import RowWeights, affine_rows, ecbf_weights, ttcbf_weights

STATES = 10_000
WHEELBASE = 2.8
WEIGHTS = {"ttcbf": ttcbf_weights(0.1, 100.0, 0.1), "ecbf": ecbf_weights(1.5, 0.3, 0.1)}

X = "px py psi v ox oy"
PARAMETERS = "vx vy psi_o c m margin ae be ao bo"


@cache
def random_states() -> tuple[Array, Array, Array]:
    """(STATES, 6) states, (STATES, 10) parameters, (STATES, 2) inputs; 60 % vehicles, 40 % road."""
    rng, n = np.random.default_rng(7), STATES
    x = np.column_stack(
        [
            rng.uniform(-20, 20, (n, 2)),
            rng.uniform(-4, 4, n),
            rng.uniform(0, 15, n),
            rng.uniform(-20, 20, (n, 2)),
        ]
    )
    m = (rng.random(n) < 0.6).astype(float)
    parameters = np.column_stack(
        [
            rng.uniform(-15, 15, (n, 2)),
            rng.uniform(-4, 4, n),
            np.where(m > 0, 0.0, rng.uniform(-1, 1, n)),
            m,
            rng.uniform(0, 1.5, n),
            rng.uniform(2, 3, n),
            rng.uniform(0.8, 1.2, n),
            rng.uniform(0.3, 6, n),
            rng.uniform(0.3, 1.5, n),
        ]
    )
    u = np.column_stack([rng.uniform(-6, 3, n), rng.uniform(-0.68, 0.68, n)])
    return x, parameters, u


def constraint(x: Array, parameters: Array) -> Bodies:
    """One constraint as the filter has it."""
    vx, vy, psi_o, c, m, margin, ae, be, ao, bo = parameters.tolist()
    vehicle = m > 0
    return Bodies(
        position=np.array([complex(x[4], x[5])]),
        velocity=np.array([complex(vx, vy)]),
        direction=np.array([complex(math.cos(psi_o), math.sin(psi_o))]),
        offset=np.array([c]),
        mode=np.array([m]),
        margin=np.array([margin]),
        short=np.array([[be**2 + EPSILON], [bo**2 + EPSILON]]) if vehicle else np.ones((2, 1)),
        stretch=np.array([[ae**2 - be**2], [ao**2 - bo**2]]) if vehicle else np.zeros((2, 1)),
    )


@cache
def ours() -> tuple[dict[str, Array], dict[str, Array]]:
    """Terms (STATES,) by name, and rows (STATES, 3) as (A, b) by kind."""
    x, parameters, u = random_states()
    found, rows = [], {kind: np.empty((STATES, 3)) for kind in WEIGHTS}
    for i in range(STATES):
        heading = complex(math.cos(x[i, 2]), math.sin(x[i, 2]))
        terms = clearance_terms(
            complex(x[i, 0], x[i, 1]), heading, x[i, 3], WHEELBASE, constraint(x[i], parameters[i])
        )
        found.append([value[0] for value in terms[:-1]])
        for kind, weights in WEIGHTS.items():
            a, b = affine_rows(terms, weights, u[i, 0], u[i, 1])
            rows[kind][i] = a[0, 0], a[0, 1], b[0]
    return dict(zip(terms._fields[:-1], np.array(found).T, strict=True)), rows


def relative(mine: Array, reference: Array) -> float:
    """Largest error over STATES, relative to the size of what is compared."""
    mine, reference = mine.reshape(STATES, -1), reference.reshape(STATES, -1)
    size = np.maximum(np.abs(reference).max(axis=1), 1e-3)
    return float((np.abs(mine - reference).max(axis=1) / size).max())


# ---- torch


def torch_h(x: Any, parameters: Any) -> Any:
    """The paper's h, written down as in the paper."""
    px, py, psi, _, ox, oy = x.unbind(-1)
    _, _, psi_o, c, m, margin, ae, be, ao, bo = parameters.unbind(-1)
    rx, ry = px + c * torch.cos(psi) - ox, py + c * torch.sin(psi) - oy
    phi = torch.atan2(ry, rx)
    rho_e = torch.sqrt((ae * torch.cos(phi - psi)) ** 2 + (be * torch.sin(phi - psi)) ** 2 + EPSILON)
    rho_o = torch.sqrt((ao * torch.cos(phi - psi_o)) ** 2 + (bo * torch.sin(phi - psi_o)) ** 2 + EPSILON)
    return rx**2 + ry**2 - (m * (rho_e + rho_o) + margin) ** 2


def torch_flow(x: Any, u: Any, parameters: Any) -> Any:
    """dx/dt of the paper's augmented model."""
    psi, v = x[..., 2], x[..., 3]
    return torch.stack(
        [
            v * torch.cos(psi),
            v * torch.sin(psi),
            v * u[..., 1] / WHEELBASE,
            u[..., 0],
            parameters[..., 0],
            parameters[..., 1],
        ],
        dim=-1,
    )


@pytest.fixture(scope="module")
def derivatives() -> dict[str, Array]:
    """h, h' and h'' along the model with u held, and their gradients by u, by automatic differentiation."""
    x, parameters, u = (torch.tensor(part, dtype=torch.float64) for part in random_states())
    x.requires_grad_(), u.requires_grad_()

    def gradient(of: Any, by: Any) -> Any:
        return torch.autograd.grad(of.sum(), by, create_graph=True, materialize_grads=True)[0]

    def along(of: Any, u: Any) -> Any:
        return (gradient(of, x) * torch_flow(x, u, parameters)).sum(dim=-1)

    still = torch.zeros_like(u)
    h = torch_h(x, parameters)
    first, lf = along(h, u), along(h, still)
    second, lf2 = along(first, u), along(lf, still)
    units = torch.eye(2, dtype=torch.float64)
    found = {
        "h": h,
        "first": first,
        "second": second,
        "lf": lf,
        "lf2": lf2,
        "first_u": gradient(first, u),
        "second_u": gradient(second, u),
        # along g_j = flow under the unit input j, less the drift
        "lglf": torch.stack([along(lf, unit.expand_as(u)) - lf2 for unit in units], dim=-1),
    }
    return {name: value.detach().numpy() for name, value in found.items()}


def test_lie_derivatives_against_autograd(derivatives: dict[str, Array]) -> None:
    terms, _ = ours()
    assert relative(terms["h"], derivatives["h"]) < 1e-9
    assert relative(terms["lf"], derivatives["lf"]) < 1e-9
    assert relative(terms["lf2"], derivatives["lf2"]) < 1e-9
    assert relative(terms["lg"], derivatives["first_u"][:, 1]) < 1e-9
    assert np.abs(derivatives["first_u"][:, 0]).max() == 0.0, "relative degree 2 in acceleration"
    assert relative(np.column_stack([terms["lglf_a"], terms["lglf_z"]]), derivatives["lglf"]) < 1e-9


@pytest.mark.parametrize("kind", WEIGHTS)
def test_rows_against_autograd(kind: str, derivatives: dict[str, Array]) -> None:
    weights: RowWeights = WEIGHTS[kind]
    _, rows = ours()
    u = random_states()[2]
    gradient = weights.first * derivatives["first_u"] + weights.second * derivatives["second_u"]
    value = (
        weights.h * derivatives["h"]
        + weights.first * derivatives["first"]
        + weights.second * derivatives["second"]
        - weights.required
    )
    # the tangent at u of the exact condition: A u - b equals its value there, A its gradient
    reference = np.column_stack([gradient, (gradient * u).sum(axis=1) - value])
    assert relative(rows[kind], reference) < 1e-9


# ---- sympy


@pytest.fixture(scope="module")
def symbolic() -> dict[str, Array]:
    """All terms of h' and h'', derived by sympy and evaluated at the random states."""
    import sympy  # loads slowly, and is of use here only

    px, py, psi, v, ox, oy = state = sympy.symbols(X, real=True)
    parameters = sympy.symbols(PARAMETERS, real=True)
    vx, vy, psi_o, c, _, margin, ae, be, ao, bo = parameters
    drift = [v * sympy.cos(psi), v * sympy.sin(psi), 0, 0, vx, vy]
    by_a, by_z = [0, 0, 0, 1, 0, 0], [0, 0, v / WHEELBASE, 0, 0, 0]

    def along(expression: Any, flow: list[Any]) -> Any:
        return sum(sympy.diff(expression, q) * rate for q, rate in zip(state, flow, strict=True) if rate != 0)

    def radius(rx: Any, ry: Any, long: Any, short: Any, angle: Any) -> Any:
        cosine = (rx * sympy.cos(angle) + ry * sympy.sin(angle)) ** 2 / (rx**2 + ry**2)
        return sympy.sqrt(long**2 * cosine + short**2 * (1 - cosine) + EPSILON)

    def terms(h: Any) -> dict[str, Any]:
        lf, lg = along(h, drift), along(h, by_z)
        assert along(h, by_a) == 0, "relative degree 2 in acceleration"
        return {
            "h": h,
            "lf": lf,
            "lg": lg,
            "lf2": along(lf, drift),
            "lglf_a": along(lf, by_a),
            "lglf_z": along(lf, by_z),
            "lflg": along(lg, drift),
            "az": along(lg, by_a),
            "zz": along(lg, by_z),
        }

    rx, ry = px - ox, py - oy
    d = radius(rx, ry, ae, be, psi) + radius(rx, ry, ao, bo, psi_o) + margin
    vehicle = terms(rx**2 + ry**2 - d**2)
    road = terms((rx + c * sympy.cos(psi)) ** 2 + (ry + c * sympy.sin(psi)) ** 2 - margin**2)
    x, given, _ = random_states()
    is_vehicle = given[:, 4] > 0
    found = {name: np.empty(STATES) for name in vehicle}
    for expressions, chosen in ((vehicle, is_vehicle), (road, ~is_vehicle)):
        function = sympy.lambdify([*state, *parameters], list(expressions.values()), cse=True)
        for name, value in zip(found, function(*x[chosen].T, *given[chosen].T), strict=True):
            found[name][chosen] = value
    return found


def test_terms_against_sympy(symbolic: dict[str, Array]) -> None:
    terms, _ = ours()
    errors = {name: relative(terms[name], reference) for name, reference in symbolic.items()}
    assert max(errors.values()) < 1e-9, errors


@pytest.mark.parametrize("kind", WEIGHTS)
def test_rows_against_sympy(kind: str, symbolic: dict[str, Array]) -> None:
    weights: RowWeights = WEIGHTS[kind]
    a0, z0 = random_states()[2].T
    t, s1, s2 = symbolic, weights.first, weights.second
    row_a = s2 * (t["lglf_a"] + t["az"] * z0)
    row_z = s1 * t["lg"] + s2 * (t["lglf_z"] + t["lflg"] + t["az"] * a0 + 2 * t["zz"] * z0)
    free = weights.h * t["h"] + s1 * t["lf"] + s2 * (t["lf2"] - t["az"] * a0 * z0 - t["zz"] * z0**2)
    reference = np.column_stack([row_a, row_z, weights.required - free])
    assert relative(ours()[1][kind], reference) < 1e-9
