"""What several test folders share."""

from __future__ import annotations

import os

# Three workers have two cores: threads of theirs would wait for each other, spinning. Matrices are
# small here, and processes that tests start inherit it.
os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"
# Each of those processes would compile all that it loads.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

import numpy as np
import pytest
from hypothesis import settings

from sarl_core import Demonstrations, PolicyTree, grow_policy_trees
from tests.toys import TOYS

# An example that takes long on a busy machine is no failure.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")


@pytest.fixture(scope="session", autouse=True)
def own_library(tmp_path_factory: pytest.TempPathFactory) -> None:
    """What tests upload is kept nowhere else."""
    os.environ["SARL_LIBRARY"] = str(tmp_path_factory.mktemp("kept"))
    os.environ["SARL_AUTHOR"] = "Tester"


@pytest.fixture(scope="session")
def lander_like() -> Demonstrations:
    """Two thousand noisy steps with eight features and four labels."""
    rng = np.random.default_rng(7)
    observations = rng.normal(size=(2000, 8)).astype(np.float32)
    labels = (observations[:, 0] * observations[:, 1] > 0) + 2 * (observations[:, 2] > 0.5)
    noisy = rng.random(2000) < 0.1
    labels = np.where(noisy, rng.integers(0, 4, 2000), labels)
    return Demonstrations(observations, labels, np.repeat(np.arange(20), 100))


@pytest.fixture(params=sorted(TOYS))
def toy_id(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="session")
def lander_trees(lander_like: Demonstrations) -> tuple[PolicyTree, ...]:
    return grow_policy_trees(lander_like)
