"""The clips and configurations of the lakes that golden records are taken of, as data."""

from __future__ import annotations

from typing import Final

# Folders of recordings: set → files below its folder; labels.csv and segments.csv keep the rows of these.
SOURCES: Final[dict[str, tuple[str, ...]]] = {
    "hdm05": (
        "clips/hopBothLegs1hops/HDM_bk_hopBothLegs1hops_020_120.amc",
        "clips/hopBothLegs1hops/HDM_mm_hopBothLegs1hops_032_120.amc",
        "clips/rotateArmsBothBackward1Reps/HDM_dg_rotateArmsBothBackward1Reps_010_120.amc",
        "clips/rotateArmsBothBackward1Reps/HDM_tr_rotateArmsBothBackward1Reps_014_120.amc",
        "clips/kickLFront1Reps/HDM_bd_kickLFront1Reps_001_120.amc",
        "clips/kickLFront1Reps/HDM_mm_kickLFront1Reps_023_120.amc",
        "clips/elbowToKnee1RepsLelbowStart/HDM_dg_elbowToKnee1RepsLelbowStart_017_120.amc",
        "clips/elbowToKnee1RepsLelbowStart/HDM_mm_elbowToKnee1RepsLelbowStart_019_120.amc",
        "clips/squat1Reps/HDM_bd_squat1Reps_005_120.amc",
        "clips/squat1Reps/HDM_mm_squat1Reps_037_120.amc",
        "clips/HDM_bd.asf", "clips/HDM_bk.asf", "clips/HDM_dg.asf", "clips/HDM_mm.asf", "clips/HDM_tr.asf",
    ),
    "cmu_dance": tuple(f"clips/salsa/{name}.bvh" for name in ("05", "10", "20", "25")),
    "utd_mhad": tuple(
        f"clips/a{action}_s{subject}_t{take}.npz"
        for action in ("01", "09", "22")
        for subject, takes in ((1, 3), (2, 3), (3, 2))
        for take in range(1, takes + 1)
    ),
    "bandai1": tuple(
        f"clips/dataset-1_{name}_001.bvh"
        for name in ("dash_musical", "dash_normal", "run_active", "run_chimpira", "byebye_proud", "walk-back_normal")
    ),
    "cmu_bvh": tuple(f"clips/{name}.bvh" for name in ("02_03", "07_12", "08_01", "08_10", "35_26", "49_04")),
}  # fmt: skip
# Clips of a dataset of its own: one file cut off in the middle of its motion, and a copy of a clip.
COPIED: Final = "bandai1/clips/dataset-1_dash_musical_001.bvh"
CUT_OFF: Final = 2_000

CLIPS: Final = {
    "hop": "hdm05/clips/hopBothLegs1hops/HDM_bk_hopBothLegs1hops_020_120.amc",
    "kick": "hdm05/clips/kickLFront1Reps/HDM_bd_kickLFront1Reps_001_120.amc",
    "salsa": "cmu_dance/clips/salsa/10.bvh",
    "kinect": "utd_mhad/clips/a01_s1_t1.npz",
    "dash": "bandai1/clips/dataset-1_dash_musical_001.bvh",
    "walk": "cmu_bvh/clips/08_01.bvh",
    "stride": "cmu_bvh/clips/08_10.bvh",
    "run": "cmu_bvh/clips/02_03.bvh",
}

# The lake of pretrained models, and the small one of made clips.
READY_CONFIG: Final = '[synthesis]\nweights = "pretrained"\n'
SMALL_CONFIG: Final = '[motifs]\nk = 12\n[synthesis]\nweights = "pretrained"\n'
SMALL_CLIPS: Final = {
    "kinect": "clips/kinect/a1.npz",
    "ntu": "clips/ntu/b1.skeleton",
    "mimic": "clips/deepmimic/c1.txt",
}

# A lake whose models are trained on its clips in seconds, by one recipe and then by the other.
OWN_CONFIG: Final = """
[network]
architecture = "conv"
weights = "own"
steps = 4
max_words = 300
seed = 1
[motifs]
k = 12
[postures]
weights = "own"
m = 20
max_postures = 1500
seed = 1
[descriptors]
weights = "own"
epochs = 2
[submotion]
weights = "own"
steps = 3
batch = 8
hidden = 32
[synthesis]
recipe = "networks"
weights = "own"
epochs = 1
"""
OTHER_CONFIG: Final = """
[network]
weights = "own"
max_words = 300
[motifs]
k = 8
[postures]
weights = "own"
dictionary = "kmeans"
m = 16
representation = "rotations"
root_weight = 0.0
velocity_weight = 0.0
smoothing = 0.0
[symbols]
repeats = false
[descriptors]
recipe = "deephums"
weights = "own"
supervision = "none"
epochs = 1
[submotion]
recipe = "deephums"
weights = "own"
steps = 2
batch = 8
hidden = 32
[synthesis]
recipe = "glogen"
weights = "own"
epochs = 1
"""
