"""The recipes for clusters: that of Slurm runs, with a stand-in for `srun`; the others name what there is."""

from __future__ import annotations

import os
import re
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
import typer
import yaml
from distributed.cli import dask_scheduler, dask_worker
from motionlake.cli.main import app
from typer.core import TyperGroup

from tests.lakes import motionlake, query, quick_lake

FOLDER = Path(__file__).parents[1] / "docs" / "cluster"
SCRIPT = FOLDER / "slurm.sh"
DASK = {"scheduler": dask_scheduler.main, "worker": dask_worker.main}
WAITS = '#!/bin/sh\ntrap "exit 143" TERM\ntouch "$STARTED"\nwhile :; do sleep 0.1; done\n'


@contextmanager
def job(tmp_path: Path, lake: Path, stage: str = "all", **programs: str) -> Iterator[subprocess.Popen[bytes]]:
    """The script as a job of Slurm's, which ends what it leaves; `programs` are stand-ins."""
    stand_ins = tmp_path / "bin"
    stand_ins.mkdir(exist_ok=True)
    for name, text in {"srun": '#!/bin/sh\nexec "$@"\n', **programs}.items():
        (stand_ins / name).write_text(text)
        (stand_ins / name).chmod(0o755)
    path = os.pathsep.join([str(stand_ins), str(Path(sys.executable).parent), os.environ["PATH"]])
    named = {"LAKE": lake, "STAGE": stage, "SLURM_SUBMIT_DIR": tmp_path, "STARTED": tmp_path / "started"}
    with (tmp_path / "said").open("wb") as said:
        ran = subprocess.Popen(
            ["bash", str(SCRIPT)], stdout=said, stderr=said, process_group=0,
            env=os.environ
            | {"PATH": path, "SLURM_CPUS_PER_TASK": "1"}
            | {key: str(value) for key, value in named.items()},
        )  # fmt: skip
    try:
        yield ran
    finally:
        with suppress(ProcessLookupError):
            os.killpg(ran.pid, signal.SIGKILL)
        ran.wait()


def said(tmp_path: Path) -> str:
    return (tmp_path / "said").read_text()


def left(tmp_path: Path) -> list[Path]:
    return list(tmp_path.glob("motionlake-*"))


def test_a_job_of_slurm_runs_stages(tmp_path: Path, clips_folder: Path, scheduler: str) -> None:
    lake = quick_lake(tmp_path / "lake")
    assert motionlake("ingest", clips_folder, "--lake", lake, "--scheduler", scheduler).status == 0
    with job(tmp_path, lake, "moves") as ran:
        assert ran.wait(timeout=120) == 0, said(tmp_path)
    made = dict(query(lake, "SELECT stage, count(*) FROM manifest GROUP BY stage"))
    assert made["moves"] == made["frames"]
    assert not left(tmp_path)


def test_time_that_runs_out_drains_the_command(tmp_path: Path) -> None:
    dask = '#!/bin/sh\n[ "$1" = worker ] || echo "{}" > "$3"\nexec sleep 600\n'
    with job(tmp_path, tmp_path / "lake", motionlake=WAITS, dask=dask) as ran:
        until = time.monotonic() + 30
        while not (tmp_path / "started").exists():
            assert time.monotonic() < until
            time.sleep(0.05)
        ran.send_signal(signal.SIGTERM)  # to the script alone, as --signal=B: does
        assert ran.wait(timeout=60) == 143, said(tmp_path)
    assert not left(tmp_path)


def test_a_scheduler_that_does_not_start_ends_the_job(tmp_path: Path) -> None:
    dask = '#!/bin/sh\n[ "$1" = worker ] && exec sleep 600\necho no scheduler here; exit 4\n'
    with job(tmp_path, tmp_path / "lake", motionlake=WAITS, dask=dask) as ran:
        assert ran.wait(timeout=60) not in (0, 143)
    assert "no scheduler here" in said(tmp_path)
    assert not left(tmp_path)


def test_a_job_without_a_lake_says_what_to_do() -> None:
    ran = subprocess.run(
        ["bash", str(SCRIPT)], capture_output=True, text=True, check=False, env={"PATH": os.environ["PATH"]}
    )
    assert ran.returncode != 0
    assert "say which lake: sbatch" in ran.stderr


def compose() -> dict[str, Any]:
    found: dict[str, Any] = yaml.safe_load((FOLDER / "compose.yaml").read_text())
    return found


def kubernetes() -> list[dict[str, Any]]:
    return list(yaml.safe_load_all((FOLDER / "kubernetes.yaml").read_text()))


def containers() -> Iterator[tuple[Mapping[str, Any], Mapping[str, Any]]]:
    """(object, container) of everything that runs."""
    for each in kubernetes():
        if "template" in each["spec"]:
            yield from ((each, one) for one in each["spec"]["template"]["spec"]["containers"])


def commands() -> list[list[str]]:
    """What the recipes run, and what they say to type."""
    said = [each["command"] for each in compose()["services"].values() if "command" in each]
    said += [container["command"] for _, container in containers()]
    text = (FOLDER / "compose.yaml").read_text() + (FOLDER.parent / "clusters.md").read_text()
    said += [shlex.split(line) for line in re.findall(r"run --rm work (motionlake .*)", text)]
    return said


@pytest.mark.parametrize("words", commands(), ids=" ".join)
def test_every_command_has_these_options(words: list[str]) -> None:
    program, name, *rest = (re.sub(r"\$\{.*\}", "a" * 16, word) for word in words)
    if program == "dask":
        DASK[name].make_context(name, list(rest))
        return
    assert program == "motionlake"
    command: Any = typer.main.get_command(app)
    assert isinstance(command, TyperGroup)
    found = command.get_command(typer.Context(command), name)
    assert found is not None
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("MOTIONLAKE_LAKE", "/lake/mylake")
        found.make_context(found.name, list(rest))


def test_services_are_those_that_commands_name() -> None:
    services = compose()["services"]
    for words in commands():
        for host in re.findall(r"tcp://([a-z-]+):8786", " ".join(words)):
            assert host in {*services, *(each["metadata"]["name"] for each in kubernetes())}
    assert {volume for each in services.values() for volume in each.get("volumes", [])} <= {
        "lake:/lake", "${CLIPS:-./clips}:/clips:ro"
    }  # fmt: skip
    assert set(compose()["volumes"]) == {"lake"}


def test_labels_ports_and_claims_fit_each_other() -> None:
    objects = {(each["kind"], each["metadata"]["name"]): each for each in kubernetes()}
    pods = [each["spec"]["template"]["metadata"]["labels"] for each in objects.values() if "template" in each["spec"]]
    for (kind, _), each in objects.items():
        if kind == "Deployment":
            assert each["spec"]["selector"]["matchLabels"] == each["spec"]["template"]["metadata"]["labels"]
        if kind == "Service":
            assert each["spec"]["selector"] in pods
            [port] = each["spec"]["ports"]
            ports = {one["containerPort"] for _, c in containers() for one in c.get("ports", [])}
            assert port["targetPort"] in ports
    claims = {name for kind, name in objects if kind == "PersistentVolumeClaim"}
    for whole, container in containers():
        spec = whole["spec"]["template"]["spec"]
        volumes = {one["name"]: one["persistentVolumeClaim"]["claimName"] for one in spec.get("volumes", [])}
        assert set(volumes.values()) <= claims
        assert {one["name"] for one in container.get("volumeMounts", [])} == set(volumes)


def test_the_image_is_made_of_what_there_is() -> None:
    text = (FOLDER / "Dockerfile").read_text()
    [extras] = re.findall(r"\$\{wheel\}\[([a-z0-9,]+)\]", text)
    known = (FOLDER.parents[1] / "pyproject.toml").read_text()
    assert all(f"\n{extra} = [" in known for extra in extras.split(","))
    assert "COPY dist/motionlake-*.whl" in text
