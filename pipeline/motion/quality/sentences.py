"""What a fault is, in a plain sentence."""

from __future__ import annotations

from typing import Final

from motionlake.motion.quality.faults import Fault

_SAYS: Final = {
    "slide": "{joint} slides {severity:.2f} m/s in {when} while the body stands",
    "penetration": "{joint} sinks {cm:.0f} cm below the ground in {when}",
    "floating": "the body hangs {cm:.0f} cm above the ground in {when}, longer than a jump lasts",
    "jitter": "{joint} trembles by {mm:.1f} mm from frame to frame in {when}",
    "spike": "{joint} leaves its path by {cm:.0f} cm at {at}",
    "flip": "{joint} turns by {severity:.0f} degrees from one frame to the next at {at}",
    "frozen": "{joint} stands still to the last digit in {when}",
    "missing": "joints were missing in {percent:.0f} % of the frames, and were filled when the file was read",
    "limb_drift": "the bone that ends at the {joint} changes its length by {percent:.0f} % in {when}",
    "tpose_start": "it begins with a T-pose of {severity:.2f} s",
    "tpose_end": "it ends with a T-pose of {severity:.2f} s",
    "fps": "it plays {severity:.2g} times as fast as bodies fall and step: its frame rate may be wrong",
    "unit": "the body is {severity:.2f} m from the ankles to the head: its length unit may be wrong",
    "up": "the body is never less than {severity:.0f} degrees from upright: its up axis may be wrong",
    "swapped_sides": "knees and toes point backwards in {when}: left and right may be exchanged",
    "seam": "the whole body jumps by {cm:.0f} cm, or starts again as it was, at {at}",
}


def sentence(fault: Fault, fps: float) -> str:
    """A fault in words, its time in seconds of the clip."""
    start, stop = fault.start / fps, fault.stop / fps
    return _SAYS[fault.kind].format(
        joint=fault.joint.replace("_", " ") or "the body", severity=fault.severity, cm=100 * fault.severity,
        mm=1000 * fault.severity, percent=100 * fault.severity, when=f"{start:.2f}-{stop:.2f} s", at=f"{start:.2f} s",
    )  # fmt: skip
