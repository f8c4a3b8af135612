"""The scenario file that one starts from."""

from __future__ import annotations

_TEMPLATE = """\
{schema_line}name: {name}
description: The leader brakes hard as the ego nears the junction.
network: four_way                      # a shipped network, or a path to a .net.xml
ego:
  route: {{from: south, turn: left}}     # or random
  speed: {{uniform: [6, 10]}}            # m/s; wherever a number stands, a distribution may
traffic:
  density: 20                          # veh/km
events:
  - kind: hard_brake
    vehicle: leader                    # or follower, oncoming, crossing, nearest, random, all
    deceleration: {{normal: [7, 1]}}     # m/s2
    when: {{ego_distance_to_junction: {{below: 20}}, probability: 0.8}}
"""


def scenario_template(name: str, schema: str | None = None) -> str:
    """Text of a new scenario file; `schema` is the path of a JSON Schema file for editors, if any."""
    line = "" if schema is None else f"# yaml-language-server: $schema={schema}\n"
    return _TEMPLATE.format(name=name, schema_line=line)
