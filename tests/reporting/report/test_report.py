"""The report of a sweep: the numbers of `rudc table`, differences and densities as scipy has them."""

import html
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from rudc.errors import SweepError
from rudc.evaluation.columns import COLUMNS, DECISION_MS, METRICS
from rudc.evaluation.folder import read_sweep
from rudc.evaluation.tables import make_table
from rudc.reporting.report import page
from rudc.reporting.report.densities import POINTS, densities
from rudc.reporting.report.episodes import Episodes, event_counts, replay_name, which, worst
from rudc.reporting.report.page import report_page, save_report
from rudc.reporting.report.pairs import differences
from tests.reporting.browser import CHROMIUM, driven, in_node, parsed
from tests.reporting.report.made_up import made_up_sweep, row

SHOWN = (*METRICS, DECISION_MS)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return made_up_sweep(tmp_path_factory.mktemp("report") / "swept", 480, scenarios=4, agents=3)


@pytest.fixture(scope="module")
def episodes(folder):
    return Episodes.of(*read_sweep(folder))


@pytest.fixture(scope="module")
def text(folder):
    return report_page(folder, folder / "report.html")


@pytest.fixture(scope="module")
def data(text):
    return json.loads(parsed(text).data["data"])


def test_the_numbers_are_those_of_rudc_table(folder, data):
    rows, _ = read_sweep(folder)
    assert [table["by"] for table in data["tables"]] == [
        ["scenario", "agent"], ["agent"], ["agent", "priority"], ["agent", "turn"]
    ]  # fmt: skip
    for table in data["tables"]:
        lines = make_table(rows, table["by"], "markdown", metrics=SHOWN).splitlines()[2:]
        theirs = [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines]
        ours = [
            [*key, str(n), *(f"**{c}**" if k in best else c for k, c in enumerate(cells))]
            for key, n, _, cells, best in table["lines"]
        ]
        assert ours == theirs
        assert table["command"] == f"rudc table {folder} --by {','.join(table['by'])}"


def test_swept_numbers_are_in_order_of_value(tmp_path):
    swept = made_up_sweep(tmp_path / "swept", 24, scenarios=1, agents=1)
    file = swept / "episodes.csv"
    header, *lines = file.read_text().splitlines()
    values = [(20, 5, 100)[k % 3] for k in range(len(lines))]
    more = [f"{line},{value}" for line, value in zip(lines, values, strict=True)]
    file.write_text("\n".join([f"{header},traffic.density", *more, ""]))
    manifest = json.loads((swept / "manifest.json").read_text())
    for scenario in manifest["configuration"]["scenarios"].values():
        scenario["values"]["sweep"] = {"traffic.density": [20, 5, 100]}
    (swept / "manifest.json").write_text(json.dumps(manifest))
    tables = json.loads(parsed(report_page(swept, swept / "report.html")).data["data"])["tables"]
    (table,) = [table for table in tables if table["by"] == ["agent", "traffic.density"]]
    assert [key for key, *_ in table["lines"]] == [["sumo", "5"], ["sumo", "20"], ["sumo", "100"]]


def test_the_heat_map_has_the_means_of_the_table(data):
    for key, _, _, cells, _ in data["tables"][0]["lines"]:
        at = data["scenarios"].index(key[0]), data["agents"].index(key[1])
        for metric, text in zip(METRICS, cells, strict=False):
            value = data["heat"][metric.name][at[0]][at[1]]
            assert f"{value[0]:.{metric.decimals}f}" == text.split()[0]


def test_scenarios_without_a_finished_episode_are_the_last_of_the_hardest(tmp_path):
    script = (Path(page.__file__).parent / "table.js").read_text(encoding="utf-8")
    rates = [[50, 70], [None, None], [10, None], [None, None], [90, 80], [20, 40]]
    values = json.dumps([[None if rate is None else [rate, 0, 100] for rate in row] for row in rates])
    code = f"console.log(JSON.stringify([1, -1].map((sign) => hardestFirst({values}, sign))));"
    told = in_node(f"const DATA = {{ metrics: [] }};\n{script}\n{code}", tmp_path)
    assert told == [[2, 5, 0, 4, 1, 3], [4, 0, 5, 2, 1, 3]]


def test_differences_are_of_the_same_episodes(episodes, data):
    assert data["pairs"] == json.loads(json.dumps(differences(episodes)))
    (pair,) = [p for p in data["pairs"]["pairs"] if (p["a"], p["b"]) == (0, 2)]
    assert [[place, values[0][0]] for place, values in pair["lines"]] == [
        [-1, 160],
        [0, 40],
        [1, 40],
        [2, 40],
        [3, 40],
    ]
    by_agent = [[row for row in episodes.rows if row["agent"] == episodes.agents[k]] for k in (0, 2)]
    assert [row["seed"] for row in by_agent[0]] == [row["seed"] for row in by_agent[1]]
    success = [np.array([row["outcome"] == "success" for row in rows]) for rows in by_agent]
    _, a, b, change, low, high, more, less, p = pair["lines"][0][1][0]
    assert (a, b) == pytest.approx([100 * s.mean() for s in success])
    assert change == pytest.approx(b - a)
    assert low < change < high
    assert (more, less) == ((success[1] & ~success[0]).sum(), (success[0] & ~success[1]).sum())
    assert p == pytest.approx(stats.binomtest(more, more + less).pvalue, rel=2e-3)
    speed = [np.array([float(row["mean_speed_mps"]) for row in rows]) for rows in by_agent]
    theirs = stats.ttest_rel(speed[1], speed[0]).confidence_interval()
    k = data["pairs"]["metrics"].index("AES")
    assert pair["lines"][0][1][k][4:6] == pytest.approx([theirs.low, theirs.high], abs=1e-3)


def test_an_episode_that_only_one_agent_finished_is_no_pair(episodes):
    rows = [dict(row) for row in episodes.rows]
    rows[0] |= {"error": "broken", "outcome": ""}
    fewer = differences(Episodes.of(rows, ()))["pairs"]
    assert [pair["lines"][0][1][0][0] for pair in fewer] == [159, 159, 160]


def test_pairs_of_a_metric_are_those_where_both_have_a_value(episodes):
    rows = [dict(row) for row in episodes.rows]
    rows[0]["min_dtc_m"] = ""
    told = differences(Episodes.of(rows, ()))
    first = dict(zip(told["metrics"], told["pairs"][0]["lines"][0][1], strict=True))
    assert (first["SR"][0], first["min_DTC"][0], first["AES"][0]) == (160, 159, 160)


def test_densities_are_scipys(episodes):
    entry = next(e for e in densities(episodes) if e["name"] == "min_dtc_m")
    grid = np.linspace(entry["low"], entry["high"], POINTS)
    values = episodes.number("min_dtc_m")[(episodes.scenario == 1) & (episodes.agent == 2)]
    place = next(p for p in entry["places"] if p["place"] == 1)
    n, mean, *_, curve = place["agents"][2]
    assert n == len(values)
    assert mean == pytest.approx(values.mean(), rel=1e-4)
    np.testing.assert_allclose(
        np.array(curve) * place["top"] / 999, stats.gaussian_kde(values)(grid), atol=2e-3
    )


def test_a_narrow_density_is_neither_lost_between_the_points_nor_a_spike():
    gaps = {"wide": np.linspace(0.0, 10.0, 20), **{f"at {x}": x + np.arange(20) / 1e4 for x in (4.93, 5.0)}}
    blank = dict.fromkeys(COLUMNS, "")
    rows = [blank | row(agent=agent, gap=str(gap)) for agent, values in gaps.items() for gap in values]
    (entry,) = densities(Episodes.of(rows, ()))
    (place,) = entry["places"]
    step = (entry["high"] - entry["low"]) / (POINTS - 1)
    curves = [np.array(line[5]) * place["top"] / 999 for line in place["agents"]]
    assert [curve.sum() * step for curve in curves[1:]] == pytest.approx([1.0, 1.0], rel=0.01)
    assert max(curves[0]) > 0.02 * place["top"]


def test_small_numbers_have_a_wide_axis_too(episodes):
    rows = [{**row, "mean_correction": f"{k % 9}e-6"} for k, row in enumerate(episodes.rows)]
    entry = next(e for e in densities(Episodes.of(rows, ())) if e["name"] == "mean_correction")
    assert (entry["low"], entry["high"]) == (0.0, 8e-6)


def test_worst_first_and_three_of_a_kind():
    rows = [
        row(), row("frozen"), row("collision", "other", "0"), row("collision", "ego", "0"), row("off_road"),
        row(gap="0.1", agent="b"), row(agent="b"), row(outcome="", error="broken", agent="b"),
    ]  # fmt: skip
    assert worst(Episodes.of(rows, ())) == [3, 4, 2, 5, 6]
    assert which(Episodes.of(rows, ()), 2) == "fog:a:0"
    assert which(Episodes.of([r | {"k": "1"} for r in rows], ("k",)), 2) == "3"


def test_pages_of_replays_have_names_that_a_disk_takes():
    row = {"scenario": "s", "seed": "3"}
    short, one, other = (
        replay_name(Episodes.of([{**row, "agent": agent, "error": ""}], ()), 0)
        for agent in ("a+b", "x" * 300 + "1", "x" * 300 + "2")
    )
    assert re.fullmatch(r"s-a\+b-3-[0-9a-f]{12}\.html", short)
    assert one != other
    assert max(len(one), len(other)) < 240


def test_a_page_shows_the_replays_of_its_own_sweep_only(folder, episodes, tmp_path):
    i = worst(episodes)[0]
    (tmp_path / "replays").mkdir()
    (tmp_path / "replays" / replay_name(episodes, i)).touch()

    def shown(swept):
        data = json.loads(parsed(report_page(swept, tmp_path / "page.html")).data["data"])
        return [line[-1] for line in data["worst"] if line[-1]]

    anew = tmp_path / "anew"
    anew.mkdir()
    lines = (folder / "episodes.csv").read_text().splitlines()
    at = lines[0].split(",").index("decision_ms_mean")
    rows = [line.split(",") for line in lines]
    rows[1:] = [[*row[:at], "7.77", *row[at + 1 :]] for row in rows[1:]]
    (anew / "episodes.csv").write_text("".join(",".join(row) + "\n" for row in rows))
    assert shown(folder) == [replay_name(episodes, i)]
    assert shown(anew) == []


def test_agents_whose_names_differ_in_signs_alone_have_pages_of_their_own():
    row = {"scenario": "s", "seed": "3", "error": ""}
    names = {
        replay_name(Episodes.of([{**row, "agent": agent}], ()), 0) for agent in ("out/a", "out_a", "out:a")
    }
    assert len(names) == 3
    assert not any(sign in name for sign in "/:" for name in names)


def test_events_are_counted_where_rows_say_so():
    told = [
        row(events_fired="2", first_event_s="3", first_event_visible_s="4"),
        row(events_fired="1", first_event_s="5"),
        row(events_fired="0"),
        row(events_fired=""),
    ]
    (entry,) = event_counts(Episodes.of(told, ()), {"fog": ["occlusion", "hard_brake"]})
    assert entry == {"scenario": 0, "kinds": ["occlusion", "hard_brake"], "agents": [[3, 2, 1, 1, 4.0]]}
    (entry,) = event_counts(Episodes.of(told, ()), {})
    assert entry == {"scenario": 0, "kinds": [], "agents": [[3, 2, None, 1, 4.0]]}


def test_the_page_is_whole_and_refers_to_nothing_outside(text, folder):
    checker = parsed(text)
    assert [link for link in checker.links if not link.startswith("#")] == []
    assert {link[1:] for link in checker.links} <= set(checker.ids)
    assert len(set(checker.ids)) == len(checker.ids)
    assert not re.search(r"https?://(?!www\.w3\.org/2000/svg)|@import|url\(", text)
    assert "default-src 'none'" in text
    assert "480 episodes: 4 scenarios × 3 agents × 40 seeds." in text
    assert report_page(folder, folder / "report.html") == text


def test_the_commands_of_a_page_import_what_this_one_did(folder, monkeypatch):
    monkeypatch.setattr("rudc.imports._asked", {"/my files/oil.py": None, "mine.events": None})
    text = report_page(folder, folder / "report.html")
    data, begin = (
        json.loads(parsed(text).data["data"]),
        "rudc --import '/my files/oil.py' --import mine.events",
    )
    assert data["rudc"] == begin
    assert data["tables"][0]["command"].startswith(f"{begin} table {folder} --by ")
    shown = html.unescape(text)
    assert f"<code>{begin} sweep --verify DIR --share 1</code>" in shown
    assert f"<code>{begin} report {folder} --replays N</code>" in shown
    assert "`${DATA.rudc} replay ${DATA.replayed} --episode" in text


def test_the_page_grows_with_what_it_shows_not_with_the_episodes(text, tmp_path):
    more = made_up_sweep(tmp_path / "more", 1920, scenarios=4, agents=3)
    assert len(report_page(more, more / "report.html")) < 1.06 * len(text) < 400_000


def test_an_unfinished_sweep_says_so(folder, tmp_path):
    part = tmp_path / "part"
    part.mkdir()
    (part / "manifest.json").write_bytes((folder / "manifest.json").read_bytes())
    lines = (folder / "episodes.csv").read_text().splitlines(keepends=True)
    (part / "episodes.csv").write_text("".join(lines[:31]) + lines[31][:20])
    text = report_page(part, part / "report.html", live=True)
    assert "30 of 480 episodes so far, of " in text
    assert 'id="fresh"' in text
    (part / "episodes.csv").write_text(lines[0])
    with pytest.raises(SweepError, match="no finished episode yet"):
        save_report(part, part / "report.html")
    with pytest.raises(SweepError, match="is no folder"):
        save_report(tmp_path / "nowhere", part / "report.html")


def test_one_agent_one_episode_and_no_manifest(folder, tmp_path):
    lines = (folder / "episodes.csv").read_text().splitlines(keepends=True)
    (tmp_path / "episodes.csv").write_text("".join(lines[:2]))
    text = report_page(tmp_path, tmp_path / "report.html")
    assert "no manifest.json in it" in text
    assert "--replays N" not in text
    checker = parsed(text)
    assert {link[1:] for link in checker.links if link.startswith("#")} <= set(checker.ids)
    data = json.loads(checker.data["data"])
    assert data["densities"] == []
    assert data["replayed"] == "", "nothing can be driven again"
    assert data["heat"]["AES"][0][0][1:] == [None, None], "one value has no interval"
    assert "too few different values for an interval" in text


DRIVE = """
const told = {}, cells = (id) => [...document.querySelectorAll(`#${id} tbody tr`)].map((tr) => tr.children);
const pick = (id, value) => { find(id).value = value; find(id).dispatchEvent(new Event('change')); };
const rates = () => [...document.querySelectorAll('#table td[data-metric=SR]')];
const means = () => rates().map((td) => parseFloat(td.textContent));
told.lines = cells('table').length;
told.first = document.querySelector('#table td[data-metric=SR]').textContent;
document.querySelector('[data-sort=m0]').click();
told.down = means();
document.querySelector('[data-sort=m0]').click();
told.up = means();
document.querySelector('[data-sort=m0]').click();
told.unsorted = document.querySelector('#table td[data-metric=SR]').textContent === told.first;
find('filter').value = DATA.scenarios[1].toUpperCase(); find('filter').dispatchEvent(new Event('input'));
told.filtered = cells('table').length;
told.address = location.hash;
find('filter').value = ''; find('filter').dispatchEvent(new Event('input'));
pick('by', '1');
told.grouped = cells('table').length;
told.command = find('table-command').textContent;
pick('pair-a', '2'); pick('pair-b', '0'); pick('pair-metric', 'VR');
told.pair = cells('pairs-table')[0][4].textContent;
told.worse = cells('pairs-table').length;
pick('density-column', '1'); pick('density-place', '2');
told.curves = document.querySelectorAll('#density .chart .curve').length;
pick('heat-metric', 'VR'); pick('heat-order', 'hard');
told.heat = cells('heat').map((row) => row[0].textContent);
pick('worst-outcome', 'off_road');
told.worst = [...new Set(cells('worst').map((row) => row[4].textContent))];
told.commands = document.querySelector('#worst-table code').textContent;
told.ends = document.querySelectorAll('#ends .part').length;
told.events = cells('events').length;
const paper = () => getComputedStyle(document.body).backgroundColor;
const before = paper();
for (const _ of [1, 2]) { find('theme').click(); told[find('theme').textContent] = paper(); }
told.changed = new Set([told.dark, told.light]).size;
told.fits = document.documentElement.scrollWidth <= window.innerWidth;
told.width = window.innerWidth;
finish(told);
"""


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium, which pip cannot install")
@pytest.mark.parametrize("width", [1400, 400])
def test_a_browser_opens_and_drives_the_page(text, data, folder, tmp_path, width):
    told = driven(text, DRIVE, tmp_path, width)
    assert "error" not in told, told["error"]
    cells = [line[3] for line in data["tables"][0]["lines"]]
    assert (told["width"], told["fits"], told["changed"]) == (width, True, 2)
    assert (told["lines"], told["first"]) == (12, cells[0][0])
    rates = sorted((float(line[0].split()[0]) for line in cells), reverse=True)
    assert told["down"] == rates
    assert told["up"] == rates[::-1]
    assert told["unsorted"]
    assert (told["filtered"], told["grouped"]) == (3, 3)
    assert f"filter={data['scenarios'][1].upper()}" in told["address"]
    assert told["command"] == f"rudc table {folder} --by agent"
    pair = next(p for p in data["pairs"]["pairs"] if (p["a"], p["b"]) == (0, 2))
    change = -pair["lines"][0][1][data["pairs"]["metrics"].index("VR")][3]
    assert float(told["pair"].split()[0].replace("−", "-")) == pytest.approx(change, abs=0.051)
    assert (told["worse"], told["curves"]) == (5, 3)
    means = [np.mean([line[k][0] for k in range(3)]) for line in data["heat"]["VR"]]
    order = sorted(range(4), key=lambda k: -means[k])
    assert told["heat"] == [*(data["scenarios"][k] for k in order), "all"]
    assert told["worst"] == ["off the road"]
    assert told["commands"].startswith(f"rudc replay {folder} --episode ")
    assert told["ends"] == 12
    assert told["events"] == len(data["events"])
    assert not math.isnan(rates[0])


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium, which pip cannot install")
def test_the_line_of_all_scenarios_is_in_sight_however_many_there_are(tmp_path):
    many = made_up_sweep(tmp_path / "many", 480, scenarios=60, agents=2)
    script = """
    const box = document.querySelector('#rates .scroll').getBoundingClientRect();
    const all = document.querySelector('#heat .total th').getBoundingClientRect();
    const cut = document.querySelector("#rates .scroll").scrollHeight > box.height;
    finish({ cut, seen: all.bottom <= box.bottom + 1 });
    """
    told = driven(report_page(many, many / "report.html"), script, tmp_path, 1400)
    assert told == {"cut": True, "seen": True}
