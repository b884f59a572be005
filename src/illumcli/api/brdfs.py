"""BRDFs of illumination models: values for directions, albedo, slices, figures."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypeAlias, TypedDict, Unpack, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from illumcli.api.choices import chosen
from illumcli.api.scenes import Overrides, given_keys, override_texts
from illumcli.arrays import column_major
from illumcli.brdf import draw_looks, looks, notes, views, write_merl_of
from illumcli.brdf.albedo import albedo
from illumcli.brdf.plot import DEFAULT_VIEWS, PLOT, Plot, View, Width, in_order
from illumcli.brdf.views import Counted
from illumcli.errors import InputError
from illumcli.models._base import IlluminationModel
from illumcli.records import Record
from illumcli.schema.description import Description
from illumcli.schema.fields import ListOf

AnyModel: TypeAlias = "str | Mapping[str, Any] | IlluminationModel"
"""A model's name, its keys as a material of a scene has them, or its description."""


class PlotKeywords(TypedDict, total=False):
    """How models are drawn; each is the option of ``illum brdf`` of the same name."""

    views: Sequence[str] | str
    """Of `polar`, `cartesian`, `across`, `albedo`, `sphere`, `plane` and `lobe`, or `all`."""
    angles: Sequence[float]
    """Angles of incidence of the slices [degrees]; the lobe is that of the middle one."""
    log: bool
    """True for a logarithmic scale of slices and lobes, four decades."""
    times_cos: bool
    """True for the response, cosine included, instead of the BRDF."""
    overlay: bool
    """True for the curves of all models on one axis."""
    per_channel: bool
    """True for a curve of R, G and B each, instead of luminance."""
    labels: Sequence[str] | str
    """What the figure calls the models, one for each."""
    width: float
    """Of the whole figure, 1 to 40 [inches]; by default 3.1 for each model."""


class PlotChoices(Description):
    """The options of `brdf`; angles are checked as those of `Brdf.slice`."""

    views: ListOf[View] = DEFAULT_VIEWS
    angles: ListOf[float] = PLOT.angles
    log: bool = PLOT.log
    times_cos: bool = PLOT.times_cos
    overlay: bool = PLOT.overlay
    per_channel: bool = PLOT.per_channel
    labels: ListOf[str] = PLOT.labels
    width: Width | None = PLOT.width


class Drawing(Record):
    """Models side by side; a notebook shows the figure of ``illum brdf``, for which it needs matplotlib."""

    looks: Mapping[str, Counted]
    plot: Plot

    @property
    def notes(self) -> list[str]:
        """Which of the values that were computed so far were negative or not finite, and are 0."""
        return notes(self.looks)

    def save(self, path: str | os.PathLike[str], force: bool = False) -> Path:
        """Write the figure, or the values as a table. Returns the path.

        Parameters
        ----------
        path
            `.png`, `.svg` or `.pdf` for a figure, `.csv` for the polar slices, `.binary` for the MERL table
            of one model without a grain.
        force : bool
            Replace a file that differs.

        Raises
        ------
        InputError
            Another suffix; no matplotlib.
        OutputError
            A different file exists, or it cannot be written.
        """
        path = Path(path)
        if path.suffix == ".binary":
            write_merl_of(self.looks, path, force)
        else:
            figure, table = (None, path) if path.suffix == ".csv" else (path, None)
            draw_looks(self.looks, figure, table, self.plot, force)
        return path

    def _repr_png_(self) -> bytes | None:
        if find_spec("matplotlib") is None:
            return None
        from illumcli.brdf.figure import figure_file

        return figure_file(self.looks, self.plot, "png")


class Brdf(Drawing):
    """One model: its values, and its figure."""

    def __repr__(self) -> str:
        return f"<brdf of {self.model!r}>"

    @property
    def model(self) -> IlluminationModel:
        """Its description."""
        return self._look.model

    @property
    def _look(self) -> Counted:
        return next(iter(self.looks.values()))

    def values(
        self,
        l: ArrayLike,
        v: ArrayLike,
        *,
        n: ArrayLike = (0, 0, 1),
        t: ArrayLike = (1, 0, 0),
        times_cos: bool = False,
    ) -> NDArray[np.float64]:
        """(..., 3) the BRDF for directions [1/sr]; 0 where one of them is at or below the horizon.

        Parameters
        ----------
        l, v : (..., 3) array_like
            Towards the light and the eye; any length. They are broadcast with each other, `n` and `t`.
        n, t : (..., 3) array_like
            The normal, and the direction of the grain, at right angles to it.
        times_cos : bool
            The response, cosine included, instead of the BRDF.

        Raises
        ------
        InputError
            Arrays that are no directions, or do not fit together.
        """
        given = {"l": l, "v": v, "n": n, "t": t}
        units = {name: _directions(name, each) for name, each in given.items()}
        try:
            shape = np.broadcast_shapes(*(each.shape for each in units.values()))
        except ValueError:
            shapes = ", ".join(f"{name} {each.shape}" for name, each in units.items())
            raise InputError(f"directions do not fit together: {shapes}") from None
        l, v, n, t = (column_major(np.broadcast_to(each, shape).reshape(-1, 3)) for each in units.values())
        return np.ascontiguousarray(views.values(self._look, n, l, v, t, times_cos)).reshape(shape)

    def albedo(self, angles: ArrayLike) -> NDArray[np.float64]:
        """(..., 3) the share of light from these angles of incidence that leaves the surface [degrees]."""
        angles = _angles(angles)
        shares = [albedo(self._look, float(angle))[0] for angle in angles.ravel()]
        return np.reshape(shares, (*angles.shape, 3))

    def slice(self, angle: float, times_cos: bool = False) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(K,) angles of view in the plane of incidence [degrees], those on the light's side negative, and
        (K, 3) values.

        Parameters
        ----------
        angle : float
            Of incidence [degrees].
        """
        return views.polar_slice(self._look, float(_angles(angle)), times_cos)


class Brdfs(Drawing, Mapping[str, Brdf]):
    """Several models by title, drawn side by side."""

    def __getitem__(self, title: str) -> Brdf:
        return Brdf({title: self.looks[title]}, self.plot)

    def __iter__(self) -> Any:
        return iter(self.looks)

    def __len__(self) -> int:
        return len(self.looks)

    def __repr__(self) -> str:
        return f"<brdfs: {', '.join(self)}>"


@overload
def brdf(  # type: ignore[overload-overlap]  # text is a sequence, too
    model: AnyModel, overrides: Overrides = (), **plot: Unpack[PlotKeywords]
) -> Brdf: ...
@overload
def brdf(model: Sequence[AnyModel], overrides: Overrides = (), **plot: Unpack[PlotKeywords]) -> Brdfs: ...
def brdf(
    model: AnyModel | Sequence[AnyModel], overrides: Overrides = (), **plot: Unpack[PlotKeywords]
) -> Brdf | Brdfs:
    """The BRDF of a model, or those of several: values for directions, albedo, and a figure.

    Parameters
    ----------
    model : model or sequence of them
        A name, a mapping with the keys of a material, or a description such as `illumcli.models.ward.Ward()`.
    overrides : mapping or sequence of str
        Parameters: ``{"alpha_x": 0.05}`` of every model that has it, ``{"ward.alpha_x": 0.05}`` of one by
        name, ``{"2.alpha_x": 0.05}`` by place.
    plot
        See `PlotKeywords`.

    Returns
    -------
    Brdf
        Of one model. Of several, a mapping of them by title.

    Raises
    ------
    IllumError
        What ``illum brdf`` would say.

    Examples
    --------
    >>> ward = illum.brdf("ward", {"alpha_x": 0.05}, views=["polar", "lobe"])
    >>> ward.values(l=[0, 0, 1], v=[1, 0, 1])
    >>> ward.save("ward.pdf")
    """
    alone = isinstance(model, str | Mapping | IlluminationModel)
    names, texts = _named([model] if alone else model)  # type: ignore[list-item,arg-type]
    settings = _plot(plot)
    drawn = looks(names, (*texts, *override_texts(overrides, Path())), settings.labels)
    return (Brdf if alone else Brdfs)(drawn, settings)


def _plot(keywords: PlotKeywords) -> Plot:
    """The settings of a drawing.

    Raises
    ------
    InputError
        An unknown option, or a value that is none of it.
    """
    given: dict[str, Any] = dict(keywords)
    if given.get("angles") is not None:
        given["angles"] = np.atleast_1d(_angles(given["angles"])).tolist()
    choices = chosen(PlotChoices, given, ("views", "labels"))
    return Plot(**{**dict(choices), "views": in_order(choices.views)})


def _named(models: Sequence[AnyModel]) -> tuple[list[str], list[str]]:
    """The names of models, and the overrides with their parameters."""
    if isinstance(models, bytes) or not isinstance(models, Sequence) or not models:
        raise InputError("model: must be a name, the keys of a material, a description, or a list of these")
    names: list[str] = []
    texts: list[str] = []
    for place, each in enumerate(models, start=1):
        if isinstance(each, str):
            names.append(each)
            continue
        keys: dict[str, Any] = {}
        if isinstance(each, IlluminationModel | Mapping):
            keys |= given_keys(each) if isinstance(each, IlluminationModel) else each
        name = keys.pop("model", None)
        if not isinstance(name, str):
            raise InputError(f"model {place}: must name its model, as a material of a scene does")
        names.append(name)
        texts += override_texts({f"{place}.{key}": value for key, value in keys.items()}, Path())
    return names, texts


def _directions(name: str, given: ArrayLike) -> NDArray[np.float64]:
    """(..., 3) unit vectors."""
    try:
        array = np.asarray(given, np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{name}: must be an array of directions, (..., 3) numbers") from None
    if array.ndim == 0 or array.shape[-1] != 3:
        raise InputError(f"{name}: must be an array of directions, (..., 3) numbers, is {array.shape}")
    lengths = np.linalg.norm(array, axis=-1, keepdims=True)
    if not (np.isfinite(lengths) & (lengths > 0)).all():
        raise InputError(f"{name}: directions must be finite, and longer than 0")
    return array / lengths


def _angles(given: ArrayLike) -> NDArray[np.float64]:
    """Angles of incidence [degrees]."""
    try:
        angles = np.asarray(given, np.float64)
    except (TypeError, ValueError):
        raise InputError("angles: must be numbers [degrees]") from None
    if not (angles.size and ((angles >= 0) & (angles < 90)).all()):
        raise InputError("angles: must be at least 0 and below 90 degrees")
    return angles
