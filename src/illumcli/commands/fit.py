"""Fits of models to a measurement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from illumcli.brdf import described
from illumcli.errors import OutputError
from illumcli.files.outputs import refuse_suffix, refuse_unwritable
from illumcli.fitting.fit import Fit, fit_model
from illumcli.fitting.lobes import with_lobes
from illumcli.fitting.material import name_of
from illumcli.fitting.measurement import Measurement, read_measurement
from illumcli.models._base import IlluminationModel
from illumcli.progress import Progress, no_progress
from illumcli.records import Record, Value
from illumcli.schema.families import tag_of


class FitOptions(Value):
    """What is fitted, and how."""

    models: tuple[str, ...]
    """Names of models."""
    overrides: tuple[str, ...] = ()
    """`PARAMETER=VALUE`: parameters that are not fitted."""
    lobes: int = 1
    """Number of specular lobes."""
    metric: str = "cosine"
    isotropic: bool = False
    """True if the surface has no grain; measurements whose format has no azimuth never have."""


class Fits(Record):
    """Fitted models and what they were fitted to."""

    measurement: Measurement
    by_name: dict[str, Fit]
    """By the name of their material."""


def fit_models(
    path: Path, options: FitOptions, name: str | None = None, progress: Progress = no_progress
) -> Fits:
    """Fit each model to the measurement of a file.

    Parameters
    ----------
    name : str, optional
        Of the material, by default that of the file; several models have their tags appended.

    Raises
    ------
    InputError
        The measurement cannot be read; a model or parameter does not exist, or cannot be fitted.
    """
    models = described(options.models, options.overrides)
    wanted = {title: with_lobes(model, options.lobes) for title, model in models.items()}
    measurement = read_measurement(path)
    if options.isotropic:
        measurement = replace(measurement, is_isotropic=True)
    fits = {
        _name(name or path.stem, title, wanted): fit_model(model, measurement, options.metric, progress)
        for title, model in wanted.items()
    }
    return Fits(measurement, fits)


def _name(stem: str, title: str, models: dict[str, IlluminationModel]) -> str:
    return name_of(stem if len(models) == 1 else f"{stem}_{title}")


def refuse_picture(path: Path, force: bool) -> None:
    """Raise an error if a picture cannot be written there; nothing is created.

    Raises
    ------
    InputError
        Its suffix is no picture's.
    OutputError
        A file is there and `force` is False, or it cannot be written.
    """
    refuse_suffix(path, "a picture of a fit", ".png", ".svg", ".pdf")
    refuse_unwritable(path)
    if path.exists() and not force:
        raise OutputError(f"{path}: a file is there; use --force to replace it, or another name")


def write_picture(path: Path, source: Path, fits: Sequence[Fit], measurement: Measurement) -> None:
    """Draw the measurement and the fits."""
    from illumcli.files.atomic import write_bytes
    from illumcli.fitting.figure import figure_file

    drawn = {tag_of(type(fit.model)): fit for fit in fits}
    write_bytes(path, figure_file(source, drawn, measurement, path.suffix.lower().removeprefix(".")))
