"""The chart of Figure 5: its bars are the numbers of sub-planes, its curve f_l (sheet of the paper, section 4.2)."""

from pathlib import Path

import pytest

from atmoref.judge.chart import draw, light_charts, write_chart
from atmoref.scene import SceneError, load_scene

M_K = (3, 3, 4, 5, 6, 7, 9, 11, 13, 14, 16, 16, 14, 12, 10, 8, 6, 5, 4, 3, 2, 2, 1)
F_L = (
    0.0318, 0.0371, 0.0438, 0.0521, 0.0625, 0.0756, 0.0917, 0.1106, 0.1310, 0.1496, 0.1610, 0.1604, 0.1473, 0.1262,
    0.1031, 0.0820, 0.0645, 0.0508, 0.0402, 0.0320, 0.0258, 0.0209, 0.0172,
)  # fmt: skip


def test_bars_are_the_numbers_of_sub_planes_of_figure_4() -> None:
    charts = light_charts(load_scene("fig4c"))
    (axes, curve) = draw(charts, "fig4c").axes
    bars = axes.patches
    assert tuple(int(bar.get_height()) for bar in bars) == M_K
    assert sum(M_K) == 174
    middles = [bar.get_x() + 0.5 * bar.get_width() for bar in bars]
    assert middles == pytest.approx([31.5098 + 1.2 * k for k in range(23)], abs=1e-4)
    assert curve.lines[0].get_ydata() == pytest.approx(F_L, abs=5.1e-5)
    assert list(curve.lines[0].get_xdata()) == pytest.approx(middles)


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_every_light_has_a_panel(tmp_path: Path, suffix: str) -> None:
    charts = write_chart(load_scene("fig9a"), tmp_path / f"chart{suffix}")
    assert [(len(c.sub_planes), sum(c.sub_planes)) for c in charts] == [(9, 309), (13, 174), (16, 162)]
    assert [path.name for path in tmp_path.iterdir()] == [f"chart{suffix}"]


def test_a_scene_whose_light_lies_behind_the_camera_has_no_chart(tmp_path: Path) -> None:
    away = load_scene("fig4c", ["camera.look_at_m=[0.0,14.0,-90.0]"])
    with pytest.raises(SceneError, match="no planes in front of the camera"):
        write_chart(away, tmp_path / "chart.png")
    assert not list(tmp_path.iterdir())
