"""Progress bars show the time of their stage, and names of stages literally."""

from types import SimpleNamespace

from meeframe.api import progress


def test_alternating_stages_have_separate_times(monkeypatch, capsys):
    now = [0.0]
    monkeypatch.setattr(progress, "time", SimpleNamespace(monotonic=lambda: now[0]))
    with progress.bars() as show:
        for stage, seconds in (("contact", 5.0), ("[red]writing", 2.0), ("contact", 70.0), ("[red]writing", 1.0)):
            show(stage, 0.5)
            now[0] += seconds
        show("figures", 0.0)
        now[0] += 9.0
    lines = {line.split()[0]: line.split()[-1] for line in capsys.readouterr().err.splitlines()}
    assert lines == {"contact": "0:01:15", "[red]writing": "0:00:03", "figures": "0:00:09"}
