"""Fuzz one reader until it fails or the time is up; started by ``python -m tests.fuzz``."""

from __future__ import annotations

import random
import sys
import warnings

import atheris

with atheris.instrument_imports(include=["sarl_core", "zipfile", "json", "csv"]):
    from tests.fuzz.readers import READERS

name = sys.argv.pop(1)
reader = READERS[name]
warnings.simplefilter("error")


def one(data: bytes) -> None:
    reader.check(data)


def mutate(data: bytes, most: int, seed: int) -> bytes:
    mutated = reader.mutate(data, random.Random(seed), lambda part: atheris.Mutate(part, most))
    return mutated if len(mutated) <= most else data


atheris.Setup(sys.argv, one, custom_mutator=mutate)
atheris.Fuzz()
