"""The stranger's path is README.md's: each step has its command there, and tests/test_readme.py runs it."""

from tests.benchmarks.stranger import steps


def test_every_step_has_its_command_in_the_readme():
    scripts = [step.script for step in steps()]
    wanted = [["make setup"], ["rudc sweep", "rudc table"], ["rudc replay"],
              ["rudc scenario new", "rudc scenario validate"], ["rudc sweep my_scenario.yaml"]]  # fmt: skip
    assert len(scripts) == len(wanted)
    for script, commands in zip(scripts, wanted, strict=True):
        assert all(command in script for command in commands)
