"""How coarse pictures are chosen by the times of the last ones."""

from __future__ import annotations

from illumcli.viewer.pace import DIVISORS, FEWEST, Pace

PIXELS = 640 * 360


def after(pace, pixels, seconds_of, count=40):
    """The divisors in turn where a picture takes a time by its pixels."""
    chosen = []
    for _ in range(count):
        divisor = pace.divisor(pixels)
        pace.add(divisor, seconds_of(pixels / divisor**2))
        chosen.append(divisor)
    return chosen


def test_fast_machines_get_all_pixels():
    assert after(Pace(0.1, 1 << 16), PIXELS, lambda pixels: 0.01 + 1e-7 * pixels)[-1] == 1


def test_slow_pictures_become_as_coarse_as_needed_and_stay():
    chosen = after(Pace(0.1, 1 << 16), PIXELS, lambda pixels: 0.01 + 2e-6 * pixels)
    assert len(set(chosen[-20:])) == 1
    last = chosen[-1]
    assert 0.01 + 2e-6 * PIXELS / last**2 <= 0.15
    finer = DIVISORS[DIVISORS.index(last) - 1]
    assert 0.01 + 2e-6 * PIXELS / finer**2 > 0.1


def test_what_costs_time_without_pixels_makes_no_picture_tiny():
    chosen = after(Pace(0.1, 1 << 16), PIXELS, lambda pixels: 5.0)
    assert PIXELS / max(chosen) ** 2 >= FEWEST


def test_it_recovers_when_the_machine_is_free_again():
    pace = Pace(0.1, 1 << 16)
    assert after(pace, PIXELS, lambda pixels: 1e-5 * pixels)[-1] > 2
    assert after(pace, PIXELS, lambda pixels: 1e-7 * pixels)[-1] == 1


def test_a_little_too_slow_is_no_reason_to_change():
    pace = Pace(0.1, 1 << 16)
    before = after(pace, PIXELS, lambda pixels: 0.09)[-1]
    assert set(after(pace, PIXELS, lambda pixels: 0.12)) == {before}
    assert after(pace, PIXELS, lambda pixels: 0.2)[-1] > before


def test_small_pictures_are_whole():
    assert Pace(0.1, 1 << 16).divisor(96 * 54) == 1


def test_a_larger_window_keeps_what_suits_the_smaller_one_until_it_is_measured():
    pace = Pace(0.1, 1 << 16)
    after(pace, PIXELS, lambda pixels: 1e-6 * pixels)
    assert after(pace, 9 * PIXELS, lambda pixels: 1e-6 * pixels)[-1] >= 4
