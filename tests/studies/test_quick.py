"""Every study runs to its end by one command at the quick budget: tables, and figures as PNG and PDF; what is
found in them, and that the same order with --resume finds it again.

What trains, trains little here: `comparison` one row, `ablation` none, since it takes one made before. From
training to tables with several rows: test_comparison.py. `sigma` and `residual` are resumed in files of their
own. `sensitivity-beta` is `sensitivity-ensemble` with another setting: test_sensitivity.py. Episodes are cut
short, but for studies that look at how they end.
"""

import shutil
from functools import partial
from pathlib import Path

import pytest
from PIL import Image

from rudc.agents.registry import make_agent
from rudc.cli.main import main
from rudc.evaluation.store import read_table
from rudc.scenario import find_scenarios
from rudc.studies import (
    ablation_case,
    base,
    cbf_grid,
    filter_study,
    filter_variants,
    latency,
    ood_case,
    residual_study,
    sensitivity,
)
from rudc.studies.campaign import Effort
from rudc.studies.catalogue import STUDIES
from tests.studies.test_trained import TINIER

LESS = {
    "training.steps": 200, "training.seed_steps": 100, "training.learning_starts": 128, "training.envs": 1,
    "training.evaluation_episodes": 1, "training.evaluate_on": ("random_destination",),
    "training.calibration_episodes": 1, "learner.batch_size": 32,
}  # fmt: skip
"""what `comparison` trains with besides the quick budget's settings"""
FEW = ("-n", 1)
"""episodes, fewer than the quick budget's"""
COMMANDS = {
    "filter": (*FEW, "-a", "TRAINED"),
    "sigma": FEW,
    "comparison": (*FEW, "-a", "sac"),
    "ablation": (*FEW, "-a", "rudc-t-wo-course", "-a", "rudc-t", "--trainings", "made"),
    "curves": ("CHECKPOINT",),
    "latency": (*FEW, "-a", "rudc-t", "-a", "gap-acceptance+ttcbf"),
    "ood-case": (*FEW, "-a", "rudc-t", "-a", "gap-acceptance"),
    "ablation-case": FEW,
    "residual": (),
    "sensitivity-ensemble": FEW,
    "cbf-grid": FEW,
}
WHOLE = ("sigma", "ablation-case")
"""studies whose episodes end as they do"""
RESUMED = {"filter": None, "latency": None, "ood-case": 2, "sensitivity-ensemble": 4}
"""study -> the line of its page that comes out the same, None for all: the others have times in them"""


def test_all_are_here():
    assert set(COMMANDS) | {"sensitivity-beta"} == set(STUDIES)


def test_who_drives_when_nobody_is_named_is_there():
    for study in (latency.AGENTS, cbf_grid.DRIVERS):
        for name in {name for names in study.values() for name in names}:
            make_agent(name)
    for study in (ood_case.DRIVERS, ablation_case.DRIVERS):
        for driver in {driver for drivers in study.values() for driver in drivers}:
            make_agent(driver.agent)


@pytest.fixture
def few(monkeypatch):
    """Smaller trainings, fewer samples and variants."""
    whole = Effort.settings.fget
    assert whole is not None
    monkeypatch.setattr(Effort, "settings", property(lambda effort: {**whole(effort), **LESS}))
    monkeypatch.setattr(sensitivity, "TRAINING", {"quick": TINIER})
    monkeypatch.setattr(sensitivity, "ASKED", 5)
    monkeypatch.setattr(residual_study, "SAMPLES", {"quick": 300})
    monkeypatch.setattr(filter_variants, "LEVELS", (1.0,))
    monkeypatch.setattr(filter_variants, "RATES", (0.5,))
    monkeypatch.setattr(filter_study, "D_SAFE", {"quick": (0.5,)})
    monkeypatch.setattr("rudc.evaluation.manifest.code_version", lambda: "v0")


def filtered(out: Path) -> None:
    lines = read_table(out / "filter.csv")
    assert len([m for m in lines if m["scenario"] == "all"]) == 2 * (2 * 8 + 1)  # gated and all; the oracle


def timed(out: Path) -> None:
    whole = [line for line in read_table(out / "latency.csv") if line["scenario"] == "both"]
    lines = {line["part"]: line for line in whole if line["agent"] == "rudc-t"}
    parts = [line for part, line in lines.items() if part in latency.PARTS]
    assert sum(float(line["share_percent"]) for line in parts) == pytest.approx(100.0, abs=0.01)
    assert {"observation", "policy", "critics", "constraints", "rest"} <= set(lines)
    assert float(lines["all"]["mean_ms"]) < float(lines["all"]["peak_ms"])


def shown(out: Path) -> None:
    lines = read_table(out / "ood_case.csv")
    assert {line["agent"] for line in lines} == {"rudc-t", "gap-acceptance"}
    assert "Shown is seed 0" in (out / "ood_case.md").read_text(encoding="utf-8")
    with Image.open(out / "ood_case.png") as picture:
        assert picture.size[1] > 900


def counted(out: Path) -> None:
    lines = read_table(out / "ablation_case_agents.csv")
    assert [line["episodes"] for line in lines] == ["1", "1"]
    assert int(lines[0]["decisions"]) > 20
    assert "Shown is seed 0" in (out / "ablation_case.md").read_text(encoding="utf-8")
    with Image.open(out / "ablation_case.png") as picture:
        assert picture.size[1] > 900


def swept(out: Path) -> None:
    lines = [m for m in read_table(out / "sensitivity_ensemble.csv") if m["scenario"] == "both tasks"]
    assert [m["members"] for m in lines] == ["3", "5"]
    assert int(lines[0]["weights"]) < int(lines[1]["weights"])
    assert "both tasks" in (out / "sensitivity_ensemble.md").read_text(encoding="utf-8")


def gridded(out: Path) -> None:
    assert len(read_table(out / "cbf_grid.csv")) == 2 + 3
    assert "paper's" in (out / "cbf_grid.md").read_text(encoding="utf-8")


FOUND = {
    "filter": filtered,
    "latency": timed,
    "ood-case": shown,
    "ablation-case": counted,
    "sensitivity-ensemble": swept,
    "cbf-grid": gridded,
}
"""what else a study's files say"""


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_a_study_runs_by_one_command(name, tmp_path, monkeypatch, capsys, few, trained):
    from rudc.agents.checkpoint import shipped_checkpoints

    monkeypatch.chdir(tmp_path)
    if name not in WHOLE:
        short = partial(find_scenarios, overrides={"episode.timeout": 2})
        for module in (base, latency, ood_case):
            monkeypatch.setattr(module, "find_scenarios", short)
    if name == "filter":
        monkeypatch.setattr(base, "IN_DISTRIBUTION", ("random_destination",))
        monkeypatch.setattr(base, "QUICK_OOD", ("ignored_priority",))
    if name in ("cbf-grid", "sensitivity-ensemble"):
        monkeypatch.setattr(base, "IN_DISTRIBUTION", ("dense_left_turn",))
    if name == "ablation":
        shutil.copytree(shipped_checkpoints()["rudc-t"], tmp_path / "made" / "rudc-t-seed0")
    places = {"CHECKPOINT": shipped_checkpoints()["rudc-t"], "TRAINED": trained}
    given = [places.get(part, part) for part in COMMANDS[name]]
    wanted = {"budget": ("--budget", "quick"), "workers": ("--workers", 1)}
    given += [part for what, option in wanted.items() if what in STUDIES[name].takes for part in option]

    def call(*more):
        words = ["rudc", "study", name, *given, "--out", "out", *more]
        monkeypatch.setattr("sys.argv", [str(word) for word in words])
        with pytest.raises(SystemExit) as ended:
            main()
        return ended.value.code or 0, capsys.readouterr()

    status, said = call()
    assert not status, said.err
    out = tmp_path / "out"
    tables, figures = sorted(out.glob("*.csv")), sorted(out.glob("*.png"))
    assert tables
    assert figures
    for table in tables:
        assert read_table(table), table.name
    for figure in figures:
        with Image.open(figure) as picture:
            assert min(picture.size) > 300
            assert max(picture.size) > 600
        assert figure.with_suffix(".pdf").read_bytes().startswith(b"%PDF")
    (page,) = out.glob("*.md") if name not in ("comparison", "ablation") else [out / f"{name}.md"]
    assert page.read_text(encoding="utf-8") == said.out
    assert said.out.startswith(f"# Study {name}\n\n")
    FOUND.get(name, lambda _: None)(out)
    if name not in RESUMED:
        return
    assert call()[0] == 2
    monkeypatch.setattr("rudc.reporting.figures._save", lambda *_: None)  # looked at above
    status, again = call("--resume")
    assert not status, again.err
    line = RESUMED[name]
    same = [text.out if line is None else text.out.splitlines()[line] for text in (said, again)]
    assert same[0] == same[1]
    assert "finished" in again.err, again.err
