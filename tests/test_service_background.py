"""What a service does in the background ends before the process does."""

from __future__ import annotations

import threading
import time

from motionlake.service.background import end_background, in_background


def test_work_is_waited_for_but_not_for_long() -> None:
    done, go_on = threading.Event(), threading.Event()

    def soon() -> None:
        time.sleep(0.05)
        done.set()

    in_background(soon)
    in_background(go_on.wait)
    started = time.monotonic()
    assert not end_background(0.2)
    assert done.is_set()
    assert time.monotonic() - started < 5
    go_on.set()
    assert end_background(5)
