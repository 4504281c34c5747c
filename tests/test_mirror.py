"""Mirrored features, against features of canonical motion that was mirrored before."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from motionlake.deep_motifs.motifs import assign
from motionlake.deep_motifs.signatures import signature
from motionlake.deep_motifs.words.network import load_network
from motionlake.lake.catalog import reading
from motionlake.lake.config import load_config
from motionlake.lake.layout import open_lake
from motionlake.motion.features import WordConfig, mirrored_features, word_features, word_windows
from motionlake.motion.kinematics import forward_kinematics
from motionlake.motion.skeleton import INDEX, mirrored_positions, mirrored_rotations
from motionlake.stages.motif_model import MOTIF_MODEL, read_motifs
from motionlake.stages.reader import LakeReader
from motionlake.stages.word_network import WORD_NETWORK

from tests.lakes import QUICK, canonical_clips, motionlake, query

CONFIGS = [
    WordConfig(),
    WordConfig(joints="deep_motifs16"),
    WordConfig(root_weight=0.0),
    WordConfig(velocity_weight=0.0),
    WordConfig.deep_motifs(),
]


@pytest.mark.parametrize("config", CONFIGS, ids=lambda c: f"{c.representation}-{c.joints}-{c.dimension}")
def test_mirrored_features_are_those_of_the_mirrored_clip(built_lake: Path, config: WordConfig) -> None:
    for clip, fps, positions, rotations in canonical_clips(built_lake):
        features = word_features(positions, rotations, fps, config)
        there, turned = mirrored_positions(positions).astype(float), mirrored_rotations(rotations).astype(float)
        expected = word_features(there, turned, fps, config)
        if config.representation == "rotations":  # q and -q are one rotation where w is 0
            signs = np.sign(np.sum((expected * mirrored_features(features, config)).reshape(len(features), -1, 4), -1))
            expected = expected * np.repeat(signs, 4, axis=1).astype(np.float32)
        np.testing.assert_allclose(mirrored_features(features, config), expected, atol=2e-6, err_msg=clip)
        assert np.abs(expected - features).max() > 0.01, clip


@pytest.mark.parametrize("config", CONFIGS, ids=lambda c: f"{c.representation}-{c.joints}-{c.dimension}")
def test_mirrored_twice_is_the_clip_itself(config: WordConfig) -> None:
    features = np.random.default_rng(0).standard_normal((9, config.dimension)).astype(np.float32)
    np.testing.assert_array_equal(mirrored_features(mirrored_features(features, config), config), features)


def test_rotations_mirror_as_positions_do(built_lake: Path) -> None:
    """Joints turned by mirrored rotations come where the mirrored joints are."""
    rest = dict(query(built_lake, "SELECT clip, rest_offsets FROM clips"))
    for clip, _, positions, rotations in canonical_clips(built_lake)[::4]:
        offsets = np.array(rest[clip], dtype=float).reshape(-1, 3)
        mirrored_offsets = mirrored_positions(offsets[None])[0]
        root = positions[:, INDEX["hips"]]
        there = forward_kinematics(root * [-1, 1, 1], mirrored_rotations(rotations).astype(float), mirrored_offsets)
        expected = mirrored_positions(forward_kinematics(root, rotations, offsets))
        np.testing.assert_allclose(there, expected, atol=1e-9)


def test_features_of_another_width_are_refused() -> None:
    with pytest.raises(ValueError, match="do not fit"):
        mirrored_features(np.zeros((3, 5), dtype=np.float32), WordConfig())


def test_the_stage_signs_the_mirrored_clips(built_lake: Path) -> None:
    lake = open_lake(built_lake)
    config = load_config(lake.config_file)
    with reading(lake) as con:
        at = LakeReader(con, lake, config)
        network, model = WORD_NETWORK.serving(at), MOTIF_MODEL.serving(at)
        idf = np.array([row[0] for row in con.execute("SELECT idf FROM motifs ORDER BY motif").fetchall()])
    embedder, vocabulary = load_network(lake.path(network.file)), read_motifs(lake.path(model.file))
    served = dict(query(built_lake, "SELECT clip, signature FROM mirrored_signatures"))
    own = dict(query(built_lake, "SELECT clip, signature FROM signatures"))
    assert served.keys() == own.keys()
    for clip, fps, positions, rotations in canonical_clips(built_lake):
        there, turned = mirrored_positions(positions).astype(float), mirrored_rotations(rotations).astype(float)
        features = word_features(there, turned, fps, config.words)
        found = assign(embedder.embed(word_windows(features, config.words)), vocabulary)
        expected = signature(np.bincount(found, minlength=vocabulary.k), idf)
        np.testing.assert_allclose(served[clip], expected, atol=1e-6)
    assert served != own


def test_mirrored_signatures_follow_the_motifs_that_are_served(lake: Path, scheduler: str) -> None:
    def run(stage: str) -> list[tuple[object, ...]]:
        done = motionlake("run", stage, "--lake", lake, "--scheduler", scheduler)
        assert done.status == 0, done.err
        return query(lake, "SELECT clip, len(signature) FROM mirrored_signatures ORDER BY clip")

    before = query(lake, "SELECT clip, len(signature) FROM mirrored_signatures ORDER BY clip")
    (lake / "config.toml").write_text(QUICK.replace("k = 12", "k = 7"), encoding="utf-8")
    # New motifs serve nothing until their signatures do.
    assert run("motifs") == before
    assert run("mirrored") == before
    assert run("signatures") == []
    assert run("mirrored") == [(clip, 7) for clip, _ in before]
    assert motionlake("remove", before[0][0], "--lake", lake).status == 0
    assert query(lake, "SELECT clip FROM mirrored_signatures ORDER BY clip") == [(clip,) for clip, _ in before[1:]]
