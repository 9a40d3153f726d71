"""Contact: overlaps at the start, fast impact, grains of unequal size."""

import numpy as np

from mufe_fenicsx.contact.laws import COMPLIANCE
from mufe_fenicsx.report.style import BLACK, BLUE, GREEN, GREY, RED, plain_log_ticks
from mufe_fenicsx.verification.stability import overlap, tunnelling, unequal

from .common import COMM, columns, safe


def measure_overlap():
    return {
        "balls": overlap.overlap_map(COMM)[0],
        "blocks": overlap.overlap_map(COMM, kind="blocks")[0],
        "limits": {kind: overlap.limit(COMM, kind) for kind in ("balls", "blocks")},
        "theory": {kind: overlap.limit_theory(COMM, kind) for kind in ("balls", "blocks")},
        "swallowed": overlap.swallowed(COMM),
    }


def draw_overlap(d, new):
    figure, axes = new(2)
    for axis, kind in zip(axes, ("balls", "blocks"), strict=True):
        depth, found, gained, parted = columns(d[kind], "depth", "found", "gained", "parted")
        edge = d["limits"][kind]
        accepted = np.array([not r["message"] for r in d[kind]])
        safe(axis, 0, depth[accepted].max(), "starts; no energy comes of it")
        axis.axvspan(depth[accepted].max(), 3.2, color=RED, alpha=0.1, linewidth=0, label="refused")
        axis.plot(depth, depth, color=BLACK, linewidth=0.7, label="overlap")
        axis.plot(depth, found, "o", color=BLUE, markersize=4, label="deepest point found")
        axis.plot(depth, parted, "s", color=GREEN, markersize=3.5, label="after parting by 0.3 h")
        worst = np.nanmax(np.abs(gained))
        axis.set(
            xlabel=f"overlap of two {kind} / h", ylabel="depth / h", xlim=(0, 3.2), ylim=(0, 3.2)
        )
        axis.set_title(f"energy gained < {max(worst, 1e-16):.0e}; refused from {edge:.2f} edges",
                       loc="right", fontsize=6.5)  # fmt: skip
        axis.legend(loc="upper left")
    return figure


def measure_impact():
    return {
        "rows": [tunnelling.meet(COMM, v, check=False) for v in tunnelling.SPEEDS],
        "guarded": [tunnelling.meet(COMM, v) for v in tunnelling.SPEEDS],
        "layers": tunnelling.LAYERS,
        "limits": [tunnelling.limit(COMM, c)[0] for c in tunnelling.LAYERS],
        "enough": [tunnelling.theory(c) for c in tunnelling.LAYERS],
        "theory": [tunnelling.stops_theory(c) for c in tunnelling.LAYERS],
        "wall": [tunnelling.through_a_wall(COMM, v) for v in (0.3, 1.0, 2.0)],
    }


def draw_impact(d, new):
    figure, (left, middle, right) = new(3, 0.36)
    v, deepest, after = columns(d["rows"], "speed", "deepest", "after")
    noticed = np.array([bool(r["message"]) for r in d["guarded"]])
    safe(left, v[0], d["theory"][0])
    left.loglog(v, deepest, "o-", color=BLUE, markersize=4, label="without the check")
    left.loglog(v[noticed], deepest[noticed], "s", color=RED, markersize=7, fillstyle="none",
                label="the program stops")  # fmt: skip
    left.axhline(0.1, color=BLACK, linewidth=0.6)
    left.axhline(0.5, color=RED, linewidth=0.6, linestyle="--")
    left.set(xlabel="speed of approach / of waves", ylabel="largest depth / edge of facets",
             ylim=(0.02, 60))  # fmt: skip
    left.legend(loc="upper left", fontsize=6)
    safe(middle, v[0], d["theory"][0])
    middle.semilogx(v, after, "o-", color=BLUE, markersize=4)
    middle.axhline(-1, color=GREY, linewidth=0.6)
    middle.axhline(1, color=RED, linewidth=0.6)
    middle.text(v[0], 0.95, "through each other", fontsize=6.5, color=RED, va="top")
    middle.text(v[0], -0.88, "bounced", fontsize=6.5, color=GREY, va="bottom")
    middle.set(xlabel="speed of approach / of waves", ylabel="relative speed after / before")
    c = np.array(d["layers"])
    right.loglog(c, d["enough"], color=BLACK, linestyle="--", label="layers just carry it")
    right.loglog(c, d["theory"], color=BLACK, label="0.5 h deep while they meet")
    right.fill_between(c, 1e-2, d["enough"], color=GREEN, alpha=0.12, linewidth=0, label="safe")
    right.loglog(c, d["limits"], "o", color=RED, markersize=4, label="long bars")
    right.axvline(COMPLIANCE, color=GREY, linestyle=":")
    plain_log_ticks(right.xaxis)
    right.set(xlabel="compliance c of the layers", ylabel="speed at which bars sink / of waves",
              ylim=(0.005, 0.6))  # fmt: skip
    right.legend(fontsize=6, loc="lower left")
    return figure


def measure_size():
    rows = unequal.size_map(COMM)[0]
    return {
        "rows": rows,
        "steps": [unequal.step_limits(row) for row in rows],
        "pressed": unequal.size_map(COMM, pressure=1e-2)[0],
        "limit": unequal.limit(COMM)[0],
        "theory": unequal.limit_theory(COMM),
    }


def draw_size(d, new):
    figure, (left, right) = new(2)
    (ratio,) = columns(d["rows"], "ratio")
    alone, measured, step = columns(d["steps"], "alone", "measured", "step")
    left.loglog(ratio, alone / ratio / alone[0], color=BLACK, label="2/ω of the small one alone")
    left.loglog(ratio, measured / ratio / alone[0], "o", color=RED, markersize=4,
                label="measured limit")  # fmt: skip
    left.loglog(ratio, step / ratio / alone[0], "s", color=BLUE, markersize=3, fillstyle="none",
                label="program: what is near counts as closed")  # fmt: skip
    left.set(xlabel="size of the neighbour / size", ylabel="time step, over 2/ω of equals")
    for name, colour, label in (("rows", BLUE, "p = 0.001 E"), ("pressed", RED, "p = 0.01 E")):
        ratio, depth, theory = columns(d[name], "ratio", "depth", "theory")
        stops = np.array([bool(r["message"]) for r in d[name]])
        right.loglog(ratio, theory, color=colour, linewidth=0.8)
        right.loglog(ratio[~stops], depth[~stops], "o", color=colour, markersize=4, label=label)
        right.loglog(ratio[stops], depth[stops], "x", color=colour, markersize=5,
                     label=f"{label}: the program stops")  # fmt: skip
    right.axhline(0.5, color=GREY, linestyle=":")
    safe(right, right.get_ylim()[0], 0.5, along="y")
    right.set(xlabel="size of the neighbour / size", ylabel="depth of the small one / its h")
    left.legend()
    right.legend(loc="upper left", bbox_to_anchor=(0.0, 0.9), fontsize=6)
    return figure


#: Of each subject what measures it and what draws it.
SUBJECTS = {
    "overlap": (measure_overlap, draw_overlap),
    "impact": (measure_impact, draw_impact),
    "size": (measure_size, draw_size),
}
