"""Every study runs to its end by one command at the quick budget: tables, and figures as PNG and PDF.

What trains, trains little here: `comparison` one row, `ablation` none, since it takes what is shipped. From
training to tables with several rows: test_comparison.py.
"""

import pytest
from PIL import Image

from rudc.cli.main import main
from rudc.evaluation.store import read_table
from rudc.studies import filter_variants, sensitivity
from rudc.studies.catalogue import STUDIES
from tests.studies.test_trained import TINIER

FEW = ("-n", 1)
"""episodes, fewer than the quick budget's"""
COMMANDS = {
    "filter": (*FEW, "-a", "gap-acceptance+ttcbf:correction.d_safe=0.5"),
    "sigma": FEW,
    "comparison": (*FEW, "-a", "sac"),
    "ablation": (*FEW, "-a", "rudc-t-wo-course", "-a", "rudc-t", "--trainings", "."),
    "curves": ("CHECKPOINT",),
    "latency": FEW,
    "ood-case": FEW,
    "ablation-case": FEW,
    "residual": (),
    "sensitivity-beta": FEW,
    "sensitivity-ensemble": FEW,
    "cbf-grid": FEW,
}


def test_all_are_here():
    assert set(COMMANDS) == set(STUDIES)


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_a_study_runs_by_one_command(name, tmp_path, monkeypatch, capsys):
    from rudc.agents.checkpoint import shipped_checkpoints

    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sensitivity.TRAINING, "quick", TINIER)
    monkeypatch.setattr(filter_variants, "LEVELS", (1.0,))
    monkeypatch.setattr(filter_variants, "RATES", (0.5,))
    given = [shipped_checkpoints()["rudc-t"] if g == "CHECKPOINT" else g for g in COMMANDS[name]]
    wanted = {"budget": ("--budget", "quick"), "workers": ("--workers", 1)}
    given += [part for what, option in wanted.items() if what in STUDIES[name].takes for part in option]
    call = ["rudc", "study", name, *given, "--out", "out"]
    monkeypatch.setattr("sys.argv", [str(part) for part in call])
    with pytest.raises(SystemExit) as ended:
        main()
    said = capsys.readouterr()
    assert not ended.value.code, said.err
    out = tmp_path / "out"
    tables, figures = sorted(out.glob("*.csv")), sorted(out.glob("*.png"))
    assert tables
    assert figures
    for table in tables:
        assert read_table(table), table.name
    for figure in figures:
        with Image.open(figure) as picture:
            assert min(picture.size) > 300
        assert figure.with_suffix(".pdf").read_bytes().startswith(b"%PDF")
    (page,) = out.glob("*.md") if name not in ("comparison", "ablation") else [out / f"{name}.md"]
    assert page.read_text(encoding="utf-8") == said.out
