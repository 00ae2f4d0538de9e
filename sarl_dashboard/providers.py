"""Who vouches for visitors (OpenID Connect), as Streamlit's secrets have it."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import streamlit as st
from streamlit import config

from sarl_core.errors import InputError

_ADVICE = "the guide shows under On a server what stands in them"


@cache
def are_named() -> bool:
    """Whether anybody does, when first looked at: as the server starts, for as long as it runs.

    Streamlit goes on without secrets that it cannot read, also where that happens to them later,
    and would let everybody in.

    Raises:
        InputError: If the secrets cannot be read, or should name somebody and do not.
    """
    for path in map(Path, config.get_option("secrets.files")):
        try:
            if path.is_dir() and path.suffix != ".toml":  # a secret a file, as Kubernetes has them
                continue
            document = tomllib.loads(path.read_bytes().decode())
        except FileNotFoundError:
            continue
        except (OSError, ValueError) as error:
            reason = (isinstance(error, OSError) and error.strerror) or error
            raise InputError(
                f"the secrets {path} cannot be read ({reason}); let whoever runs the dashboard "
                f"read that file, or take it away; {_ADVICE}"
            ) from error
        if "auth" in document and not (isinstance(document["auth"], dict) and document["auth"]):
            raise InputError(f"'auth' in the secrets {path} names nobody; {_ADVICE}")
    return bool(section())


def section() -> Mapping[str, Any]:
    """What the secrets say of them now; nothing where they say nothing or cannot be read."""
    return dict(st.secrets.get("auth", {})) if st.secrets.load_if_toml_exists() else {}
