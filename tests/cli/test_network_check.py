"""`rudc network check` on networks that are not shipped."""

import json

from rudc.data import data_folder
from rudc.network.network import load_network

TWO_TEES = data_folder("results") / "held-out-11" / "networks" / "5edc7c247a3b591b" / "twin_tees.net.xml"


def test_of_several_junctions_a_table_says_which_there_are(rudc, tmp_path):
    """With more than 12 there was no way to learn it."""
    text = TWO_TEES.read_text()
    names = [line.split()[0] for line in rudc("network", "check", TWO_TEES).out.splitlines()[1:]]
    lit = f'<junction id="{names[0]}" type="'
    assert text.count(f"{lit}priority") == 1
    (tmp_path / "lit.net.xml").write_text(text.replace(f"{lit}priority", f"{lit}traffic_light"))
    answer = rudc("network", "check", "lit.net.xml")
    assert answer.status == 2
    assert "several junctions" in answer.err
    assert "traffic lights" in answer.out.splitlines()[1]
    told = rudc("network", "check", "lit.net.xml", "--json")
    assert told.status == 2
    first, second = json.loads(told.out)["junctions"]
    assert [first["id"], second["id"]] == names
    assert (first["unusable"], second["unusable"]) == ("traffic lights", None)
    network = load_network(TWO_TEES, second["id"])
    assert second["arms"] == len(network.arms)
    assert [second["x_m"], second["y_m"]] == network.center.tolist()
    assert second["kind"] == network.node_type
