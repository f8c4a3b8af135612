"""Case studies: which episode is shown, and what is kept of it. The studies run for real in test_quick.py."""

import numpy as np
import pytest

from rudc.agents.follower import Follower
from rudc.errors import AgentError
from rudc.scenario import find_scenarios
from rudc.studies.case import COLUMNS, Driver, chosen_seed, drive, drivers
from rudc.studies.ood_case import summary
from tests.studies.test_latency import busy


def rows(*ends: tuple[int, str, str]):
    """Rows of a sweep: seed, agent, outcome; an error where it is empty."""
    return [{"seed": str(s), "agent": a, "outcome": o, "error": "" if o else "no"} for s, a, o in ends]


def test_the_shown_seed_is_that_in_which_the_first_alone_succeeds():
    both = [(0, "a", "success"), (0, "b", "success"), (1, "a", "success"), (1, "b", "collision")]
    worse = [(2, "a", "frozen"), (2, "b", "collision"), (3, "a", "success"), (3, "b", "frozen")]
    assert chosen_seed(rows(*both, *worse), ("a", "b")) == 1
    assert chosen_seed(rows(*both[:2], *worse[:2]), ("a", "b")) == 0
    assert chosen_seed(rows(*worse[:2]), ("a", "b")) == 2
    assert chosen_seed(rows((0, "a", "success"), (0, "b", "")), ("a", "b")) is None


def test_drivers_named_are_called_as_they_are():
    assert drivers(("sumo", "sumo"), ()) == (Driver("sumo", "sumo"),)
    with pytest.raises(AgentError):
        drivers(("nobody",), ())


def test_a_case_holds_the_episode():
    (scenario,) = find_scenarios(["blocked_left_turn"])
    case = drive(scenario, Driver("mine", "planner"), 0)
    assert tuple(case.ego) == COLUMNS
    assert np.diff(case.ego["time_s"]) == pytest.approx(0.1)
    assert sum(track.is_event for track in case.tracks) == 3
    assert np.isnan(case.ego["sigma_total"]).all()
    assert not case.ego["HOCBF_ms"].any(), "drawing h is no part of a decision"
    assert case.ego["h_m2"].min() < 25.0 < case.ego["h_m2"].max()
    assert case.duration_s == pytest.approx(case.ego["time_s"][-1] + 0.1)
    said = summary(Driver("mine", "planner"), case, [])
    assert np.isnan([said["sigma_peak"], said["sigma_peak_at_s"]]).all(), "no sigma, no peak"
    sigma = np.full(len(case.ego["time_s"]), np.nan)
    sigma[3:6] = 1.0, 2.0, 1.0
    said = summary(Driver("mine", "planner"), case._replace(ego={**case.ego, "sigma_total": sigma}), [])
    assert (said["sigma_peak"], said["sigma_peak_at_s"]) == (2.0, case.ego["time_s"][4])


def test_warming_up_is_left_out_and_the_scene_of_a_collision_counts(monkeypatch):
    act, acted = Follower.act, []

    def slow_at_first(self, scene):
        if not acted:
            busy(0.05)
        acted.append(scene)
        return act(self, scene)

    monkeypatch.setattr(Follower, "act", slow_at_first)
    (scenario,) = find_scenarios(["blocked_left_turn"])
    case = drive(scenario, Driver("blind", "follower"), 0)
    assert case.ego["rest_ms"].max() < 50.0
    assert case.outcome == "collision"
    assert case.least_h_m2 < case.ego["h_m2"].min()
