"""What rules prevent, against what they leave to an agent: `python -m docs.scripts.freedom`.

A novice in Lunar Lander plays the same fresh episodes under rules of every kind. Writes
data/rules/freedom.json after every set, the pictures and the table of the page. Rule sets that
`sarl probe` has made are named on the command line. A set that is in the file already is not
played again; delete the file to begin anew.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import plotly.graph_objects as go

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formats import load_demonstrations
from sarl_core.explaining.figures.png import figure_to_png
from sarl_core.explaining.figures.rules.freedom import (
    FEATURES,
    KINDS,
    FreedomPoint,
    freedom_figure,
    point_front,
)
from sarl_core.files import whole_file
from sarl_core.mining.algorithm_1 import mine_rules
from sarl_core.mining.combining.choice import with_combinations
from sarl_core.mining.growing.growth import grow_policy_trees
from sarl_core.mining.language import share_text
from sarl_core.mining.never.never_rules import mine_never_rules, with_never_rules
from sarl_core.mining.rule_set import RuleSet, load_rules
from sarl_core.rollouts import seeds
from sarl_core.rollouts.episodes import rollout
from sarl_core.shielding.shield import Shield

DOCS = Path(__file__).resolve().parents[1]
DATA = DOCS.parent / "data"
JSON, PAGE = DATA / "rules" / "freedom.json", DOCS / "guides" / "never_rules.md"
PICTURES = DOCS / "pictures"
BEGIN = "<!-- made by: python -m docs.scripts.freedom -->"
END = "<!-- end of what is made -->"

ENVIRONMENT, AGENT, EPISODES = "LunarLander-v3", "novice", 200
# Of a run that made nothing that is shipped.
SEED = seeds.of_run(seeds.REPORT, 20)

DEMANDS = (
    *((0.0, 1.0), (0.0, 0.9), (0.0, 0.8), (0.001, 0.95), (0.005, 0.95)),
    *((0.005, 0.9), (0.005, 0.8), (0.005, 0.7)),
)
"""Pairs of support and confidence."""
NEVER = (
    *((0.0, 0.02), (0.0, 0.05), (0.0, 0.1), (0.0, 0.14), (0.0, 0.2)),
    *((0.005, 0.05), (0.005, 0.1), (0.005, 0.14), (0.05, 0.1)),
)
"""Pairs of support and epsilon."""
MIXED = ((0.005, 0.95, 0.05), (0.005, 0.95, 0.1), (0.005, 0.9, 0.1), (0.005, 0.8, 0.1))
"""Support, confidence and epsilon."""
SHIPPED = ("lunar_lander_compact", "lunar_lander_combined", "lunar_lander_few_combined")

HEAD = (
    *("rules", "at", "freedom", "failures, 95 % interval", "mean return"),
    *("200 or more", "at the time limit"),
)


def main() -> None:
    """Play what is missing; write the file, the pictures and the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("probed", nargs="*", type=Path, help="rule files that sarl probe made")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    arguments = parser.parse_args()
    points: list[dict[str, Any]] = json.loads(JSON.read_text("utf-8")) if JSON.is_file() else []
    for label, rules in rule_sets(arguments.probed):
        digest = "" if rules is None else rules.digest
        if any((one["digest"], one["kind"]) == (digest, label["kind"]) for one in points):
            continue
        points.append({**label, "digest": digest, **played(rules, arguments.jobs)})
        with whole_file(JSON) as unfinished:
            unfinished.write_text(json.dumps(points, indent=1) + "\n", encoding="utf-8")
        print(points[-1], flush=True)
    for dark in (False, True):
        with whole_file(PICTURES / f"freedom{'_dark' * dark}.png") as unfinished:
            unfinished.write_bytes(figure_to_png(picture(points, dark=dark)))
    page = with_table(PAGE.read_text("utf-8"), points)
    with whole_file(PAGE) as unfinished:
        unfinished.write_text(page, "utf-8")


def rule_sets(probed: Sequence[Path]) -> Iterator[tuple[dict[str, Any], RuleSet | None]]:
    """Every set of rules, with its kind and its thresholds."""
    yield {"kind": "none"}, None
    demonstrations = load_demonstrations(DATA / "demonstrations" / "lunar_lander.parquet")
    yield from ((one | {"features": 1}, rules) for one, rules in mined(demonstrations))
    combined = with_combinations(demonstrations)
    yield from ((one | {"features": 2}, rules) for one, rules in mined(combined))
    for name in SHIPPED:
        yield {"kind": "shipped", "name": name}, load_rules(DATA / "rules" / f"{name}.json")
    for path in probed:
        yield {"kind": "probed", "name": path.stem}, load_rules(path)


def mined(demonstrations: Demonstrations) -> Iterator[tuple[dict[str, Any], RuleSet]]:
    """What is mined at all thresholds."""
    trees = grow_policy_trees(demonstrations)
    for support, confidence in DEMANDS:
        rules = mine_rules(trees, supp_min=support, conf_min=confidence)
        yield {"kind": "demand", "support": support, "confidence": confidence}, rules
    for support, epsilon in NEVER:
        rules = mine_never_rules(trees, supp_min=support, epsilon=epsilon)
        yield {"kind": "never", "support": support, "epsilon": epsilon}, rules
    for support, confidence, epsilon in MIXED:
        demanding = mine_rules(trees, supp_min=support, conf_min=confidence)
        label = {"support": support, "confidence": confidence, "epsilon": epsilon}
        yield {"kind": "mixed", **label}, with_never_rules(demanding, trees, epsilon)


def played(rules: RuleSet | None, jobs: int) -> dict[str, Any]:
    """What becomes of the novice."""
    episodes = rollout(
        ENVIRONMENT,
        AGENT,
        shield=None if rules is None else Shield(rules),
        episodes=EPISODES,
        seed=SEED,
        jobs=jobs,
        keep_steps=False,
    )
    summary = episodes.summary()
    names = ("failures", "failure_low", "failure_high", "mean", "std", "intervention_rate")
    return {
        "rules": 0 if rules is None else len(rules),
        "episodes": EPISODES,
        "seed": SEED,
        "freedom": 1.0 if rules is None else summary["freedom"],
        **{name: summary[name] for name in names},
        "steps": float(episodes.lengths.mean()),
        "solved": int((episodes.returns >= 200).sum()),
        "timed_out": int(episodes.truncated.sum()),
    }


def picture(points: Sequence[dict[str, Any]], *, dark: bool) -> go.Figure:
    """The figure of all sets, for a page."""
    ground, ink = ("#1e2129", "#d5dce2") if dark else ("#ffffff", "#1d2730")
    figure = freedom_figure(list(map(FreedomPoint.of, points)), front=True, dark=dark)
    figure.update_layout(
        width=720,
        height=600,
        paper_bgcolor=ground,
        plot_bgcolor=ground,
        font={"color": ink, "size": 14},
    )
    return figure


def with_table(page: str, points: Sequence[dict[str, Any]]) -> str:
    """A page with the table of what was measured between its marks."""
    before, rest = page.split(BEGIN)
    return f"{before}{BEGIN}\n\n{freedom_table(points)}\n\n{END}{rest.split(END)[1]}"


def freedom_table(points: Sequence[dict[str, Any]]) -> str:
    """The sets that no other beats, in bold, and of each kind that with the fewest failures."""
    best = point_front(list(map(FreedomPoint.of, points)))
    rows = []
    for kind, (name, _, _) in KINDS.items():
        for features in FEATURES:
            of_kind = [
                one for one in points if (one["kind"], one.get("features")) == (kind, features)
            ]
            least = min((one["failures"] for one in of_kind), default=0)
            rows += [
                _row(name, one, bold=FreedomPoint.of(one) in best)
                for one in of_kind
                if FreedomPoint.of(one) in best or one["failures"] == least
            ]
    return "\n".join([f"| {' | '.join(HEAD)} |", f"|{' --- |' * len(HEAD)}", *rows])


def _row(name: str, one: dict[str, Any], *, bold: bool) -> str:
    at = ", ".join(
        f"{name} {one[name]:g}" for name in ("support", "confidence", "epsilon") if name in one
    )
    low, high = (share_text(one[end]) for end in ("failure_low", "failure_high"))
    kind = f"{name}{FEATURES[one.get('features')]}"
    cells = [
        (f"**{kind}**" if bold else kind) + (f": {one['rules']:,}" if one["rules"] else ""),
        f"`{one['name']}`" if "name" in one else at or "–",
        share_text(one["freedom"]),
        f"{one['failures']} of {one['episodes']} ({low.removesuffix(' %')} to {high})",
        f"{one['mean']:,.0f}".replace("-", "−"),
        f"{one['solved']}",
        f"{one['timed_out']}",
    ]
    return f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    main()
