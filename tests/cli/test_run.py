"""One episode: what of a scenario it takes."""

SHORT = ("--set", "episode.timeout=0.5")
SWEPT = (
    "name: swept\nevents: [{kind: hard_brake, deceleration: {uniform: [6, 8]}}]\n"
    "sweep: {traffic.density: [5, 10], events.0.deceleration: [3, 4], ego.may_cross_centre: [true, false]}\n"
)


def test_a_sweep_in_a_file_is_said_not_to_be_driven(rudc, tmp_path):
    (tmp_path / "swept.yaml").write_text(SWEPT)
    for command in (("run", "swept.yaml", "-a", "follower", *SHORT), ("scenario", "preview", "swept.yaml")):
        answer = rudc(*command)
        assert answer.status == 0
        assert answer.err.splitlines()[0] == (
            "swept sweeps traffic.density (5, 10), events.0.deceleration (3, 4), "
            "ego.may_cross_centre (true, false); this is one episode, with traffic.density=20.0, "
            "events.0.deceleration={uniform: [6.0, 8.0]}, ego.may_cross_centre=false: "
            "`rudc sweep` drives the grid, `--set traffic.density=VALUE` chooses a value"
        )


def test_a_value_chosen_of_a_sweep_is_driven_and_the_rest_said(rudc, tmp_path):
    (tmp_path / "swept.yaml").write_text(SWEPT)
    command = ("run", "swept.yaml", "-a", "follower", *SHORT)
    chosen = [f"--set={key}" for key in ("traffic.density=5", "events.0.deceleration=3")]
    answer = rudc(*command, *chosen)
    assert answer.err.startswith("swept sweeps ego.may_cross_centre (true, false); this is one episode")
    assert rudc(*command, *chosen, "--set", "ego.may_cross_centre=true").err == ""
    assert rudc(*command, "--quiet").err == ""
