#!/usr/bin/env python3
"""The stages of the Dockerfile without a container engine: each in a folder of its own, with its sizes at the end.

    image_stages.py FOLDER

COPY takes what .dockerignore leaves, RUN is run by bash with the stage's folder in place of the root, ENV is set. The
Python stage has a virtual environment in place of the base image; the stage of the page uses the Node that is there.
What needs the root of a container (apt-get, useradd, chown) is skipped and named. Exit 1 where a command fails.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
import time
import venv
from dataclasses import dataclass, field
from fnmatch import fnmatch
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
OF_CONTAINERS = ("apt-get", "useradd", "chown", "rm -rf /var/lib")
PATHS = re.compile(r"(?<![\w./-])/(app|build|data|tmp)\b")


@dataclass
class Stage:
    """A stage while it is built: its folder in place of /, working folder and variables."""

    base: str
    root: Path
    folder: Path = Path()
    variables: dict[str, str] = field(default_factory=dict)

    def inside(self, path: str) -> Path:
        """A path of the image as a path of this machine."""
        return self.root / path.lstrip("/") if path.startswith("/") else self.folder / path

    def mapped(self, text: str) -> str:
        """A text with this stage's folder in place of the root in every path of the image."""
        return PATHS.sub(lambda found: f"{self.root}/{found[1]}", text)


def instructions() -> list[tuple[str, str]]:
    """Instruction and arguments of every line of the Dockerfile, continued lines joined."""
    text = re.sub(r"\\\n\s*", " ", (ROOT / "Dockerfile").read_text())
    lines = [line.strip() for line in text.splitlines() if line.strip() and not line.startswith("#")]
    return [(first, rest) for first, _, rest in (line.partition(" ") for line in lines)]


def left_out(path: Path) -> bool:
    """Whether .dockerignore keeps a path of the checkout from the engine."""
    name = path.relative_to(ROOT).as_posix()
    patterns = (ROOT / ".dockerignore").read_text().split()
    return any(fnmatch(name, p) or fnmatch(f"/{name}", p.replace("**", "*")) for p in patterns)


def copy(source: Path, target: Path) -> None:
    """COPY of one file or folder: of a folder its contents, merged into the target."""
    if source.is_dir():
        inside = source.is_relative_to(ROOT) and not source.is_relative_to(ROOT / "build")
        shutil.copytree(source, target, dirs_exist_ok=True, symlinks=True, ignore=lambda folder, names: {
            n for n in names if inside and left_out(Path(folder, n))})
    else:
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(source, target)


def run(stage: Stage, command: str) -> None:
    """RUN of one line; raises CalledProcessError."""
    parts = [p.strip() for p in command.split("&&")]
    for part in (p for p in parts if p.startswith(OF_CONTAINERS)):
        print(f"  skipped: {part}")
    kept = " && ".join(p for p in parts if not p.startswith(OF_CONTAINERS))
    if not kept:
        return
    print(f"  RUN {kept}", flush=True)
    started = time.monotonic()
    (stage.root / "tmp").mkdir(exist_ok=True)
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("ZONEMILL_", "VIRTUAL_ENV", "PYTHON"))}
    subprocess.run(["bash", "-euc", stage.mapped(kept)], cwd=stage.folder, check=True,
                   env={**environment, **stage.variables})
    print(f"  {time.monotonic() - started:.0f} s", flush=True)


def build(folder: Path) -> dict[str, Stage]:
    """Build every stage below a folder; returns the stages by name, the last as ``image``."""
    lines, stages = instructions(), {}
    stage = Stage("", folder)
    for word, rest in lines:
        if word == "FROM":
            base, _, name = rest.partition(" AS ")
            stage = Stage(base, folder / (name or "image"))
            stages[name or "image"] = stage
            stage.root.mkdir(parents=True)
            stage.folder = stage.root
            print(f"{rest} in {stage.root}", flush=True)
            if base.startswith("python:"):
                venv.create(stage.root / "python", with_pip=True, symlinks=True)
                stage.variables["PATH"] = f"{stage.root}/python/bin:{os.environ['PATH']}"
        elif word == "WORKDIR":
            stage.folder = stage.inside(rest)
            stage.folder.mkdir(parents=True, exist_ok=True)
        elif word == "ENV":
            pairs = (p.partition("=") for p in shlex.split(rest))
            stage.variables |= {k: stage.mapped(v) for k, _, v in pairs}
        elif word == "COPY":
            words = rest.split()
            other = words.pop(0).removeprefix("--from=") if words[0].startswith("--from=") else None
            *sources, target = words
            for source in sources:
                origin = stages[other].inside(source) if other else ROOT / source
                into = stage.inside(target)
                copy(origin, into / origin.name if origin.is_file() and target.endswith("/") else into)
        elif word == "RUN":
            run(stage, rest)
        else:
            print(f"  skipped: {word} {rest}")
    return stages


def megabytes(folder: Path) -> float:
    """What a folder takes on disk, MB of 2^20 bytes, as du counts it."""
    blocks = (p.lstat().st_blocks for p in (folder, *folder.rglob("*")))
    return 512 * sum(blocks) / 2**20


def main() -> int:
    """Build all stages and print their sizes."""
    folder = Path(sys.argv[1]).resolve()
    shutil.rmtree(folder, ignore_errors=True)
    try:
        image = build(folder)["image"]
    except subprocess.CalledProcessError as error:
        print(f"failed with {error.returncode}", file=sys.stderr)
        return 1
    print(f"python {megabytes(image.root / 'python'):.0f} MB (the packages; goal at most 1100)")
    print(f"app {megabytes(image.root / 'app'):.0f} MB, of them compiled kernels "
          f"{megabytes(image.root / 'app' / 'numba'):.0f} MB")
    print(f"page {sum(p.stat().st_size for p in (image.root / 'app/service/page').rglob('*')) / 2**20:.1f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
