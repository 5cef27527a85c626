import numpy as np
import pytest

from geometry.errors import SetupError
from geometry.setup_frame import SetupFrame


def test_default_is_the_file_frame():
    assert np.array_equal(SetupFrame().matrix, np.eye(4))


def test_axis_along_y():
    p = SetupFrame(origin=(1, 2, 3), z_axis=(0, 5, 0), x_axis=(0, 0, 1))
    assert np.allclose(p.matrix @ [1, 12, 3, 1], [0, 0, 10, 1])
    assert np.allclose(p.matrix @ [1, 2, 4, 1], [1, 0, 0, 1])
    assert np.allclose(p.matrix @ p.inverse, np.eye(4))
    assert np.linalg.det(p.matrix[:3, :3]) == pytest.approx(1.0)


def test_slanted_x_axis_is_projected():
    p = SetupFrame(z_axis=(0, 0, 1), x_axis=(1, 0, 7))
    assert np.allclose(p.matrix, np.eye(4))


def test_survives_the_pipe():
    p = SetupFrame((0.1, 0.2, 0.3), (0, 1, 1), (1, 0, 0))
    assert SetupFrame(**p.as_dict()) == p


@pytest.mark.parametrize("bad", [
    {"z_axis": (0, 0, 0)}, {"x_axis": (0, 0, 0)}, {"x_axis": (0, 0, -3)}, {"origin": (0, float("nan"), 0)},
    {"origin": (1, 2)}, {"z_axis": "up"},
])
def test_bad_frames_are_refused(bad):
    with pytest.raises(SetupError) as caught:
        SetupFrame(**bad)
    assert caught.value.code == "bad_placement" and caught.value.subjects
