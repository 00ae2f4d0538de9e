"""How much visitors of a dashboard may ask of the machine that serves it."""

from __future__ import annotations

import json
import os
from typing import Annotated

import msgspec

from sarl_core.documents import conformed, parse_json

VARIABLE = "SARL_APP_LIMITS"
"""The environment variable of the server's process; there where its settings name limits."""

Gibibytes = Annotated[float, msgspec.Meta(ge=0.25, le=65536.0)]


class ServerLimits(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What visitors may ask for.

    Attributes:
        upload_mb: Of a file that is uploaded, in MB.
        jobs: Long work that goes on at once, of all visitors; the rest waits for its turn.
        jobs_each: The same, of one visitor.
        learning_steps: Of each learner in a study.
        learning_seeds: Learners of each kind in a study.
        memory_gib: What the server and its processes may take, in GiB, for new work to begin and
            for demonstrations to be read; None where nobody looks.
    """

    upload_mb: Annotated[int, msgspec.Meta(ge=1, le=100_000)] = 200
    jobs: Annotated[int, msgspec.Meta(ge=1, le=1000)] = 6
    jobs_each: Annotated[int, msgspec.Meta(ge=1, le=1000)] = 3
    learning_steps: Annotated[int, msgspec.Meta(ge=1000, le=100_000_000)] = 500_000
    learning_seeds: Annotated[int, msgspec.Meta(ge=1, le=100)] = 5
    memory_gib: Gibibytes | None = None

    def to_text(self) -> str:
        """What `of_process` reads in the environment."""
        return json.dumps(msgspec.structs.asdict(self))

    @classmethod
    def of_process(cls) -> ServerLimits:
        """Those that this process, a dashboard's, was started with."""
        text = os.environ.get(VARIABLE, "")
        return conformed(parse_json(text), cls) if text else cls()
