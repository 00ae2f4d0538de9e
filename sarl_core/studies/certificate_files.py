"""Certificates as files; read back, they say the same or are refused."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta, Struct
from msgspec.structs import asdict

from sarl_core.documents import Count, MisfitError, Share, conformed, parse_json
from sarl_core.errors import InputError
from sarl_core.files import as_path, whole_file
from sarl_core.limits import limited_bytes
from sarl_core.studies.certificate import Certificate, Subject
from sarl_core.studies.sequential_test import (
    SequentialTest,
    Verdict,
    chances,
    sequential_test,
)

FORMAT, VERSION = "sarl-certificate", 1
_ROUNDING = 1e-3  # of a look: as far as another processor may move it
_Positive = Annotated[int, Meta(ge=1, le=2**53)]


class _Seeds(Struct, forbid_unknown_fields=True):
    first: Count
    last: Count


class _Ends(Struct, forbid_unknown_fields=True):
    low: Share
    high: Share
    certainty: Share


class _Looks(Struct, forbid_unknown_fields=True):
    certified: tuple[_Positive, ...]
    refused: tuple[Count, ...]


class _Tested(Struct, forbid_unknown_fields=True):
    env_id: str
    env_arguments: str
    wrappers: tuple[str, ...]
    package: str
    failure: str
    agent: str
    agent_digest: str
    sampled: bool
    rules: Count
    rules_digest: str
    projection: str
    outside: str
    on_invalid: str
    max_steps: _Positive


class _CertificateDocument(Struct, forbid_unknown_fields=True):
    format: str
    version: int
    certified: bool | None
    at_most: Share
    certainty: Share
    episodes: Count
    failures: Count
    undecided: Count
    most_episodes: _Positive
    seeds: _Seeds
    interval: _Ends
    tested: _Tested
    looks: _Looks
    made: str
    command: str
    versions: dict[str, str]
    notes: tuple[str, ...]


def certificate_document(certificate: Certificate) -> dict[str, Any]:
    """A certificate as JSON has it, in a file and in what ``certify --json`` prints.

    Args:
        certificate: Whatever its verdict.

    Returns:
        All of it. `interval` is the 95 % interval that `evaluate` would tell of these episodes,
        and no part of the verdict; `looks` are those of the `SequentialTest`.
    """
    test, verdict, rate = certificate.test, certificate.verdict, certificate.rate
    tested = _Tested(**vars(certificate.subject))
    return {
        "format": FORMAT,
        "version": VERSION,
        "certified": verdict.certified,
        "at_most": test.at_most,
        "certainty": test.certainty,
        "episodes": verdict.episodes,
        "failures": verdict.failures,
        "undecided": verdict.undecided,
        "most_episodes": test.episodes,
        "seeds": {"first": certificate.seed, "last": certificate.last_seed},
        "interval": {"low": rate.low, "high": rate.high, "certainty": 0.95},
        "tested": {
            name: list(value) if isinstance(value, tuple) else value
            for name, value in asdict(tested).items()
        },
        "looks": {"certified": list(test.certified), "refused": list(test.refused)},
        "made": certificate.made,
        "command": certificate.command,
        "versions": dict(certificate.versions),
        "notes": list(certificate.notes),
    }


def certificate_from(document: object, *, name: str) -> Certificate:
    """A certificate that was written.

    Args:
        document: What was parsed.
        name: What to call it in an error.

    Returns:
        The certificate.

    Raises:
        InputError: If it is something else, of a version that is not known, or does not hold
            together: if its looks are not those of its test, or its counts do not give its
            verdict.
    """
    advice = "make the certificate again with `sarl certify`"
    if not isinstance(document, Mapping) or document.get("format") != FORMAT:
        raise InputError(f"{name} is no certificate; give a file that `sarl certify` wrote")
    if document.get("version") != VERSION:
        raise InputError(
            f"{name} is a certificate of a version that this program does not read; {advice}"
        )
    try:
        read = conformed(document, _CertificateDocument)
        usual = sequential_test(read.at_most, read.certainty, read.most_episodes)
    except (MisfitError, InputError) as error:
        raise InputError(f"{name} cannot be read ({error}); {advice}") from error
    test = replace(usual, certified=read.looks.certified, refused=read.looks.refused)
    verdict = Verdict(read.certified, read.episodes, read.failures, read.undecided)
    certificate = Certificate(
        Subject(**asdict(read.tested)),
        test,
        verdict,
        read.seeds.first,
        read.made,
        read.command,
        tuple(read.versions.items()),
        read.notes,
    )
    whole = (
        _is_same_test(test, usual)
        and _gives(test, verdict)
        and read.seeds.last == certificate.last_seed
    )
    if not whole:
        raise InputError(
            f"{name} does not hold together: its counts are not those of its verdict; {advice}"
        )
    return certificate


def load_certificate(path: str | Path) -> Certificate:
    """Read a certificate.

    Args:
        path: Of a file that `save_certificate` wrote.

    Raises:
        InputError: As of `certificate_from`, or if the file cannot be read.
    """
    path = as_path(path)
    try:
        document = parse_json(limited_bytes(path))
    except (OSError, ValueError, InputError) as error:
        reason = (isinstance(error, OSError) and error.strerror) or error
        raise InputError(
            f"{path} cannot be read ({reason}); give a file that `sarl certify` wrote"
        ) from error
    return certificate_from(document, name=str(path))


def certificate_to_json(certificate: Certificate) -> str:
    """The text of a certificate's file."""
    return json.dumps(certificate_document(certificate), indent=1, ensure_ascii=False) + "\n"


def save_certificate(certificate: Certificate, path: str | Path) -> None:
    """Write a certificate.

    Args:
        certificate: Whatever its verdict.
        path: With the ending ``.json``.

    Raises:
        InputError: If its folder does not exist, or it ends in something else.
        WorkError: If it cannot be written.
    """
    with whole_file(as_path(path, ending=".json")) as unfinished:
        unfinished.write_text(certificate_to_json(certificate), encoding="utf-8")


def _is_same_test(test: SequentialTest, usual: SequentialTest) -> bool:
    """Whether looks are those of a test, but for what another processor rounds otherwise.

    Whatever rounding moves is an episode or two of the late looks. So looks that lie elsewhere are
    not this test's, and those that lie there must keep to its error all the same.
    """
    if test == usual:
        return True
    every = ((test.certified, usual.certified), (test.refused, usual.refused))
    near = all(
        abs(len(one) - len(other)) <= 1
        and all(abs(look - at) <= 1 + at * _ROUNDING for look, at in zip(one, other, strict=False))
        and list(one) == sorted(one)
        and (not one or one[-1] <= test.episodes)
        for one, other in every
    )
    if not near:
        return False
    wrong, allowed = chances(test, test.at_most), (1.0 - test.certainty) * (1.0 + 1e-6)
    return wrong.certified <= allowed and wrong.refused <= allowed


def _gives(test: SequentialTest, verdict: Verdict) -> bool:
    """Whether such counts bring such a verdict, and not another one before."""
    sure, possible = verdict.failures, verdict.failures + verdict.undecided
    if not possible <= verdict.episodes <= test.episodes:
        return False
    if verdict.certified:
        return possible < len(test.certified) and test.certified[possible] == verdict.episodes
    if verdict.certified is None:
        return verdict.episodes == test.episodes
    return 0 < sure <= len(test.refused) and verdict.episodes <= test.refused[sure - 1]
