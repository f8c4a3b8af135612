"""Scenes made by hand, as the tests of the environment have them."""

from tests.env.conftest import make_scene, network

__all__ = ["make_scene", "network"]
