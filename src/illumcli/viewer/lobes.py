"""The data of the BRDF panel: slices, the lobe in space, a lit sphere and a lit plane of several models."""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from illumcli.brdf import views
from illumcli.brdf.curves import quantity
from illumcli.brdf.pictures import in_srgb
from illumcli.brdf.plot import Plot
from illumcli.brdf.scales import DECADES, STEEPEST, radius, scale
from illumcli.brdf.views import Doubles
from illumcli.color import luminance
from illumcli.errors import InputError
from illumcli.models._base import IlluminationModel
from illumcli.records import Record, Value
from illumcli.scene.access import resolve
from illumcli.scene.scene_file import SceneFile
from illumcli.schema.docs import summary
from illumcli.viewer.specimens import described, prepared

STEPS = 36
"""Of a lobe, from its peak to the horizon."""
SPHERE, PLANE = 128, 192
"""Width of the pictures [pixels]."""
KEPT = 24
"""Models whose pictures a window keeps."""


class Lit(Value):
    """The light of slices and lobes, and their scale."""

    theta: float
    """Angle of the light to the normal [degrees], below 90."""
    phi: float
    """Angle that the plane of incidence is turned by, about the normal [degrees]; the grain stays."""
    log: bool = False
    cosine: bool = False
    """True for the response, cosine included, instead of the BRDF."""


class Curves(Record):
    """What changes with the light."""

    angles: Doubles
    slice: Doubles
    """(K,) luminance."""
    directions: Doubles
    """(R, C, 3) unit vectors over the hemisphere, the light at -x."""
    lobe: Doubles
    """(R, C) luminance."""


class Specimen(Record):
    """A model that is shown."""

    model: IlluminationModel
    pictures: Mapping[str, Any]
    """Its sphere and plane, which the light of the panel does not change."""


class LobePanel:
    """Answers the messages of the BRDF panel of one window; it keeps the models that it showed last."""

    def __init__(self) -> None:
        self._kept: dict[str, Specimen] = {}

    def answer(self, loaded: SceneFile, message: Mapping[str, Any]) -> dict[str, Any]:
        """The data of the models that the message names; the reason in place of one that cannot be shown.

        Raises
        ------
        InputError
            Too many models.
        Exception
            One of `messages.MISUNDERSTOOD`.
        """
        theta, phi = float(message["theta"]), float(message["phi"])
        if not (math.isfinite(theta) and math.isfinite(phi)):
            raise ValueError("theta and phi are angles in degrees")
        lit = Lit(
            min(max(theta, 0.0), 89.9),
            phi,
            bool(message.get("log")),
            bool(message.get("cosine")),
        )
        if len(message["of"]) > KEPT:
            raise InputError(f"{len(message['of'])} BRDFs are too many; choose {KEPT} at most")
        shown = [self._shown(loaded, of, lit) for of in message["of"]]
        top = _top([curves for _, curves in shown if curves is not None], lit.log)
        theta, phi = np.radians([lit.theta, lit.phi])
        incident = -np.sin(theta) * np.cos(phi), -np.sin(theta) * np.sin(phi), np.cos(theta)
        return {
            "type": "lobes",
            "theta": lit.theta,
            "phi": lit.phi,
            "log": lit.log,
            "cosine": lit.cosine,
            "quantity": quantity(Plot(times_cos=lit.cosine)),
            "top": top,
            "decades": DECADES,
            "incident": [float(each) for each in incident],
            "lobes": [
                entry if curves is None else entry | _drawn(curves, lit, top) for entry, curves in shown
            ],
        }

    def _shown(
        self, loaded: SceneFile, of: Mapping[str, Any], lit: Lit
    ) -> tuple[dict[str, Any], Curves | None]:
        """What is told of a model beside its curves, and the curves; None if it cannot be shown."""
        label = " ".join(map(str, of.values()))
        try:
            specimen = self._specimen(loaded, of)
        except InputError as error:
            return {"label": label, "of": of, "problem": "; ".join(error.problems)}, None
        title = summary(type(specimen.model)).partition(":")[0]
        entry = {"label": label, "title": title, "of": of, **specimen.pictures}
        return entry, _curves(specimen.model, lit)

    def _specimen(self, loaded: SceneFile, of: Mapping[str, Any]) -> Specimen:
        model = described(loaded, of)
        files = [resolve(loaded, file).stat().st_mtime_ns for file in model.files().values()]
        key = f"{model.model_dump_json()} {loaded.folder} {files}"
        if key not in self._kept:
            while len(self._kept) >= KEPT:
                del self._kept[next(iter(self._kept))]
            ready = prepared(loaded, model)
            sphere, plane = views.lit_sphere(ready, SPHERE), views.lit_plane(ready, PLANE)
            self._kept[key] = Specimen(ready, {"sphere": _picture(sphere), "plane": _picture(plane)})
        return self._kept[key]


def _curves(model: IlluminationModel, lit: Lit) -> Curves:
    angles, values = views.polar_slice(model, lit.theta, lit.cosine, -lit.phi)
    directions, lobe = views.lobe(model, lit.theta, lit.cosine, STEPS, -lit.phi)
    return Curves(angles, luminance(values), directions, luminance(lobe))


def _top(shown: Sequence[Curves], log: bool) -> float:
    """The value at the rim, of all models."""
    is_visible = np.cos(np.radians(STEEPEST))
    slices = [each.slice[np.abs(each.angles) < STEEPEST] for each in shown]
    return scale([*slices, *(each.lobe[each.directions[..., 2] > is_visible] for each in shown)], log)


def _drawn(curves: Curves, lit: Lit, top: float) -> dict[str, Any]:
    """Slice and lobe as the page draws them, with radii up to 1; the lobe is turned to its light."""
    x, y, z = np.moveaxis(curves.directions * radius(curves.lobe, top, lit.log)[..., None], -1, 0)
    cos, sin = np.cos(np.radians(lit.phi)), np.sin(np.radians(lit.phi))
    points = np.stack([cos * x - sin * y, sin * x + cos * y, z], axis=-1).astype("<f4")
    rows, columns = z.shape
    return {
        "slice": {
            "angles": _short(curves.angles),
            "values": _short(curves.slice),
            "radius": _short(radius(curves.slice, top, lit.log)),
        },
        "lobe": {"rows": rows, "columns": columns, "points": base64.b64encode(points.tobytes()).decode()},
    }


def _short(values: Doubles) -> list[float]:
    return [float(f"{value:.5g}") for value in values.tolist()]


def _picture(picture: Doubles) -> dict[str, Any]:
    """A picture as RGBA bytes in sRGB."""
    height, width = picture.shape[:2]
    data = np.round(in_srgb(picture) * 255).astype(np.uint8)
    return {"width": width, "height": height, "pixels": base64.b64encode(data.tobytes()).decode()}
