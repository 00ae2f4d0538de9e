"""Makes the font that pictures are lettered with: `python -m docs.scripts.font [FOLDER]`.

FOLDER holds DejaVu Sans Condensed, as Debian's fonts-dejavu-extra brings it. What the product can
write stands in `sarl_core.rendering.canvas.ALPHABET`; the font has these characters and no others.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from fontTools.subset import Options, Subsetter, load_font, save_font

from sarl_core.rendering.canvas import ALPHABET, FONTS

NAMES = ("DejaVuSansCondensed", "DejaVuSansCondensed-Bold")
_NOTICE, _LICENCE = 0, 13  # places in a font's table of names
DEBIAN = Path("/usr/share/fonts/truetype/dejavu")
CARD = {
    "what": "DejaVu Sans Condensed, regular and bold, with the characters that pictures may hold",
    "from": "DejaVu fonts 2.37 (https://dejavu-fonts.github.io), as in Debian's fonts-dejavu-extra",
    "licence": "LICENCE.txt",
    "command": "python -m docs.scripts.font",
}


def main(source: Path) -> None:
    """Write both fonts and their card.

    Args:
        source: Folder of the whole fonts.
    """
    options = Options()
    options.drop_tables += ["FFTM", "GDEF", "GPOS", "GSUB", "MATH"]  # letters stand one by one
    options.hinting = False
    options.bidi_closure = False
    options.name_IDs = [_NOTICE, 1, 2, 4, 6]
    for name in NAMES:
        font = load_font(str(source / f"{name}.ttf"), options)
        licence = font["name"].getDebugName(_LICENCE)
        subsetter = Subsetter(options)
        subsetter.populate(unicodes=map(ord, ALPHABET))
        subsetter.subset(font)
        save_font(font, str(FONTS / f"{name}.ttf"), options)
    text = "\n".join(line.rstrip() for line in licence.splitlines())
    (FONTS / "LICENCE.txt").write_text(f"{text}\n")
    (FONTS / "fonts.json").write_text(json.dumps(CARD, indent=2, ensure_ascii=False) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else DEBIAN)
