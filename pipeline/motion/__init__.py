"""A body in numbers: clips, rotations, kinematics, rigs and the canonical skeleton, features, frame distances."""
