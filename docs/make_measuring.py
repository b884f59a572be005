"""Draws the plots of measuring.md: micro-surfaces measured by rays, beside what models say of them.

Run it after a change to the gonioreflectometer; it takes some minutes of a core:

    python docs/make_measuring.py [NAME...]
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import matplotlib
import numpy as np

matplotlib.use("agg")
import matplotlib.pyplot as plt

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "benchmarks"))
micro, measured = map(import_module, ("_micro_surfaces", "gonioreflectometer"))

PICTURES = Path(__file__).with_name("measuring")
WIDTH = 6.6
"""Of a picture [inches]: two columns of a page."""
BLUE, ORANGE, GREEN, PINK, GREY = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#555555"
"""Okabe and Ito's colours, which colour-blind readers tell apart; lines differ in their dashes, too."""
STYLE = {
    "font.size": 8,
    "font.family": "serif",
    "mathtext.fontset": "dejavuserif",
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 8,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "lines.linewidth": 1.1,
    "legend.frameon": False,
    "legend.fontsize": 7,
    "legend.handlelength": 2.2,
    "savefig.dpi": 200,
}
POINTS: Mapping[str, Any] = {"fmt": "o", "ms": 2.4, "elinewidth": 0.7, "capsize": 0, "zorder": 3}


def main() -> None:
    PICTURES.mkdir(exist_ok=True)
    plt.rcParams.update(STYLE)
    for name in sys.argv[1:] or DRAWINGS:
        figure = DRAWINGS[name]()
        figure.savefig(PICTURES / f"{name}.png", metadata={"Software": None})
        plt.close(figure)


def sheet(columns: int, height: float, ratios: tuple[float, ...] | None = None) -> tuple[Any, Any]:
    """A figure and its axes side by side."""
    return plt.subplots(
        1, columns, figsize=(WIDTH, height), layout="constrained", width_ratios=ratios, squeeze=True
    )


def degrees(axes: Any, label: str, step: float = 30) -> None:
    """An axis of angles."""
    axes.set_xlabel(label)
    axes.xaxis.set_major_locator(plt.MultipleLocator(step))


def surfaces() -> Any:
    """The cross-sections of the four surfaces."""
    figure, axes = plt.subplots(1, 4, figsize=(WIDTH, 0.62), layout="constrained")
    slopes = np.random.default_rng(5).permutation(micro.slope_quantiles(7, np.radians(25)))
    x = np.arange(15) / 2
    z = np.zeros(15)
    z[1::2] = -np.tan(slopes) / 2
    psi = np.linspace(-0.9, 0.9, 60)
    log_x = np.concatenate([np.sin(psi) + 2 * k * np.sin(0.9) for k in range(4)])
    heights = micro.gaussian_heights((256,), 12.0, 0.5, 3)
    profiles = (
        (x, z, "V-grooves, mirrors", BLUE),
        (x, z, "V-grooves, matt", ORANGE),
        (np.arange(256.0), heights, "Gaussian heights, mirrors", BLUE),
        (log_x, np.tile(np.cos(psi), 4), "logs, matt", ORANGE),
    )
    for ax, (across, up, title, colour) in zip(axes, profiles, strict=True):
        across, up = (across - across[0]) / np.ptp(across), up / np.ptp(across)
        ax.fill_between(across, up - up.max(), -0.17, color=colour, alpha=0.18, lw=0)
        ax.plot(across, up - up.max(), color=colour, lw=1)
        ax.set_aspect("equal")
        ax.set_ylim(-0.17, 0.01)
        ax.set_axis_off()
        ax.set_title(title)
    return figure


def torrance_sparrow() -> Any:
    figure, (left, right) = sheet(2, 2.5, (1.5, 1))
    for each, colour, dash in zip(
        measured.masking_of_grooves(), (BLUE, ORANGE, GREEN), ("-", "--", "-."), strict=True
    ):
        theta = np.degrees(each["theta"])
        name = f"slope {np.degrees(each['slope']):.0f}°"
        left.plot(theta, each["formula"], dash, color=colour, label=name)
        left.errorbar(theta, each["measured"], each["error"], color=colour, **POINTS)
    degrees(left, "eye, to the normal [degrees]")
    left.set(ylabel="$G$: facets lit and seen", ylim=(0, 1.05))
    left.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=3)

    rows = measured.rows_of_grooves()
    z = measured.scores(rows["measured"], rows["error"], rows["formula"])
    edges = np.linspace(-4, 4, 41)
    right.hist(z, edges, density=True, color=BLUE, alpha=0.35)
    centres = (edges[1:] + edges[:-1]) / 2
    right.plot(centres, np.exp(-(centres**2) / 2) / np.sqrt(2 * np.pi), color=GREY, label="normal")
    right.set(xlabel="(measured − formula) / stated error", ylabel="density")
    right.set_title(f"$f_r$ of many slopes, {len(z):,} cells")
    right.legend(loc="upper left")
    return figure


def oren_nayar() -> Any:
    figure, axes = sheet(2, 2.7)
    for ax, sigma in zip(axes, (20.0, 40.0), strict=True):
        each = measured.oren_nayar(sigma, 75.0)
        theta = np.degrees(each["theta"])
        f1, both = each["f1"] * np.pi, (each["f1"] + each["f2"]) * np.pi
        first, second = each["first"] * np.pi, each["second"] * np.pi
        error = np.hypot(each["first_error"], each["second_error"]) * np.pi
        ax.plot(theta, both, color=BLUE, label="integral, both orders")
        ax.errorbar(theta, first + second, error, color=BLUE, **POINTS)
        ax.plot(theta, f1, color=GREY, label="integral, first order")
        ax.errorbar(theta, first, each["first_error"] * np.pi, color=GREY, **POINTS)
        full = np.maximum(each["fit1"] + each["fit2"], 0) * np.pi
        ax.plot(theta, full, "--", color=ORANGE, label="Oren–Nayar, full fit")
        ax.plot(theta, each["form"] * np.pi, ":", color=GREEN, lw=1.6, label="Oren–Nayar, qualitative")
        ax.set_title(rf"$\sigma = {sigma:.0f}°$, light from 75°")
        degrees(ax, "eye, to the normal [degrees]")
        ax.set_ylim(0, None)
    axes[0].set_ylabel(r"$\pi f_r$ of white facets")
    axes[0].legend(loc="upper left")
    return figure


def oren_nayar_errors() -> Any:
    figure, axes = sheet(2, 2.2)
    table = measured.simplifications()
    for ax, column, title in ((axes[0], 0, "root mean square"), (axes[1], 1, "largest")):
        for row, colour, dash, name in (
            (0, ORANGE, "--", "full fit"),
            (1, GREEN, ":", "qualitative form"),
            (2, GREY, "-", "first order of the fit alone"),
        ):
            ax.plot(table["sigma"], 100 * table["errors"][:, row, column], dash, color=colour, label=name)
        ax.set(xlabel=r"$\sigma$ [degrees]", ylim=(0, None), title=f"error, {title} [%]")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return figure


def smith() -> Any:
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(WIDTH, 2.6), layout="constrained")
    slope = 0.5**0.5
    kinds = (
        ("profile", BLUE, "profile"),
        ("surface", ORANGE, "surface"),
        ("rougher", GREEN, "rougher surface"),
    )
    found = {kind: measured.visibility(kind, slope) for kind, _, _ in kinds}
    theta = np.radians(np.linspace(8, 86, 100))
    lam = micro.smith_lambda(slope, theta)
    left.plot(np.degrees(theta), 1 / (1 + lam), color=GREY, label="Smith")
    right.plot(np.degrees(theta), 1 / (1 + lam) ** 2, "--", color=GREY, label="Smith, separable")
    right.plot(np.degrees(theta), 1 / (1 + 2 * lam), color=GREY, label="Smith, correlated")
    middle.axhline(1 / (1 + micro.smith_lambda(slope, np.radians([70.0]))[0]), color=GREY, label="Smith")
    for kind, colour, name in kinds:
        each = found[kind]
        angle = np.degrees(each["theta"])
        left.errorbar(angle, each["share"], each["share_error"], color=colour, label=name, **POINTS)
        right.errorbar(angle, each["both"], each["both_error"], color=colour, **POINTS)
        centre = (each["edges"][1:] + each["edges"][:-1]) / 2
        middle.errorbar(centre, each["bins"], each["bins_error"], color=colour, **POINTS)
    for ax in (left, right):
        degrees(ax, "direction, to the normal [degrees]")
        ax.set_ylim(0, 1.03)
        ax.legend(loc="lower left")
    left.set_title("facets seen, of those that face the eye")
    middle.set_title("the same by slope, eye at 70°")
    middle.set(xlabel="slope towards the eye", ylim=(0, 1.03))
    right.set_title("level facets, lit and seen")
    return figure


def gaussian() -> Any:
    figure, axes = sheet(2, 2.6)
    for ax, roughness in zip(axes, (0.5, 1.0), strict=True):
        each = measured.slices_of_gaussian(roughness / 2**0.5, 70.0)
        theta = np.degrees(each["theta"])
        for name, dash, colour, label in (
            ("separable", "--", ORANGE, "Smith, separable"),
            ("correlated", "-", BLUE, "Smith, correlated"),
            ("grooves", ":", GREEN, "V-grooves"),
        ):
            ax.plot(theta, each[name], dash, color=colour, label=label)
        ax.errorbar(theta, each["measured"], each["error"], color="black", label="measured", **POINTS)
        ax.set_title(f"roughness {roughness:g}, light from 70°")
        degrees(ax, "eye, to the normal [degrees]")
        ax.set_ylim(0, None)
    axes[0].set_ylabel(r"$f_r$ [1/sr]")
    axes[0].legend(loc="upper right")
    return figure


def poulin_fournier() -> Any:
    figure, axes = plt.subplots(1, 3, figsize=(WIDTH, 2.3), layout="constrained", sharey=True)
    for ax, incidence in zip(axes, (0.0, 30.0, 70.0), strict=True):
        each = measured.poulin_fournier(incidence)
        theta = np.degrees(each["theta"])
        ax.plot(theta, each["formula"] * np.pi, color=BLUE, label="arcs, with shadows")
        ax.plot(theta, each["model"] * np.pi, "--", color=ORANGE, label="model, without")
        ax.errorbar(
            theta, each["measured"] * np.pi, each["error"] * np.pi, color="black", label="measured", **POINTS
        )
        ax.set_title(f"light from {incidence:.0f}°")
        degrees(ax, "eye [degrees]", 45)
        ax.set_ylim(0, 2.2)
    axes[0].set_ylabel(r"$\pi f_r$ of white facets")
    axes[0].legend(loc="upper center")
    return figure


def copper() -> Any:
    """Bumps of copper and a sphere of what was measured of them."""
    formula = "0.1*cos(2*pi*x)*cos(2*pi*y) + 0.03*cos(4*pi*x + 1)*cos(6*pi*y)"
    x, y = np.meshgrid(*2 * (np.arange(400) / 200,))
    z = 0.1 * np.cos(2 * np.pi * x) * np.cos(2 * np.pi * y)
    z += 0.03 * np.cos(4 * np.pi * x + 1) * np.cos(6 * np.pi * y)
    figure, (left, right) = plt.subplots(1, 2, figsize=(WIDTH * 0.7, 2.3), layout="constrained")
    light = matplotlib.colors.LightSource(135, 40)
    left.imshow(light.hillshade(z, vert_exag=1, dx=1 / 200, dy=1 / 200), cmap="gray", origin="lower")
    left.set_title("four periods of the bumps")
    with TemporaryDirectory() as folder:
        table, picture = f"{folder}/copper.binary", f"{folder}/copper.png"
        run("measure", formula, "--fresnel", "copper", "--samples", "32", "--grid", "256", "-o", table)
        run("brdf", "merl", "-D", f"file={table}", "--view", "sphere", "-o", picture)
        sphere = plt.imread(picture)
    right.imshow(sphere[30:])
    right.set_title("a sphere of them")
    for ax in (left, right):
        ax.set_axis_off()
    return figure


def run(*words: str) -> None:
    """Run a command of illum."""
    subprocess.run([sys.executable, "-m", "illumcli", *words, "-q"], check=True)


DRAWINGS: Mapping[str, Callable[[], Any]] = {
    "copper": copper,
    "surfaces": surfaces,
    "torrance_sparrow": torrance_sparrow,
    "oren_nayar": oren_nayar,
    "oren_nayar_errors": oren_nayar_errors,
    "smith": smith,
    "gaussian": gaussian,
    "poulin_fournier": poulin_fournier,
}

if __name__ == "__main__":
    main()
