"""Where compiled kernels and fonts are kept for a user who can write neither to the program's folder nor to a home."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import Final

# What says where numba and matplotlib keep theirs, and whether the folder of the program would do as well.
_SETTINGS: Final = {"NUMBA_CACHE_DIR": True, "MPLCONFIGDIR": False}


def settle() -> None:
    """Name a folder in the temporary one to numba and matplotlib, where they would fail or complain without."""
    program = Path(__file__).parent
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path(os.environ.get("HOME", "/"), ".cache"))
    at_home = os.access(next(place for place in (home, *home.parents) if place.exists()), os.W_OK)
    for name, beside_program in _SETTINGS.items():
        if name not in os.environ and not at_home and not (beside_program and os.access(program, os.W_OK)):
            os.environ[name] = str(_own_folder() / name.lower())


def _own_folder() -> Path:
    """A folder that nobody else can write to: what is kept there is run."""
    import tempfile  # needed by few

    folder = Path(tempfile.gettempdir()) / f"motionlake-cache-{os.geteuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    own = stat.S_ISDIR(found.st_mode) and found.st_uid == os.geteuid() and not found.st_mode & 0o077
    return folder if own else Path(tempfile.mkdtemp(prefix="motionlake-cache-"))
