import numpy as np
import pytest
from matplotlib.figure import Figure

from rudc.network.network import load_network, shipped_networks
from rudc.world.draw import draw_network, draw_rectangles, draw_route, draw_ways, new_axes, polygon_of, save


def pixels(axes):
    """(H, W, 3) what the figure shows."""
    canvas = axes.figure.canvas
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].astype(int)


@pytest.mark.parametrize("name", sorted(shipped_networks()))
def test_asphalt_is_drawn_where_the_road_is_and_grass_where_not(name):
    network = load_network(name)
    image = pixels(draw_network(network, new_axes(4.0, 100), extent=40.0, labels=False, arrows=False))
    side = image.shape[0]
    place = (np.arange(side) + 0.5) / side * 80.0 - 40.0
    x, y = np.meshgrid(place, -place)
    distance = network.surface.signed_distance(np.stack([x, y], axis=-1) + network.center)
    grass = np.array([0xDF, 0xE6, 0xD5])
    is_grass = np.abs(image - grass).sum(axis=-1) < 12
    assert is_grass[distance < -0.6].mean() > 0.99
    assert is_grass[distance > 0.6].mean() < 0.01


def test_a_route_and_vehicles_are_drawn_over_the_road_and_saved(tmp_path):
    network = load_network("four_way")
    axes = draw_network(network, extent=40.0)
    before = pixels(axes)
    draw_route(axes, network.route("south", "left"))
    draw_ways(axes, network)
    draw_rectangles(axes, [polygon_of(1.75, -30.0, np.pi / 2, 5.0, 1.8)], "#d62728")
    assert np.abs(pixels(axes) - before).sum() > 10_000
    target = save(axes, tmp_path / "new" / "road.png")
    assert target.read_bytes().startswith(b"\x89PNG")
    assert target.stat().st_size > 20_000


def test_it_draws_on_axes_of_the_callers_own():
    axes = Figure().add_subplot()
    assert draw_network(load_network("t_junction"), axes) is axes
    assert axes.get_aspect() == 1.0
    texts = {text.get_text() for text in axes.texts}
    assert texts == {"east (major)", "west (major)", "south"}


def test_a_rectangle_has_its_corners():
    corners = polygon_of(1.0, 2.0, np.pi / 2, 4.0, 2.0)
    np.testing.assert_allclose(corners, [[0, 4], [0, 0], [2, 0], [2, 4]], atol=1e-12)
