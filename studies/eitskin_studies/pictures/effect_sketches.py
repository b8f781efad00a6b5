"""The left half of an effect's picture: its law, drawn from the very functions that the effect
computes with.

A sketch takes (axes, session, parameters), the parameters being those of the picture. matplotlib is
imported by whoever made the axes.
"""

from __future__ import annotations

from collections.abc import Callable
from math import exp, pi
from typing import TYPE_CHECKING, Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.fem.mesh import Mesh
from eitskin.scene.effect import EffectSession
from eitskin.scene.scan import channels, row_delays_s
from eitskin.view.pictures import ELECTRODE, FOUND, INK, RIM

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LIGHT = "#b9c4cc"
STRONG = "#b2182b"


def gel_drying(axes: Axes, session: EffectSession, parameters: Any) -> None:
    """Conductivity against hours."""
    from eitskin.scene.effects.gel_drying import drying_factor

    hours = np.linspace(0, 4 * parameters.time_constant_h, 200)
    axes.plot(hours, [drying_factor(3600 * h, parameters) for h in hours], color=STRONG)
    axes.axhline(drying_factor(1e12, parameters), color=LIGHT, linestyle="--")
    axes.set(
        xlabel="time (h)",
        ylabel="conductivity / described",
        ylim=(0, 1.05),
        title="a sheet that dries",
    )
    axes.locator_params(axis="x", nbins=5)


def temperature(axes: Axes, session: EffectSession, parameters: Any) -> None:
    """Conductivity against minutes."""
    from eitskin.scene.effects.temperature import temperature_factor

    minutes = np.linspace(0, 10, 50)
    axes.plot(minutes, [temperature_factor(60 * t, parameters) for t in minutes], color=STRONG)
    axes.axhline(1, color=LIGHT, linestyle="--")
    title = f"{parameters.offset_k:g} K warmer, then {parameters.drift_k_per_min:g} K/min"
    axes.set(xlabel="time (min)", ylabel="conductivity / described", title=title)


def background(axes: Axes, session: EffectSession, parameters: Any) -> None:
    """The pattern on the mesh."""
    from eitskin.scene.effects.background import NAME, pattern

    mesh = session.mesh
    factors = pattern(mesh.centroids_mm(), mesh.areas_mm2, parameters, session.stream(NAME))
    size = float(np.abs(factors - 1).max())
    colour = {"cmap": "RdBu_r", "vmin": 1 - size, "vmax": 1 + size}
    _on_mesh(axes, mesh, factors, "conductivity / its mean", colour)
    axes.set_title("the pattern")


def _on_mesh(
    axes: Axes, mesh: Mesh, values: FloatArray, label: str, colour: dict[str, Any]
) -> None:
    """Colour the elements of ``mesh`` by ``values`` (E,)."""
    colour = {"triangles": mesh.triangles, "facecolors": values, **colour}
    shown = axes.tripcolor(mesh.nodes_mm[:, 0], mesh.nodes_mm[:, 1], **colour)
    axes.figure.colorbar(shown, ax=axes, shrink=0.8).set_label(label)
    axes.set_aspect("equal")
    axes.set(xlabel="x (mm)", ylabel="y (mm)")


def misplacement(axes: Axes, session: EffectSession, parameters: Any) -> None:
    """Draw the electrodes where they are described and where they are."""
    from eitskin.scene.effects.misplacement import make

    skin = session.skin
    placed = make(parameters, session).apply(skin)
    rim = skin.outline.points_at(np.linspace(0, skin.outline.perimeter_mm, 361))
    axes.plot(*rim.T, color=RIM, linewidth=0.8)
    for shown, colour, inward in ((skin, LIGHT, 0.94), (placed, ELECTRODE, 1.0)):
        for k, (start, end) in enumerate(shown.electrode_spans_mm()):
            label = None if k else ("described" if shown is skin else "true")
            along = inward * shown.outline.points_at(np.linspace(start, end, 9))
            axes.plot(*along.T, color=colour, linewidth=4, label=label, solid_capstyle="butt")
    axes.set_aspect("equal")
    axes.legend(loc="center", frameon=False)
    axes.set(xlabel="x (mm)", ylabel="y (mm)", title="electrodes along the rim")


def out_of_round(axes: Axes, session: EffectSession, parameters: Any) -> None:
    """The outline described and the true one."""
    from eitskin.scene.effects.out_of_round import make

    for skin, colour, label in (
        (session.skin, LIGHT, "described"),
        (make(parameters, session).apply(session.skin), STRONG, "true"),
    ):
        rim = skin.outline.points_at(np.linspace(0, skin.outline.perimeter_mm, 361))
        axes.plot(*rim.T, color=colour, label=label)
    axes.set_aspect("equal")
    axes.legend(loc="center", frameon=False)
    axes.set(xlabel="x (mm)", ylabel="y (mm)", title="the outline")


def stretch(axes: Axes, session: EffectSession, parameters: Any) -> None:
    """Rim and electrodes, flat and stretched."""
    from eitskin.scene.deformation import FLAT
    from eitskin.scene.effects.stretch import stretched_at

    skin = session.skin
    pulled = stretched_at(parameters.at_s + parameters.rise_s, parameters)
    rim = skin.outline.points_at(np.linspace(0, skin.outline.perimeter_mm, 361))
    for how, colour, label in ((FLAT, LIGHT, "flat"), (pulled, STRONG, "stretched")):
        axes.plot(*(rim @ how.matrix.T).T, color=colour, label=label)
        axes.plot(*(skin.electrode_centres_mm() @ how.matrix.T).T, "s", color=colour, ms=4)
    axes.set_aspect("equal")
    axes.legend(loc="center", frameon=False)
    title = f"by {100 * parameters.strain:g} %, electrodes with it"
    axes.set(xlabel="x (mm)", ylabel="y (mm)", title=title)


def bend(axes: Axes, session: EffectSession, parameters: Any) -> None:
    """The lengthening that it acts like, by radius, about the lower face and about the middle."""
    from dataclasses import replace

    from eitskin.scene.effects.bend import lengthening

    radii = np.geomspace(50, 1000, 60)
    for neutral, colour, label in ((0.0, STRONG, "lower face"), (0.5, ELECTRODE, "middle")):
        shown = [
            100 * (lengthening(replace(parameters, radius_mm=float(r), neutral=neutral), 12, 1) - 1)
            for r in radii
        ]
        axes.semilogx(radii, shown, color=colour, label=f"neutral layer: {label}")
    axes.legend(frameon=False)
    title = "acts as a stretch between held sides"
    axes.set(xlabel="radius (mm)", ylabel="lengthening (%)", title=title)


def flex(axes: Axes, session: EffectSession, parameters: Any) -> None:
    """How thick the skin is in the pose, on the flattened copy."""
    from eitskin.scene.effects.flex import make

    skin, mesh, whole_s = session.skin, session.mesh, parameters.at_s + parameters.rise_s
    thickness, _ = make(parameters, session).apply(whole_s, 0).thickness_of(mesh)
    _on_mesh(axes, mesh, thickness, "thickness / at rest", {"cmap": "viridis"})
    rim = skin.outline.points_at(np.linspace(0, skin.outline.perimeter_mm, 361))
    axes.plot(*rim.T, color=RIM, linewidth=0.8)
    axes.plot(*skin.electrode_centres_mm().T, "s", color=ELECTRODE, ms=4)
    axes.set_title("the flattened copy of a forearm's skin")


def creep(axes: Axes, session: EffectSession, parameters: Any) -> None:
    """Strain against time."""
    from eitskin.scene.effects.creep import strain_at

    times = np.linspace(-0.5, 3, 400)
    axes.plot(times, [100 * strain_at(float(t), parameters) for t in times], color=STRONG)
    axes.set(xlabel="time (s)", ylabel="strain (%)", title="pulled, then let go")


def sheet_change(axes: Axes, session: EffectSession, parameters: Any) -> None:
    """The whole change on the mesh."""
    from eitskin.scene.effects.sheet_change import make

    mesh, whole_s = session.mesh, parameters.at_s + parameters.rise_s
    factors = make(parameters, session).apply(np.ones(mesh.n_elements), whole_s, 0)
    size = 100 * float(np.abs(factors - 1).max())
    colour: dict[str, Any] = {
        "triangles": mesh.triangles,
        "cmap": "RdBu_r",
        "vmin": -size,
        "vmax": size,
    }
    x, y = mesh.nodes_mm.T
    shown = axes.tripcolor(x, y, facecolors=100 * (factors - 1), **colour)
    axes.figure.colorbar(shown, ax=axes, shrink=0.8).set_label("change (%)")
    axes.set_aspect("equal")
    title = f"since the tare, whole at {whole_s:g} s"
    axes.set(xlabel="x (mm)", ylabel="y (mm)", title=title)


def contact_impedance(axes: Axes, session: EffectSession, parameters: Any) -> None:
    """Each electrode's impedance."""
    from eitskin.scene.effects.contact_impedance import impedances

    z = impedances(parameters, session.skin.electrodes.count, session)
    axes.bar(np.arange(len(z)), z * 1e3, color=ELECTRODE)
    axes.axhline(parameters.mean_ohm_m2 * 1e3, color=INK, linestyle="--", linewidth=0.8)
    axes.set(
        xlabel="electrode (from 0)",
        ylabel="contact impedance (mohm m2)",
        title="drawn once a session",
    )


def detached(axes: Axes, session: EffectSession, parameters: Any) -> None:
    """Draw the rows of the scan that are lost."""
    count = session.skin.electrodes.count
    state = np.full((count, count), np.nan)
    rows = session.protocol.drive_measure.astype(int)
    state[rows[:, 2], rows[:, 0]] = np.isin(rows, parameters.electrodes).any(axis=1)
    axes.imshow(state, origin="lower", cmap="Greys", vmin=-0.25, vmax=1.3, interpolation="nearest")
    lost = int(np.nansum(state))
    title = f"rows that read 0 V (dark): {lost} of {len(rows)}"
    axes.set(xlabel="driven pair (k, k + 1)", ylabel="measuring pair (k, k + 1)", title=title)


def bridged(axes: Axes, session: EffectSession, parameters: Any) -> None:
    """The circuit's conductance against the resistor: the chord that the bridge adds on the rim."""
    skin = session.skin
    rim = skin.outline.points_at(np.linspace(0, skin.outline.perimeter_mm, 361))
    axes.plot(*rim.T, color=RIM, linewidth=0.8)
    centres = skin.electrode_centres_mm()
    axes.plot(*centres.T, "s", color=ELECTRODE, markersize=6)
    for k, (x, y) in enumerate(1.12 * centres):
        axes.text(x, y, str(k), ha="center", va="center", fontsize=7)
    axes.plot(*centres[list(parameters.electrodes)].T, color=STRONG, linewidth=2.5)
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.set(
        xlim=(-120, 120), ylim=(-120, 120), title=f"joined by {parameters.resistance_ohm:g} ohm"
    )


def phase(axes: Axes, session: EffectSession, parameters: Any) -> None:
    """The interface's impedance over frequency, in the complex plane."""
    from eitskin.scene.effects.phase import interface

    z = np.array([0.01])
    hertz = np.logspace(-1, 5.5, 400)
    curve = np.array([interface(z, f, parameters.capacitance_f_per_m2)[0] for f in hertz]) * 1e3
    axes.plot(curve.real, -curve.imag, color=STRONG)
    for f in (10.0, 100.0, 1e3, parameters.frequency_hz):
        at = interface(z, f, parameters.capacitance_f_per_m2)[0] * 1e3
        axes.plot(at.real, -at.imag, "o", color=FOUND, markersize=4)
        aside = (5, 4) if at.real < 9 else (-32, 0)
        axes.annotate(
            f"{f:g} Hz", (at.real, -at.imag), xytext=aside, textcoords="offset points", fontsize=8
        )
    axes.set_aspect("equal")
    axes.set(
        xlabel="real part (mohm m2)",
        ylabel="- imaginary part (mohm m2)",
        title="interface of 10 mohm m2",
    )
    axes.margins(0.12)


def source_impedance(axes: Axes, session: EffectSession, parameters: Any) -> None:
    """The load's share of the current."""
    from eitskin.scene.effects.source_impedance import share

    load = np.logspace(1, 6, 300)
    axes.semilogx(load, share(load, parameters), color=STRONG)
    axes.axhline(0, color=LIGHT, linewidth=0.8)
    axes.set(
        xlabel="load (ohm)", ylabel="current in phase / the source's", title="the current divides"
    )


def amplitude_drift(axes: Axes, session: EffectSession, parameters: Any) -> None:
    """The current by time."""
    from eitskin.scene.effects.amplitude_drift import make

    step = make(parameters, session)
    times_s = session.times_s()
    factors = [float(step.apply(np.ones(1), float(t), k)[0]) for k, t in enumerate(times_s)]
    axes.plot(times_s, factors, color=STRONG)
    axes.axhline(1, color=LIGHT, linestyle="--")
    axes.set(xlabel="time (s)", ylabel="current / described", title="slope and random walk")


def channel_gain(axes: Axes, session: EffectSession, parameters: Any) -> None:
    """Each channel's gain."""
    from eitskin.scene.effects.channel_gain import gains

    pairs, number = channels(session.protocol)
    gain = np.zeros(len(pairs))
    gain[number] = gains(parameters, session)
    axes.bar(np.arange(len(pairs)), 100 * (gain - 1), color=ELECTRODE)
    axes.axhline(0, color=INK, linewidth=0.8)
    axes.set(xlabel="channel: measuring pair", ylabel="gain - 1 (%)", title="drawn once a session")


def offset(axes: Axes, session: EffectSession, parameters: Any) -> None:
    """Each channel's offset."""
    from eitskin.scene.effects.offset import offsets_v

    pairs, number = channels(session.protocol)
    added_mv = np.zeros(len(pairs))
    added_mv[number] = 1e3 * offsets_v(parameters, session)
    axes.bar(np.arange(len(pairs)), added_mv, color=ELECTRODE)
    axes.axhline(0, color=INK, linewidth=0.8)
    axes.set(xlabel="channel: measuring pair", ylabel="offset (mV)", title="drawn once a session")


def mux(axes: Axes, session: EffectSession, parameters: Any) -> None:
    """A row's voltage after switching."""
    t = np.linspace(0, 2 * parameters.dwell_us, 300)
    axes.plot(t, 1 - np.exp(-t / parameters.settling_us), color=STRONG)
    left = exp(-parameters.dwell_us / parameters.settling_us)
    axes.plot(
        [parameters.dwell_us] * 2,
        [1 - left, 1],
        color=FOUND,
        linewidth=2.5,
        label=f"{100 * left:.1f} % is left",
    )
    axes.axhline(1, color=LIGHT, linestyle="--")
    axes.legend(frameon=False, loc="center right")
    axes.set(
        xlabel="time since switching (us)",
        ylabel="from the row before (0) to this (1)",
        title="settling",
    )


def charge_injection(axes: Axes, session: EffectSession, parameters: Any) -> None:
    """The charge's voltage, and the demodulator's window."""
    start, end = parameters.dwell_us, parameters.dwell_us + parameters.window_us
    t = np.linspace(0, end, 400)
    step_mv = parameters.charge_pc / parameters.capacitance_pf * 1e3
    axes.plot(t, step_mv * np.exp(-t / parameters.settling_us), color=STRONG)
    axes.axvspan(start, end, color=LIGHT, alpha=0.5, linewidth=0, label="demodulator's window")
    axes.legend(frameon=False)
    axes.set(
        xlabel="time since switching (us)",
        ylabel="on one line (mV)",
        title="a switch's charge leaks away",
    )


def crosstalk(axes: Axes, session: EffectSession, parameters: Any) -> None:
    """How often driven wires couple into each measuring pair."""
    from eitskin.scene.effects.crosstalk import pick_up

    count = session.skin.electrodes.count
    source, sink = pick_up(session.protocol)
    rows = session.protocol.drive_measure.astype(int)
    shown = np.full((count, count), np.nan)
    shown[rows[:, 2], rows[:, 0]] = np.abs(source) + np.abs(sink)
    axes.imshow(shown, origin="lower", cmap="Reds", vmin=-0.2, vmax=1.6, interpolation="nearest")
    title = "rows with a wire beside a driven one (dark)"
    axes.set(xlabel="driven pair (k, k + 1)", ylabel="measuring pair (k, k + 1)", title=title)


def mains(axes: Axes, session: EffectSession, parameters: Any) -> None:
    """The hum, and how one row samples it."""
    from eitskin.scene.effects.mains import alias_hz, make

    step = make(parameters, session)
    times_s = session.times_s()[session.quiet_frames :][:12]
    fine = np.linspace(0, float(times_s[-1]), 1500)
    wave = np.sin(2 * pi * parameters.frequency_hz * (fine + row_delays_s(session)[0]))
    axes.plot(fine, 1e3 * parameters.amplitude_v * wave, color=LIGHT, linewidth=0.7)
    row = [
        1e3 * float(step.apply(np.zeros(session.protocol.n_rows), float(t), 0)[0]) for t in times_s
    ]
    axes.plot(times_s, row, "o-", color=STRONG, markersize=4)
    seen = alias_hz(parameters.frequency_hz, session.rate_hz)
    axes.set(
        xlabel="time (s)",
        ylabel="added (mV)",
        title=f"row 0 at {session.rate_hz:g} Hz sees {seen:g} Hz",
    )


def common_mode(axes: Axes, session: EffectSession, parameters: Any) -> None:
    """Draw the part of a common mode that is left, against the rejection."""
    decibels = np.linspace(20, 100, 100)
    axes.semilogy(decibels, 10 ** (-decibels / 20), color=STRONG)
    axes.plot(parameters.cmrr_db, 10 ** (-parameters.cmrr_db / 20), "o", color=FOUND)
    title = f"ground at the {parameters.ground}"
    axes.set(xlabel="CMRR (dB)", ylabel="part of the common voltage that is read", title=title)


def noise(axes: Axes, session: EffectSession, parameters: Any) -> None:
    """The errors' distribution over all frames."""
    from eitskin.scene.effects.noise import deviation_v, make

    step, sigma_mv = make(parameters, session), 1e3 * deviation_v(parameters, session)
    zero = np.zeros(session.protocol.n_rows)
    drawn = 1e3 * np.concatenate([step.apply(zero, 0.0, k) for k in range(session.n_frames)])
    axes.hist(drawn, bins=50, density=True, color=LIGHT)
    x = np.linspace(-4, 4, 200) * sigma_mv
    axes.plot(x, np.exp(-((x / sigma_mv) ** 2) / 2) / (sigma_mv * np.sqrt(2 * pi)), color=STRONG)
    axes.set(xlabel="noise (mV)", ylabel="density (1/mV)", title=f"sigma = {sigma_mv:.3g} mV")


def _transfer(
    axes: Axes, session: EffectSession, effect: Any, parameters: Any, span_v: float
) -> None:
    v = np.linspace(-span_v, span_v, 3000)
    axes.plot(v * 1e3, v * 1e3, color=LIGHT, linestyle="--")
    axes.plot(v * 1e3, effect.make(parameters, session).apply(v, 0.0, 0) * 1e3, color=STRONG)
    axes.set(xlabel="in (mV)", ylabel="out (mV)")


def rectifier(axes: Axes, session: EffectSession, parameters: Any) -> None:
    """Its characteristic."""
    from eitskin.scene.effects import rectifier as effect

    _transfer(axes, session, effect, parameters, float(np.abs(session.v0_v()).max()))
    axes.set_title("magnitudes")


def saturation(axes: Axes, session: EffectSession, parameters: Any) -> None:
    """The limiter's characteristic."""
    from eitskin.scene.effects import saturation as effect

    limit_v = session.limit_v(parameters.limit_v, parameters.headroom)
    _transfer(axes, session, effect, parameters, 1.6 * limit_v)
    axes.set_title("clipped")


def adc(axes: Axes, session: EffectSession, parameters: Any) -> None:
    """The converter's characteristic."""
    from eitskin.scene.effects import adc as effect

    limit_v = session.limit_v(parameters.range_v, parameters.headroom)
    _transfer(axes, session, effect, parameters, 1.2 * limit_v)
    axes.set_title(f"{parameters.bits} bits")


def jitter(axes: Axes, session: EffectSession, parameters: Any) -> None:
    """A sine sampled a little off, with the jitter enlarged to be seen."""
    s = 0.25
    t = np.linspace(0, 1, 300)
    axes.plot(t, np.sin(2 * pi * t), color=LIGHT)
    at = np.arange(16) / 16
    off = np.random.default_rng(3).standard_normal(16) * s / (2 * pi)
    axes.plot(at, np.sin(2 * pi * (at + off)), "o", color=STRONG, markersize=4, label="taken")
    axes.plot(at, np.sin(2 * pi * at), "o", color=RIM, markersize=2.5, label="meant")
    axes.legend(frameon=False)
    axes.set(xlabel="time (periods)", ylabel="signal", title=f"samples off by {s:g} rad (enlarged)")


SKETCHES: dict[str, Callable[[Any, EffectSession, Any], None]] = {
    sketch.__name__: sketch
    for sketch in (
        out_of_round, misplacement, stretch, bend, flex, creep,
        background, temperature, gel_drying, sheet_change,
        contact_impedance, detached, bridged,
        phase,
        source_impedance, amplitude_drift, crosstalk, mux, charge_injection, mains, common_mode,
        channel_gain, offset, jitter,
        noise, rectifier, saturation, adc,
    )
}  # fmt: skip
