"""`--target-error`: the picture has the target error, and the stated error is the true one."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from illumcli.accuracy import target
from illumcli.accuracy.sampled import Sampling, sampled_layer
from illumcli.accuracy.target import VarianceLaw, choose_sampling, paired_error
from illumcli.errors import InputError, LimitError
from illumcli.scene.load import load
from ring import RING

SCENE = RING.format(samples=1, ambient=0.8)


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "ring.yaml"
    path.write_text(SCENE)
    return path


def true_rmse(path, choice, layer="beauty"):
    own = sampled_layer(load(path), layer)
    fine = Sampling(32, 32, "owen", 77)
    truth = np.mean([own.render(fine)[0], own.render(Sampling(32, 32, "owen", 78))[0]], axis=0, dtype=float)
    made = own.render(Sampling(choice.sampling.pixel, choice.sampling.obscurance, "spiral", 0))[0]
    return math.sqrt(np.square(made - truth).mean())


@pytest.mark.parametrize("error", [0.04, 0.02])
def test_the_picture_errs_as_asked_and_says_so(scene, error):
    choice = choose_sampling(scene, error)
    truth = true_rmse(scene, choice)
    assert choice.expected <= error
    assert truth < 1.15 * error
    assert truth > 0.4 * error  # no more work than needed
    assert choice.reached() == pytest.approx(truth, rel=0.15)


def test_200_doubled_pixels_tell_the_error_of_a_picture(scene, monkeypatch):
    monkeypatch.setattr(target, "MIN_PIXELS", 200)
    monkeypatch.setattr(target, "FILM_SHARE", 10**9)
    own = sampled_layer(load(scene), "obscurance")
    every = [paired_error(own, Sampling(1, 8, "spiral", 0), f"try {k}")[0] for k in range(12)]
    truth = own.render(Sampling(1, 2048, "owen", 4))[0].astype(float)
    pictures = [own.render(Sampling(1, 8, "spiral", seed))[0] for seed in range(8)]
    error = math.sqrt(np.mean([np.square(picture - truth).mean() for picture in pictures]))
    assert math.sqrt(np.mean(every)) == pytest.approx(error, rel=0.1)
    assert np.std(np.sqrt(every)) < 0.15 * np.mean(np.sqrt(every))


def test_laws_go_through_their_points():
    law = VarianceLaw.through((4, 0.04), (16, 0.005))
    assert law.power == pytest.approx(1.5)
    assert (law.at(4), law.at(16)) == pytest.approx((0.04, 0.005))
    assert VarianceLaw.through((4, 0.0), (16, 0.0)).at(2) == 0
    assert VarianceLaw.through((4, 1.0), (16, 2.0)).power == 1  # never taken to grow with samples


def test_pilots_share_no_random_number_with_the_picture(scene, monkeypatch):
    seeds = []
    own = sampled_layer(load(scene), "beauty")
    monkeypatch.setattr(
        type(own),
        "render_pixels",
        lambda self, sampling, x, y: (seeds.append(sampling.seed), (np.zeros((3, 1)), 0))[1],
    )
    for k in range(3):
        paired_error(own, Sampling(2, 4, "spiral", 0), f"check {k}")
    assert 0 not in seeds
    assert len(set(seeds)) == 6 * target.SEEDS


def test_nothing_to_reach_and_too_much(scene):
    with pytest.raises(InputError, match="--target-error needs one"):
        choose_sampling(scene, 0.01, only=["depth"])
    with pytest.raises(LimitError, match="choose a larger"):
        choose_sampling(scene, 1e-9)


@pytest.mark.parametrize("reconstruct", ["null", "false"])
def test_the_command_chooses_renders_and_reports(illum, scene, tmp_path, reconstruct):
    own = ("-D", f"obscurance.reconstruct={reconstruct}")
    words = (*own, "--target-error", "0.05", "-o", "ring.exr", "--report", "r.json", "--force")
    done = illum("render", "ring.yaml", *words)
    assert (done.returncode, done.stdout) == (0, "ring.exr\n")
    error = json.loads((tmp_path / "r.json").read_text())["error"]
    assert error["target"] == 0.05
    assert 0 < error["reached"] < 0.06
    counts = (f"film.samples={error['pixel_samples']}", f"obscurance.samples={error['obscurance_samples']}")
    assert error["reconstructed"] == (reconstruct == "null")
    assert all(count in done.stderr for count in counts)
    fitted = f"obscurance.reconstruct={str(error['reconstructed']).lower()}"
    chosen = [word for count in (*counts, fitted) for word in ("-D", count)]
    again = illum("render", "ring.yaml", *chosen, "-o", "again.exr")
    assert again.returncode == 0
    same = illum("compare", "ring.exr", "again.exr", "--no-flip", "--max-difference", "0")
    assert same.returncode == 0, same.stdout
