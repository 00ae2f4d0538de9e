"""Starts the dashboard: `streamlit run app.py`.

The navigation lives in `pages/_router.py`. Were it here, Streamlit would take `pages/` for its
older kind of multipage app and run a page file alone when a fresh server is first visited by a
deep link.
"""

from __future__ import annotations

import atexit
import sys
from contextlib import ExitStack
from importlib import import_module
from pathlib import Path
from threading import Thread

import streamlit as st

from sarl_core.errors import InputError
from sarl_core.files import temporary_folder
from sarl_dashboard import providers
from sarl_dashboard.serving.log_lines import write_json_lines
from sarl_dashboard.serving.routes import routes

write_json_lines()
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

# Importing what grows trees takes as long as a browser takes to begin.
Thread(target=import_module, args=("sklearn.tree",), daemon=True).start()

app = st.App(_PAGES / "_router.py", routes=routes())
