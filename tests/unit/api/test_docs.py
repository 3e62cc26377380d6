"""The tutorial docs/tutorials/python.md works as printed."""

import re
from pathlib import Path

import numpy as np
import pytest

PAGE = (Path(__file__).parents[3] / "docs" / "tutorials" / "python.md").read_text(encoding="utf-8")


@pytest.mark.full
def test_page_runs(tmp_path, monkeypatch):
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("agg")
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    for text in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL):
        exec(text, names)
    pyplot.close("all")
    result = names["result"]
    assert result.status == "converged"
    assert (tmp_path / "overview.pdf").read_bytes().startswith(b"%PDF")
    np.testing.assert_allclose(names["middle"].max(), max(-step.traction[:, 2].min() for step in result))
    force, area = (names["curve"][name].max() for name in ("normal_force", "contact_area"))
    assert names["mean_pressure"] == pytest.approx(force / area, rel=0.2)
    assert names["again"].to_toml() == names["text"] == result.provenance.case_text


def test_message_of_the_page():
    import meeframe

    message = re.search(r"`(Case: mesh\.half_width = .*?)`", PAGE, re.DOTALL)[1]
    with pytest.raises(meeframe.MeeframeError) as caught:
        meeframe.Case(
            material="pzt-4",
            mesh=meeframe.mesh.block("50 s", "120 mm", "5 mm", divisions=6, rings=2, layers=1),
            indenter=meeframe.Sphere("100 mm"),
            steps=[meeframe.Step(approach=1e-5)],
        )
    assert str(caught.value) == " ".join(message.split())
