"""Files of a lake by their relative names: none leads out of it."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from motionlake.errors import UserError
from motionlake.lake.layout import Lake

PIECES = ("frames", "part.parquet", "..", ".", "", "inside", "outside", "file", "link", "lake")


@pytest.fixture(scope="module")
def lake(tmp_path_factory: pytest.TempPathFactory) -> Lake:
    """A lake with links to a folder and a file of its own, and to others."""
    root = tmp_path_factory.mktemp("paths") / "lake"
    (root / "frames").mkdir(parents=True)
    (root / "frames/part.parquet").touch()
    (root.parent / "other").touch()
    for folder in (root, root / "frames"):
        (folder / "inside").symlink_to(root / "frames")
        (folder / "outside").symlink_to(root.parent)
        (folder / "file").symlink_to(root.parent / "other")
        (folder / "link").symlink_to(root / "frames/part.parquet")
    return Lake(root)


@given(st.lists(st.lists(st.sampled_from(PIECES), max_size=5).map("/".join), max_size=4))
def test_paths_are_those_that_names_resolve_to(lake: Lake, names: list[str]) -> None:
    root = lake.root.resolve()
    wanted = [(root / name).resolve() for name in names]
    if all(path.is_relative_to(root) for path in wanted):
        assert lake.paths(names) == wanted
    else:
        with pytest.raises(UserError, match="leads out of the lake"):
            lake.paths(names)


@pytest.mark.parametrize(
    "name", ["/etc", "/etc/passwd", "../other", "outside/other", "file", "frames/file", "frames/../.."]
)
def test_a_name_that_leads_out_is_refused(lake: Lake, name: str) -> None:
    with pytest.raises(UserError, match="leads out of the lake"):
        lake.path(name)
