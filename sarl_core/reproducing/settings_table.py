"""Table 1: the two named settings, and the rule sets that they give."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from sarl_core.explaining.language import counted, share_text
from sarl_core.mining.rules import NAMED_SETTINGS
from sarl_core.reproducing.shipped import (
    PAPER_DIVIDER,
    TREE_SEEDS,
    demonstrations_of,
    environment_name,
    environments,
    named_rules,
)
from sarl_core.reproducing.study import Claim, Drawing, Effort, Frames, Study, judge
from sarl_core.reproducing.words import percent
from sarl_core.rollouts.progress import Progress, report

if TYPE_CHECKING:
    import pandas as pd

_LAYERS = ("rule_count", "mean_length", "coverage", "fidelity")
_COLUMNS = (
    "environment",
    "setting",
    "support",
    "confidence",
    "divider",
    "tree_seed",
    *_LAYERS,
)
_COMPACT = 0.1  # of the unfiltered rules
_EVERY_STATE = 0.995
_ALL = "all environments"


def measure(_: Effort, progress: Progress | None) -> pd.DataFrame:
    """Mine the two named rule sets of every shipped environment, once a tree seed.

    Args:
        _: Takes a minute, whatever the effort.
        progress: Called with (pairs of rule sets done, in all); returning False stops.

    Returns:
        One row a rule set; columns `environment`, `setting`, its `support` and `confidence`,
        `divider` (0 for discrete actions), `tree_seed`, `rule_count`, `mean_length`, `coverage`,
        `fidelity`.
    """
    import pandas as pd

    wanted = [(env_id, seed) for env_id in environments() for seed in TREE_SEEDS]
    rows = []
    report(progress, 0, len(wanted))
    for done, (env_id, seed) in enumerate(wanted, 1):
        discrete = demonstrations_of(env_id).is_discrete
        for name, rules in named_rules(env_id, seed=seed).items():
            rows.append(
                {
                    "environment": env_id,
                    "setting": name,
                    "support": rules.thresholds.support,
                    "confidence": rules.thresholds.confidence,
                    "divider": 0 if discrete else PAPER_DIVIDER,
                    "tree_seed": seed,
                    **{layer: getattr(rules, layer) for layer in _LAYERS},
                }
            )
        report(progress, done, len(wanted))
    return pd.DataFrame(rows, columns=list(_COLUMNS))


def _first(frame: pd.DataFrame) -> pd.DataFrame:
    """The rule sets of the first tree seed, which are those used everywhere."""
    chosen: pd.DataFrame = frame[frame["tree_seed"] == frame["tree_seed"].iloc[0]]
    return chosen


def _numbers(frame: pd.DataFrame) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for row in _first(frame).to_dict("records"):
        env_id, setting = row["environment"], row["setting"]
        every = frame[(frame["environment"] == env_id) & (frame["setting"] == setting)]
        found.setdefault(env_id, {})[setting] = {
            **{layer: row[layer] for layer in _LAYERS},
            "over_tree_seeds": {
                layer: [float(every[layer].min()), float(every[layer].max())] for layer in _LAYERS
            },
        }
    return found


def _settings(_: Effort) -> dict[str, Any]:
    return {
        **{
            name: {"support": setting.support, "confidence": setting.confidence}
            for name, setting in NAMED_SETTINGS.items()
        },
        "divider": PAPER_DIVIDER,
        "environments": list(environments()),
        "seeds": {"tree": list(TREE_SEEDS)},
    }


def settings_claims(frames: Frames) -> tuple[Claim, ...]:
    """What the paper says of the two rule sets themselves.

    Args:
        frames: With the table of Table 1.

    Returns:
        Its claims and ours.
    """
    frame = frames["table-1"]
    filtered, unfiltered = (
        frame[frame["setting"] == setting].set_index(["environment", "tree_seed"])
        for setting in ("filtered", "unfiltered")
    )
    shares = (filtered["rule_count"] / unfiltered["rule_count"]).groupby(level=0, sort=False).max()
    covered = unfiltered["coverage"].groupby(level=0, sort=False).min().to_dict()
    told = "; ".join(
        f"{environment_name(str(env_id))} {_range(filtered.loc[env_id, 'rule_count'])} of "
        f"{_range(unfiltered.loc[env_id, 'rule_count'])} "
        f"({_range(filtered.loc[env_id, 'mean_length'], 1)} and "
        f"{_range(unfiltered.loc[env_id, 'mean_length'], 1)})"
        for env_id in shares.index
    )
    seeds = counted(int(frame["tree_seed"].nunique()), "tree seed")
    least = min(covered, key=lambda env_id: covered[env_id])
    return (
        Claim(
            paper="Filtering by support and confidence gives a compact rule set.",
            where="Lessons Learned, Table 1",
            ours="Filtered rules of the unfiltered ones, and the mean lengths of both, from the "
            f"least to the most of {seeds}: {told}.",
            verdict=judge(shares.max() <= _COMPACT, shares.min() <= _COMPACT),
            decided_by=f"Agrees if at most {percent(_COMPACT)} of the rules remain, with every "
            "tree seed and in every environment; partly, in some.",
            numbers={f"share_{env_id}": float(share) for env_id, share in shares.items()},
        ),
        Claim(
            paper="The unfiltered rule set has an action for every state.",
            where="text on Figure 4",
            ours=f"Its rules cover {share_text(float(covered[least]))} of the demonstrated states "
            "or more"
            + (
                f"; least on {environment_name(str(least))}, where some equal states were shown "
                "with different actions."
                if covered[least] < 1
                else "."
            ),
            verdict=judge(covered[least] >= _EVERY_STATE, max(covered.values()) >= _EVERY_STATE),
            decided_by=f"Agrees from {100 * _EVERY_STATE:g} % with every tree seed and in every "
            "environment; partly, in some.",
            numbers={f"coverage_{env_id}": float(share) for env_id, share in covered.items()},
        ),
    )


def _range(values: pd.Series[Any], decimals: int = 0) -> str:
    """The least and the most of some numbers, or the one that they all are, for people."""
    ends = dict.fromkeys(f"{value:,.{decimals}f}" for value in (values.min(), values.max()))
    return " to ".join(ends)


def _draw(frame: pd.DataFrame, _: str, dark: bool) -> tuple[Drawing, ...]:
    from sarl_core.explaining.settings_figures import settings_figure

    rows = [
        (environment_name(str(row["environment"])), str(row["setting"]), row)
        for row in _first(frame).to_dict("records")
    ]
    counts = [(name, setting, float(row["rule_count"])) for name, setting, row in rows]
    covered = [(name, setting, float(row["coverage"])) for name, setting, row in rows]
    return (
        Drawing(
            "Number of rules",
            settings_figure(counts, title="rules", share=False),
            alt="Number of rules of the filtered and the unfiltered rule set of each environment",
        ),
        Drawing(
            "Coverage: share of the demonstrated states with a rule",
            settings_figure(covered, title="coverage", share=True),
            alt="Coverage of the filtered and the unfiltered rule set of each environment",
        ),
    )


SETTINGS = Study(
    name="table-1",
    place="Table 1",
    title="The two named settings",
    about="The rule sets at the paper's two named settings, filtered (support 0.005, confidence "
    "0.95) and unfiltered (support 0, confidence 1), for every environment. They are meant by "
    "these words wherever they stand. A rule needs at least these values; under the paper's "
    "Algorithm 1, which asks for more than them, the unfiltered set would be empty. Drawn for tree "
    "seed 0; the claims are decided for five, by which trees choose among equally good queries.",
    measure=measure,
    settings=_settings,
    numbers=_numbers,
    claims=settings_claims,
    parts=lambda frame: (_ALL,),
    draw=_draw,
    columns=_COLUMNS,
)
