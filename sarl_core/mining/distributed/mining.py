"""Mining Parquet files on a cluster: three passes over their rows, and what is left of them."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.clusters import cluster as connected
from sarl_core.clusters import saying_losses, worked_out
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.fields import Whole
from sarl_core.demonstrations.formats.columns import Columns, stated
from sarl_core.demonstrations.formats.missing import Missing
from sarl_core.environments.description import describe_environment
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.errors import InputError, quoted, require, require_whole
from sarl_core.mining.combining.candidates import Pair
from sarl_core.mining.combining.choice import with_combinations
from sarl_core.mining.distributed.binning import bin_counts, bin_piece, label_counts
from sarl_core.mining.distributed.counting import TreeCounts, at_nodes, count_piece, together
from sarl_core.mining.distributed.growth import DistributedGrowth, added_up
from sarl_core.mining.distributed.mined_data import FeatureHistogram, MinedData, boxes_of
from sarl_core.mining.distributed.pieces import (
    Piece,
    Reading,
    parquet_paths,
    pieces_of,
    some_rows,
)
from sarl_core.mining.distributed.survey import (
    Layout,
    columns_of_head,
    episode_keys,
    layout_of,
    row_keys,
    survey_piece,
)
from sarl_core.mining.envelope import HIGH_QUANTILE, LOW_QUANTILE
from sarl_core.mining.evidence import EpisodeCounts
from sarl_core.mining.growing.growth import fewest_pairs
from sarl_core.mining.growing.histogram import BinnedStates
from sarl_core.mining.growing.structure import TreeStructure, tree_levels, tree_of_counts
from sarl_core.mining.labels import label_dimensions
from sarl_core.mining.tree import PolicyTree, Source
from sarl_core.mining.validation.episode_counts import LeafCounts, count_above
from sarl_core.progress import Progress, report

SAMPLE_ROWS = 2**19
"""Rows by which bins and the inner sides of boxes are chosen, about; of fewer all are."""
HELD_ROWS = 50_000
"""Rows of the sample that stay in a mined file, about."""
MOST_HELD_OUT = 2_000
"""Episodes that are held out at most: more would say nothing that these do not."""
_STEPS = 1_000  # of the progress


@dataclass(frozen=True)
class ClusterPlan:
    """What is to be mined.

    Attributes:
        divider: Number of intervals of continuous dimensions.
        min_support: No node with less is split further.
        max_depth: Of the trees; None for no limit.
        hold_out: Share of the episodes to hold out; 0 for none.
        seed: Draws these, and chooses among equally good queries.
    """

    divider: int = 2
    min_support: float = 0.0
    max_depth: int | None = None
    hold_out: float = 0.0
    seed: int = 0


def mine_files(
    paths: str | Path | Sequence[str | Path],
    cluster: str,
    *,
    env_id: EnvironmentOrId | None = None,
    columns: Columns | None = None,
    missing: Missing = "refuse",
    formulas: Sequence[str] = (),
    pairs_of: Callable[[Demonstrations], tuple[Pair, ...]] | None = None,
    divider: int = 2,
    min_support: float = 0.0001,
    max_depth: int | None = None,
    hold_out: float = 0.0,
    seed: int = 0,
    progress: Progress | None = None,
) -> MinedData:
    """Mine Parquet files that no single memory holds, on a cluster of Dask.

    The same files, or the same rows cut into others, give the same trees, however many workers
    there are.

    Args:
        paths: Files, folders of them, or patterns as `fleet/*.parquet`; the workers see them under
            the same paths.
        cluster: The address of a scheduler, as "tcp://scheduler:8786"; or "local:2" for two
            processes of this machine, "local:2:4GB" with so much memory each.
        env_id: As of `load_demonstrations`.
        columns: Likewise.
        missing: Likewise.
        formulas: Features that a person wants derived, as of `with_formulas`.
        pairs_of: Says of a sample which pairs of features may be combined; None for none.
        divider: Number of intervals of continuous dimensions.
        min_support: No node with less is split further: no rule with less is found.
        max_depth: Of the trees; None for no limit.
        hold_out: Share of the episodes to hold out, drawn by their own numbers; 0 for none.
        seed: Draws these, and chooses among equally good queries.
        progress: Told how far it is; may stop it.

    Returns:
        The trees, and what was counted: `MinedData.mine` gives rules.

    Raises:
        InputError: If a file, or the cluster, cannot be used.
        WorkError: If the cluster cannot go on, or the extra "cluster" is not installed.
        CancelledError: If the caller wants no more.
    """
    if not (isinstance(min_support, Real) and 0.0 <= min_support <= 1.0):
        raise InputError(f"the support is {quoted(min_support)}; give 0 to 1")
    if not (isinstance(hold_out, Real) and 0.0 <= hold_out < 1.0):
        raise InputError(
            f"the held-out share is {quoted(hold_out)}; give 0 or more, and less than 1"
        )
    require_whole("seed", seed, 0)
    if max_depth is not None:
        require_whole("maximum depth", max_depth, 0)
    require(cluster, str, "the cluster must be text", "give its address, or local:2")
    given = [paths] if isinstance(paths, (str, Path)) else list(paths)
    description = None if env_id is None else describe_environment(env_id)
    reading = Reading(stated(columns), description, missing, tuple(formulas))
    plan = ClusterPlan(divider, min_support, max_depth, hold_out, seed)
    files = parquet_paths(given)
    with connected(cluster) as client:
        return mine_on_cluster(client, files, reading, plan, pairs_of=pairs_of, progress=progress)


def mine_on_cluster(
    client: Any,
    paths: Sequence[Path],
    reading: Reading,
    plan: ClusterPlan,
    *,
    pairs_of: Callable[[Demonstrations], tuple[Pair, ...]] | None = None,
    progress: Progress | None = None,
) -> MinedData:
    """The same as `mine_files`, by a client of a cluster.

    Args:
        client: Of a cluster whose workers can open the files; a ``distributed.Client``.
        paths: The files.
        reading: How they are read.
        plan: What is to be mined.
        pairs_of: Says of a sample which features may be combined; None for none.
        progress: Told how far it is; may stop it.

    Returns:
        The trees, and what was counted.

    Raises:
        InputError: If a file cannot be read, or is wrong.
        WorkError: If the cluster cannot go on.
        CancelledError: If the caller wants no more.
    """

    def advance(share: float) -> None:
        report(progress, round(share * _STEPS), _STEPS)

    pieces = pieces_of(paths)
    with saying_losses():
        advance(0.0)
        layout, pieces, reading = _surveyed(
            client, pieces, reading, lambda share: advance(0.2 * share)
        )
        held_out = _held_out(layout, plan)
        mined = layout.sample
        if len(held_out):
            mined = _without(layout.sample, held_out)
        if pairs_of is not None:
            mined = with_combinations(mined, pairs=pairs_of(mined), divider=plan.divider)
            layout = replace(layout, sample=layout.sample.deriving(mined.derived))
        placement = layout.placement(held_out)
        borders = BinnedStates.of(mined.observations).borders
        rows = worked_out(
            [
                client.submit(bin_piece, piece, reading, placement, borders, plan.divider)
                for piece in pieces
            ],
            lambda share: advance(0.2 + 0.2 * share),
        )
        dimensions = label_dimensions(mined, plan.divider)
        most = max(one.n_labels for one in dimensions)
        labels = added_up(client, [client.submit(label_counts, one, most) for one in rows]).result()
        bins = [len(own) + 1 for own in borders]
        counted = added_up(client, [client.submit(bin_counts, one, max(bins)) for one in rows])
        steps = int(labels[0].sum())
        structures = []

        def growing(tree: int) -> Callable[[float], None]:
            return lambda share: advance(0.4 + 0.4 * (tree + share) / len(dimensions))

        for index, dimension in enumerate(dimensions):
            growth = DistributedGrowth(
                client,
                rows,
                labels[index, : dimension.n_labels],
                bins,
                dimension=index,
                least=fewest_pairs(float(plan.min_support), steps),
                max_depth=plan.max_depth,
                seed=plan.seed,
                advance=growing(index),
            )
            structures.append(_of_values(growth.grow(), borders))
        in_bins = counted.result()
        del rows, counted
        total = added_up(
            client,
            worked_out(
                [
                    client.submit(count_piece, piece, reading, placement, structures, plan.divider)
                    for piece in pieces
                ],
                lambda share: advance(0.8 + 0.2 * share),
            ),
            together,
        ).result()
        advance(1.0)
    return _mined(layout, mined, held_out, structures, total, borders, in_bins, plan)


def _surveyed(
    client: Any, pieces: Sequence[Piece], reading: Reading, advance: Callable[[float], None]
) -> tuple[Layout, list[Piece], Reading]:
    """The first pass; with the pieces that hold steps.

    How the first piece of several steps is understood, all others are read.
    """
    share = min(1.0, SAMPLE_ROWS / sum(piece.rows for piece in pieces))
    one_by_one = (client.submit(survey_piece, piece, reading, share).result() for piece in pieces)
    several = ((at, one) for at, one in enumerate(one_by_one) if one is not None and one.rows > 1)
    place, first = next(several, (0, None))
    if first is None:
        raise InputError(
            "hardly a step of these files has all of its values; leave out the columns that are "
            "empty instead"
        )
    if reading.columns is None:
        reading = replace(reading, columns=columns_of_head(first.head))
    others = [*pieces[:place], *pieces[place + 1 :]]
    futures = [client.submit(survey_piece, piece, reading, share) for piece in others]
    surveys = [one.result() for one in worked_out(futures, advance)]
    surveys.insert(place, first)
    there = [known for known in zip(pieces, surveys, strict=True) if known[1] is not None]
    pieces = [piece for piece, _ in there]
    return layout_of(pieces, [survey for _, survey in there]), pieces, reading


def _held_out(layout: Layout, plan: ClusterPlan) -> NDArray[np.int64]:
    """The episodes that are held out, drawn by their own numbers."""
    if not plan.hold_out:
        return np.zeros(0, dtype=np.int64)
    episodes = layout.episodes
    if len(episodes) < 2:
        raise InputError(
            "there is one episode, and holding it out leaves none to mine from; leave --hold-out "
            "out, or give more episodes"
        )
    drawn = np.uint64(plan.seed * 1_000_003 % 2**64)
    keys = episode_keys(episodes.astype(np.uint64) + drawn)
    count = min(max(round(plan.hold_out * len(episodes)), 1), len(episodes) - 1, MOST_HELD_OUT)
    return np.sort(episodes[np.argsort(keys, kind="stable")[:count]])


def _without(sample: Demonstrations, held_out: NDArray[np.int64]) -> Demonstrations:
    rows = ~np.isin(sample.episodes, held_out)
    if np.count_nonzero(rows) < 2:
        raise InputError(
            "the episodes that are held out have nearly all steps, and leave none to mine from; "
            "hold out a smaller share, or draw others by another --seed"
        )
    return some_rows(sample, rows)


def _of_values(structure: TreeStructure, borders: Sequence[NDArray[np.float64]]) -> TreeStructure:
    """The same tree, asking of values what it asks of bins."""
    threshold = np.zeros(len(structure.feature))
    for feature, own in enumerate(borders):
        here = structure.feature == feature
        threshold[here] = own[structure.threshold[here].astype(np.int64)]
    return replace(structure, threshold=threshold)


def _mined(
    layout: Layout,
    mined: Demonstrations,
    held_out: NDArray[np.int64],
    structures: Sequence[TreeStructure],
    counted: Sequence[TreeCounts],
    borders: Sequence[NDArray[np.float64]],
    in_bins: NDArray[np.int64],
    plan: ClusterPlan,
) -> MinedData:
    steps = int(counted[0].counts.sum())
    episodes = len(layout.episodes) - len(held_out)
    digest = layout.digest
    if len(held_out):
        digest = hashlib.blake2b(digest.encode() + held_out.tobytes(), digest_size=16).hexdigest()
    sample = replace(_some(mined), sample_of=Whole(digest, steps, episodes))
    source = Source.of(sample)
    trees: list[PolicyTree] = []
    boxes = []
    for index, (structure, counts) in enumerate(zip(structures, counted, strict=True)):
        tree = tree_of_counts(
            structure,
            counts.counts,
            sample,
            structure.apply(sample.observations),
            index,
            divider=plan.divider,
            learner="histogram",
            source=source.with_splits(counts.splits),
        )
        levels = tree_levels(structure.children_left, structure.children_right)
        boxes.append(
            boxes_of(
                tree,
                at_nodes(structure, counts.least, np.minimum, levels),
                at_nodes(structure, counts.most, np.maximum, levels),
                mined.observations,
                (LOW_QUANTILE, HIGH_QUANTILE),
            )
        )
        trees.append(replace(tree, least_support=plan.min_support))
    return MinedData(
        tuple(trees),
        sample,
        tuple(boxes),
        tuple(
            FeatureHistogram(own, in_bins[feature, : len(own) + 1])
            for feature, own in enumerate(borders)
        ),
        tuple(
            _episode_counts(tree, counts.held_out, held_out)
            for tree, counts in zip(trees, counted, strict=True)
        )
        if len(held_out)
        else (),
        plan.hold_out,
        plan.seed,
    )


def _some(mined: Demonstrations) -> Demonstrations:
    """Those of the sample that stay, by their keys: the same ones every time."""
    if len(mined) <= HELD_ROWS:
        return mined
    keys = row_keys(mined)
    return some_rows(mined, keys <= np.partition(keys, HELD_ROWS - 1)[HELD_ROWS - 1])


def _episode_counts(
    tree: PolicyTree, held_out: NDArray[np.int64], numbers: NDArray[np.int64]
) -> EpisodeCounts:
    above, label = np.divmod(held_out[0], tree.dimension.n_labels)
    leaf, episode = np.divmod(above, len(numbers))
    lengths = np.bincount(episode, held_out[1], minlength=len(numbers)).astype(np.int64)
    return count_above(tree, LeafCounts(leaf, episode, label, held_out[1], numbers, lengths))
