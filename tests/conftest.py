"""Fixtures every test may use."""

from __future__ import annotations

from pathlib import Path

import pytest

SHARED_PARTS = Path(__file__).resolve().parents[2] / "shared" / "parts"


@pytest.fixture(scope="session")
def shared_parts() -> Path:
    """Folder of the STEP parts by others; the test is skipped where a checkout stands without them."""
    if not SHARED_PARTS.is_dir():
        pytest.skip("the collection of STEP parts by others (../shared/parts) does not lie beside this checkout")
    return SHARED_PARTS


@pytest.fixture(scope="session")
def demo_files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The demo part and its setup, written once per run: (step_path, setup_path)."""
    pytest.importorskip("cadquery")
    from examples.demo import write_demo

    return write_demo(tmp_path_factory.mktemp("demo"))
