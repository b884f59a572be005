"""Does a virtual gonioreflectometer agree with models on their own micro-surfaces, and where do they err?

Question   Are mirror V-grooves Torrance and Sparrow's, Lambertian ones the Oren-Nayar integral, circular
           ones Poulin and Fournier's, within the standard errors that are stated? How far are Oren and
           Nayar's fits from their integral, and Smith's masking from Gaussian surfaces?
Reference  The formulas, summed over the very slopes of the surfaces (_micro_surfaces.py); no rays.
Repeats    8 replicates of every value, REALISATIONS Gaussian surfaces; z = (measured - reference) / error,
           whose root mean square is 1.18 for 8 replicates (Student's t with 7 degrees of freedom) and less
           where a value is exact.

    python benchmarks/gonioreflectometer.py [--small]
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping

import numpy as np

from _bench import SMALL, header, took
from _micro_surfaces import (
    Array,
    beckmann,
    cylinders,
    gaussian_heights,
    gaussian_surface,
    grooves,
    in_plane,
    oren_nayar_integral,
    profile_first_order,
    slope_quantiles,
    smith_lambda,
    torrance_sparrow,
)
from illumcli.gonioreflectometer.bench import Bench
from illumcli.gonioreflectometer.directions import around_half_vector, half_angles, turned
from illumcli.gonioreflectometer.estimate import of_replicates
from illumcli.gonioreflectometer.lambert import LambertSettings, lambert_orders
from illumcli.gonioreflectometer.mirrors import Ring, above_horizon, mirrored_once, seen_and_lit
from illumcli.gonioreflectometer.surface import Surface
from illumcli.models.oren_nayar import oren_nayar_ab, oren_nayar_terms
from illumcli.models.poulin_fournier import Across, facing, lit_and_seen

REALISATIONS = 2 if SMALL else 8
SAMPLES = 256 if SMALL else 4096
Data = Mapping[str, Array]
EXPECTED = np.sqrt(7 / 5)


def scores(measured: Array, error: Array, reference: Array) -> Array:
    """z of each value."""
    return np.divide(measured - reference, error, out=np.zeros_like(measured), where=error > 0)


def said(name: str, z: Array, off: Array) -> None:
    """Print a row of the table of z-scores."""
    mean = z.mean() * np.sqrt(len(z)) / EXPECTED
    rms = np.sqrt(np.mean(z**2))
    print(
        f"{name:44s} {len(z):6d} {mean:+6.2f} {rms:6.2f} {np.abs(z).max():6.2f} "
        f"{100 * np.sqrt(np.mean(off**2)):8.2f}"
    )


# --- 1. mirror grooves ----------------------------------------------------------------------------------


def masking_of_grooves() -> Iterator[Data]:
    """G across grooves of one slope, eye and light mirrored at the facet: measured and formula."""
    for slope in np.radians([15.0, 30.0, 45.0]):
        surface = grooves(np.array([slope]))
        ring = Ring.of(surface, slope, np.radians(0.5))
        theta_v = np.radians(np.arange(-88.0, 89.0, 4.0))
        v = in_plane(theta_v)
        h = in_plane(np.full(len(theta_v), slope))
        v_h = np.sum(v * h, axis=1)
        l = 2 * v_h[:, None] * h - v
        seen = (v_h > 0.02) & (l[:, 2] > 0.02)
        l, v, v_h = l[seen], v[seen], v_h[seen]
        _, theta_d, phi_d = half_angles(l, v)
        means = seen_and_lit(Bench(surface), (surface, ring), (theta_d, phi_d), SAMPLES, (1,))
        to_share = (4 * l[:, 2] * v[:, 2])[:, None]
        share, error = of_replicates(means * to_share, np.full(len(l), 1 / SAMPLES), SAMPLES)
        formula = torrance_sparrow(np.cos(np.full(len(l), slope)), l[:, 2], v[:, 2], v_h)
        yield {"slope": slope, "theta": theta_v[seen], "measured": share, "error": error, "formula": formula}


def rows_of_grooves() -> Data:
    """f_r of grooves of many slopes at random angles where some facet is masked: measured, and the sum over
    the slopes."""
    slopes = slope_quantiles(128 if SMALL else 1024, np.radians(20.0))
    surface = grooves(slopes)
    bench, random = Bench(surface), np.random.default_rng(3)
    measured, errors, reference = [], [], []
    for theta in np.radians([5.0, 15.0, 30.0, 45.0]):
        ring = Ring.of(surface, theta, np.radians(0.5))
        cells = 100 if SMALL else 1000
        theta_d = np.arcsin(np.sqrt(random.random(cells)) * np.sin(np.radians(80)))
        phi_d = np.pi * random.random(cells)
        found = mirrored_once(bench, (surface, ring), (theta_d, phi_d), 512, (4, int(1e4 * theta)))
        value, error = of_replicates(found, np.full(cells, np.inf), 512)
        # Each slope of the ring, with its facets' area, at its own h.
        own = slopes[(slopes >= ring.low) & (slopes < ring.high)]
        masks = np.zeros(cells, np.bool_)
        total, part = np.zeros(cells), above_horizon(ring, theta_d, phi_d)
        for slope in own:
            h = np.broadcast_to([np.sin(slope), 0.0, np.cos(slope)], (cells, 3))
            l, v = around_half_vector(h, theta_d, phi_d)
            n_l, n_v = l[:, 2], v[:, 2]
            high = (n_l > np.sin(np.radians(1))) & (n_v > np.sin(np.radians(1)))
            G = torrance_sparrow(np.cos(slope), n_l, n_v, np.cos(theta_d))
            masks |= G < 1
            total += np.where(high, G / (4 * n_l * n_v), 0) / np.cos(slope)
        solid_angle = 2 * np.pi * (np.cos(ring.low) - np.cos(ring.high))
        expected = total / len(slopes) / solid_angle
        chosen = (part == 1) & masks
        measured.append(value[chosen])
        errors.append(error[chosen])
        reference.append(expected[chosen])
    return {
        "measured": np.concatenate(measured),
        "error": np.concatenate(errors),
        "formula": np.concatenate(reference),
    }


# --- 2. Lambertian grooves ------------------------------------------------------------------------------


def oren_nayar(sigma: float, incidence: float, samples: int = SAMPLES) -> Data:
    """Orders 1 and 2 in the plane of incidence: measured, integral, full fit and qualitative form."""
    slopes = slope_quantiles(64 if SMALL else 256, np.radians(sigma))
    theta = np.radians(np.arange(-80.0, 81.0, 20.0 if SMALL else 8.0))
    l = np.tile(in_plane(np.radians([incidence])), (len(theta), 1))
    v = in_plane(theta)
    orders = lambert_orders(Bench(grooves(slopes)), l, v, samples, LambertSettings(2, True, (5, int(sigma))))
    one = 1 / (np.pi * l[:, 2] * samples)
    (first, first_error), (second, second_error) = (of_replicates(order, one, samples) for order in orders)
    f1, f2 = oren_nayar_integral(slopes, l, v, 90 if SMALL else 360)
    fit1, fit2, form = fits(l, v, sigma)
    return {
        "theta": theta, "first": first, "first_error": first_error, "second": second,
        "second_error": second_error, "f1": f1, "f2": f2, "fit1": fit1, "fit2": fit2, "form": form,
    }  # fmt: skip


def fits(l: Array, v: Array, sigma: float) -> tuple[Array, Array, Array]:
    """Oren and Nayar's fits of both orders, and their qualitative form, for an albedo of 1 [1/sr]."""
    sin_l, sin_v = np.hypot(l[:, 0], l[:, 1]), np.hypot(v[:, 0], v[:, 1])
    across = np.sum(l[:, :2] * v[:, :2], axis=1)
    cos_phi = across / np.maximum(sin_l * sin_v, 1e-12)
    spread = np.full(len(l), np.radians(sigma))
    fit1, fit2 = oren_nayar_terms(l[:, 2], v[:, 2], sin_l, sin_v, cos_phi, spread)
    form = oren_nayar_ab(l[:, 2], v[:, 2], np.sum(l * v, axis=1), spread)
    return fit1 / np.pi, fit2 / np.pi, form / np.pi


def simplifications() -> Data:
    """Relative errors of the full fit and the qualitative form for white facets, up to 75 degrees."""
    sigmas = np.array([10.0, 30.0]) if SMALL else np.arange(5.0, 46.0, 5.0)
    random = np.random.default_rng(6)
    count = 20 if SMALL else 150
    l, v = (
        turned(in_plane(np.arcsin(np.sqrt(random.random(count)) * np.sin(np.radians(75)))), turn)
        for turn in (np.zeros(count), 2 * np.pi * random.random(count))
    )
    rows = []
    for sigma in sigmas:
        f1, f2 = oren_nayar_integral(slope_quantiles(64, np.radians(sigma)), l, v, 180)
        fit1, fit2, form = fits(l, v, sigma)
        off = [
            (np.maximum(fit1 + fit2, 0) / (f1 + f2)) - 1,
            form / (f1 + f2) - 1,
            fit1 / f1 - 1,
            form / f1 - 1,
        ]
        rows.append([[np.sqrt(np.mean(each**2)), np.abs(each).max()] for each in off])
    return {"sigma": sigmas, "errors": np.array(rows)}


# --- 3. Gaussian surfaces -------------------------------------------------------------------------------

KINDS: Mapping[str, Callable[[float, int], Surface]] = {
    "profile": lambda slope, seed: gaussian_surface(
        gaussian_heights((2048 if SMALL else 16384,), 16.0, slope, seed)
    ),
    "surface": lambda slope, seed: gaussian_surface(
        gaussian_heights((96, 96) if SMALL else (384, 384), 12.0, slope, seed)
    ),
    "rougher": lambda slope, seed: gaussian_surface(
        gaussian_heights((96, 96) if SMALL else (384, 384), 6.0, slope, seed, "matern")
    ),
}


def visibility(kind: str, slope: float) -> Data:
    """Of the facets that face a direction, by their share of the mean plane, those that it reaches.

    `bins` has it by the facet's slope towards the direction, at 70 degrees; `both` for level facets from two
    directions on opposite sides; all with the spread of REALISATIONS surfaces.
    """
    theta = np.radians([30.0, 70.0] if SMALL else np.arange(10.0, 86.0, 5.0))
    edges = slope * np.linspace(-0.5, 2.5, 13)
    shares, bins, both, level = [], [], [], []
    for seed in range(REALISATIONS):
        surface = KINDS[kind](slope, seed)
        bench, random = Bench(surface), np.random.default_rng(seed + 100)
        count = 4000 if SMALL else 40000
        up = np.cumsum(np.maximum(surface.area_vectors[:, 2], 0))
        triangle = np.searchsorted(up / up[-1], random.random(count)).astype(np.int32)
        points = bench.points_on(triangle, random.random((count, 2)))
        turn = 2 * np.pi * random.random(count) * (kind != "profile")
        shares.append([])
        both.append([])
        level.append([])
        for each in theta:
            d = turned(in_plane(np.full(count, each)), turn)
            open_ = ~bench.occluded(points, d)
            facing_ = np.sum(points.normal * d, axis=1) > 0
            shares[-1].append(np.mean(open_[facing_]))
            towards = -(points.normal[:, 0] * np.cos(turn) + points.normal[:, 1] * np.sin(turn))
            towards = towards / points.normal[:, 2]
            if round(np.degrees(each)) == 70:
                place = np.digitize(-towards, edges)
                bins.append([np.mean(open_[facing_ & (place == k)]) for k in range(1, len(edges))])
            flat = np.abs(towards) < 0.15 * slope
            other = ~bench.occluded(
                points.take(np.flatnonzero(flat)), turned(d[flat], np.full(flat.sum(), np.pi))
            )
            both[-1].append(np.mean(open_[flat] & other))
            level[-1].append(np.mean(open_[flat]))
    means = {"share": shares, "bins": bins, "both": both, "level": level}
    out: dict[str, Array] = {"theta": theta, "edges": edges}
    for name, values in means.items():
        out[name] = np.nanmean(values, axis=0)
        out[f"{name}_error"] = np.nanstd(values, axis=0, ddof=1) / np.sqrt(REALISATIONS)
    return out


def slices_of_gaussian(slope: float, incidence: float) -> Data:
    """f_r of mirror facets in the plane of incidence, with Beckmann's D by Smith and by V-grooves."""
    theta = np.radians(np.arange(-80.0, 81.0, 40.0 if SMALL else 5.0))
    l, v = np.tile(in_plane(np.radians([incidence])), (len(theta), 1)), in_plane(theta)
    theta_h, theta_d, phi_d = half_angles(l, v)
    found = []
    for seed in range(REALISATIONS):
        surface = KINDS["surface"](slope, seed)
        bench = Bench(surface)
        values = []
        for k in range(len(theta)):
            ring = Ring.of(surface, theta_h[k], np.radians(1.0))
            cell = theta_d[k : k + 1], phi_d[k : k + 1]
            values.append(mirrored_once(bench, (surface, ring), cell, 512, (seed, k)).mean())
        found.append(values)
    lam_l, lam_v = (smith_lambda(slope, np.maximum(np.arccos(d[:, 2]), 1e-3)) for d in (l, v))
    base = beckmann(slope, theta_h) / (4 * l[:, 2] * v[:, 2])
    return {
        "theta": theta,
        "measured": np.mean(found, axis=0),
        "error": np.std(found, axis=0, ddof=1) / np.sqrt(REALISATIONS),
        "separable": base / ((1 + lam_l) * (1 + lam_v)),
        "correlated": base / (1 + lam_l + lam_v),
        "grooves": base * torrance_sparrow(np.cos(theta_h), l[:, 2], v[:, 2], np.cos(theta_d)),
    }


# --- 4. circular grooves --------------------------------------------------------------------------------


def poulin_fournier(incidence: float, steepest: float = 0.9) -> Data:
    """Lambertian logs across their axes: measured, by sums with all shadows, the model without."""
    theta = np.radians(np.arange(-84.0, 85.0, 28.0 if SMALL else 6.0))
    l, v = np.tile(in_plane(np.radians([incidence])), (len(theta), 1)), in_plane(theta)
    surface = cylinders(steepest, 128)
    orders = lambert_orders(Bench(surface), l, v, SAMPLES, LambertSettings(1, False, (7, int(incidence))))
    measured, error = of_replicates(orders[0], 1 / (np.pi * l[:, 2] * SAMPLES), SAMPLES)
    psi = np.linspace(-steepest, steepest, 129)
    formula = profile_first_order(np.sin(psi), np.cos(psi), l, v)
    a, b = Across(l[:, 2], l[:, 0]), Across(v[:, 2], v[:, 0])
    model = facing(a, b, lit_and_seen(a, b, np.float64(steepest)))
    model = model / (2 * np.pi * np.sin(steepest) * l[:, 2] * v[:, 2])
    return {"theta": theta, "measured": measured, "error": error, "formula": formula, "model": model}


# --- the table ------------------------------------------------------------------------------------------


def mirror_grooves() -> None:
    for each in masking_of_grooves():
        name = f"mirror grooves of {np.degrees(each['slope']):.0f} degrees: G"
        z = scores(each["measured"], each["error"], each["formula"])
        said(name, z, each["measured"] - each["formula"])
    rows = rows_of_grooves()
    off = rows["measured"] / rows["formula"] - 1
    said("mirror grooves of many slopes: f_r", scores(rows["measured"], rows["error"], rows["formula"]), off)


def lambertian_grooves() -> None:
    for sigma, incidence in ((20.0, 75.0), (40.0, 75.0), (40.0, 30.0)):
        each = oren_nayar(sigma, incidence)
        for order, name in (("first", "f1"), ("second", "f2")):
            z = scores(each[order], each[f"{order}_error"], each[name])
            said(
                f"Lambertian grooves, sigma {sigma:.0f}, {incidence:.0f}: {name}",
                z,
                each[order] / each[name] - 1,
            )


def circular_grooves() -> None:
    for incidence in (0.0, 30.0, 70.0):
        each = poulin_fournier(incidence)
        z = scores(each["measured"], each["error"], each["formula"])
        said(f"Lambertian logs, {incidence:.0f}: with shadows", z, each["measured"] / each["formula"] - 1)
        off = each["model"] / each["formula"] - 1
        print(f"{'    the model, without shadows, is off by':44s} {100 * np.sqrt(np.mean(off**2)):36.2f} %")


def gaussian_surfaces() -> None:
    for kind in KINDS:
        for slope in (0.5**0.5,):
            each = visibility(kind, slope)
            smith = 1 / (1 + smith_lambda(slope, each["theta"]))
            z = scores(each["share"], each["share_error"], smith)
            said(f"Gaussian {kind}, slope {slope:.2f}: G1 by Smith", z, each["share"] - smith)
            at = int(np.argmin(np.abs(each["theta"] - np.radians(70))))
            pair = f"{each['share'][at]:.4f} +- {each['share_error'][at]:.4f}"
            print(f"    at 70 degrees {pair}, Smith {smith[at]:.4f}")


def main() -> None:
    header(__doc__.partition("\n")[0])
    print(f"{'surface':44s} {'values':>6s} {'mean z':>6s} {'rms z':>6s} {'most':>6s} {'off [%]':>8s}")
    for part in (mirror_grooves, lambertian_grooves, circular_grooves, gaussian_surfaces):
        time = took(part)
        print(f"    {time.wall:.1f} s, {time.cpu:.1f} s of processors")
    table = simplifications()
    print(
        "Oren-Nayar, white facets, up to 75 degrees, against f1 + f2: "
        "full fit, qualitative form [%], root mean square (most)"
    )
    for sigma, row in zip(table["sigma"], 100 * table["errors"], strict=True):
        print(
            f"    sigma {sigma:4.0f}: {row[0, 0]:5.1f} ({row[0, 1]:5.1f})   "
            f"{row[1, 0]:5.1f} ({row[1, 1]:5.1f})"
        )


if __name__ == "__main__":
    sys.exit(main())
