"""What two rules are proved to do in Cart Pole, whatever an agent proposes.

The shipped rules of `cartpole_combined` decide every step and ask about the pole alone: its angle
and its angular velocity. So does Cart Pole's equation for the angle. That plane is cut into small
boxes, and each box is taken through one step of the rules and of Gymnasium's equations with
interval arithmetic: what comes out holds every state that can follow, and a little more. A box that
lies on both sides of a rule's border goes both ways.

- From the boxes that never lead out of the limit of 12 degrees it is proved that the pole never
  falls.
- For the cart there is one equation more. With l half the pole's length, cart velocity plus
  4/3 l times angular velocity changes by the tilt of the pole alone, and position plus 4/3 l times
  angle sums that up. This bounds how far the cart can have gone, for as many steps as it does.

"Not proved" says that the boxes are too coarse or the bound is, and not that the pole falls.

Run it from the top folder of a checkout, `python -m examples.prove_cartpole`. It writes
`proved_cartpole.html`, the proved part of the plane.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import gymnasium
import numpy as np
import plotly.graph_objects as go

from sarl_core import RuleSet, Shield, load_rules
from sarl_core.shipped import DATA

ANGLES, VELOCITIES = 600, 1_200  # boxes along each axis, both even: 0 is a border
FASTEST = 3.0  # rad/s; what turns faster is not followed
STEPS = 500
RESET = 0.05  # Cart Pole begins within this of 0 in all four numbers
SLACK = 1e-9  # by which each bound is widened: far more than rounding to float64 can do


class Interval(NamedTuple):
    """Lower and upper bounds of many numbers at once."""

    low: np.ndarray
    high: np.ndarray

    def __add__(self, other: Interval) -> Interval:
        """Every sum, and a little more."""
        return Interval(self.low + other.low - SLACK, self.high + other.high + SLACK)

    def times(self, other: Interval) -> Interval:
        """Every product, and a little more."""
        ends = np.stack([one * two for one in self for two in other])
        return Interval(ends.min(axis=0) - SLACK, ends.max(axis=0) + SLACK)

    def scaled(self, factor: float) -> Interval:
        """All of it, a number of times."""
        return self.times(Interval(np.float64(factor), np.float64(factor)))


@dataclass(frozen=True)
class Boxes:
    """The plane of angle and angular velocity, cut into boxes; arrays of shape (A, V).

    Attributes:
        angles: Borders along the angle, (A + 1,), from limit to limit.
        velocities: Borders along the angular velocity, (V + 1,).
        images: For each label, the first and the last box along both axes that a box leads to,
            (4, A, V); 0 to -1 where the rules do not give this label there.
        leaves: Whether a box may lead out of the plane.
        drift: Least and largest change of the cart's own velocity from a box.
    """

    angles: np.ndarray
    velocities: np.ndarray
    images: tuple[np.ndarray, ...]
    leaves: np.ndarray
    drift: Interval


def pole(angle: Interval, velocity: Interval, force: float, world) -> tuple[Interval, Interval]:
    """The pole's acceleration in a box, and how the cart's own velocity changes in a step.

    Gymnasium's equations, term by term; the second is what they come to for cart velocity plus
    4/3 l times angular velocity: tau (g tan a - 4/3 l acceleration (1 / cos a - 1)).
    """
    sine = Interval(np.sin(angle.low) - SLACK, np.sin(angle.high) + SLACK)
    ends = np.cos(angle.low), np.cos(angle.high)
    over_zero = (angle.low <= 0.0) & (angle.high >= 0.0)
    cosine = Interval(
        np.minimum(*ends) - SLACK, np.where(over_zero, 1.0, np.maximum(*ends)) + SLACK
    )
    size = np.abs(velocity.low), np.abs(velocity.high)
    still = (velocity.low <= 0.0) & (velocity.high >= 0.0)
    square = Interval(
        np.where(still, 0.0, np.minimum(*size) ** 2) - SLACK, np.maximum(*size) ** 2 + SLACK
    )
    pushed = Interval(np.float64(force), np.float64(force))
    push = (pushed + square.times(sine).scaled(world.polemass_length)).scaled(
        1.0 / world.total_mass
    )
    turning = sine.scaled(world.gravity) + cosine.times(push).scaled(-1.0)
    inertia = cosine.times(cosine).scaled(-world.masspole / world.total_mass)
    inertia = (inertia + Interval(np.float64(4.0 / 3.0), np.float64(4.0 / 3.0))).scaled(
        world.length
    )
    acceleration = turning.times(Interval(1.0 / inertia.high - SLACK, 1.0 / inertia.low + SLACK))
    tilt = Interval(np.tan(angle.low) - SLACK, np.tan(angle.high) + SLACK)
    lean = Interval(np.maximum(1.0 / cosine.high - 1.0, 0.0), 1.0 / cosine.low - 1.0 + SLACK)
    rest = acceleration.times(lean).scaled(-4.0 / 3.0 * world.length)
    return acceleration, (tilt.scaled(world.gravity) + rest).scaled(world.tau)


def labels_in(rule_set: RuleSet, angle: Interval, velocity: Interval) -> list[np.ndarray]:
    """For each label, in which boxes some state has it.

    What the rules compare is worked out from float32 numbers, and rises with the angle and with the
    angular velocity, rounding included: its bounds in a box are those in two of its corners.
    """
    (combination,) = (one.derived for one in rule_set.source.features if one.derived is not None)
    assert combination.features == (2, 3)
    assert combination.ratio > 0.0
    values = []
    for angles, velocities in zip(angle, velocity, strict=True):
        states = np.zeros((*angles.shape, 4), dtype=np.float32)
        states[..., 2], states[..., 3] = angles, velocities
        flat = combination.values(states.reshape(-1, 4)).astype(np.float32)
        values.append(flat.astype(np.float64).reshape(angles.shape))
    low, high = values
    below, above = rule_set.rules
    (border,) = {rule.conditions[0].threshold for rule in rule_set.rules}
    assert [len(rule.conditions) for rule in rule_set.rules] == [1, 1]
    assert (below.conditions[0].op, above.conditions[0].op) == ("<=", ">")
    return [low <= border if label == below.action else high > border for label in (0, 1)]


def cut_plane(rule_set: RuleSet, world) -> Boxes:
    """Take every box through one step."""
    limit = world.theta_threshold_radians
    angles = np.linspace(-limit, limit, ANGLES + 1)
    velocities = np.linspace(-FASTEST, FASTEST, VELOCITIES + 1)
    low = np.meshgrid(angles[:-1], velocities[:-1], indexing="ij")
    high = np.meshgrid(angles[1:], velocities[1:], indexing="ij")
    angle, velocity = (Interval(*ends) for ends in zip(low, high, strict=True))
    following = angle + velocity.scaled(world.tau)
    leaves = np.zeros(low[0].shape, dtype=bool)
    drifts, images = [], []
    for label, here in enumerate(labels_in(rule_set, angle, velocity)):
        force = world.force_mag if label == 1 else -world.force_mag
        acceleration, drift = pole(angle, velocity, force, world)
        turned = velocity + acceleration.scaled(world.tau)
        leaves |= here & ((following.low < -limit) | (following.high > limit))
        leaves |= here & ((turned.low < -FASTEST) | (turned.high > FASTEST))
        ends = [
            np.searchsorted(borders, end, side="right" if first else "left") - 1
            for borders, interval in ((angles, following), (velocities, turned))
            for first, end in ((True, interval.low), (False, interval.high))
        ]
        last = (ANGLES - 1, ANGLES - 1, VELOCITIES - 1, VELOCITIES - 1)
        image = np.stack([np.clip(end, 0, most) for end, most in zip(ends, last, strict=True)])
        image[1][~here] = image[3][~here] = -1
        image[0][~here] = image[2][~here] = 0
        images.append(image)
        drifts.append((np.where(here, drift.low, np.inf), np.where(here, drift.high, -np.inf)))
    lowest, highest = (np.stack(ends) for ends in zip(*drifts, strict=True))
    drift = Interval(lowest.min(axis=0), highest.max(axis=0))
    return Boxes(angles, velocities, tuple(images), leaves, drift)


def never_falling(boxes: Boxes) -> np.ndarray:
    """Boxes from which all that can follow stays among them for ever: the largest such set."""
    safe = ~boxes.leaves
    while True:
        sums = np.zeros((ANGLES + 1, VELOCITIES + 1), dtype=np.int64)
        sums[1:, 1:] = safe.cumsum(axis=0).cumsum(axis=1)
        still = safe.copy()
        for first, last, slow, fast in boxes.images:
            inside = sums[last + 1, fast + 1] - sums[first, fast + 1]
            inside += sums[first, slow] - sums[last + 1, slow]
            still &= inside == (last - first + 1) * (fast - slow + 1)
        if (still == safe).all():
            return safe
        safe = still


def following_boxes(boxes: Boxes, reached: np.ndarray) -> np.ndarray:
    """The boxes that some state of a set of boxes can lead to."""
    corners = np.zeros((ANGLES + 1, VELOCITIES + 1), dtype=np.int64)
    for image in boxes.images:
        first, last, slow, fast = image[:, reached & (image[1] >= 0)]
        for rows, columns, sign in (
            (first, slow, 1),
            (last + 1, slow, -1),
            (first, fast + 1, -1),
            (last + 1, fast + 1, 1),
        ):
            np.add.at(corners, (rows, columns), sign)
    return corners.cumsum(axis=0).cumsum(axis=1)[:ANGLES, :VELOCITIES] > 0


def begun_in(boxes: Boxes) -> tuple[slice, slice]:
    """The boxes that episodes begin in."""
    ends = (np.searchsorted(one, [-RESET, RESET]) for one in (boxes.angles, boxes.velocities))
    angle, velocity = (slice(int(first) - 1, int(last)) for first, last in ends)
    return angle, velocity


def steps_on_the_track(boxes: Boxes, world) -> int:
    """For how many steps the cart cannot have left the track, from any state of a reset."""
    reached = np.zeros(boxes.leaves.shape, dtype=bool)
    reached[begun_in(boxes)] = True
    arm = 4.0 / 3.0 * world.length
    own = (1.0 + arm) * RESET  # of cart position, and of cart velocity, with the pole's part
    place, speed = np.array([-own, own]), np.array([-own, own])
    for step in range(STEPS):
        if (reached & boxes.leaves).any():
            return step
        place = place + world.tau * speed + np.array([-SLACK, SLACK])
        drift = boxes.drift.low[reached].min(), boxes.drift.high[reached].max()
        speed = speed + np.array(drift)
        reached = following_boxes(boxes, reached)
        rows = np.flatnonzero(reached.any(axis=1))
        tilt = max(-boxes.angles[rows[0]], boxes.angles[rows[-1] + 1])
        if np.abs(place).max() + arm * tilt > world.x_threshold:
            return step
    return STEPS


def draw(boxes: Boxes, safe: np.ndarray) -> go.Figure:
    """The plane: where it is proved, and the box that episodes begin in."""
    angles, velocities = (
        (borders[1:] + borders[:-1]) / 2 for borders in (boxes.angles, boxes.velocities)
    )
    figure = go.Figure(
        go.Heatmap(
            x=np.degrees(angles[::4]),
            y=velocities[::4],
            z=safe[::4, ::4].T.astype(int),
            colorscale=[(0.0, "#e6e6e6"), (1.0, "#0072b2")],
            showscale=False,
            hovertemplate="%{x:.2f}°, %{y:.2f} rad/s<extra></extra>",
        )
    )
    end = math.degrees(RESET)
    figure.add_shape(type="rect", x0=-end, x1=end, y0=-RESET, y1=RESET, line_color="#d55e00")
    figure.update_layout(
        title="Cart Pole under two rules. Blue: proved that the pole never falls. Grey: not "
        "proved.<br>Orange: where episodes begin.",
        xaxis_title="pole angle [°]",
        yaxis_title="pole angular velocity [rad/s]",
        template="plotly_white",
    )
    return figure


def checked(boxes: Boxes, safe: np.ndarray, rule_set: RuleSet, count: int = 300) -> int:
    """Play from states of proved boxes with the shield itself; every step has to be in its image.

    Returns:
        How many steps were looked at. It raises where the mathematics and the environment differ.
    """
    generator = np.random.default_rng(0)
    env = gymnasium.make("CartPole-v1").unwrapped
    env.reset(seed=0)
    shield = Shield(rule_set)
    rows, columns = np.nonzero(safe)
    looked_at = 0
    for at in generator.integers(len(rows), size=count).tolist():
        state = np.zeros(4)
        row, column = rows[at], columns[at]
        state[2] = generator.uniform(boxes.angles[row], boxes.angles[row + 1])
        state[3] = generator.uniform(boxes.velocities[column], boxes.velocities[column + 1])
        for _ in range(20):
            env.state = state
            label = int(shield.decide(state.astype(np.float32), 0).executed)
            env.step(label)
            before, state = state, np.array(env.state)
            row = int(np.searchsorted(boxes.angles, before[2], side="right")) - 1
            column = int(np.searchsorted(boxes.velocities, before[3], side="right")) - 1
            first, last, slow, fast = boxes.images[label][:, row, column]
            assert boxes.angles[first] <= state[2] <= boxes.angles[last + 1]
            assert boxes.velocities[slow] <= state[3] <= boxes.velocities[fast + 1]
            arm = 4.0 / 3.0 * env.length
            change = (state[1] + arm * state[3]) - (before[1] + arm * before[3])
            assert boxes.drift.low[row, column] <= change <= boxes.drift.high[row, column]
            looked_at += 1
    return looked_at


def main() -> None:
    """Prove what can be proved, check it against the environment, and draw it."""
    rule_set = load_rules(DATA / "rules" / "cartpole_combined.json")
    world = gymnasium.make("CartPole-v1").unwrapped
    boxes = cut_plane(rule_set, world)
    safe = never_falling(boxes)
    steps = steps_on_the_track(boxes, world)
    every = bool(safe[begun_in(boxes)].all())
    print(
        f"{ANGLES} x {VELOCITIES} boxes, held against {checked(boxes, safe, rule_set)} real steps"
    )
    print(f"proved that the pole never falls: from {safe.mean():.1%} of the plane")
    print(f"among them every state that an episode begins in: {'yes' if every else 'not proved'}")
    print(f"proved that the cart stays on the track: for {steps} of {STEPS} steps")
    draw(boxes, safe).write_html(Path("proved_cartpole.html"), include_plotlyjs=True)


if __name__ == "__main__":
    main()
