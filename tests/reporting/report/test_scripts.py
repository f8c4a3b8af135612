"""Scripts of a report's page, in node."""

from pathlib import Path

from rudc.reporting.report import page
from tests.reporting.browser import in_node

FOLDER = Path(page.__file__).parent
VISITS = """
const listeners = {}, PARTS = ['pairs', 'worst'];
const window = { addEventListener: (name, act) => { listeners[name] = act; } };
const document = { addEventListener() {} };
const find = (name) => (PARTS.includes(name) ? {} : null);
const location = { hash: 'HASH' };
const history = { replaceState: (_, __, address) => { location.hash = address; } };
"""


def test_links_to_parts_of_the_page_leave_the_choices_in_its_address(tmp_path):
    script = (FOLDER / "state.js").read_text(encoding="utf-8")
    visit = """
    const go = (hash) => { location.hash = hash; listeners.hashchange?.(); return location.hash; };
    const told = [state];
    choose('by', 1);
    told.push(go('#pairs'), go('#worst'), go('#by=2&pm=VR'));
    console.log(JSON.stringify(told));
    """
    told = in_node(VISITS.replace("HASH", "#pm=SR") + script + visit, tmp_path)
    assert told == [{"pm": "SR", "by": "1"}, "#pm=SR&by=1", "#pm=SR&by=1", "#by=2&pm=VR"]
    told = in_node(VISITS.replace("HASH", "#pairs") + script + visit, tmp_path)
    assert told == [{"by": "1"}, "#by=1", "#by=1", "#by=2&pm=VR"]
