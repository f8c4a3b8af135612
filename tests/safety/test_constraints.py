"""From scene to constraints: ellipses, the gate, road-edge points."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rudc.geometry import rectangle_gaps
from rudc.network.network import load_network
from rudc.safety.barrier_kernels import on_edges
from rudc.safety.constraints import ConstraintBuilder, Constraints
from rudc.safety.filter import FilterConfig, SafetyFilter
from rudc.safety.road_points import RoadPoints
from rudc.safety.vehicles import VehicleSettings
from rudc.vehicle import EgoVehicle
from rudc.world.scene import Scene
from tests.safety.scenes import Other, make_scene, straight_road

ALL = ConstraintBuilder(FilterConfig(constrained="all"))
GATED = ConstraintBuilder(FilterConfig())


def vehicles(scene: Scene, builder: ConstraintBuilder = GATED) -> set[str]:
    constraints = builder.build(scene)
    return {name.removeprefix("veh:") for name in constraints.names[constraints.parts[0].rows]}


def test_ellipses_and_margins() -> None:
    scene = make_scene([Other(20.0, 3.0, 0.5, 4.0, length=10.0, width=2.4)])
    found = ALL.build(scene)
    assert found.names[0] == "veh:sv0"
    assert found.count == 7
    assert found.parts[0].rows == slice(0, 1)
    assert found.bodies.position[0] == 20 + 3j
    assert found.bodies.velocity[0] == pytest.approx(4.0 * np.exp(0.5j))
    assert found.bodies.direction[0] == pytest.approx(np.exp(0.5j))
    assert found.bodies.short[:, 0] == pytest.approx([1.0, 1.3**2], abs=2e-6)
    assert found.bodies.short[:, 0] + found.bodies.stretch[:, 0] == pytest.approx([2.5**2, 5.0**2], abs=2e-6)
    assert found.bodies.margin == pytest.approx([0.5] + [0.9 + 0.2] * 6)
    assert found.mode.tolist() == [1, 0, 0, 0, 0, 0, 0]


CAR, BUS, SMALL, WIDE = (
    EgoVehicle(),
    EgoVehicle(length=12.0, width=2.55, wheelbase=6.0, cg_to_rear=3.0, delta_max=0.7),
    EgoVehicle(length=3.6, width=1.5, wheelbase=2.2, cg_to_rear=1.1),
    EgoVehicle(length=8.0, width=3.2, wheelbase=5.0, cg_to_rear=2.0),
)


@pytest.mark.parametrize("vehicle", [CAR, BUS, SMALL, WIDE])
@pytest.mark.parametrize("size", [(5.0, 1.8), (12.0, 2.5), (2.0, 0.8), (0.5, 0.5)])
def test_h_is_negative_where_bodies_overlap_whatever_vehicle_the_ego_is(vehicle, size) -> None:
    """The ego's ellipse was that of a car of 5 m; h was 24 m2 while a bus stood over half of another car.
    Ellipses leave corners out, so bodies of 0.7 times the size are looked at."""
    rng, met = np.random.default_rng(0), 0
    reach = 0.5 * (vehicle.length + size[0])
    for x, y, heading in zip(*rng.uniform(-reach, reach, (2, 60)), rng.uniform(-3.1, 3.1, 60), strict=True):
        scene = make_scene([Other(x, y, heading, 3.0, *size)], vehicle=vehicle)
        gap = rectangle_gaps(
            0.0, 0.0, 0.0, 0.7 * vehicle.length, 0.7 * vehicle.width,
            scene.position, scene.heading, 0.7 * scene.size,
        )  # fmt: skip
        if gap[0] <= 0.0:
            met += 1
            assert SafetyFilter(FilterConfig(constrained="all")).filter(scene, np.zeros(2)).h[0] < 0.0
    assert met >= 4


@pytest.mark.parametrize(("v", "behind"), [(4.0, 10.0), (8.0, 14.0), (6.0, 14.0), (4.0, 14.0), (8.0, 10.0)])
def test_the_gate_knows_how_long_the_ego_is(v: float, behind: float) -> None:
    """A car that would drive into the rear third of a bus was not constrained."""
    crossing = Other(0.0, -behind, math.pi / 2, 6.0, row=0, s=100.0 - behind)
    least = min(
        rectangle_gaps(
            -2.0 + v * t, 0.0, 0.0, BUS.length, BUS.width, np.array([[0.0, 6.0 * t - behind]]),
            np.array([math.pi / 2]), np.array([[5.0, 1.8]]),
        )[0]
        for t in np.arange(0.0, 3.0, 0.05)
    )  # fmt: skip
    there = vehicles(make_scene([crossing], x=-2.0, v=v, vehicle=BUS))
    assert there == ({"sv0"} if least <= 0.0 else set())


def test_an_ellipse_that_is_set_is_that_of_any_vehicle() -> None:
    given = VehicleSettings(half_length=4.0, half_width=1.5)
    assert given.axes(CAR) == given.axes(BUS) == (4.0, 1.5)
    assert VehicleSettings().axes(CAR) == (2.5, 1.0)
    assert VehicleSettings(width_margin=0.3).axes(BUS) == (6.0, pytest.approx(1.575))


def test_the_nearest_twelve() -> None:
    scene = make_scene([Other(10.0 + 3 * i, 0.0) for i in range(20)])
    assert vehicles(scene, ALL) == {f"sv{i}" for i in range(12)}
    assert vehicles(scene) < vehicles(scene, ALL), "the gate looks 3 s ahead, not 43 m"
    few = ConstraintBuilder(FilterConfig(constrained="all", max_vehicles=2))
    assert vehicles(scene, few) == {"sv0", "sv1"}


class TestGate:
    """The ego drives east along y = 0 at 8 m/s."""

    def test_oncoming_in_its_own_lane_is_no_threat(self) -> None:
        on_path = Other(30.0, 3.5, math.pi, 8.0, row=1, s=70.0)
        straight = Other(30.0, 3.5, math.pi, 8.0)
        assert vehicles(make_scene([on_path])) == set()
        assert vehicles(make_scene([straight])) == set()

    @pytest.mark.parametrize(
        ("beside", "width", "row", "threat"),
        [
            (2.8, 1.8, 1, False),
            (2.5, 1.8, 1, True),
            (3.2, 2.5, 1, False),
            (3.0, 2.6, 1, True),
            (2.8, 1.8, -1, True),
        ],
    )
    def test_oncoming_on_a_narrow_road_is_one_only_if_it_passes_closely(
        self, beside: float, width: float, row: int, threat: bool
    ) -> None:
        """On lanes of 2.8 m the ego stopped for each car that came on the lane beside."""
        coming = Other(20.0, beside, math.pi, 8.0, row=row, s=80.0, width=width)
        assert vehicles(make_scene([coming])) == ({"sv0"} if threat else set())

    def test_crossing_is_a_threat_if_both_arrive_together(self) -> None:
        def north(s: float) -> Other:
            return Other(0.0, s - 100.0, math.pi / 2, 8.0, row=0, s=s)

        assert vehicles(make_scene([north(84.0)], x=-16.0)) == {"sv0"}
        assert vehicles(make_scene([north(70.0)], x=-10.0)) == set(), "the ego is gone before"
        assert vehicles(make_scene([north(84.0)], x=-16.0, v=0.0)) == set(), "the ego stands"

    def test_who_turns_off_before_is_no_threat(self) -> None:
        """Southwards towards the ego's lane; its path turns west 6 m before."""
        turning = Other(-1.75, 15.0, -math.pi / 2, 8.0, row=2, s=85.0)
        straight = Other(-1.75, 15.0, -math.pi / 2, 8.0)
        scene = make_scene([turning], x=-14.0)
        assert vehicles(scene) == set()
        assert vehicles(make_scene([straight], x=-14.0)) == {"sv0"}

    def test_leader_and_obstacle_are_threats(self) -> None:
        assert vehicles(make_scene([Other(20.0, 0.0, 0.0, 2.0)])) == {"sv0"}
        assert vehicles(make_scene([Other(20.0, 1.0, 1.0, 0.0, 1.0, 1.0)])) == {"sv0"}
        assert vehicles(make_scene([Other(20.0, 0.0, 0.0, 9.0)])) == set(), "it drives away"
        assert vehicles(make_scene([Other(45.0, 0.0)])) == set(), "more than 3 s away"

    def test_who_follows_is_no_threat(self) -> None:
        behind = Other(-12.0, 0.4, 0.05, 12.0)
        assert vehicles(make_scene([behind])) == set()
        assert vehicles(make_scene([behind]), ALL) == {"sv0"}
        assert vehicles(make_scene([Other(-12.0, 0.4, 1.2, 12.0)])) == set(), "passes behind"
        cutting_in = Other(-6.0, -3.2, 0.25, 11.0)
        assert vehicles(make_scene([cutting_in])) == {"sv0"}, "beside the lane: it does not follow"

    def test_who_is_close_now_is_a_threat(self) -> None:
        assert vehicles(make_scene([Other(0.0, 2.5, 0.0, 0.5)], v=0.0)) == {"sv0"}

    def test_who_stands_is_one_only_if_its_rectangle_is_in_the_way(self) -> None:
        assert not vehicles(make_scene([Other(6.0, 2.0, 0.0, 0.0)], v=3.0))
        assert vehicles(make_scene([Other(6.0, 1.9, 0.0, 0.0)], v=3.0)) == {"sv0"}

    @given(st.floats(-30, 30), st.floats(-30, 30), st.floats(-3, 3), st.floats(0, 10))
    def test_gated_is_part_of_all(self, x: float, y: float, heading: float, speed: float) -> None:
        scene = make_scene([Other(x, y, heading, speed), Other(25.0, 0.0)])
        assert vehicles(scene) <= vehicles(scene, ALL)


def feet(scene: Scene, builder: ConstraintBuilder = ALL) -> Constraints:
    found = builder.build(scene)
    assert not found.parts[0].found.names
    return found


@given(st.floats(-80, 80), st.floats(-5, 5), st.floats(-3.2, 3.2), st.floats(0, 12))
def test_road_points_of_a_straight_road(x: float, y: float, psi: float, v: float) -> None:
    scene = make_scene(x=x, y=y, psi=psi, v=v)
    found = feet(scene)
    third = 2.8 / 3
    offsets = [0.0, third - 1.4, 2 * third - 1.4]
    assert found.bodies.offset == pytest.approx(offsets * 2)
    points = complex(x, y) + np.array(offsets * 2) * np.exp(1j * psi)
    expected = points.real + 1j * np.repeat([7.0, -7.0], 3)
    # where two pieces of the edge meet, their distances are the same to rounding within sqrt(2^-52) * 7 m
    assert found.bodies.position == pytest.approx(expected, abs=2e-7)
    # the projection moves along the edge as fast as the point moves along it
    assert found.bodies.velocity == pytest.approx(v * math.cos(psi), abs=1e-6)
    fixed = feet(scene, ConstraintBuilder(FilterConfig(road_points="fixed")))
    assert not fixed.bodies.velocity.any()
    assert fixed.bodies.position == pytest.approx(found.bodies.position)


def test_sliding_keeps_square() -> None:
    away = np.array([1 + 2j, -3j, 2.0])
    place, velocity, direction = np.empty((3, 3), dtype=np.complex128)
    offset, margin = np.empty((2, 3))
    on_edges(away, np.zeros(3), 1j, 1 + 0j, 5 + 1j, 1.2, place, velocity, direction, offset, margin)
    assert place == pytest.approx(1j - away)
    relative = (5 + 1j) - velocity
    assert np.abs((relative * away.conj()).imag).max() < 1e-12, "what is left is along r"
    assert np.abs((velocity * away.conj()).real).max() < 1e-12, "the projection moves square to r"


def test_no_road() -> None:
    assert ConstraintBuilder(FilterConfig(road=False)).build(make_scene()).count == 0


def test_the_builder_follows_a_change_of_route() -> None:
    builder = ConstraintBuilder(FilterConfig(constrained="all"))
    assert builder.build(make_scene()).bodies.position[0].imag == pytest.approx(7.0)
    narrow = make_scene(route=straight_road(half_width=4.0))
    assert builder.build(narrow).bodies.position[0].imag == pytest.approx(4.0)


@pytest.mark.parametrize("name", ["four_way", "t_junction", "roundabout", "skewed_four_way"])
def test_road_points_on_real_routes(name: str) -> None:
    """On its path the ego is clear of both edges all along, and projections are the nearest points."""
    network = load_network(name)
    for movement in network.movements:
        route = network.route(movement.origin, movement.destination)
        points = RoadPoints(route, EgoVehicle())
        edges = [edge[:, 0] + 1j * edge[:, 1] for edge in (route.left_edge, route.right_edge)]
        for s in np.arange(5.0, route.length - 5.0, 4.0):
            x, y, psi = (float(value) for value in route.path.pose(s))
            away = points.away(complex(x, y), complex(math.cos(psi), math.sin(psi)), s)
            assert np.abs(away).min() > 1.1, f"{movement.origin} {movement.turn} at {s} m"
            for side, edge in enumerate(edges):
                beside = slice(max(int(2 * s) - 14, 0), int(2 * s) + 15)
                corners = np.abs(edge[beside] - complex(x, y))
                assert abs(away[3 * side]) <= corners.min() + 1e-9
