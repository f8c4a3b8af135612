"""A network over which SUMO would crash is found out in a child process; this process goes on."""

import shutil

import pytest

from rudc.errors import NetworkError
from rudc.network.network import load_network, shipped_networks
from rudc.world import trial
from rudc.world.trial import refuse_untried
from rudc.world.world import World


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    trial._try_once.cache_clear()
    return tmp_path / "cache"


def without(tmp_path, words, instead=""):
    """four_way without some words of its file."""
    text = shipped_networks()["four_way"].read_text(encoding="utf-8")
    assert text.count(words) == 1
    path = tmp_path / "own.net.xml"
    path.write_text(text.replace(words, instead), encoding="utf-8")
    return load_network(path)


def test_a_network_over_which_sumo_crashes_is_refused(tmp_path):
    link = '    <connection from=":centre_13" to="east_out" fromLane="1" toLane="1" dir="s" state="M"/>\n'
    network = without(tmp_path, link)
    with pytest.raises(NetworkError, match=r"own\.net\.xml: SUMO crashes over this network \(signal 11"):
        World(network)


def test_a_network_that_sumo_refuses_is_refused_in_its_words(tmp_path):
    link = '    <connection from=":centre_4" to="north_out" fromLane="0" toLane="0" dir="r" state="M"/>\n'
    with pytest.raises(NetworkError, match="':centre_4' is not properly connected"):
        refuse_untried(without(tmp_path, link))


def test_what_sumo_says_on_stderr_alone_is_said(tmp_path):
    network = without(tmp_path, 'incLanes="east_out_0 east_out_1"', 'incLanes="east_out_"')
    with pytest.raises(NetworkError, match=r"SUMO could not begin: .* \(Error: .*east"):
        refuse_untried(network)


def test_what_has_passed_is_remembered_by_its_content(tmp_path, cache, monkeypatch):
    shutil.copy(shipped_networks()["four_way"], tmp_path / "one.net.xml")
    refuse_untried(load_network(tmp_path / "one.net.xml"))
    assert len(list(cache.rglob("*"))) == 3  # two folders and a mark
    trial._try_once.cache_clear()
    monkeypatch.setattr(trial, "_try_out", lambda *_: pytest.fail("tried again"))
    refuse_untried(load_network(tmp_path / "one.net.xml"))
    refuse_untried(load_network("four_way"))  # shipped
    with (tmp_path / "one.net.xml").open("a") as file:
        file.write("<!-- changed -->\n")
    with pytest.raises(pytest.fail.Exception, match="tried again"):
        refuse_untried(load_network(tmp_path / "one.net.xml"))
