"""Starts the dashboard: `streamlit run app.py`.

The navigation lives in `pages/_router.py`. Were it here, Streamlit would take `pages/` for its
older kind of multipage app and run a page file alone when a fresh server is first visited by a
deep link.
"""

from __future__ import annotations

import atexit
import gc
import sys
from contextlib import ExitStack
from importlib import import_module
from pathlib import Path
from threading import Thread

import streamlit as st

from sarl_core.errors import InputError
from sarl_core.files import temporary_folder
from sarl_core.memory import give_back_large_arrays
from sarl_dashboard import providers
from sarl_dashboard.serving.lean_start import lean_start
from sarl_dashboard.serving.log_lines import write_json_lines
from sarl_dashboard.serving.routes import routes

# What libraries consist of stays for good. To look for garbage among it, again and again until the
# last of them is loaded, takes a tenth of a start.
gc.freeze()
gc.disable()

write_json_lines()
lean_start()
give_back_large_arrays()
try:
    providers.check()
except InputError as error:
    sys.exit(f"error: {error}")
_while_it_runs = ExitStack()
_while_it_runs.enter_context(temporary_folder())
atexit.register(_while_it_runs.close)

# Streamlit puts a script's folder first on the import path while it runs, and takes it away again
# unless it was there before. An import in another thread that falls into that moment passes over a
# folder and finds no module.
_PAGES = Path(__file__).parent / "pages"
sys.path.append(str(_PAGES))


def _load() -> None:
    """Load what grows trees, as long as a browser takes to begin; then look for garbage again."""
    try:
        import_module("sklearn.tree")
    finally:
        gc.enable()


Thread(target=_load, daemon=True).start()

app = st.App(_PAGES / "_router.py", routes=routes())
