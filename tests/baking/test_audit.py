"""The audit of values: unbiased over noise and bias, with an interval that holds the truth."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.baking.audit import Audit, Audited, ErrorLaw, _chances, _drawn, audit
from illumcli.baking.sampling import PointEstimates
from illumcli.visibility.obscurance_error import Estimates


class Sampler:
    """Estimates of a known truth with independent errors."""

    def __init__(self, truth, sigma, seed):
        self.truth, self.sigma, self.seed, self.replicates = truth, sigma, seed, []

    def estimate(self, purpose, counts, replicate):
        self.replicates.append(replicate)
        noise = np.random.default_rng([self.seed, replicate]).normal(0, self.sigma, len(counts.points))
        values = (self.truth[counts.points] + noise).astype(np.float32)
        rays = int(counts.samples.sum())
        return PointEstimates(Estimates(values, np.zeros(len(values), np.float32)), rays)


def audits(bias, expected, seeds=40):
    """Audits of values that err by noise of 0.01 and a bias at a few points, and the true square errors."""
    found, true = [], []
    for seed in range(seeds):
        random = np.random.default_rng([1, seed])
        truth = random.random(20000)
        w = truth + random.normal(0, 0.01, len(truth)) + bias * (np.arange(len(truth)) % 50 == 0)
        values = Audited(np.arange(len(w)), w, np.full(len(w), expected**2), 64, 0.03**2)
        found.append(audit(Sampler(truth, 0.01, seed), values, 0))
        true.append(np.mean(np.square(w - truth)))
    return found, np.array(true)


@pytest.mark.parametrize(("bias", "expected"), [(0.0, 0.01), (0.08, 0.015), (0.03, 0.002)])
def test_noise_and_bias_are_stated_without_bias(bias, expected):
    found, true = audits(bias, expected)
    ratio = np.array([each.mean_square for each in found]) / true
    assert abs(ratio.mean() - 1) < 3 * ratio.std() / len(ratio) ** 0.5
    assert ratio.std() < 0.2
    inside = [
        low <= t**0.5 <= high for (low, high), t in zip((a.interval(1) for a in found), true, strict=True)
    ]
    assert np.mean(inside) >= 0.85


def test_points_are_drawn_by_their_chances():
    weight = np.random.default_rng(0).random(5000) ** 4
    chance = _chances(weight, 512)
    assert chance.max() <= 1
    assert chance.sum() == pytest.approx(512)
    hits = np.zeros(5000)
    for number in range(2000):
        drawn = _drawn(chance, 3, number)
        assert len(drawn) in (511, 512, 513)
        hits[drawn] += 1
    assert np.abs(hits / 2000 - chance).max() < 5 * 0.5 / 2000**0.5
    assert (_chances(weight[:100], 512) == 1).all()


def test_what_cannot_be_excluded_is_stated():
    truth = np.ones(1000)
    found = audit(Sampler(truth, 0.0, 0), Audited(np.arange(1000), truth, np.zeros(1000), 64, 0.0), 0)
    assert found.mean_square == 0
    assert found.rmse(1) > 0
    assert found.interval(1)[1] > 0
    assert found.law.at(np.zeros(3)).min() > 0
    below = Audit(-1e-4, 3e-4, ErrorLaw(1e-8, 1.0), 10, 10, 10)
    assert below.rmse(0.25) == pytest.approx(0.5 * 3e-4**0.5)


def test_audits_share_no_scramble():
    truth = np.random.default_rng(0).random(3000)
    values = Audited(np.arange(3000), truth + 0.01, np.full(3000, 1e-4), 16, 1e-3)
    first, second = Sampler(truth, 0.02, 0), Sampler(truth, 0.02, 0)
    audit(first, values, 0)
    audit(second, values, 1)
    used = first.replicates + second.replicates
    assert len(set(used)) == len(used)


def test_a_target_that_is_missed_by_far_is_seen_early():
    truth = np.random.default_rng(0).random(20000)
    w = truth + 0.1 * (np.arange(20000) % 20 == 0)
    values = Audited(np.arange(20000), w, np.full(20000, 1e-4), 64, 1e-4)
    whole = audit(Sampler(truth, 0.01, 0), values, 0)
    early = audit(Sampler(truth, 0.01, 0), values, 0, target=0.005)
    assert early.mean_square - 3 * early.spread > 0.005**2
    assert early.draws < whole.draws


def test_no_values_have_no_error():
    none = audit(Sampler(np.zeros(0), 0.1, 0), Audited(np.zeros(0, np.int64), *(np.zeros(0),) * 2, 0, 0.0), 0)
    assert none.rmse(0) == 0
