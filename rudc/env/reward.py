"""The reward, term by term, and the step-wise cost of safe reinforcement learning.

Reward (paper, Sec. "Reward Design"). The paper states no units; those below give its terms similar sizes:

    collision       -50 when the ego hits anything                                     Eq. (reward_sparse)
    rule_violation  -50 when it leaves the road or drives against a lane's direction
    arrive_goal     +50 at the destination                                             Eq. (reward_sparse)
    reference       3 / (1 + r_ref) / 3,  r_ref the smaller, over the route's path and its alternatives, of
                    400 (e_p / 100)^2 + 30 (e_vx / 20)^2 + 30 (v_y / 20)^2 + 2 e_phi^2 + 0.5 omega^2
    action          -(u' R_a u + du' R_d du) / 3,  R_a = diag(0.05, 0.02), R_d = diag(0.2, 0.3)
    progress        -0.02 (d_des / 10)^2 / 3
    safe            0 if d_veh > 2;  -(2 - d_veh) / 3 down to 0.5;  -3 (1 - d_veh) / 3 below

    e_p    m, distance to the nearest point of the line (the paper's x and y errors, whose weights are equal)
    e_vx   m/s, speed limit there, or the vehicle's top speed if that is lower, less longitudinal velocity
    v_y    m/s, lateral velocity in the body frame
    e_phi  rad, heading less the line's;  omega rad/s, yaw rate
    u      applied acceleration / 6 m/s2 and steering / 0.6 rad (the largest that the vehicle allows), so
           that doing nothing costs nothing;  du its change since the last decision
    d_des  m along the path to the destination;  d_veh m between rectangles

The dense terms are divided by 3, so that a step on the line at full speed near the goal earns about 1. A
collision is the only event that the paper punishes. Leaving the road or entering an opposing lane ends the
episode as a violation too, and costs as much; it has a term of its own so that the paper's stays visible.

Mean reward of an episode over 100 seeds in random_destination and in dense_left_turn, measured with
tests/benchmarks/reward_scale.py:

    good      gap acceptance, episodes that arrived          110    100
    reckless  a path follower that ignores traffic            97     72    (where it arrived 113, 110)
    crashed   episodes of the reckless that collided         -34    -35
    frozen    waits at the stop line for all of 40 s         -22    -37

Cost (paper, appendix "Safe Reinforcement Learning", unified step-wise cost):

    C = w_d c_dist + w_c I_col + w_c I_road,   w_d = 1, w_c = 5
    z_q = clip((h - d_q) / (h - l), 0, 1),     l = 1 m, h = 3 m, q in {veh, road}
    c_dist = (z_veh^2 + z_road^2) / 2

The paper does not say how c_dist follows from the z_q. We square them, since d_road is measured from the
centre of gravity and is 1.75 m in the middle of an outer lane: z itself would be 0.63 there all the time.
I_road includes wrong-way driving.
"""

from __future__ import annotations

import math

from rudc.env.distances import Distances, measure
from rudc.network.network import ReferencePath
from rudc.network.paths import SPACING
from rudc.world.scene import Scene

COLLISION, RULE_VIOLATION, ARRIVE_GOAL = -50.0, -50.0, 50.0
Q_POSITION, Q_VX, Q_VY, Q_HEADING, Q_YAW_RATE = 400.0, 30.0, 30.0, 2.0, 0.5
"""diagonal of Q; x and y have the same weight"""
R_ACCELERATION, R_STEERING = 0.05, 0.02
"""diagonal of R_a"""
R_JERK, R_STEERING_CHANGE = 0.2, 0.3
"""diagonal of R_Delta"""
POSITION_UNIT, SPEED_UNIT, DESTINATION_UNIT = 100.0, 20.0, 10.0
"""m, m/s, m: units of the errors in position, in speed, and of d_des"""
DENSE_UNIT = 3.0
"""the dense terms are divided by this"""

COST_NEAR, COST_FAR = 1.0, 3.0
"""m, l_q and h_q"""
COST_DISTANCE, COST_VIOLATION = 1.0, 5.0
"""w_d and w_c"""


def reward_terms(
    before: Scene, after: Scene, distances: Distances, *, collided: bool, broke_rule: bool, arrived: bool
) -> dict[str, float]:
    """The terms of the reward of a decision that led from one scene to another; their sum is the reward.

    `distances`: those of `after`. `broke_rule`: left the road or drove the wrong way.
    """
    return {
        "collision": COLLISION if collided else 0.0,
        "rule_violation": RULE_VIOLATION if broke_rule else 0.0,
        "arrive_goal": ARRIVE_GOAL if arrived else 0.0,
        "reference": 3.0 / (1.0 + _reference_error(after)) / DENSE_UNIT,
        "action": -_action_effort(before, after) / DENSE_UNIT,
        "progress": -0.02 * (distances.destination_m / DESTINATION_UNIT) ** 2 / DENSE_UNIT,
        "safe": _closeness(distances.vehicle_m) / DENSE_UNIT,
    }


def step_cost(distances: Distances, *, collided: bool, broke_rule: bool) -> float:
    """The unified step-wise cost C of a scene's distances and of how the decision ended."""
    closeness = 0.5 * (_z(distances.vehicle_m) ** 2 + _z(distances.road_m) ** 2)
    return COST_DISTANCE * closeness + COST_VIOLATION * collided + COST_VIOLATION * broke_rule


def scene_cost(scene: Scene) -> float:
    """The cost C of a scene in which no violation has happened: that of its distances alone."""
    return step_cost(measure(scene), collided=False, broke_rule=False)


def _reference_error(scene: Scene) -> float:
    """r_ref: the tracking error with respect to the candidate line that is nearest."""
    ego, route = scene.ego, scene.route
    errors = [_line_error(scene, route.path, scene.ego_s, scene.ego_offset)]
    errors += [
        _line_error(scene, line, *line.project(ego.x, ego.y, scene.ego_s)) for line in route.alternatives
    ]
    wanted = min(route.limit_at(scene.ego_s), scene.vehicle.v_max)
    speed = (wanted - ego.v * math.cos(ego.slip)) / SPEED_UNIT
    lateral = ego.v * math.sin(ego.slip) / SPEED_UNIT
    return min(errors) + Q_VX * speed**2 + Q_VY * lateral**2 + Q_YAW_RATE * ego.yaw_rate**2


def _line_error(scene: Scene, line: ReferencePath, s: float, offset: float) -> float:
    """The part of r_ref that depends on the line: position and heading."""
    heading = float(line.heading[min(max(round(s / SPACING), 0), len(line.heading) - 1)])
    turned = math.remainder(scene.ego.psi - heading, 2 * math.pi)
    return Q_POSITION * (offset / POSITION_UNIT) ** 2 + Q_HEADING * turned**2


def _action_effort(before: Scene, after: Scene) -> float:
    """-r_act: weighted squares of the applied action and of its change."""
    body = after.vehicle
    a_unit = max(abs(body.a_min), body.a_max)
    a, delta = float(after.last_u[0]) / a_unit, float(after.last_u[1]) / body.delta_max
    da = a - float(before.last_u[0]) / a_unit
    ddelta = delta - float(before.last_u[1]) / body.delta_max
    size = R_ACCELERATION * a**2 + R_STEERING * delta**2
    return size + R_JERK * da**2 + R_STEERING_CHANGE * ddelta**2


def _closeness(gap: float) -> float:
    """r_safe for d_veh = gap (m)."""
    if gap > 2.0:
        return 0.0
    return -(2.0 - gap) if gap > 0.5 else -3.0 * (1.0 - gap)


def _z(distance: float) -> float:
    """z_q: 0 from `COST_FAR` m on, 1 up to `COST_NEAR` m."""
    return min(max((COST_FAR - distance) / (COST_FAR - COST_NEAR), 0.0), 1.0)
