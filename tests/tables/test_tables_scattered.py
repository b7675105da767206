"""Tables of light scattered n times: closed forms, exact splits, normalisation, reads in every storage; the shipped."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

import atmoref.tables.scattered as module
from atmoref.optics import legendre, orders
from atmoref.optics.analytic import Formula
from atmoref.optics.drops import cosines
from atmoref.optics.features import features
from atmoref.optics.particles import DROPS, PARTICLES
from atmoref.optics.phase_functions import HENYEY_GREENSTEIN, evaluate
from atmoref.optics.single import Single, hat_weights
from atmoref.store import list_tables, shipped_directory
from atmoref.tables.scattered import Axes, build, rows_of, scattered, table_of
from atmoref.tables.scattered_lookup import (
    LINEAR,
    LINEAR_IN_N,
    NEAREST,
    lookup_errors,
    read_table,
    stored,
)
from atmoref.tables.shipped import SHIPPED, rebuild

G = 0.8
HG = Formula("henyey_greenstein", 1e-12, G)
ONE = Axes((550.0,), columns=1801, orders=12)


def made(particle, axes=ONE):
    return table_of(build(particle, axes), axes)


def test_henyey_greenstein_scattered_n_times_is_henyey_greenstein() -> None:
    """Closed form: asymmetry g^n, at every angle; F_n of the sheet's section 7."""
    table, mu = made(HG), cosines(ONE.angles_deg)
    for n in range(1, ONE.orders + 1):
        exact = evaluate(HENYEY_GREENSTEIN, G**n, mu)
        np.testing.assert_allclose(table.values[0, n - 1], exact, rtol=3e-5)  # normalised for its interpolation
    g = G
    expected = (1.0 - g * g) / (2.0 * g) * (1.0 / (1.0 - g) - 1.0 / math.sqrt(1.0 + g * g))
    assert table.forward[0, 0] == pytest.approx(expected, abs=1e-10)
    assert (table.delta == 0.0).all()
    assert table.asymmetry[0] == pytest.approx(G, abs=1e-12)


def test_isotropic_light_stays_isotropic() -> None:
    table = made(PARTICLES["isotropic"])
    np.testing.assert_allclose(table.values, 1.0 / (4.0 * math.pi), rtol=1e-7)
    np.testing.assert_allclose(table.forward, 0.5, atol=1e-15)


def peaked(f: float) -> Single:
    """Return Henyey-Greenstein with a delta beside it."""
    rest = HG.single(550.0, ONE.angles_deg)
    return Single(f, rest.values, rest.rest)


@pytest.mark.parametrize("f", [0.25, 0.65])
def test_a_delta_is_split_exactly(f: float) -> None:
    """M-23: the binomial sum is the series of a_l^n - f^n; delta f^n; mean cosine g^n; whole integral 1."""
    single, mu = peaked(f), cosines(ONE.angles_deg)
    rows, deltas = rows_of(single, ONE.angles_deg, ONE)
    a = f + (1.0 - f) * single.rest
    for n in range(1, ONE.orders + 1):
        np.testing.assert_allclose(deltas[n - 1], f**n, rtol=1e-14)
        np.testing.assert_allclose(rows[n - 1], legendre.series(a**n - f**n, mu), rtol=1e-10, atol=1e-12)
        dense, weights = legendre.gauss_nodes(600)
        fine, _ = rows_of(
            Single(f, evaluate(HENYEY_GREENSTEIN, G, dense), single.rest), np.degrees(np.arccos(dense)), ONE
        )
        moment = 2.0 * math.pi * float((weights * dense * fine[n - 1]).sum()) + f**n
        assert moment == pytest.approx(float(a[1]) ** n, abs=1e-9)


@pytest.mark.parametrize("f", [0.0, 0.5])
def test_poisson_rows_are_sums_over_orders(f: float) -> None:
    """R-E21: row n is one scattering more than a Poisson number of mean n - 1."""
    single, angles = peaked(f), ONE.angles_deg[::60]
    thin = Single(f, single.values[::60], single.rest)
    averaged, delta = rows_of(thin, angles, dataclasses.replace(ONE, poisson=True, orders=4))
    powers, deltas = rows_of(thin, angles, dataclasses.replace(ONE, orders=60))
    for mean in range(4):
        shares = [math.exp(-mean) * mean**k / math.factorial(k) for k in range(60)]
        np.testing.assert_allclose(averaged[mean], np.array(shares) @ powers, rtol=1e-9)
        assert delta[mean] == pytest.approx(float(np.array(shares) @ deltas), rel=1e-12)


@pytest.mark.parametrize("name", sorted(SHIPPED))
def test_shipped_tables_are_normalised_and_forget_the_direction(name: str) -> None:
    """M-1, M-2, M-4, M-5, with what single precision leaves; the forward share by an independent sum."""
    table = scattered(name, SHIPPED[name])
    angles = table.axes.angles_deg
    whole, ahead = hat_weights(angles), hat_weights(angles, 90.0)
    for values, delta, forward, g in zip(table.values, table.delta, table.forward, table.asymmetry, strict=True):
        rows = values.astype(np.float64)
        assert (rows > 0.0).all()
        np.testing.assert_allclose(rows @ whole + delta, 1.0, atol=1e-6)
        np.testing.assert_allclose(rows @ ahead + delta, forward, atol=2e-4)
        assert (np.diff(forward) < 0.0).all()
        assert forward[-1] > 0.5
        moments = rows @ (whole * cosines(angles)) + delta
        np.testing.assert_allclose(moments, g ** np.arange(1.0, 27.0), atol=2e-3)
        assert np.abs(4.0 * math.pi * rows[-1] - 1.0).max() < 0.3


def test_forward_shares_are_the_sheets() -> None:
    """Section 7, 550 nm: cloud within what its norm was off, rain that of one drop of 1 mm."""
    cloud, rain = scattered("cloud"), scattered("rain")
    np.testing.assert_allclose(cloud.forward[1, :4], [0.96354, 0.92624, 0.88845, 0.85099], atol=1e-3)
    np.testing.assert_allclose(rain.forward[1, :4], [0.97056, 0.94055, 0.90946, 0.87769], atol=2e-4)
    assert 0.495 < rain.delta[1, 0] < 0.5


def test_features_of_shipped_tables_are_theorys() -> None:
    """Section 8: bows within half a degree, red outside and reversed; halo edges within .15; glory and fogbow."""
    found = {}
    for name in ("rain", "ice", "cloud"):
        table = scattered(name)
        for i, nm in enumerate(table.axes.wavelengths_nm):
            for one in features(name, table.axes.angles_deg, table.values[i, 0], nm):
                found[one.name, nm] = one.measured_deg
                if not math.isnan(one.theory_deg):
                    assert one.measured_deg == pytest.approx(one.theory_deg, abs=0.15 if "edge" in one.name else 0.5)
    for nm, primary, secondary in ((680.0, 137.9, 129.2), (550.0, 138.4, 128.2), (440.0, 139.2, 126.8)):
        assert found["primary bow", nm] == pytest.approx(primary, abs=0.3)
        assert found["secondary bow", nm] == pytest.approx(secondary, abs=0.3)
    for nm, fog, ring, dark in (
        (680.0, 141.7, 178.3, 176.6),
        (550.0, 141.7, 178.6, 176.5),
        (440.0, 142.5, 178.9, 176.5),
    ):
        assert found["fogbow", nm] == pytest.approx(fog, abs=1.5)
        assert found["glory, bright ring", nm] == pytest.approx(ring, abs=0.3)
        assert dark - 0.3 < found["glory, dark ring around it", nm] < found["glory, bright ring", nm]
    assert found["primary bow", 680.0] < found["primary bow", 440.0]
    assert found["secondary bow", 680.0] > found["secondary bow", 440.0]
    assert found["22 degree halo, inner edge", 680.0] < found["22 degree halo, inner edge", 440.0]
    rain = scattered("rain")
    band = (rain.axes.angles_deg > 131.0) & (rain.axes.angles_deg < 136.0)
    middle = rain.values[1, 0]
    dark = middle[band].mean()
    assert middle[~band & (rain.axes.angles_deg > 136.0) & (rain.axes.angles_deg < 141.0)].max() > 100.0 * dark
    assert middle[(rain.axes.angles_deg > 124.0) & (rain.axes.angles_deg < 131.0)].max() > 10.0 * dark
    snow = scattered("snow")
    inside = (snow.axes.angles_deg > 15.0) & (snow.axes.angles_deg < 50.0)
    smooth = np.convolve(snow.values[1, 0], np.ones(40) / 40.0, "same")[inside]
    assert (np.diff(smooth) < 0.0).mean() > 0.99  # no halo: it falls


def test_reads_are_interpolation() -> None:
    """The kernel against NumPy; borders; n beyond the rows, between them, and below 1."""
    table = made(HG)
    values = table.values[0]
    rng = np.random.default_rng(8)
    angle = rng.uniform(0.0, math.pi, 1000).astype(np.float32)
    angle[:3] = 0.0, np.float32(math.pi), np.nextafter(np.float32(math.pi), np.float32(4.0))
    n = rng.integers(1, 13, 1000).astype(np.float32)
    degrees = np.minimum(np.degrees(angle.astype(np.float64)), 180.0)
    expected = np.array([np.interp(d, ONE.angles_deg, values[int(k) - 1]) for d, k in zip(degrees, n, strict=True)])
    np.testing.assert_allclose(read_table(values, angle, n, LINEAR), expected, rtol=2e-5)
    nearest = np.array([values[int(k) - 1, round(float(d) * 10.0)] for d, k in zip(degrees, n, strict=True)])
    differs = read_table(values, angle, n, NEAREST) != nearest.astype(np.float32)
    assert differs.mean() < 2e-3  # an angle halfway between two columns may go either way
    same = np.full(4, 1.0, np.float32)
    at = np.array([-3.0, 1.99, 1.5, 99.0], np.float32)
    where = read_table(values, same, at, LINEAR)
    rows = [read_table(values, same[:1], np.array([float(k)], np.float32), LINEAR)[0] for k in (1, 2, 12)]
    np.testing.assert_array_equal(where, [rows[0], rows[0], rows[0], rows[2]])
    between = read_table(values, same, at, LINEAR_IN_N)
    assert between[2] == pytest.approx(0.5 * (rows[0] + rows[1]), rel=1e-6)
    assert between[3] == rows[2]


@pytest.mark.parametrize(
    ("storage", "most"), [("float64", 8e-5), ("float32", 8e-5), ("float16", 3e-4), ("unorm16", 0.15), ("unorm8", 0.4)]
)
def test_reads_lose_what_is_stated(storage: str, most: float) -> None:
    """Cloud, 550 nm, random angles and all n: root mean square of the relative error (docs/optics.md)."""
    table = scattered("cloud")
    angles = np.sort(np.random.default_rng(3).uniform(0.0, 180.0, 2000))
    exact, _ = rows_of(DROPS["cloud"].single(550.0, angles), angles, table.axes)
    found = lookup_errors(table, 1, exact, angles, storage)
    assert 0.0 < found.rms < most
    assert found.rms <= found.greatest
    assert found.percent_99 <= found.greatest


def test_unorm_rows_are_divided_by_their_greatest_value() -> None:
    values = np.array([[0.0, 2.0, 4.0], [10.0, 5.0, 0.0]], np.float32)
    np.testing.assert_allclose(
        stored(values, "unorm8"), np.rint(values / values.max(1)[:, None] * 255) / 255 * [[4], [10]], rtol=1e-6
    )


def test_a_series_that_rings_is_refused() -> None:
    class Ringing:
        def single(self, wavelength_nm, angles_deg, progress=None):
            rest = np.concatenate([np.ones(60), np.zeros(1)])  # a delta cut off
            return Single(0.0, legendre.series(rest, cosines(angles_deg)), rest)

    with pytest.raises(ValueError, match="rings"):
        build(Ringing(), ONE)


def test_axes_and_names_are_checked() -> None:
    for wrong in ({"columns": 1}, {"columns": 1000}, {"orders": 0}, {"wavelengths_nm": ()}, {"orders": 99999}):
        with pytest.raises(ValueError, match="a table needs"):
            Axes(**wrong)
    with pytest.raises(ValueError, match="found 'fog'; allowed: air"):
        scattered("fog")


def test_coarse_tables_keep_values() -> None:
    """Seven columns: the forward peak cannot be interpolated, so nothing is scaled; F_n does not depend on columns."""
    coarse = made(HG, Axes((550.0,), columns=7, orders=3))
    np.testing.assert_allclose(
        coarse.values[0, 0], evaluate(HENYEY_GREENSTEIN, G, cosines(coarse.axes.angles_deg)), rtol=1e-6
    )
    assert coarse.changed > 0.01
    np.testing.assert_array_equal(coarse.forward[0], made(HG).forward[0, :3])


def test_any_wavelengths_and_more_than_26_orders() -> None:
    waves = tuple(np.linspace(400.0, 700.0, 5))
    table = made(DROPS["cumulus"], Axes(waves, columns=361, orders=60))
    assert table.values.shape == (5, 60, 361)
    late = 4.0 * math.pi * table.values[2, 59].astype(np.float64) - 1.0
    g = table.asymmetry[2] ** 60
    assert 1.5 * g < np.abs(late).max() < 6.0 * g  # M-4: 3 g^n within a factor of 2


def test_what_is_shipped_is_whole_and_small() -> None:
    place = shipped_directory()
    assert place is not None
    entries = list_tables(place)
    assert len(entries) == len(SHIPPED)
    assert [entry.problem for entry in entries] == [None] * len(entries)
    assert sum(path.stat().st_size for path in place.rglob("*")) <= 12_000_000
    for name in ("cloud", "rain"):  # they say how far their sizes are from converged, below 1 %
        (entry,) = [e for e in entries if repr(PARTICLES[name])[6:40] in e.parameters]
        assert f"size_error={PARTICLES[name].size_error}" in entry.parameters
        assert PARTICLES[name].size_error < 0.01


@pytest.mark.parametrize("name", sorted(SHIPPED))
def test_shipped_tables_are_not_built(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    def unwanted(*arguments):
        raise AssertionError("built")

    monkeypatch.setattr(module, "build", unwanted)
    assert scattered(name, SHIPPED[name]).values.shape == (3, 26, 3601)


def test_a_shipped_table_is_reproduced(tmp_path: Path) -> None:
    told = []
    (found,) = rebuild(tmp_path, ("cumulus",), lambda title, share: told.append((title, share)))
    assert found.reproduced
    assert (tmp_path / found.entry.path.name).stat().st_size == found.entry.bytes
    assert ("650 nm", 0.0) in told


def test_a_table_that_differs_is_told_even_where_it_replaces_the_shipped_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Into the very directory that is shipped: what stood there before counts."""
    import atmoref.store as store
    import atmoref.tables.shipped as shipped

    monkeypatch.setattr(store, "shipped_directory", lambda: tmp_path)
    monkeypatch.setattr(shipped, "build", lambda *_: {"values": np.zeros(3)})
    assert [made.shipped_sha256 for made in rebuild(tmp_path, ("ice",))] == [""]
    assert [made.reproduced for made in rebuild(tmp_path, ("ice",))] == [True]
    monkeypatch.setattr(shipped, "build", lambda *_: {"values": np.ones(3)})
    (made,) = rebuild(tmp_path, ("ice",))
    assert made.shipped_sha256
    assert not made.reproduced


@pytest.mark.slow
def test_all_shipped_tables_are_reproduced(tmp_path: Path) -> None:
    """Rain's 2400 sizes take two minutes, the crystals' 96 million rays a minute a wavelength set."""
    assert [(made.name, made.reproduced) for made in rebuild(tmp_path)] == [(name, True) for name in SHIPPED]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "radii"), [("cloud", 8000), ("cumulus", 24000)])
def test_size_averages_are_converged_as_stated(name: str, radii: int) -> None:
    drops = DROPS[name]
    mu = cosines(np.arange(0.0, 180.05, 0.1).clip(0.0, 180.0))
    chosen = drops.fine_radii or drops.radii
    off = drops.phase_function(mu, 550.0, chosen) / drops.phase_function(mu, 550.0, radii) - 1.0
    assert math.sqrt(float((off * off).mean())) == pytest.approx(drops.size_error, rel=0.15)
    assert orders.forward_share(drops.legendre(550.0, chosen)) > 0.95
