"""What the entries of run.json are: what is of another kind is left out, and said to be."""

import math

#: Text that a page can show.
LONGEST_TEXT = 10_000


def _text(value):
    return isinstance(value, str) and len(value) <= LONGEST_TEXT


def _truth(value):
    return isinstance(value, bool)


def _number(value):
    """Whether it is a number that NumPy takes; JSON may hold integers of any length."""
    if isinstance(value, bool):
        return False
    if isinstance(value, int):
        return abs(value) < 2**63
    return isinstance(value, float) and abs(value) < 1e300 and math.isfinite(value)


def _count(value):
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 2**53


def _list_of(kind):
    return lambda value: isinstance(value, list) and all(map(kind, value))


def _table(required=(), **kinds):
    """A dict: of the kinds that are stated and not None; those of ``required`` are there."""

    def holds(value):
        if not isinstance(value, dict) or not all(value.get(k) is not None for k in required):
            return False
        return all(value.get(k) is None or kind(value[k]) for k, kind in kinds.items())

    return holds


def _numbers(*names):
    return dict.fromkeys(names, _number)


def _texts_by_name(value):
    return isinstance(value, dict) and all(map(_text, value.values()))


def _separation(value):
    names = ("volume_change", "overlap_nodes", "max_depth", "close_gaps", "contact_area",
             "contact_area_before")  # fmt: skip
    if not _table(**_numbers(*names))(value):
        return False
    needed = ("contact_area", "contact_area_before") if value.get("close_gaps") else ()
    return all(value.get(name) is not None for name in needed)


_FOUND = ("slowest", "fastest", "largest_kinetic", "largest_unbalanced")
_ADDED = ("added", "added_to_grain", "num_elements", "gain")
_CARRIED = ("num_grains", "num_idle", "num_half", "heaviest")
_BREAKAGE = (
    *("num_fragments", "broken", "split", "chipped", "hardin", "einav", "d10", "d50"),
    *("num_opened", "opened_area", "failed_area", "fracture_work"),
)
_STEPS = {"failed_at_step": _count, "from_step": _count, "cause": _text,
          "time_step_factor": _number}  # fmt: skip
#: Name -> whether a value is of its kind; None is of all kinds.
KINDS = {
    "title": _text,
    "command": lambda value: _text(value) or _list_of(_text)(value),
    "versions": _texts_by_name,
    **dict.fromkeys(("num_ranks", "num_grains", "num_cells", "num_nodes", "num_steps"), _count),
    "element": _text,
    "finished": _truth,
    "stop_reason": _text,
    "strain_definition": _text,
    **_numbers(
        "area", "first_height", "reference_height", "setup_s", "wall_s", "time", "time_step",
        "element_time_step", "strain", "stress", "peak_memory_bytes", "mass", "added_mass",
        "edges_per_diameter", "diameters", "void_ratio", "porosity", "void_ratio_inside",
        "void_ratio_error",
    ),
    "separation": _separation,
    "contact": _table(
        **dict.fromkeys(
            ("num_searches", "num_overlaps_at_start", "num_closed", "num_with_offset",
             "num_at_largest_force"), _count,
        ),
        deepest_at_start=_number,
    ),
    "quasi_static": lambda value: _table(**_numbers(*_FOUND))(value)
    and (not value.get("slowest") or _table(_FOUND)(value)),
    "breakage": _table(**_numbers(*_BREAKAGE)),
    "mass_scaling": _table(_ADDED, **_numbers(*_ADDED)),
    "tools": _list_of(
        _table(
            ("name",), name=_text,
            **dict.fromkeys(("force", "torque", "displacement", "turn"), _list_of(_number)),
        )
    ),
    "container": _table(
        ("shape",), shape=_text, centre=lambda at: _list_of(_number)(at) and len(at) == 2,
        **_numbers("radius", "inner_radius"),
    ),
    "contact_resolution": _table(
        num_patches=_count, **_numbers("tenth", "half", "nine_tenths", "coarse")
    ),
    "carriers": _table(
        _CARRIED, **dict.fromkeys(_CARRIED, _count), bridging=_list_of(_count),
        **_numbers("most", "bridged", "doubtful"),
    ),
    "holds_from": _table(),
    "voids": _list_of(_table(("start", "end"), stage=_text, start=_table(), end=_table())),
    "membrane": _table(("label",), label=_count),
    "failed_grains": _list_of(_count),
    "unusual": _list_of(_text),
    "stages": _list_of(_table(name=_text, step=_count, time=_number, strain=_number)),
    "retries": _list_of(_table(tuple(_STEPS), **_STEPS)),
    "resumed_at_steps": _list_of(_count),
    "balanced_at_steps": _list_of(_count),
}  # fmt: skip


def sorted_out(run):
    """Entries that are of their kind, and the names of those that are not."""
    wrong = [
        name for name, value in run.items()
        if value is not None and name in KINDS and not KINDS[name](value)
    ]  # fmt: skip
    return {name: value for name, value in run.items() if name not in wrong}, wrong
