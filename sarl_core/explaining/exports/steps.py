"""Recorded steps as files: CSV for a spreadsheet, Parquet with all that is known about them."""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from sarl_core.demonstrations.dataset import Feature
from sarl_core.demonstrations.derived import extend
from sarl_core.demonstrations.formats.metadata import KEY
from sarl_core.explaining.tables.spreadsheet_cells import safe_cells
from sarl_core.explaining.words.states import state_columns
from sarl_core.mining.rule_set import RuleSet
from sarl_core.rollouts.steps import StepTable

if TYPE_CHECKING:
    import pandas as pd

FORMAT, VERSION = "sarl-steps", 1


@dataclass(frozen=True, eq=False)
class RecordedSteps:
    """Recorded steps and what is known about them.

    Attributes:
        steps: T of them.
        env_id: Environment.
        agent: Who acted.
        seeds: Of the episodes, in their order.
        features: The d features.
        rule_set: Whose rules were in force, or None.
        chosen: What was left of how many steps, in words; "" for all.
    """

    steps: StepTable
    env_id: str
    agent: str
    seeds: Sequence[int]
    features: Sequence[Feature]
    rule_set: RuleSet | None
    chosen: str = ""

    @property
    def all_features(self) -> tuple[Feature, ...]:
        """The d features, and what the rules derive from them."""
        further = () if self.rule_set is None else self.rule_set.source.features
        return (*self.features, *further[len(self.features) :])

    def to_frame(self) -> pd.DataFrame:
        """One row a step.

        Returns:
            The columns of `StepTable.to_frame`, the episode's `seed` after its number, and after
            each `rule` column the rule's id in a `rule_id` column, empty where none applies. What
            the features say of a column of words stands in one column, in words.
        """
        features = self.all_features
        states = extend(self.steps.observation, features)
        steps = replace(self.steps, observation=states)
        frame = steps.to_frame([feature.name for feature in features])
        for column in state_columns(features):
            if column.of_words:
                names = [f"obs_{feature.name}" for feature in column.features]
                place = list(frame.columns).index(names[0])
                frame = frame.drop(columns=names)
                words = column.words(states)
                frame.insert(place, f"obs_{column.title}", words, allow_duplicates=True)
        seeds = [int(seed) for seed in self.seeds]
        frame.insert(1, "seed", [seeds[episode] for episode in self.steps.episode.tolist()])
        if self.rule_set is None:
            return frame
        ids = [*(rule.id for rule in self.rule_set.rules), None]  # -1 is the last one
        many = self.steps.rules.shape[1] > 1
        for dimension, rules in enumerate(self.steps.rules.T.tolist()):
            ending = f"_{dimension}" if many else ""
            place = list(frame.columns).index(f"rule{ending}") + 1
            frame.insert(place, f"rule_id{ending}", [ids[rule] for rule in rules])
        return frame


def steps_to_csv(record: RecordedSteps) -> bytes:
    """Steps as CSV, every number in full.

    Args:
        record: The steps.

    Returns:
        The file's content; nothing in it is taken for a formula.
    """
    return str(safe_cells(record.to_frame()).to_csv(index=False)).encode()


def steps_to_parquet(record: RecordedSteps) -> bytes:
    """Steps as Parquet, with a description under the schema's key ``sarl`` (JSON).

    Args:
        record: The steps.

    Returns:
        The file's content.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    rule_set = record.rule_set
    described = {
        "format": FORMAT,
        "version": VERSION,
        "env_id": record.env_id,
        "agent": record.agent,
        "seeds": [int(seed) for seed in record.seeds],
        "features": [{"name": one.name, "unit": one.unit} for one in record.all_features],
        "rules": None if rule_set is None else len(rule_set.rules),
        "demonstrations": None if rule_set is None else rule_set.source.digest,
        "chosen": record.chosen,
    }
    table = pa.Table.from_pandas(record.to_frame(), preserve_index=False)
    out = io.BytesIO()
    pq.write_table(
        table.replace_schema_metadata({KEY: json.dumps(described, ensure_ascii=False)}),
        out,
        compression="zstd",
    )
    return out.getvalue()
