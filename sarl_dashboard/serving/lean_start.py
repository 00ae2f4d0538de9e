"""What Streamlit does as it starts, and nobody here needs."""

from __future__ import annotations

from contextlib import suppress

from streamlit import delta_generator


def lean_start() -> None:
    """Leave out what takes a tenth of a start; no option of Streamlit turns it off.

    Before it serves the first visitor it reads the metadata of every installed package, to find
    components in it: pages use only those they define themselves. And as the first element is
    written it looks up the file of every loaded module, to warn whoever wrote it at a Python
    prompt.
    """
    with suppress(ImportError):  # where a later Streamlit finds components elsewhere
        from streamlit.components.v2 import manifest_scanner

        manifest_scanner.scan_component_manifests = lambda *_, **__: []
    delta_generator._use_warning_has_been_displayed = True
