"""What people meet: help with examples, one clear line for a mistake, exit status 0, 1 and 2, JSON for machines."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from importlib.metadata import version
from pathlib import Path

import pytest
from motionlake import cli
from motionlake.cli._measures import METRICS
from motionlake.cli._output import notice, tell
from motionlake.cli.common import frame_or_seconds
from motionlake.cli.main import COMMANDS, MODULES
from motionlake.motion import rigs
from motionlake.names import printable
from motionlake.stages.registry import ALL, BY_NAME

from tests.lakes import QUICK, Run, assert_same, finish, motionlake, query, quick_lake, tables
from tests.processes import start_fresh
from tests.samples import BVH, FLAT, KINECT_1, npz_bytes, swinging_body

NAMES = [name for commands in COMMANDS.values() for name in commands]
# What computes, and takes long to import.
HEAVY = {"torch", "numba", "ot", "dask", "distributed", "sklearn", "matplotlib"}
LIBRARIES = {"scipy", "duckdb", "pyarrow", "pandas"}
CREATES = ("init", "ingest")
COMMAND_LINES = {
    "ingest": ["ingest", "{source}"],
    "inbetween": ["inbetween", "clip", "--out", "a.bvh"],
    "run": ["run", "all"],
    "status": ["status"],
    "search": ["search", "x"],
    "sql": ["sql", "SELECT 1"],
    "export": ["export", "x"],
    "remove": ["remove", "x"],
}


def assert_clear(run: Run, *parts: str) -> None:
    """Exit status 2, one line on stderr that says what and where, nothing on stdout."""
    assert run.status == 2, run.err
    line = run.err.strip().splitlines()[-1]
    assert line.startswith("motionlake: ")
    assert "Traceback" not in run.err
    for part in parts:
        assert part in line, line


def imported_by(*words: str | Path) -> set[str]:
    """The modules that a run of the command line imports in a process of its own."""
    code = (
        "import sys; from motionlake.cli.main import main\ntry: main()\nfinally: print(*sys.modules, file=sys.stderr)"
    )
    run = subprocess.run([sys.executable, "-c", code, *map(str, words)], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    return set(run.stderr.splitlines()[-1].split())


def test_help_imports_no_command_and_no_library_but_typer() -> None:
    modules = imported_by("--help")
    assert {m for m in modules if m.startswith("motionlake")} == {
        "motionlake", "motionlake.caches", "motionlake.errors", "motionlake.names", "motionlake.stopping",
        "motionlake.cli", "motionlake.cli.main", "motionlake.cli.common", "motionlake.cli._output",
        "motionlake.cli._progress", "motionlake.cli._event_log",
    }  # fmt: skip
    assert not modules & {*HEAVY, *LIBRARIES, "numpy", "rich"}


@pytest.mark.parametrize("module", ["lake.config", "lake.catalog", "lake.frames", "formats"])
def test_what_opens_a_lake_imports_no_library_that_computes(module: str) -> None:
    code = f"import sys, motionlake.{module}; print(*sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not set(run.stdout.split()) & {*HEAVY, "scipy"}


def test_a_look_at_names_of_files_imports_no_library_that_computes() -> None:
    code = "import sys; from motionlake.formats import readers; assert len(readers()) > 4; print(*sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not set(run.stdout.split()) & {*HEAVY, "scipy"}


@pytest.mark.parametrize(
    ("words", "needed"),
    [(["status"], set()), (["sql", "FROM clips"], {"numba"})],  # numba: of the kernels of SQL functions
)
def test_a_look_at_a_lake_imports_no_library_that_computes(tmp_path: Path, words: list[str], needed: set[str]) -> None:
    assert motionlake("init", tmp_path).status == 0
    assert imported_by(*words, "--lake", tmp_path) & HEAVY <= needed


@pytest.mark.parametrize(
    "words", [["search", "{clip}"], ["search", "{clip}", "--method", "descriptor"], ["classify", "{clip}"], ["status"]]
)
def test_a_search_of_few_clips_imports_no_compiler(built_lake: Path, words: list[str]) -> None:
    ((clip,),) = query(built_lake, "SELECT min(clip) FROM clips")
    named = [word.format(clip=clip) for word in words]
    assert not imported_by(*named, "--lake", built_lake) & {*HEAVY - {"ot"}, "pandas", "scipy.ndimage"}


def test_the_package_alone_imports_nothing() -> None:
    code = "import sys; before = set(sys.modules); import motionlake; print(*set(sys.modules) - before)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert {m.partition(".")[0] for m in run.stdout.split()} - sys.stdlib_module_names == {"motionlake"}


def test_help_lists_every_command_by_what_it_is_for() -> None:
    run = motionlake("--help")
    words = " ".join(run.out.split())
    for title, commands in COMMANDS.items():
        assert f"{title}:" in words
        for name, line in commands.items():
            assert f"{name} {line}" in words
    modules = {p.stem for p in Path(cli.__file__).parent.iterdir() if not p.name.startswith("_")}
    assert set(MODULES) == modules - {"common", "main"}
    assert sorted(name for names in MODULES.values() for name in names) == sorted(NAMES)
    assert motionlake("-h").out == run.out


def test_the_version() -> None:
    assert motionlake("--version").out == f"motionlake {version('motionlake')}\n"


def test_a_command_that_is_not_there() -> None:
    run = motionlake("serch", "x")
    assert run.status == 2
    assert "Did you mean 'search'" in run.err


@pytest.mark.parametrize("words", [["{lake}"], ["--lake", "{lake}"], ["{lake}", "--lake", "{lake}"]])
def test_init_takes_the_folder_either_way(tmp_path: Path, words: list[str]) -> None:
    lake = tmp_path / "lake"
    run = motionlake("init", *(word.format(lake=lake) for word in words))
    assert run.status == 0, run.err
    assert (lake / "config.toml").is_file()


def test_init_needs_one_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert_clear(motionlake("init"), "name the folder")
    assert_clear(motionlake("init", tmp_path / "a", "--lake", tmp_path / "b"), "two folders")
    monkeypatch.setenv("MOTIONLAKE_LAKE", str(tmp_path / "c"))
    assert motionlake("init", tmp_path / "a").status == 0
    assert motionlake("init").status == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a", "c"]


def test_ctrl_c_says_how_to_go_on(built_lake: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("motionlake.lake.raw.own_rig", interrupt)
    clip = query(built_lake, "SELECT clip FROM clips LIMIT 1")[0][0]
    run = motionlake("export", clip, "--lake", built_lake)
    assert run.status == 130
    assert run.err == "motionlake: interrupted; the same command goes on where this one stopped\n"


@pytest.mark.parametrize("command", NAMES)
def test_every_command_has_an_example(command: str) -> None:
    run = motionlake(command, "--help")
    assert run.status == 0
    listed = next(commands[command] for commands in COMMANDS.values() if command in commands)
    assert " ".join(run.out.split("\n\n")[1].split()) == listed
    assert re.search(rf"Example: motionlake\s+{command}", run.out)
    assert "--json" in run.out


@pytest.mark.parametrize("command", [c for c in COMMAND_LINES if c not in CREATES])
def test_a_folder_that_is_no_lake(command: str, tmp_path: Path) -> None:
    assert_clear(motionlake(*COMMAND_LINES[command], "--lake", tmp_path), "no lake here", "motionlake init")


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["search", "no_such_clip"], ["no_such_clip: no such clip"]),
        (["search"], ["name a clip"]),
        (["sql", "SELECT * FROM nowhere"], ["SQL", "nowhere"]),
        (["sql", "DROP TABLE clips"], ["SQL", "read-only"]),
        (["sql", ""], ["no statement"]),
        (["export", "no_such_clip"], ["no such clip"]),
        (["export", "a0", "--rig", "mine"], ["--rig mine", "own or canonical"]),
        (["run", "frobnicate"], ["frobnicate: no such stage", "signatures"]),
        (["remove"], ["--dataset", "--gone"]),
        (["remove", "--dataset", "nowhere"], ["nowhere: no such dataset", "clips"]),
        (["remove", "--dataset", "../x"], ["dataset '../x'"]),
        (["ingest", "/no/such/folder"], ["/no/such/folder: no such file or folder"]),
        (["ingest", "{source}", "--rig", "nonsense"], ["--rig nonsense", "cmu_asf"]),
        (["ingest", "{source}", "--up", "w"], ["--up w", "x, y, z"]),
        (["ingest", "{source}", "--unit", "ells"], ["--unit ells", "cm"]),
        (["ingest", "{source}", "--fps", "0"], ["--fps 0"]),
        (["ingest", "{source}", "--dataset", "../../etc"], ["dataset '../../etc'"]),
        (["ingest", "{source}", "--labels", "/no/labels.csv"], ["/no/labels.csv: no such file"]),
    ],
)
def test_a_mistake_gets_one_clear_line(
    built_lake: Path, clips_folder: Path, words: list[str], parts: list[str]
) -> None:
    filled = [w.format(source=clips_folder) for w in words]
    before = tables(built_lake)
    assert_clear(motionlake(*filled, "--lake", built_lake), *parts)
    assert_same(before, tables(built_lake))


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("[words]\nstride = 'four'\n", ["config.toml", "stride", "int"]),
        ("[wrods]\nstride = 4\n", ["config.toml", "[wrods]", "words"]),
        ("[words]\nstrid = 4\n", ["config.toml", "strid", "stride"]),
        ("[words\n", ["config.toml", "not valid TOML"]),
    ],
)
def test_a_mistake_in_the_configuration(tmp_path: Path, text: str, parts: list[str]) -> None:
    lake = quick_lake(tmp_path / "lake", text)
    assert_clear(motionlake("run", "all", "--lake", lake), *parts)


def test_debug_shows_the_traceback(tmp_path: Path) -> None:
    run = finish(start_fresh("--debug", "status", "--lake", tmp_path))
    assert run.status != 0
    assert "Traceback" in run.err


def test_init_does_not_overwrite(built_lake: Path) -> None:
    assert_clear(motionlake("init", built_lake), "there is a lake here already")


def test_an_ambiguous_name_lists_what_it_may_mean(tmp_path: Path, clips_folder: Path, scheduler: str) -> None:
    clip = next(p for p in sorted(clips_folder.rglob("*")) if p.suffix in (".bvh", ".npz"))
    for name in ("a", "b"):
        (tmp_path / "twice" / name).mkdir(parents=True)
        shutil.copyfile(clip, tmp_path / "twice" / name / clip.name)
    lake = quick_lake(tmp_path / "lake")
    run = motionlake("ingest", tmp_path / "twice", "--lake", lake, "--scheduler", scheduler)
    assert run.status == 0, run.err
    assert_clear(motionlake("export", clip.stem, "--lake", lake), "means 2 clips", f"twice/a/{clip.name}")


def test_search_before_there_are_motifs(tmp_path: Path, clips_folder: Path, scheduler: str) -> None:
    lake = quick_lake(tmp_path / "lake")
    assert motionlake("ingest", clips_folder, "--lake", lake, "--scheduler", scheduler).status == 0
    clip = next(p for p in sorted(clips_folder.rglob("*")) if p.suffix in (".bvh", ".npz"))
    assert_clear(motionlake("search", clip.name, "--lake", lake), "is not ready for search", "motionlake run all")
    assert_clear(motionlake("search", clip, "--lake", lake), "is not ready for search", "motionlake run all")


def test_rejects_are_named_counted_and_told_by_the_exit_status(
    tmp_path: Path, clips_folder: Path, scheduler: str
) -> None:
    source = Path(shutil.copytree(clips_folder, tmp_path / "clips"))
    (source / "broken.bvh").write_text(BVH.replace("OFFSET 9.0", "OFFSET nine", 1), encoding="utf-8")
    line = 1 + BVH[: BVH.index("OFFSET 9.0")].count("\n")
    (source / "empty.bvh").touch()
    lake = quick_lake(tmp_path / "lake")
    run = motionlake("ingest", source, "--lake", lake, "--scheduler", scheduler)
    assert run.status == 1
    assert "2 files rejected" in run.out
    assert f"rejected clips/broken.bvh, line {line}: " in run.err
    again = motionlake("ingest", source, "--lake", lake, "--scheduler", scheduler, "--json")
    assert (again.status, again.json["clips"], again.json["rejected"]) == (1, 0, 2)
    retried = motionlake("ingest", source, "--lake", lake, "--scheduler", scheduler, "--retry-failed", "--json")
    assert (retried.status, retried.json["clips"], retried.json["rejected"]) == (1, 0, 2)
    run = motionlake("sql", "SELECT path, line, reason FROM rejects ORDER BY path", "--lake", lake, "--json")
    assert [(r["path"], r["line"]) for r in run.json] == [("broken.bvh", line), ("empty.bvh", None)]
    (source / "broken.bvh").unlink()
    (source / "empty.bvh").unlink()
    assert motionlake("remove", "--gone", "--lake", lake).status == 0
    assert motionlake("ingest", source, "--lake", lake, "--scheduler", scheduler).status == 0


@pytest.mark.parametrize("words", [["status"], ["sql", "FROM clips LIMIT 2"], ["search", "--sample", "2", "-k", "1"]])
def test_json_is_json_and_alone_on_stdout(built_lake: Path, words: list[str]) -> None:
    run = motionlake(*words, "--lake", built_lake, "--json")
    assert run.status == 0
    assert json.loads(run.out)


def test_a_run_says_before_it_starts_whether_it_will_train(lake: Path, tmp_path: Path, scheduler: str) -> None:
    run = motionlake("run", "all", "--lake", lake, "--scheduler", scheduler)
    assert "will not train" in run.err
    run = motionlake("run", "embed", "--refit", "--lake", lake, "--scheduler", scheduler)
    assert "will train a word network (" in run.err


def test_status_counts_what_is_due(lake: Path) -> None:
    before = motionlake("status", "--lake", lake, "--json").json
    due = {stage["stage"]: stage["due"] for stage in before["stages"]}
    assert due == dict.fromkeys(ALL, 0) | dict.fromkeys(BY_NAME)
    (lake / "config.toml").write_text("[motifs]\nk = 5\n", encoding="utf-8")
    after = {s["stage"]: s["due"] for s in motionlake("status", "--lake", lake, "--json").json["stages"]}
    assert after["frames"] == after["words"] == 0
    assert after["embed"] > 0


def test_an_unknown_rig_is_rejected_until_its_map_is_there(tmp_path: Path, scheduler: str) -> None:
    source, lake = tmp_path / "shots", quick_lake(tmp_path / "lake")
    source.mkdir()
    renamed = [name for name in KINECT_1 if name.endswith(("Left", "Right")) or name == "HipCenter"]
    joints = [f"{name}Bone" if name in renamed else name for name in KINECT_1]
    # All joints hang on the root: by its tree this is no body.
    (source / "take.npz").write_bytes(npz_bytes(swinging_body(40), joints, FLAT, 30.0))
    run = motionlake("ingest", source, "--lake", lake, "--scheduler", scheduler)
    assert run.status == 1
    assert "unknown rig" in run.err
    assert "kinect_v1" in run.err
    starter = motionlake("rig", source / "take.npz", "--lake", lake)
    assert starter.status == 0
    tomllib.loads(starter.out)
    assert "HipCenterBone" in starter.out
    # What the user makes of it: the map of the rig it resembles, with its own names.
    known = (Path(rigs.__file__).parent / "rigs" / "kinect_v1.toml").read_text(encoding="utf-8")
    text = re.sub("|".join(renamed), lambda m: f"{m[0]}Bone", known)
    (lake / "rigs").mkdir(exist_ok=True)
    (lake / "rigs" / "studio.toml").write_text(text.replace('"kinect_v1"', '"studio"'), encoding="utf-8")
    run = motionlake("ingest", source, "--lake", lake, "--scheduler", scheduler)
    assert run.status == 0, run.err
    assert query(lake, "SELECT rig FROM clips") == [("studio",)]
    assert motionlake("rig", source / "take.npz", "--lake", lake).out.startswith("studio")


def test_what_is_no_regular_file_is_rejected_and_stops_nothing(
    tmp_path: Path, clips_folder: Path, scheduler: str
) -> None:
    few = QUICK.replace("k = 12", "k = 4").replace("m = 40", "m = 8")  # for one clip, which may be short
    source, lake = tmp_path / "clips", quick_lake(tmp_path / "lake", few)
    (source / "ünï'cødé").mkdir(parents=True)
    clip = next(p for p in sorted(clips_folder.rglob("*")) if p.suffix in (".bvh", ".npz"))
    shutil.copyfile(clip, source / "ünï'cødé" / f'it\'s "one"{clip.suffix}')
    (source / "dangling.bvh").symlink_to(tmp_path / "nowhere.bvh")
    (source / "loop").symlink_to(source)
    (source / "folder.bvh").mkdir()
    for name in ("pipe.bvh", "pipe.amc", "pipe.txt"):
        os.mkfifo(source / name)
    run = motionlake("ingest", source, "--lake", lake, "--scheduler", scheduler, "--json")
    assert run.status == 1, run.err
    assert run.json["clips"] == 1
    reasons = dict(query(lake, "SELECT path, reason FROM rejects"))
    assert reasons.keys() == {"dangling.bvh", "pipe.bvh", "pipe.amc"}
    assert "does not exist" in reasons["dangling.bvh"]
    assert "not a regular file" in reasons["pipe.bvh"]
    assert motionlake("run", "all", "--lake", lake, "--scheduler", scheduler).status == 1
    found = motionlake("search", 'it\'s "one"', "--lake", lake, "--json")
    assert (found.status, found.json) == (0, [])
    before = tables(lake)
    assert motionlake("ingest", source, "--lake", lake, "--scheduler", scheduler, "--json").json["clips"] == 0
    assert_same(before, tables(lake))


def test_a_folder_without_clips(tmp_path: Path, scheduler: str) -> None:
    (tmp_path / "empty").mkdir()
    run = motionlake("ingest", tmp_path / "empty", "--lake", tmp_path / "lake", "--scheduler", scheduler)
    assert run.status == 2
    assert not (tmp_path / "lake").exists()
    assert "no clip files; motionlake reads .amc, .bvh" in run.err


@pytest.mark.parametrize(
    ("text", "frame"), [("0", 0), ("120", 120), ("0s", 0), ("3s", 360), ("1.5 s", 180), (".25s", 30), ("1.004s", 120)]
)
def test_a_place_in_a_clip_is_a_frame_or_a_time(text: str, frame: int) -> None:
    assert frame_or_seconds(text).frame(120.0) == frame


@pytest.mark.parametrize("text", ["", "s", "-1", "-1s", "1.5", "3sec", "1e3s", "nan s", "0:03"])
def test_what_is_neither_a_frame_nor_a_time(built_lake: Path, text: str) -> None:
    run = motionlake("export", "a0", f"--from={text}", "--lake", built_lake)
    assert run.status == 2
    assert "is neither a frame, such as 120, nor seconds" in " ".join(re.sub("[│╭╮╰╯─]", "", run.err).split())


def test_frames_and_seconds_mean_the_same_range(built_lake: Path, tmp_path: Path) -> None:
    clip, fps = query(built_lake, "SELECT clip, fps FROM clips ORDER BY clip LIMIT 1")[0]
    for words in (["export"], ["view", "--beside", "none"]):
        found = []
        for first, last in ((6, 21), (f"{6 / fps:.5f}s", f"{21 / fps:.5f}s")):
            out = tmp_path / f"{words[0]}.{'bvh' if words == ['export'] else 'html'}"
            run = motionlake(*words, clip, "--from", first, "--to", last, "--out", out, "--lake", built_lake, "--json")
            assert run.status == 0, run.err
            found.append((run.json, out.read_bytes()))
        assert found[0] == found[1]
    ranges = [
        motionlake("find", clip, "--from", 0, "--to", stop, "--lake", built_lake, "--json").json
        for stop in (40, f"{40 / fps:.5f}s")
    ]
    assert ranges[0] == ranges[1] != []


CONTROLS = "a\x1b[2Jb\x07\nc\x9b1m\u202ed\u2028\udc80[bold]:smile:é日本👍"


def test_what_a_terminal_would_obey_is_spelled_out(capsys: pytest.CaptureFixture[str]) -> None:
    spelled = "a\\x1b[2Jb\\x07\\nc\\x9b1m\\u202ed\\u2028\\udc80[bold]:smile:é日本👍"
    assert printable(CONTROLS) == spelled
    tell([{"label": CONTROLS}], as_json=False)
    tell(CONTROLS, as_json=False)
    notice(CONTROLS)
    run = capsys.readouterr()
    assert run.out.split() == ["label", spelled, spelled]
    assert run.err == f"{spelled}\n"
    tell({"label": CONTROLS.replace("\udc80", "")}, "", as_json=True)
    assert json.loads(capsys.readouterr().out) == {"label": CONTROLS.replace("\udc80", "")}


def test_errors_spell_out_what_they_name(tmp_path: Path) -> None:
    run = finish(start_fresh("export", "\x1b[2Jx\udce9", "--lake", tmp_path / "no\x1blake"))
    assert_clear(run, "no\\x1blake", "no lake here")


def test_metrics_of_tables_say_which_way_is_better() -> None:
    counts = {name for name in METRICS if name.startswith(("n", "all_p")) and name != "nn"} | {"m"}
    assert all("is better" in line for name, line in METRICS.items() if name not in counts)


@pytest.mark.parametrize(("words", "status"), [(["--help"], 0), (["status", "--lake", "nowhere"], 2)])
@pytest.mark.parametrize("thread", [False, True])
def test_a_process_ends_with_all_that_it_had_to_say(words: list[str], status: int, thread: bool) -> None:
    code = (
        "import atexit, sys, threading, time\nfrom motionlake.cli.main import program\n"
        "atexit.register(print, 'the end')\n"
        f"if {thread}: threading.Thread(target=lambda: (time.sleep(0.5), print('done'))).start()\n"
        "program()"
    )
    run = subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, check=False)
    assert run.returncode == status
    assert bool(run.stdout.startswith("Usage")) == (status == 0)
    assert bool(run.stderr) == (status == 2)
    assert run.stdout.endswith("done\nthe end\n" if thread else "the end\n")
