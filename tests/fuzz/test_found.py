"""What the fuzzer found once: each of these files ended a reader in another way than it should."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.fuzz.readers import READERS

ROOT = Path(__file__).parents[2]
FOUND = sorted((Path(__file__).parent / "found").iterdir())
READ = """
import sys, warnings
from pathlib import Path
from tests.fuzz.readers import READERS
warnings.simplefilter("error")
READERS[sys.argv[1]].check(Path(sys.argv[2]).read_bytes())
"""


@pytest.mark.parametrize("path", FOUND, ids=lambda path: path.name)
def test_what_was_found_is_read_or_refused_in_one_sentence(path: Path) -> None:
    # In a process of its own, because one of them ended the whole process.
    name = path.suffix[1:]
    done = subprocess.run(
        [sys.executable, "-c", READ, name, str(path)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", [name for name in READERS if name != "model"])
def test_the_files_that_fuzzing_begins_with_are_read_or_refused(name: str) -> None:
    seeds = READERS[name].seeds()
    assert seeds
    for seed in seeds:
        READERS[name].check(seed)
