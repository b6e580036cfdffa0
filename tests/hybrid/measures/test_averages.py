"""The standard error covers the truth and the weighted mean converges as documented."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.fft import dct
from scipy.signal import lfilter
from scipy.stats import norm, t

from hybrid.measures import averages
from hybrid.measures.averages import (
    TaperedMean,
    running_tapered_mean,
    standard_error,
    standard_error_from_batches,
    taper_inflation,
)

RUNS = 1000
GOLDEN = np.pi * (np.sqrt(5.0) - 1.0)


def autoregressive(phi, length, rng):
    noise = rng.standard_normal((length, RUNS))
    noise[0] /= np.sqrt(1.0 - phi**2)
    return lfilter([1.0], [1.0, -phi], noise, axis=0)


def moving_average(theta, length, rng):
    noise = rng.standard_normal((length + 1, RUNS))
    return noise[1:] + theta * noise[:-1]


def logistic_growth(length, rng):
    x = np.sin(0.5 * np.pi * rng.random(RUNS)) ** 2
    growth = np.empty((length, RUNS))
    for row in growth:
        row[:] = np.log(np.abs(4.0 - 8.0 * x))
        x = 4.0 * x * (1.0 - x)
    return growth


def quasi_periodic(length, mean=0.0, columns=16):
    phases = np.linspace(0.0, 2.0 * np.pi, columns, endpoint=False)
    return mean + np.cos(GOLDEN * np.arange(length)[:, np.newaxis] + phases)


def coverage(series, truth=0.0):
    return np.mean(np.abs(series.mean(axis=0) - truth) <= 2.0 * standard_error(series))


def error_ratio(series):
    """Ratio of the mean standard error to the true scatter of the means."""
    return standard_error(series).mean() / series.mean(axis=0).std()


@pytest.mark.parametrize("length", [1000, 3000])
@pytest.mark.parametrize("phi", [0.0, 0.5, 0.9, 0.99])
def test_two_standard_errors_cover_the_mean_of_autoregressive_noise(phi, length):
    series = autoregressive(phi, length, np.random.default_rng(1))
    assert 0.93 <= coverage(series) <= 0.98
    assert 1.0 <= error_ratio(series) <= 1.7


def test_slow_correlation_under_white_noise_is_not_missed():
    rng = np.random.default_rng(2)
    slow = np.sqrt(1.0 - 0.98**2) * autoregressive(0.98, 3000, rng)
    series = slow + 3.0 * rng.standard_normal(slow.shape)
    assert 0.93 <= coverage(series) <= 0.98


def test_anticorrelated_noise_is_not_overstated():
    series = moving_average(-0.7, 3000, np.random.default_rng(3))
    assert 0.93 <= coverage(series) <= 0.98
    assert error_ratio(series) <= 1.3


def test_short_runs_are_covered_too():
    rng = np.random.default_rng(4)
    for length in (4, 6, 10, 50):
        assert coverage(autoregressive(0.0, length, rng)) >= 0.92, length


def test_logistic_map_covers_log_two_and_converges_like_its_bounded_sum():
    rng = np.random.default_rng(5)
    short, long = logistic_growth(500, rng), logistic_growth(4000, rng)
    assert coverage(long, np.log(2.0)) >= 0.95
    assert error_ratio(long) < 2.0
    assert standard_error(short).mean() / standard_error(long).mean() == pytest.approx(8.0, rel=0.25)


def test_error_of_a_quasi_periodic_mean_falls_like_its_length():
    lengths = np.array([500, 4000, 32_000, 256_000])
    errors = np.array([standard_error(quasi_periodic(m, mean=0.3)).mean() for m in lengths])
    slope = np.polyfit(np.log(lengths), np.log(errors), 1)[0]
    assert slope == pytest.approx(-1.0, abs=0.25)
    assert np.all(errors > 0.0)


def test_two_standard_errors_cover_the_zero_of_a_quasi_periodic_mean():
    for length in (100, 1000, 10_000):
        series = quasi_periodic(length)
        assert np.all(np.abs(series.mean(axis=0)) <= 2.0 * standard_error(series)), length


def test_constant_series_has_no_error():
    assert np.all(standard_error(np.full((1000, 2), 0.25)) == 0.0)


def test_collapsed_column_is_exact_and_leaves_the_others_alone():
    series = np.random.default_rng(6).standard_normal((5000, 3))
    expected = standard_error(series)
    series[7, 1] = -np.inf
    np.testing.assert_array_equal(standard_error(series), [expected[0], 0.0, expected[2]])


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_undefined_growth_has_no_error(bad):
    series = np.random.default_rng(6).standard_normal((100, 2))
    series[3, 0] = bad
    assert np.isnan(standard_error(series)).tolist() == [True, False]


@pytest.mark.parametrize("length", [0, 1, 3])
def test_too_short_a_series_has_no_error(length):
    np.testing.assert_array_equal(standard_error(np.ones((length, 2))), [np.nan, np.nan])


@given(scale=st.floats(1e-6, 1e6), shift=st.floats(-1e3, 1e3))
def test_error_scales_with_the_series_and_ignores_its_mean(scale, shift):
    series = autoregressive(0.5, 300, np.random.default_rng(7))[:, :3]
    np.testing.assert_allclose(
        standard_error(scale * (series + shift)), scale * standard_error(series), rtol=1e-6
    )


def error_as_documented(means):
    """The formula of ``standard_error_from_batches`` for one column of batch means ``(b,)``."""
    b = len(means)
    nu = min(8, b // 2)
    mean_square = np.mean(dct(means, norm="ortho")[1 : nu + 1] ** 2)

    size = b // 32 if b >= 32 else 1
    coarse = [np.mean(each) for each in np.split(means[b % size :], b // size)]
    y = np.array(coarse) - means.mean()
    r = sum(y[1:] * y[:-1]) / sum(y**2)
    r = min(max(r + (1 + 3 * r) / len(y), 0.0), 0.9)
    # Spectrum of first-order autoregressive noise, relative to frequency zero.
    share = np.mean([abs((1 - r) / (1 - r * np.exp(1j * np.pi * j / len(y)))) ** 2 for j in range(1, nu + 1)])
    return np.sqrt(mean_square / (share * b)) * t.ppf(norm.cdf(2.0), nu) / 2


@pytest.mark.parametrize("length", [4, 5, 15, 31, 63, 64, 100, 1000, 1023, 1024])
@pytest.mark.parametrize("phi", [-0.5, 0.0, 0.6, 0.95])
def test_error_is_that_of_the_documented_formula(length, phi):
    """For up to 1024 values, each of which is a batch of its own."""
    series = autoregressive(phi, length, np.random.default_rng(length))[:, :3]
    expected = [error_as_documented(column) for column in series.T]
    np.testing.assert_allclose(standard_error(series), expected, rtol=1e-7)


@pytest.mark.parametrize(("length", "size"), [(1025, 2), (2048, 2), (2049, 3), (5003, 5)])
def test_long_series_are_merged_into_at_most_1024_batches(length, size):
    """A remainder is left out at the start, which is nearest to the transient."""
    series = autoregressive(0.6, length, np.random.default_rng(length))[:, :3]
    batches = series[length % size :].reshape(-1, size, 3).mean(axis=1)
    assert len(batches) <= 1024
    np.testing.assert_allclose(standard_error(series), standard_error_from_batches(batches), rtol=1e-12)


def test_student_factors():
    two_sigma = norm.cdf(2.0)
    expected = t.ppf(two_sigma, np.arange(1, 9)) / 2.0
    np.testing.assert_allclose(averages.TWO_SIGMA_OF_STUDENT, expected, rtol=1e-7)


def tapered_mean(series):
    mean = TaperedMean(series.shape[1])
    mean.add(series)
    return mean.value()


def test_tapered_mean_is_the_weighted_mean_it_says_in_one_go_and_in_bursts():
    series = np.random.default_rng(11).standard_normal((57, 3))
    place = np.arange(57) + 0.5
    weight = place**2 * (57 - place) ** 2
    expected = weight @ series / weight.sum()
    mean = TaperedMean(3)
    for part in np.array_split(series, [1, 20, 20, 50]):
        mean.add(part)
    np.testing.assert_allclose(mean.value(), expected, rtol=1e-12)
    np.testing.assert_allclose(running_tapered_mean(series)[-1], expected, rtol=1e-12)
    np.testing.assert_allclose(running_tapered_mean(series)[19], tapered_mean(series[:20]), rtol=1e-12)


def test_tapered_mean_gains_two_orders_over_the_plain_mean_on_quasi_periodic_series():
    lengths = np.array([89, 233, 610, 1597, 4181]) + 30
    errors = [np.abs(tapered_mean(quasi_periodic(m))).max() for m in lengths]
    assert np.polyfit(np.log(lengths), np.log(errors), 1)[0] == pytest.approx(-3.0, abs=0.5)


def test_taper_costs_variance_on_white_noise():
    noise = np.random.default_rng(10).standard_normal((500, 20_000))
    assert 500 * tapered_mean(noise).var() == pytest.approx(taper_inflation() ** 2, rel=0.03)


def test_tapered_mean_keeps_its_digits_over_a_million_rows():
    rows = np.full((1_000_000, 1), 0.1)
    assert tapered_mean(rows)[0] == pytest.approx(0.1, rel=1e-12)


@pytest.mark.parametrize("row", [0, 500])
def test_tapered_mean_of_a_collapsed_column_is_minus_infinity(row):
    series = np.ones((1000, 2))
    series[row, 0] = -np.inf
    np.testing.assert_allclose(tapered_mean(series), [-np.inf, 1.0])
    running = running_tapered_mean(series)
    assert np.all(np.isfinite(running[:row, 0]))
    assert np.all(running[row:, 0] == -np.inf)


def test_tapered_mean_of_nothing_is_nan():
    assert np.isnan(TaperedMean(1).value()[0])


@pytest.mark.parametrize("columns", [1, 3])
def test_a_series_of_a_stack_is_to_the_last_bit_what_it_is_alone(columns):
    stack = np.random.default_rng(13).standard_normal((24, 300, columns))
    stack[1, 7, 0], stack[2, 8, 0] = -np.inf, np.nan
    mean = TaperedMean((24, columns))
    mean.add(stack)
    means, errors = mean.value(), standard_error_from_batches(stack)
    for i, series in enumerate(stack):
        np.testing.assert_array_equal(means[i], [tapered_mean(column[:, None])[0] for column in series.T])
        np.testing.assert_array_equal(errors[i], standard_error_from_batches(series))


def test_a_series_may_end_before_the_others_of_its_stack():
    stack = np.random.default_rng(14).standard_normal((3, 300, 2))
    counts = np.array([300, 40, 0])
    for series, count in zip(stack, counts, strict=True):
        series[count:] = 0.0
    mean = TaperedMean((3, 2))
    mean.add(stack)
    expected = [tapered_mean(series[:count]) for series, count in zip(stack, counts, strict=True)]
    np.testing.assert_allclose(mean.value(counts), expected, rtol=1e-12)


@pytest.mark.parametrize("phi", [0.5, 0.7])
def test_the_correlation_of_neighbours_has_no_bias(phi):
    """In 256 values the plain estimate is too small by ``(1 + 3 phi) / 256`` (Marriott, Pope 1954)."""
    rng = np.random.default_rng(12)
    noise = rng.standard_normal((256, 20_000))
    noise[0] /= np.sqrt(1.0 - phi**2)
    series = lfilter([1.0], [1.0, -phi], noise, axis=0)
    found = averages._lag_one_correlation((series - series.mean(axis=0)).T)
    assert found.mean() == pytest.approx(phi, abs=3.5e-3)
