"""What is chosen, and the cached ways to everything that follows from it.

The URL holds every choice. Widgets that can bind themselves to it; the choices that cannot (the
data set, whose name on screen is not its name in the URL, and the rule, which is a selection in
a table) go through `url_choice`.
"""

from __future__ import annotations

from typing import cast

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import SarlError
from sarl_core.shipped import DATA
from sarl_dashboard.cache import cached, visit
from sarl_dashboard.state import combining, formulas, given_names, hold_out
from sarl_dashboard.state.hold_out import Parts
from sarl_dashboard.state.url import set_url_choice, url_choice
from sarl_dashboard.text import refuse

SHIPPED_SETS = {
    "lunar_lander": ("Lunar Lander", "LunarLander-v3"),
    "cartpole": ("Cart Pole", "CartPole-v1"),
    "pendulum": ("Pendulum", "Pendulum-v1"),
    "bipedal_walker": ("Bipedal Walker", "BipedalWalker-v3"),
    "lunar_lander_continuous": ("Lunar Lander, continuous", "LunarLanderContinuous-v3"),
    "driving": ("Driving", "Driving-v0"),
}
UPLOAD = "upload"
DEFAULT_DATA = "lunar_lander"
DATA_FOLDER = DATA / "demonstrations"


# --- what is chosen ----------------------------------------------------------------------------


def dataset_names() -> tuple[str, ...]:
    """What the URL parameter `data` may be: the shipped sets, and "upload"."""
    return (*SHIPPED_SETS, UPLOAD)


def dataset_label(name: str) -> str:
    """What a data set is called on screen."""
    return SHIPPED_SETS[name][0] if name in SHIPPED_SETS else "Your upload"


def chosen_dataset() -> str:
    """Name of the chosen data set, one of `dataset_names`."""
    return url_choice("data", dataset_names(), DEFAULT_DATA)


def choose_dataset(name: str) -> None:
    """Choose a data set, with all its episodes; for callbacks."""
    hold_out.leave_out(())
    combining.choose_all()
    set_url_choice("data", name, DEFAULT_DATA)


def set_upload(demonstrations: Demonstrations, *, file_name: str = "") -> None:
    """Keep uploaded demonstrations for this session, and choose them.

    Args:
        demonstrations: Read and checked.
        file_name: Shown where the data is named.
    """
    visit().bring(demonstrations.digest)
    st.session_state["_upload"] = demonstrations
    st.session_state["_upload_name"] = file_name
    choose_dataset(UPLOAD)


def upload_name() -> str:
    """Of the file that was uploaded, as the command line would name it."""
    return str(st.session_state.get("_upload_name") or "demonstrations.parquet")


def uploaded_demonstrations() -> Demonstrations | None:
    """The demonstrations uploaded in this session, if any."""
    return cast("Demonstrations | None", st.session_state.get("_upload"))


def raw_demonstrations() -> Demonstrations | None:
    """The chosen demonstrations as they were read; None while nothing is uploaded.

    A shipped file that cannot be read is said on the page, which then stops.
    """
    name = chosen_dataset()
    if name == UPLOAD:
        return uploaded_demonstrations()
    try:
        return shipped_demonstrations(name)
    except SarlError as error:
        refuse(error)
        st.stop()


# The way of the data: as it was read (`raw_demonstrations`), with a visitor's `formulas` and under
# the names given to it (`all_demonstrations`), less what is left out, less what is held out
# (`hold_out`), with combinations of its features (`combining`). What rules are mined from is what
# remains.


def all_demonstrations() -> Demonstrations | None:
    """The chosen demonstrations with every episode; None while nothing is uploaded."""
    raw = raw_demonstrations()
    return None if raw is None else given_names.named(raw)


def data_key() -> str:
    """What tells the data that rules are mined from, whatever names were given to them."""
    raw, choice = raw_demonstrations(), hold_out.chosen()
    drawn = (choice.share, choice.seed) if choice.share else ()
    combinations = combining.chosen()
    derived: tuple[object, ...] = (combinations,) if combinations.on else ()
    if raw is not None and (written := formulas.values_key(raw)) is not None:
        derived += (written,)
    return repr(("" if raw is None else raw.digest, choice.left_out, drawn, *derived))


def uncombined_parts() -> Parts | None:
    """What is mined from and what is held out, as it was observed; None without an upload."""
    demonstrations = all_demonstrations()
    return None if demonstrations is None else hold_out.parted(demonstrations)


def data_parts() -> Parts | None:
    """What is mined from and what is held out; None while nothing is uploaded."""
    parts = uncombined_parts()
    return None if parts is None else combining.combined(parts)


def chosen_demonstrations() -> Demonstrations | None:
    """The demonstrations that rules are mined from, and every page works on.

    None while nothing is uploaded.
    """
    parts = data_parts()
    return None if parts is None else parts.mined


def held_out_demonstrations() -> Demonstrations | None:
    """The episodes that rules are tried on; None where nothing is held out."""
    parts = data_parts()
    return None if parts is None else parts.held_out


def uncombined_demonstrations() -> Demonstrations | None:
    """The chosen demonstrations with no combinations, whatever rules are mined with."""
    parts = uncombined_parts()
    return None if parts is None else parts.mined


def require_demonstrations() -> Demonstrations:
    """The chosen demonstrations; where there are none, say what to do and stop the page."""
    demonstrations = chosen_demonstrations()
    if demonstrations is None:
        st.info(
            "Nothing has been uploaded in this session. Upload a file on the Demonstrations "
            "page, or choose a shipped set in the sidebar.",
            icon=":material/upload_file:",
        )
        st.page_link(
            "demonstrations.py", label="Go to Demonstrations", icon=":material/arrow_forward:"
        )
        st.stop()
    return demonstrations


# --- what follows, cached ----------------------------------------------------------------------


@cached(show_spinner="Reading the demonstrations …")
def shipped_demonstrations(name: str) -> Demonstrations:
    """A shipped set.

    Args:
        name: One of `SHIPPED`.

    Returns:
        Its demonstrations, shared between sessions (they are immutable).
    """
    from sarl_core.demonstrations.formats import load_demonstrations

    return load_demonstrations(DATA_FOLDER / f"{name}.parquet")
