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
for path in map(Path, sys.argv[1:]):
    print(path.name, flush=True)
    READERS[path.suffix[1:]].check(path.read_bytes())
"""


def test_what_was_found_is_read_or_refused_in_one_sentence() -> None:
    # In a process of its own, because one of them ended the whole process.
    done = subprocess.run(
        [sys.executable, "-c", READ, *map(str, FOUND)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    # Where it ended, the last name is that of the file that ended it.
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
    assert done.stdout.split() == [path.name for path in FOUND]


@pytest.mark.parametrize("name", [name for name in READERS if name != "model"])
def test_the_files_that_fuzzing_begins_with_are_read_or_refused(name: str) -> None:
    seeds = READERS[name].seeds()
    assert seeds
    for seed in seeds:
        READERS[name].check(seed)
