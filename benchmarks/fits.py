"""Do fits find known parameters within their stated errors, and which model fits measured materials best?

Recovery: pairs of directions with normal noise (`tests/fitting/recovery.py`); z is the deviation of a
parameter from the truth in its standard errors, over all seeds and parameters. Its root mean square is 1, and
95 % are within 1.96, if errors are right. Ranking: files of measurements, named on the command line, fitted
by each model under each metric; the distance as a share of that of black.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

from _bench import ROOT, SMALL, header
from illumcli.commands.fit import FitOptions, fit_models

sys.path.insert(0, str(ROOT / "tests"))
from fitting.recovery import ABSOLUTE, CASES, RELATIVE, z_scores

SEEDS = 2 if SMALL else 60
PAIRS = 200 if SMALL else 2000
MODELS = ("lambert", "blinn_phong", "ward", "ashikhmin_shirley", "cook_torrance", "lafortune", "principled")
GIVEN = ("blinn_phong.normalised=true", "cook_torrance.distribution={D: ggx}", "cook_torrance.masking=smith")


def main() -> None:
    """Print a row per model, then a row per file, metric and model."""
    header(
        "do fits find known parameters within their stated errors?",
        seeds=SEEDS,
        pairs=PAIRS,
        noise=f"{RELATIVE:.0%} + {ABSOLUTE:g}",
    )
    titles = f"{'RMS z':>8}{'+-':>6}{'in 95 %':>9}{'largest mean z':>16}{'cpu s':>8}"
    print(f"{'model':40}{'errors from':>12}{titles}")

    for case in list(CASES)[: 2 if SMALL else None]:
        for with_errors in (True, False):
            start = time.process_time()
            z = z_scores(case, range(SEEDS), PAIRS, with_errors=with_errors)
            squares = np.square(z).mean(axis=1)
            rms = np.sqrt(squares.mean())
            spread = squares.std(ddof=1) / np.sqrt(len(z)) / (2 * rms)
            print(
                f"{case:40}{'the table' if with_errors else 'residuals':>12}{rms:8.2f}{spread:6.2f}"
                f"{np.mean(np.abs(z) < 1.96):9.1%}{np.abs(z.mean(axis=0)).max() * np.sqrt(len(z)):16.1f}"
                f"{time.process_time() - start:8.1f}",
                flush=True,
            )
    for name in (word for word in sys.argv[1:] if not word.startswith("-")):
        rank(Path(name))


def rank(path: Path) -> None:
    """Fit every model to a file under every metric."""
    for metric in ("cosine", "cube_root", "log"):
        for model in MODELS:
            start = time.process_time()
            given = tuple(each.partition(".")[2] for each in GIVEN if each.startswith(f"{model}."))
            (fit,) = fit_models(path, FitOptions((model,), given, metric=metric)).by_name.values()
            share = fit.distances[metric] / fit.sizes[metric]
            print(
                f"{path.stem:32}{metric:11}{model:20}{share:8.1%}"
                f"{fit.optimum.reached:4d} of {fit.optimum.starts}{time.process_time() - start:8.1f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
