"""The version of the product in programs, reports and the API, and the digest of its sources."""

from __future__ import annotations

import hashlib
from functools import lru_cache
from pathlib import Path

VERSION = "0.2.0"
PACKAGES = ("geometry", "zones", "toolpath", "output", "verify", "schemas", "service")


@lru_cache(maxsize=1)
def code_version() -> str:
    """Hash of every source file that can change a result, hex."""
    root = Path(__file__).resolve().parent.parent
    digest = hashlib.sha256()
    for package in PACKAGES:
        for path in sorted(p for p in (root / package).rglob("*") if p.suffix in (".py", ".html")):
            digest.update(f"{path.relative_to(root)}\0".encode())
            digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()
