"""The draft's figures: each by one function, the same every time, no label in another's way."""

from __future__ import annotations

from itertools import combinations

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

from cuticle._support.plots import figure_bytes
from cuticle.draft.document import Document
from cuticle.draft.figures import figure_1, figure_2, figure_3, figure_comparison, figure_functions, figure_mixing, figures


def test_figures_are_drawn_each_by_one_function(reproduced: Document) -> None:
    d, own = reproduced, reproduced.fits["found"].sampler
    drawn = {
        "1": figure_1(d.model, cells=(20, 30)),
        "2": figure_2(d.model, 4, cells=(20, 30)),
        "3": figure_3(d.model, strands=(1, 8), theta_r=(0, 60)),
        "functions": figure_functions(d.table_2, d.found.functions if d.found else None),
        "comparison": figure_comparison(d.model, own, d.fits["lobes"].sampler, theta_r=-45, strands=(0, 8)),
        "mixing": figure_mixing(d.mixing),
    }
    maps = [len(drawn[k].axes) for k in ("1", "2", "3", "comparison")]
    assert maps == [36, 36, 4, 10 + 3]  # maps and colour bars
    for name, figure in drawn.items():
        made = figure_bytes(figure, "svg")
        assert made.startswith(b"<?xml")
        if name in ("functions", "1"):  # the same bytes every time: of curves, and of maps
            assert made == figure_bytes(figure, "svg")
        for text in figure.findobj(match=lambda artist: hasattr(artist, "get_text")):
            assert "nan" not in text.get_text()  # type: ignore[attr-defined]


@pytest.mark.slow
def test_no_label_runs_into_another(reproduced: Document) -> None:
    for name, (figure, _) in figures(reproduced).items():
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        boxes = []
        for text in figure.findobj(match=lambda artist: isinstance(artist, Text)):
            box = text.get_window_extent(canvas.get_renderer())
            if text.get_text().strip() and text.get_visible() and figure.bbox.overlaps(box):
                boxes.append((text.get_text(), box))
        assert len(boxes) > 20
        for (first, p), (second, q) in combinations(boxes, 2):
            apart = p.x0 >= q.x1 - 1 or q.x0 >= p.x1 - 1 or p.y0 >= q.y1 - 1 or q.y0 >= p.y1 - 1
            assert apart or first == second, (name, first, second)  # a legend's text is found twice
