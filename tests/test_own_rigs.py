"""A rig that nobody knows, from its starter map into a lake; options of a folder that stay, and are undone."""

from __future__ import annotations

from pathlib import Path

from motionlake.motion.units import UNITS

from tests.lakes import made_clips, motionlake
from tests.samples import FLAT, KINECT_1, npz_bytes, swinging_body


def renamed(folder: Path) -> Path:
    """A folder of made clips, of which one has joint names that only it knows, and no tree that tells a body."""
    made_clips(folder, 2)
    names = tuple(f"CC_Base_{name}_of_ours" for name in KINECT_1)
    (folder / "ours.npz").write_bytes(npz_bytes(swinging_body(40) / UNITS["in"], names, FLAT, 30.0))
    return folder


def rigs_of(lake: Path) -> dict[str, str]:
    rows = motionlake("sql", "SELECT clip, rig FROM clips", "--json", "--lake", lake).json
    return {row["clip"].rpartition("/")[2]: row["rig"] for row in rows}


def test_a_starter_map_takes_its_file_in_and_no_option_drops_another(tmp_path: Path) -> None:
    source, lake = renamed(tmp_path / "shots"), tmp_path / "lake"
    refused = motionlake("ingest", source, "--lake", lake)
    assert "ours.npz: unknown rig" in refused.err
    others = rigs_of(lake)
    assert others
    assert "ours.npz" not in others

    (lake / "rigs").mkdir(exist_ok=True)
    starter = lake / "rigs" / "ours.toml"
    starter.write_text(motionlake("rig", source / "ours.npz").out, encoding="utf-8")
    taken = motionlake("ingest", source, "--lake", lake, "--rig", "my_rig")
    assert taken.status == 0, taken.err
    assert rigs_of(lake) == others | {"ours.npz": "my_rig"}
    notes = motionlake("sql", "SELECT notes FROM clips WHERE rig = 'my_rig'", "--json", "--lake", lake).json
    assert any("unit 0.0254 m, by body height" in note for note in notes[0]["notes"])

    again = motionlake("ingest", source, "--lake", lake)
    assert f"{source}: is taken in with --rig my_rig, as before; --rig auto undoes it" in again.err

    starter.unlink()
    for words in (["ingest", source], ["run", "frames"]):
        lost = motionlake(*words, "--lake", lake)
        assert lost.status == 2
        assert "there is no such map any more" in lost.err
        assert "--rig auto" in lost.err
        assert "Traceback" not in lost.err
    undone = motionlake("ingest", source, "--lake", lake, "--rig", "auto")
    assert "ours.npz: unknown rig" in undone.err
    assert rigs_of(lake) == others
    assert "as before" not in motionlake("ingest", source, "--lake", lake).err
