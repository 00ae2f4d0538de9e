"""Episodes as a table in a Parquet file, which grows while they are played."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.files import whole_file
from sarl_core.progress import Progress, part_of
from sarl_core.rollouts.episodes import Episodes, join, rollout

_AT_ONCE = 10_000  # episodes of a row group


def rollout_into(
    path: Path,
    env_id: EnvironmentOrId,
    agent: Any,
    *,
    episodes: int,
    seed: int = 0,
    progress: Progress | None = None,
    **settings: Any,
) -> Episodes:
    """Run episodes as `rollout`, and write them down, some thousand at a time.

    Args:
        path: A Parquet file, one row an episode as `Episodes.to_frame` has it; it appears when all
            are played.
        env_id: As of `rollout`.
        agent: Likewise.
        episodes: How many.
        seed: Of the first.
        progress: As of `rollout`.
        settings: The others of `rollout`.

    Returns:
        The episodes without their steps, the same as those of `rollout`.

    Raises:
        InputError: As `rollout`.
        WorkError: Likewise; or if the file cannot be written.
        CancelledError: If the caller wants no more.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    parts: list[Episodes] = []
    with whole_file(path) as unfinished:
        writer: Any = None
        try:
            for start in range(0, episodes, _AT_ONCE):
                part = rollout(
                    env_id,
                    agent,
                    episodes=min(_AT_ONCE, episodes - start),
                    seed=seed + start,
                    progress=part_of(progress, start, episodes),
                    **(settings | {"keep_steps": False}),
                )
                table = pa.Table.from_pandas(part.to_frame(), preserve_index=False)
                writer = writer or pq.ParquetWriter(unfinished, table.schema)
                writer.write_table(table)
                parts.append(part)
        finally:
            if writer is not None:
                writer.close()
    return join(parts)
