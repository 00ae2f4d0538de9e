"""How often a certificate is wrong, and how many episodes it takes, beside other tests.

`python -m docs.scripts.certificates` writes docs/guides/certificates.json and the tables of the
page beside it.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.files import whole_file
from sarl_core.rollouts.statistics import rate_of
from sarl_core.studies.sequential_test import SequentialTest, chances, sequential_test

GUIDES = Path(__file__).resolve().parents[1] / "guides"
JSON, PAGE = GUIDES / "certificates.json", GUIDES / "certificates.md"
BEGIN = "<!-- {}, made by: python -m docs.scripts.certificates -->"
END = "<!-- end of {} -->"
RATE, CERTAINTY = 0.01, 0.95
TIMES = (0.0, 0.25, 0.5, 0.9, 1.0, 1.1, 2.0)
"""True rates, as multiples of the one that is to be certified."""
DRAWS, SEED = 20_000, 1


class Looks(NamedTuple):
    """What decides after each episode.

    Attributes:
        certified: Most failures with which it certifies, (N,); -1 for none.
        refused: Fewest with which it refuses, (N,).
    """

    certified: NDArray[np.int64]
    refused: NDArray[np.int64]


class Outcome(NamedTuple):
    """Probabilities, and the expected number of episodes."""

    certified: float
    refused: float
    episodes: float


def of_test(test: SequentialTest) -> Looks:
    """Those of the product."""
    certified = np.full(test.episodes, -1)
    for failures, episode in enumerate(test.certified):
        certified[episode - 1] = failures
    first = np.searchsorted(np.array(test.refused), np.arange(1, test.episodes + 1)) + 1
    return Looks(certified, first)


def of_ratios(episodes: int, certifies: NDArray[np.bool_], refuses: NDArray[np.bool_]) -> Looks:
    """Those of tests that look at every pair of episodes and failures, (N, K + 1)."""
    most = np.where(
        certifies.any(axis=1), certifies.shape[1] - 1 - certifies[:, ::-1].argmax(1), -1
    )
    least = np.where(refuses.any(axis=1), refuses.argmax(axis=1), episodes + 1)
    return Looks(most, least)


def wald(p: float, error: float, episodes: int, failures: int) -> Looks:
    """Wald's test of p against a quarter of it; its refusal says only that it is no quarter."""
    ratio = log_ratio(p / 4, p, episodes, failures)
    border = math.log((1.0 - error) / error)
    return of_ratios(episodes, ratio >= border, ratio <= -border)


def mixture(p: float, error: float, episodes: int, failures: int) -> Looks:
    """Bets on several rates at once, equally much on each; Ville's bound on what they win."""
    border = math.log(1.0 / error)

    def bets(rates: tuple[float, ...]) -> NDArray[np.float64]:
        won = [log_ratio(rate, p, episodes, failures) for rate in rates]
        mean: NDArray[np.float64] = np.logaddexp.reduce(np.array(won), axis=0) - math.log(len(won))
        return mean

    below, above = bets((0.0, p / 8, p / 4, p / 2)), bets((1.5 * p, 2 * p, 4 * p, 16 * p))
    return of_ratios(episodes, below >= border, above >= border)


def log_ratio(rate: float, p: float, episodes: int, failures: int) -> NDArray[np.float64]:
    """Of the likelihoods of two rates, after each episode with each number of failures."""
    of, count = np.arange(1, episodes + 1)[:, None], np.arange(failures + 1)[None, :]
    with np.errstate(divide="ignore", invalid="ignore"):
        on_failure = math.log(rate / p) if rate else -np.inf
        ratio = np.where(count > 0, count * on_failure, 0.0)
        ratio = ratio + (of - count) * (math.log1p(-rate) - math.log1p(-p))
    return np.where(count <= of, ratio, -np.inf)


def outcome(looks: Looks, rate: float, failures: int) -> Outcome:
    """What becomes of a test at a true rate, exactly."""
    going = np.zeros(failures + 2)
    going[0] = 1.0
    certified = refused = expected = 0.0
    for most, least in zip(looks.certified.tolist(), looks.refused.tolist(), strict=True):
        expected += float(going.sum())
        going[1:] = going[1:] * (1.0 - rate) + going[:-1] * rate
        going[0] *= 1.0 - rate
        certified += float(going[: most + 1].sum())
        going[: most + 1] = 0.0
        refused += float(going[least:].sum())
        going[least:] = 0.0
    return Outcome(certified, refused, expected)


def drawn(test: SequentialTest, rate: float, generator: np.random.Generator) -> dict[str, float]:
    """Shares of many tests of episodes that are drawn, each ended as the product ends it."""
    counts, covered = {True: 0, False: 0, None: 0}, 0
    none = np.zeros(test.episodes, dtype=np.bool_)
    episodes = 0
    for _ in range(DRAWS):
        failed = generator.random(test.episodes) < rate
        verdict = test.decided(failed, none)
        counts[verdict.certified] += 1
        episodes += verdict.episodes
        interval = rate_of(failed[: verdict.episodes])
        covered += interval.low <= rate <= interval.high
    return {
        "certified": counts[True] / DRAWS,
        "refused": counts[False] / DRAWS,
        "episodes": episodes / DRAWS,
        "interval_covers": covered / DRAWS,
    }


def measured() -> dict[str, Any]:
    """All of it."""
    generator = np.random.default_rng(SEED)
    errors = []
    for at_most, certainty in ((0.01, 0.95), (0.05, 0.95), (0.1, 0.9), (0.01, 0.99)):
        test = sequential_test(at_most, certainty)
        for times in TIMES:
            rate = times * at_most
            errors.append(
                {
                    "at_most": at_most,
                    "certainty": certainty,
                    "times": times,
                    "rate": round(rate, 6),
                    "exact": vars(chances(test, rate)),
                    "drawn": drawn(test, rate, generator),
                }
            )
    test = sequential_test(RATE, CERTAINTY)
    size = (RATE, 1.0 - CERTAINTY, test.episodes, 120)
    tests = {"this one": of_test(test), "Wald's": wald(*size), "a mixture": mixture(*size)}
    return {
        "draws": DRAWS,
        "seed": SEED,
        "errors": errors,
        "tests": {
            name: {
                "first_look": int(np.argmax(looks.certified >= 0)) + 1,
                "at": {str(times): outcome(looks, times * RATE, 120)._asdict() for times in TIMES},
            }
            for name, looks in tests.items()
        },
    }


def error_table(parts: dict[str, Any]) -> str:
    """Exact and drawn, at the border and on either side of it."""
    lines = [
        "| to certify | true rate | certified, exactly | in draws | refused, exactly | in draws | "
        "interval covers |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for one in parts["errors"]:
        if one["times"] not in (0.9, 1.0, 1.1):
            continue
        exact, seen = one["exact"], one["drawn"]
        lines.append(
            f"| {percent(one['at_most'])} at {percent(one['certainty'])} | {percent(one['rate'])} "
            f"| {percent(exact['certified'])} | {percent(seen['certified'])} "
            f"| {percent(exact['refused'])} | {percent(seen['refused'])} "
            f"| {percent(seen['interval_covers'])} |"
        )
    return "\n".join(lines)


def effort_table(parts: dict[str, Any]) -> str:
    """Episodes that tests take, and how often they certify."""
    rates = ("0.0", "0.25", "0.5", "2.0")
    headings = " | ".join(f"at {percent(float(one) * RATE)}" for one in rates)
    lines = [
        f"| test | without a failure | {headings} |",
        f"| --- | --- |{' --- |' * len(rates)}",
    ]
    for name, one in parts["tests"].items():
        cells = []
        for rate in rates:
            at = one["at"][rate]
            share = at["refused"] if rate == "2.0" else at["certified"]
            word = "refused" if rate == "2.0" else "certified"
            cells.append(f"{at['episodes']:,.0f}, {percent(share)} {word}")
        lines.append(f"| {name} | {one['first_look']:,} | {' | '.join(cells)} |")
    return "\n".join(lines)


def percent(share: float) -> str:
    """A share in percent, to three digits, rounded up at no border."""
    return f"{float(f'{100 * share:.3g}'):g} %"


def with_tables(page: str, parts: dict[str, Any]) -> str:
    """A page with the tables between their marks."""
    for name, table in (("errors", error_table(parts)), ("effort", effort_table(parts))):
        begin, end = BEGIN.format(name), END.format(name)
        before, _, rest = page.partition(begin)
        _, _, after = rest.partition(end)
        page = f"{before}{begin}\n\n{table}\n\n{end}{after}"
    return page


def main() -> None:
    """Measure, and write what was measured."""
    parts = measured()
    with whole_file(JSON) as unfinished:
        unfinished.write_text(json.dumps(parts, indent=1) + "\n", encoding="utf-8")
    page = with_tables(PAGE.read_text(encoding="utf-8"), parts)
    with whole_file(PAGE) as unfinished:
        unfinished.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
