"""Draw BRDFs: slices, albedo, a lit sphere, a lit plane, the lobe in space; and tables of them.

Called, the package is the function of the interface: ``illumcli.brdf("ward")``.
"""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from illumcli.brdf import views
from illumcli.brdf.outputs import write_files
from illumcli.brdf.plot import DEFAULT_VIEWS, PLOT, VIEWS, Plot
from illumcli.brdf.views import Counted, Look
from illumcli.callable_package import make_callable
from illumcli.errors import InputError
from illumcli.files.outputs import refuse_suffix, refuse_unwritable
from illumcli.images.drawings import read_numbers
from illumcli.models._base import IlluminationModel
from illumcli.scene.faults import faults
from illumcli.scene.override import Override, parse
from illumcli.scene.source import Problem
from illumcli.schema.description import Description
from illumcli.schema.families import member, tag_of
from illumcli.schema.messages import suggestion

__all__ = ["DEFAULT_VIEWS", "PLOT", "VIEWS", "Plot", "described", "draw_brdfs", "slices_table", "write_merl"]

PACKAGE = "illumcli.models"
make_callable(__name__, "illumcli.api.brdfs")


def draw_brdfs(
    names: Sequence[str],
    overrides: Sequence[str] = (),
    output: Path | None = None,
    table: Path | None = None,
    plot: Plot = PLOT,
    force: bool = False,
) -> tuple[list[Path], list[Path], list[str]]:
    """Draw the models `names` side by side.

    Parameters
    ----------
    overrides : sequence of str
        `PARAMETER=VALUE` for every model, or `MODEL.PARAMETER=VALUE`; MODEL is a name or a number from 1.
    output : Path, optional
        A picture, .png, .svg or .pdf.
    table : Path, optional
        The polar slices as CSV.

    Returns
    -------
    paths : list of Path
        All files.
    kept : list of Path
        Those that have the same bytes already.
    notes : list of str
        What is drawn as 0 because it is negative or not finite.

    Raises
    ------
    InputError
        Models or parameters do not exist, or values are out of range; all problems at once.
    OutputError
        A different file exists and `force` is not given.
    """
    _refuse_outputs(output, table)
    models = looks(names, overrides, plot.labels)
    return (*draw_looks(models, output, table, plot, force), notes(models))


def looks(
    names: Sequence[str], overrides: Sequence[str] = (), labels: Sequence[str] = ()
) -> dict[str, Counted]:
    """The models `names` by their titles, ready to be evaluated.

    Raises
    ------
    InputError
        As `draw_brdfs`.
    """
    return _counted(_labelled(_prepared(described(names, overrides)), labels))


def draw_looks(
    models: Mapping[str, Counted], output: Path | None, table: Path | None, plot: Plot, force: bool
) -> tuple[list[Path], list[Path]]:
    """Draw models side by side: the files, and those that are kept, as `draw_brdfs`."""
    _refuse_outputs(output, table)
    files: dict[Path, bytes] = {}
    if table is not None:
        files[table] = slices_table(models, plot).encode()
    if output is not None:
        from illumcli.brdf.figure import figure_file

        files[output] = figure_file(models, plot, output.suffix.lower().removeprefix("."))
    return list(files), write_files(files, force)


def _refuse_outputs(output: Path | None, table: Path | None) -> None:
    """Refuse outputs that cannot be written before anything is computed."""
    if output is not None:
        refuse_suffix(output, "a picture of BRDFs", ".png", ".svg", ".pdf")
    if table is not None:
        refuse_suffix(table, "a table", ".csv")
    for path in (table, output):
        if path is not None:
            refuse_unwritable(path)


def _prepared(models: Mapping[str, IlluminationModel]) -> dict[str, IlluminationModel]:
    """The models with what they read from files."""
    return {title: model.prepared(read_numbers) for title, model in models.items()}


def _labelled(models: Mapping[str, IlluminationModel], labels: Sequence[str]) -> dict[str, IlluminationModel]:
    """The models by the user's labels, if there are any."""
    if not labels:
        return dict(models)
    if len(labels) != len(models):
        raise InputError(f"--label: {len(labels)} for {len(models)} models; give one for each")
    if len(set(labels)) < len(labels):
        raise InputError("--label: two models have the same; give each its own")
    return dict(zip(labels, models.values(), strict=True))


def _counted(models: Mapping[str, IlluminationModel]) -> dict[str, Counted]:
    """The models with counts of 0."""
    return {title: Counted(model, Counter()) for title, model in models.items()}


def notes(models: Mapping[str, Counted]) -> list[str]:
    """A line for each model of which something is drawn as 0."""
    return [
        f"{title}: {each.mended.total()} values were negative or not finite, and are 0; "
        "see illum verify SCENE, with the model in a scene"
        for title, each in models.items()
        if each.mended
    ]


def write_merl(
    names: Sequence[str], overrides: Sequence[str], path: Path, force: bool = False
) -> tuple[list[Path], list[str]]:
    """Write one isotropic model as a MERL table, which `model: merl` reads.

    Returns
    -------
    kept : list of Path
        The file, if it has the same bytes already.
    notes : list of str
        What the table cannot hold, and what is 0 in it because it is negative or not finite.

    Raises
    ------
    InputError
        Not one model, or one with a grain; otherwise as `draw_brdfs`.
    OutputError
        A different file exists and `force` is not given.
    """
    _refuse_table(path)
    return write_merl_of(looks(names, overrides), path, force)


def _refuse_table(path: Path) -> None:
    refuse_suffix(path, "a MERL table", ".binary")
    refuse_unwritable(path)


def write_merl_of(
    models: Mapping[str, Counted], path: Path, force: bool = False
) -> tuple[list[Path], list[str]]:
    """Write one model as a MERL table, as `write_merl`.

    Raises
    ------
    InputError
        Not one model, or one with a grain.
    OutputError
        A different file exists and `force` is not given.
    """
    from illumcli.brdf.merl_table import merl_table
    from illumcli.measured_files import merl

    _refuse_table(path)
    if len(models) != 1:
        raise InputError(f"{path}: a MERL table holds one model, and {len(models)} are named; name one")
    ((title, look),) = models.items()
    if look.model.has_grain():
        raise InputError(
            f"{path}: {title} is anisotropic with these parameters, and a MERL table is isotropic; "
            "choose parameters without a grain, or another model"
        )
    table = merl_table(look)
    kept = write_files({path: merl.encode(table.values)}, force)
    fact = f"{title} changes if light and eye are exchanged; {path} holds the mean of both"
    return kept, [*([] if table.is_reciprocal else [fact]), *notes(models)]


def described(names: Sequence[str], overrides: Sequence[str] = ()) -> dict[str, IlluminationModel]:
    """The models by name, with their parameters; models named twice get the number of their place.

    Raises
    ------
    InputError
        Models or parameters do not exist, or values are out of range; all problems at once.
    """
    # Parse the overrides; all problems are raised at once.
    problems: list[str] = []
    unreadable: list[Problem] = []
    changes = [(text, change) for text in overrides if (change := parse(text, unreadable))]
    problems += map(str, unreadable)

    # Apply to each model the overrides that address it.
    models: dict[str, IlluminationModel] = {}
    applied: set[str] = set()
    parameters: list[str] = []
    for place, name in enumerate(names, start=1):
        title = name if names.count(name) == 1 else f"{name} {place}"
        try:
            Model = member(PACKAGE, name)
        except LookupError as error:
            problems.append(f"no model '{name}'; {error}")
            applied |= {text for text, change in changes if change.steps[0] in (name, str(place))}
            continue
        parameters += [name for name in Model.model_fields if name != "model"]
        settings = [
            (text, setting)
            for text, change in changes
            if (setting := _for(change, name, place, Model, names))
        ]
        applied |= {text for text, _ in settings}
        model, facts = _described(Model, settings)
        problems += [f"{title}: {fact}" if not fact.startswith("-D ") else fact for fact in facts]
        if model is not None:
            models[title] = model

    # Refuse overrides that address no model.
    known = tuple(dict.fromkeys([*names, *parameters]))
    for text, change in changes:
        if text not in applied:
            hint = suggestion(change.steps[0], known)
            problems.append(f"-D {text}: no model or parameter '{change.steps[0]}'; {hint}")
    if problems:
        raise InputError(dict.fromkeys(problems))
    return models


def _for(
    change: Override, name: str, place: int, Model: type[Description], names: Sequence[str]
) -> tuple[tuple[str, ...], Any] | None:
    """The override's path within the model and its value; None if it does not address the model."""
    first, *rest = change.steps
    if first in (name, str(place)) and rest:
        return tuple(rest), change.value.plain()
    if first in Model.model_fields and first != "model" and first not in names:
        return change.steps, change.value.plain()
    return None


def _described(
    Model: type[Any], changes: Sequence[tuple[str, tuple[tuple[str, ...], Any]]]
) -> tuple[IlluminationModel | None, list[str]]:
    """The model with its changes; or None and the problems, with the overrides that cause them."""
    # Nest the keys as in a scene.
    keys: dict[str, Any] = {"model": tag_of(Model)}
    text_of: dict[tuple[str, ...], str] = {}
    for text, (steps, value) in changes:
        here = keys
        for step in steps[:-1]:
            here = here.setdefault(step, {})
            if not isinstance(here, dict):
                return None, [f"-D {text}: {step} is a value and has no parts; replace the whole"]
        here[steps[-1]] = value
        text_of[steps] = text

    # Validate; a problem is attributed to the last override of its key.
    try:
        return Model.model_validate(keys), []
    except ValidationError as error:
        facts = []
        for path, fact in faults(error, Model, keys):
            where = ".".join(map(str, path))
            given = [text for steps, text in text_of.items() if path[: len(steps)] == steps]
            facts.append(f"-D {given[-1]}: {fact}" if given else f"{where}: {fact}" if where else fact)
        return None, facts


def slices_table(models: Mapping[str, Look], plot: Plot) -> str:
    """The polar slices as CSV: model, both angles [degrees], values; the light is at negative angles."""
    out = io.StringIO()
    rows = csv.writer(out, lineterminator="\n")
    kind = "response" if plot.times_cos else "f"
    rows.writerow(["model", "incidence", "view", *(f"{kind}.{channel}" for channel in "RGB")])
    for title, model in models.items():
        for incidence in plot.angles:
            angles, values = views.polar_slice(model, incidence, plot.times_cos)
            for angle, color in zip(angles.tolist(), values.tolist(), strict=True):
                rows.writerow([title, f"{incidence:g}", f"{angle:.10g}", *(repr(each) for each in color)])
    return out.getvalue()
