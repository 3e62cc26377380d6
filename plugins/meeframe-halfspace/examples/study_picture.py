"""Draw the picture of the study of a rough surface: `uv run python study_picture.py FILE.png`."""

import sys
from pathlib import Path

from meeframe.results.figures import save_figure
from meeframe.study.rough.figures import contact_figure
from meeframe.study.rough.study import load_study, rough

STUDY = Path(__file__).with_name("rough-study.toml")

if __name__ == "__main__":
    result = rough(load_study(STUDY, {}))
    if not result.is_converged:
        raise RuntimeError(f"{STUDY}: not converged")
    save_figure(contact_figure(result), Path(sys.argv[1]))
