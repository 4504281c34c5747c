"""The software bill of materials of a wheel, as CycloneDX 1.6: `python .ci/sbom.py dist/motionlake-*.whl`.

It names what runs with the program, with versions and licences as installed beside it and the hashes of the lock files,
and the pretrained weights in the wheel. The same wheel and packages give the same bytes.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import re
import uuid
import zipfile
from importlib import metadata
from pathlib import Path
from typing import Any, Final

from packaging.metadata import parse_email
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name, parse_wheel_filename

LOCKS: Final = ("requirements.lock", "requirements-torch.lock")
ROOT: Final = Path(__file__).parents[1]
_PINNED: Final = re.compile(r"^(\S+?)==(\S+)((?:\s*\\\n\s+--hash=\S+)*)", re.MULTILINE)
_HASH: Final = re.compile(r"--hash=sha256:([0-9a-f]{64})")


def pinned(folder: Path = ROOT) -> dict[str, tuple[str, list[str]]]:
    """Version and hashes of every file, by package, as the lock files have them."""
    text = "".join((folder / name).read_text(encoding="utf-8") for name in LOCKS)
    return {canonicalize_name(name): (version, _HASH.findall(rest)) for name, version, rest in _PINNED.findall(text)}


def requirements(lines: list[str], extras: frozenset[str] = frozenset()) -> list[tuple[str, frozenset[str]]]:
    """Packages, with extras of theirs, that requirements ask for on this machine."""
    found = []
    for line in lines:
        asked = Requirement(line)
        if asked.marker is None or any(asked.marker.evaluate({"extra": extra}) for extra in extras or {""}):
            found.append((str(canonicalize_name(asked.name)), frozenset(asked.extras)))
    return found


def closure(lines: list[str]) -> dict[str, list[str]]:
    """All packages that requirements bring along, each with those that it needs itself."""
    needs: dict[str, list[str]] = {}
    waiting = requirements(lines)
    while waiting:
        name, extras = waiting.pop()
        more = requirements(metadata.requires(name) or [], extras | {""})
        if name not in needs or not {n for n, _ in more} <= set(needs[name]):
            needs[name] = sorted({*needs.get(name, ()), *(n for n, _ in more)})
            waiting += more
    return needs


def purl(name: str, version: str) -> str:
    return f"pkg:pypi/{name}@{version}"


def _licences(said: Any) -> list[dict[str, Any]]:
    if expression := said.get("License-Expression"):
        return [{"expression": expression}]
    named = [line.rpartition(" :: ")[2] for line in said.get_all("Classifier") or [] if line.startswith("License ::")]
    named = named or [text for text in [(said.get("License") or "").strip()] if text and "\n" not in text]
    return [{"license": {"name": name}} for name in named]


def package(name: str, files: list[str]) -> dict[str, Any]:
    """One package as it is installed, with the hashes of the files that it may come in."""
    said = metadata.metadata(name)
    version = str(said["Version"]).partition("+")[0]  # torch's says which build this machine has
    found: dict[str, Any] = {"type": "library", "bom-ref": purl(name, version), "name": name, "version": version}
    found |= {"purl": purl(name, version), "licenses": _licences(said)}
    if files:
        hashes = [{"alg": "SHA-256", "content": content} for content in files]
        found["externalReferences"] = [{"type": "distribution", "url": purl(name, version), "hashes": hashes}]
    return found


def weights(wheel: zipfile.ZipFile) -> list[dict[str, Any]]:
    """The pretrained models in a wheel."""
    names = sorted(name for name in wheel.namelist() if "/weights/" in name)
    return [
        {
            "type": "machine-learning-model", "bom-ref": name, "name": name,
            "hashes": [{"alg": "SHA-256", "content": hashlib.sha256(wheel.read(name)).hexdigest()}],
        }
        for name in names
    ]  # fmt: skip


def bill(path: Path) -> dict[str, Any]:
    """The bill of materials of a wheel."""
    name, parsed, _, _ = parse_wheel_filename(path.name)
    version = str(parsed)
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    with zipfile.ZipFile(path) as wheel:
        described = next(entry for entry in wheel.namelist() if entry.endswith(".dist-info/METADATA"))
        said, _ = parse_email(wheel.read(described))
        models = weights(wheel)
    lines = said.get("requires_dist", [])
    needs, files = closure(lines), pinned()
    own = purl(name, version)
    packages = [package(found, files.get(found, ("", []))[1]) for found in sorted(needs)]
    reference = {found["name"]: found["bom-ref"] for found in packages}
    direct = sorted(reference[found] for found, _ in requirements(lines))
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "serialNumber": f"urn:uuid:{uuid.uuid5(uuid.NAMESPACE_URL, digest)}",
        "version": 1,
        "metadata": {
            "component": {
                "type": "application", "bom-ref": own, "name": name, "version": version, "purl": own,
                "licenses": [{"expression": said["license_expression"]}],
                "hashes": [{"alg": "SHA-256", "content": digest}],
            }
        },
        "components": [*packages, *models],
        "dependencies": [
            {"ref": own, "dependsOn": [*direct, *(model["bom-ref"] for model in models)]},
            *({"ref": reference[n], "dependsOn": [reference[other] for other in needs[n]]} for n in sorted(needs)),
        ],
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("wheel", type=Path, nargs="+")
    for path in parser.parse_args().wheel:
        target = path.with_name(f"{path.name.removesuffix('.whl')}.cdx.json")
        target.write_text(json.dumps(bill(path), indent=1) + "\n", encoding="utf-8")
        print(target)


if __name__ == "__main__":
    main()
