"""How a motion shows itself in a notebook, as a picture and in rerun's viewer; what draws is imported when asked."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from motionlake.arrays import Float64Array

_DRAWN_BY: Final = "motionlake.pictures.notebook"  # of a higher room: a body in numbers knows no pictures


class ShownMotion:
    """What a motion with joints `positions` [F, 21, 3], metres, at `fps` frames a second shows of itself."""

    fps: float
    positions: Float64Array

    def _repr_html_(self) -> str:
        """A player, for notebooks."""
        shown: str = import_module(_DRAWN_BY).motion_html(self)
        return shown

    def plot(self, moments: int = 12) -> Any:
        """A picture of the motion as stick figures, from the first frame to the last.

        Examples:
            >>> lake.motion("humanoid3d_walk").plot()
            <Drawing of 60 frames>

        Args:
            moments: how many figures, 1 to 40.

        Returns:
            A `motionlake.pictures.notebook.Drawing`: a notebook shows it, `.save("walk.png")` writes it (PNG, SVG or
            PDF), `.figure` is the figure of matplotlib.

        Raises:
            UserError: no frames, or another number of moments.
        """
        return import_module(_DRAWN_BY).motion_plot(self, moments)

    def to_rerun(self, name: str = "motion", recording: Any = None) -> Any:
        """The motion as points and lines of rerun, over the timelines "frame" and "seconds".

        rerun is an extra: `pip install 'motionlake[rerun]'`.

        Examples:
            motion.to_rerun().save("walk.rrd")  # a file for `rerun walk.rrd`
            motion.to_rerun().spawn()  # the viewer on this machine

        Args:
            name: under which path of the recording it lies.
            recording: a `rerun.RecordingStream` that it is written into, as beside another motion; None: a new one.

        Returns:
            The recording.

        Raises:
            UserError: rerun is not installed, or there are no frames.
        """
        return import_module("motionlake.pictures.rerun_recording").to_rerun(self, name, recording)
