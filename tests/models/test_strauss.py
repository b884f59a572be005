"""Strauss: published values, its mirror and its metal."""

from __future__ import annotations

import numpy as np

from illumcli.models.strauss import Strauss, Surface, strauss_fresnel, strauss_geometry, strauss_specular

MIRRORED = {"n": [0, 0, 1], "l": [0.6, 0, 0.8], "v": [-0.6, 0, 0.8]}


def model_of(i):
    names = ("smoothness", "metalness", "transparency", "kj", "kf", "kg")
    return Strauss(color=tuple(i.get("color", (1.0, 1.0, 1.0))), **{name: i[name] for name in names})


def test_published_values(cases, respond, agree):
    for case in cases("strauss"):
        i = case["inputs"]
        model = model_of(i)
        ambient = np.array(model.ambient_color()) * i["ambient"]
        agree(respond(model, i) * i["light"] + ambient, case)


def test_published_terms(cases, frame, term, agree):
    for case in cases("strauss_terms"):
        i = case["inputs"]
        words = frame(i)
        # these terms are defined below the horizon too, so cosines are taken as they are
        n_l, n_v = ((words["n"] * words[word]).sum(1) for word in "lv")
        named = [term(name, **words) for name in ("sin_l", "sin_v", "gap_rv")]
        s, t = i["smoothness"], i["transparency"]
        parts = strauss_specular(n_l, n_v, *named, Surface(s, t, i["kj"], i["kf"], i["kg"]))
        r_d = (1 - s**3) * (1 - t)
        agree([r_d, 1 - t - r_d, *(part[0] for part in parts)], case)


def test_published_fresnel_and_geometry(cases, agree):
    for case in cases("strauss_fresnel"):
        agree(strauss_fresnel(case["inputs"]["x"], case["inputs"]["kf"]), case)
    for case in cases("strauss_geometry"):
        agree(strauss_geometry(1 - case["inputs"]["x"], case["inputs"]["kg"]), case)


def test_a_perfectly_smooth_surface_is_a_mirror(respond):
    mirror = Strauss(smoothness=1.0, metalness=1.0)
    assert respond(mirror, MIRRORED).min() > 0.79
    assert not respond(mirror, MIRRORED | {"v": [-0.6, 1e-6, 0.8]}).any()


def test_single_precision_finds_the_mirror_image_too(frame):
    from illumcli.arrays import F
    from illumcli.shading.terms import evaluate

    given = {name: value.astype(F) for name, value in frame(MIRRORED).items()}
    assert evaluate(Strauss(smoothness=1.0).lobes(), given)["specular"].min() > 0.99


def test_metals_color_their_highlight_and_others_do_not(respond):
    red = (1.0, 0.2, 0.2)
    plain = respond(Strauss(color=red, smoothness=1.0), MIRRORED)
    metal = respond(Strauss(color=red, smoothness=1.0, metalness=1.0), MIRRORED)
    assert plain[0] == plain[1] == metal[0]
    assert metal[1] < 0.3 * metal[0]
