"""Take down and compare golden records.

python -m bench.golden record --out FILE      two lakes of real recordings (MOTIONLAKE_DATA), some minutes
python -m bench.golden small --out FILE       a lake of made clips, which tests/test_golden.py compares with
python -m bench.golden compare OLD NEW        each entry that differs; exit status 1 if any does

Nothing of the library is imported: commands run by the installed script `motionlake` (`make setup` anew where its entry
has moved), and lakes are read with DuckDB and Arrow. An intended renaming is a line in `RENAMED`, an option that is
called otherwise one in a template, both in `bench.golden.commands`.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from bench.golden.comparing import differences, entries
from bench.golden.recording import record
from bench.golden.serve import serve
from bench.golden.small import small_differences, small_record
from bench.record import recordings


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m bench.golden", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    actions = parser.add_subparsers(dest="action", required=True)
    actions.add_parser("record", help="take down a record").add_argument("--out", type=Path, required=True)
    small = actions.add_parser("small", help="take down the record of made clips")
    small.add_argument("--out", type=Path, required=True)
    compare = actions.add_parser("compare", help="name the entries that differ")
    compare.add_argument("old", type=Path)
    compare.add_argument("new", type=Path)
    compare.add_argument("--tolerant", action="store_true", help="fractions may differ as between two machines (small)")
    actions.add_parser("serve", help="run commands given as JSON (what `record` calls)")
    asked = parser.parse_args()
    if asked.action == "serve":
        serve()
    elif asked.action == "record":
        began = time.perf_counter()
        _write(asked.out, record(recordings()), began)
    elif asked.action == "small":
        began = time.perf_counter()
        with tempfile.TemporaryDirectory(prefix="golden-") as folder:
            _write(asked.out, small_record(Path(folder)), began)
    else:
        lines = (small_differences if asked.tolerant else differences)(_read(asked.old), _read(asked.new))
        print("\n".join(lines) if lines else "no entry differs")
        sys.exit(bool(lines))


def _write(path: Path, found: dict[str, Any], began: float) -> None:
    text = json.dumps(found, ensure_ascii=False, indent=1)
    path.write_text(text + "\n", encoding="utf-8")
    count = sum(1 for _ in entries(found))
    print(f"{path}: {count} entries, {len(text) / 1000:.0f} kB, {time.perf_counter() - began:.0f} s")


def _read(path: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return found


if __name__ == "__main__":
    main()
