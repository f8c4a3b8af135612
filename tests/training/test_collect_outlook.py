"""What is learnt from where training is driven with the outlook."""

import pytest

from rudc.agents.outlook import Outlook
from rudc.errors import InputError
from rudc.training.config import TrainConfig
from tests.training.test_collect_filtered import changed, driven

CHANGES = {"training.outlook": True}


def test_the_replay_gets_what_the_outlook_let_be_done():
    assert changed(driven("sac", {**CHANGES, "training.filtered_share": 1.0})) > 5
    assert changed(driven("sac", {**CHANGES, "training.filtered_share": 0.0})) == 0
    assert changed(driven("sac", {})) == 0


def test_what_is_learnt_from_is_what_the_outlook_shows(monkeypatch):
    see = Outlook.see
    shown = []

    def watched(self, scene):
        shown.append(scene.time_s)
        return see(self, scene)

    monkeypatch.setattr(Outlook, "see", watched)
    new = driven("sac", CHANGES)
    starts = shown.count(min(shown))
    assert len(shown) == len(new) + starts, "once a decision, and once at each start"


def test_without_an_outlook_it_does_nothing():
    off = {"outlook.course": False, "outlook.plant": "off"}
    with pytest.raises(InputError, match=r"training\.outlook: has no effect"):
        TrainConfig.of("sac", {"training.outlook": True, **off})
    assert TrainConfig.of("sac", {"training.outlook": True, "training.filtered_share": 0.3})
