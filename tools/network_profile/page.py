"""Page of the profile of a network as one self-contained HTML file.

Plots of the errors of a network beside those of the simulated detector with its profile, as SVG.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from scipy.stats import binomtest

from mvpose.arrays import Floats
from mvpose.report.documents import fill_template
from mvpose.report.svg_plots import legend_above, svg_plot
from simharness.outputs.validation.plots import REAL_COLOR, TWIN_COLOR
from simharness.reality.detector_fit.detector_sums import Trials
from simharness.trial.identity import provenance_sentence
from tools.network_profile.error_curves import ErrorCurve, condition_curves, error_curves
from tools.network_profile.profile_fit import NetworkProfile

_SIZE = (3.6, 2.6)
_FEWEST = 10  # trials behind a point that is drawn
_TURNED = 24  # letters of all labels together from which they are turned


def compared_curves(network: ErrorCurve, simulated: ErrorCurve, *, name: str) -> str:
    """Plot shares of both by bin, percent: the network as bars with 95 % intervals, the simulated detector as a line.

    The intervals are Wilson's (Journal of the American Statistical Association 1927), of independent trials.

    Args:
        network: of the network.
        simulated: of the simulated detector, with the same bins.
        name: different from the name of every other plot on the page.
    """
    at = np.arange(len(network.labels))
    enough = network.counts.n >= _FEWEST
    with svg_plot(name, size=_SIZE) as (axes, written):
        share = np.where(enough, 100 * network.share, np.nan)
        low, high = _intervals(network.counts)
        axes.bar(at, share, color=REAL_COLOR, width=0.72, alpha=0.5, label="network")
        if (network.counts.k <= network.counts.n).all():
            axes.vlines(at[enough], low[enough], high[enough], color=REAL_COLOR, lw=1.6)
        shares = np.where(simulated.counts.n >= _FEWEST, 100 * simulated.share, np.nan)
        axes.plot(at, shares, "o--", color=TWIN_COLOR, ms=4, lw=1.2, label="profile")
        turned = sum(map(len, network.labels)) > _TURNED
        axes.set_xticks(at, network.labels, rotation=55 if turned else 0, ha="right" if turned else "center")
        axes.set(xlabel=network.axis, ylabel="%")
        axes.set_ylim(0, None)
        axes.grid(axis="y")
        legend_above(axes)
    return written[0]


def _intervals(counts: Trials) -> Floats:
    """Return the ends of the 95 % interval (Wilson) of each share, (2, B), %; NaN without a trial."""
    pairs = zip(counts.k.astype(int), counts.n.astype(int), strict=True)
    ends = [binomtest(min(k, n), n).proportion_ci(method="wilson") if n else (np.nan, np.nan) for k, n in pairs]
    return 100 * np.array(ends).T


def render_profile(profile: NetworkProfile, *, provenance: Mapping[str, Any]) -> str:
    """Return the page of a profile.

    Args:
        profile: the fitted profile.
        provenance: keys of :func:`simharness.trial.identity.provenance`.
    """
    return fill_template(
        "network_profile.html",
        folder=Path(__file__).parent,
        program="simharness",
        name=profile.name,
        profile=profile,
        joints=int(profile.labels.risk["drop"].sum()),
        conditions=list(_plots(profile, conditions=True)),
        curves=list(_plots(profile, conditions=False)),
        code=provenance["code"],
        command=provenance.get("command") or "",
        provenance=provenance_sentence(provenance),
    )


def _plots(profile: NetworkProfile, *, conditions: bool) -> Iterator[tuple[str, Markup]]:
    """Yield title and plot of each curve."""
    both = [
        condition_curves(profile.scenes, labels) if conditions else error_curves(labels)
        for labels in (profile.labels, profile.simulated)
    ]
    for index, (network, simulated) in enumerate(zip(*(each.values() for each in both), strict=True)):
        svg = compared_curves(network, simulated, name=f"{'condition' if conditions else 'curve'}-{index}")
        yield network.title, Markup(svg)
