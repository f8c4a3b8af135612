"""A network file that contradicts itself is refused in words, before SUMO sees it."""

import re
import warnings

import pytest

from rudc.errors import NetworkError
from rudc.network.network import load_network, shipped_networks


def read(tmp_path, pattern, replacement):
    """Read four_way with the first match of a pattern replaced."""
    text = shipped_networks()["four_way"].read_text(encoding="utf-8")
    text, count = re.subn(pattern, replacement, text, count=1)
    assert count == 1
    path = tmp_path / "own.net.xml"
    path.write_text(text, encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        load_network(path).route("south", "west")


@pytest.mark.parametrize(
    ("pattern", "replacement", "told"),
    [
        (r' *<connection from="south_in".*\n', "", "states right of way for 16 ways through it, and has 15"),
        (r' *<request index="15".*\n', "", "states right of way for 15 ways through it, and has 16"),
        (r'<request index="3"', '<request index="33"', "not numbered from 0 to 15"),
        (r'response="\d+"', 'response="01"', "does not say 0 or 1 for each of its 16 ways"),
        (r'shape="[-0-9.]+,', 'shape="nan,', "lies nowhere"),
        (r'shape="[-0-9.]+,', 'shape="1e300,', "lies nowhere"),
        (r'length="120.00"', 'length="inf"', "a length of inf m"),
        (r'(<lane id="west_in_0".*)width="3.50"', r'\1width="-3.5"', "a width of -3.5 m"),
        (r'(<lane id="west_in_0".*)speed="10.00"', r'\1speed="nan"', "a speed of nan m/s"),
        (r'(via=":centre_4_0" dir="r")', r'via=":centre_nowhere_0" dir="r"', "cannot be made out"),
        (r'x="0.00" y="0.00"', 'x="" y="0.00"', "not a SUMO network"),
    ],
)
def test_a_contradiction_is_a_network_error(tmp_path, pattern, replacement, told):
    with pytest.raises(NetworkError, match=told) as caught:
        read(tmp_path, pattern, replacement)
    assert "own.net.xml" in str(caught.value)
