"""Scripts of a report's page, in node."""

import json
from pathlib import Path

from rudc.evaluation.columns import METRICS
from rudc.evaluation.tables import heading
from rudc.evaluation.text import rate_decimals
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


def test_a_difference_has_the_unit_of_its_metric_if_any(tmp_path):
    metrics = [
        {"name": m.name, "heading": heading(m), "is_rate": bool(m.outcomes), "decimals": m.decimals}
        for m in METRICS
    ]
    values = [[5, 1, 2, 1, 0, 2, 1, 0, 1]] * len(metrics)
    pairs = {"metrics": [m.name for m in METRICS], "pairs": [{"a": 0, "b": 1, "lines": [[-1, values]]}]}
    data = {"agents": ["a", "b"], "scenarios": ["s"], "metrics": metrics, "pairs": pairs}
    before = """
    const element = (_, __, ...children) => children.flat(), shape = element, signed = String;
    const decimalsOf = () => 1;
    const holder = { replaceChildren: (_, head) => told.push(head.flat(3)[4]) }, told = [];
    const find = () => holder, chosen = (id) => ({ 'pair-a': 0, 'pair-b': 1, 'pair-metric': asked })[id];
    let asked;
    """
    code = """
    for (asked of DATA.pairs.metrics) drawPairs();
    console.log(JSON.stringify(told));
    """
    script = (FOLDER / "compare.js").read_text(encoding="utf-8")
    told = in_node(f"const DATA = {json.dumps(data)};{before}{script}{code}", tmp_path)
    assert dict(zip(data["pairs"]["metrics"], told, strict=True)) == {
        "SR": "difference (points)", "FR": "difference (points)", "RC": "difference (%)",
        "AES": "difference (m/s)", "AER": "difference", "VR": "difference (points)",
        "min_DTC": "difference (m)",
    }  # fmt: skip


def test_a_rate_looks_like_0_or_100_only_where_it_is(tmp_path):
    script = (FOLDER / "charts.js").read_text(encoding="utf-8")
    rates = [0, 0.04, -0.04, 0.003, 5, 99.96, 100]
    before = "const find = () => ({ textContent: '{}' });"
    code = f"""
    const of = (is_rate) => {rates}.map((rate) => decimalsOf({{ is_rate, decimals: 1 }}, rate));
    console.log(JSON.stringify([of(true), of(false)]));
    """
    told = in_node(before + script + code, tmp_path)
    assert told == [[rate_decimals(rate) for rate in rates], [1] * len(rates)]
