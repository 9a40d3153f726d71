"""What the 3D view tells of grains and contacts: numbers, lines, colours of grains that touch."""

from dataclasses import dataclass

import numpy as np

from mufe_fenicsx.container import WALLS
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.report import style

#: Colours of grains that do not touch may be the same; without black, that of their edges.
PALETTE = (style.SKY, style.ORANGE, style.GREEN, "#F0E442", style.BLUE, style.RED, style.PINK)


@dataclass(frozen=True)
class Column:
    """A number of a grain."""

    name: str
    title: str
    symbol: str = ""  #: unit without prefix
    fixed: tuple | None = None  #: (factor, unit) instead
    signed: bool = False
    coloured: bool = True


COLUMNS = (
    Column("diameter", "Equivalent diameter (ball of the same volume)", "m"),
    Column("volume", "Volume", fixed=(1e-9, "mm³"), coloured=False),
    Column("von_mises_mean", "von Mises stress, mean over the grain", "Pa"),
    Column("von_mises_percentile_95", "von Mises stress, 95th percentile over its volume", "Pa"),
    Column("von_mises_peak", "von Mises stress, largest of a tetrahedron", "Pa"),
    Column("tensile_stress_zz", "Vertical stress, mean, tension positive", "Pa", signed=True),
    Column("yielded_volume_fraction", "Yielded part of the volume", fixed=(0.01, "%")),
    Column("num_active_contacts", "Coordination number (active contacts with grains)"),
    Column("num_active_walls", "Active contacts with walls", coloured=False),
    Column("contact_area", "Contact area", fixed=(1e-12, "µm²")),
    Column("translation", "Displacement of the centroid since strain 0", "m"),
    Column(
        "translation_z", "Displacement of the centroid since strain 0, upwards", "m", signed=True
    ),
    Column("rotation_angle", "Rotation", fixed=(np.pi / 180, "°")),
    Column(
        "volume_expansion", "Volumetric strain, expansion positive", fixed=(1.0, ""), signed=True
    ),
    Column("shear_strain", "Shear strain, mean", fixed=(1.0, "")),
    Column("friction_work", "Frictional dissipation at its contacts", "J"),
)


def pack_columns(packer, run, numbers, labels, without):
    """Pack the numbers of the grains.

    Args:
        packer: :class:`~mufe_fenicsx.report.packing.Packer`; gets ``grain.COLUMN.STAGE``.
        run: :class:`mufe_fenicsx.results.Run`.
        numbers: Numbers of the states that are the stages.
        labels: Of the grains, shape (num_grains,).
        without: Called with what a stage lacks and the error that says why.

    Returns:
        List of dicts for the page, one a column: title, unit, range.
    """
    tables = []
    for number in numbers:
        try:
            tables.append(_columns_of(run, number, labels))
        except InputError as error:
            without("numbers of the grains", error)
            tables.append({})
    rows = []
    for column in COLUMNS:
        if not any(column.name in table for table in tables):
            continue
        nothing = np.full(labels.size, np.nan)
        values = [table.get(column.name, nothing) for table in tables]
        every = np.concatenate(values)
        every = every[np.isfinite(every)]
        largest = float(np.abs(every).max()) if every.size else 0.0
        factor, unit = column.fixed or (1.0, "")
        if column.symbol:
            factor, unit = style.unit_of([largest], column.symbol)
        for stage, v in enumerate(values):
            packer.add(f"grain.{column.name}.{stage}", v, "f4")
        rows.append(
            {"name": column.name, "title": column.title, "unit": unit, "factor": factor}
            | {"high": largest, "signed": column.signed, "coloured": column.coloured}
        )
    return rows


def _columns_of(run, number, labels):
    """Numbers of the grains of a state, dict column -> values in the order of the labels."""
    found, table = {}, run.grain_table(number)
    table["diameter"] = np.cbrt(6 / np.pi * table["volume"])
    table["translation"] = np.sqrt(sum(table[f"translation_{axis}"] ** 2 for axis in "xyz"))
    try:
        contacts = run.grains(number).assign(contact_area=_contact_area(run, number))
    except InputError:  # said where contacts are packed
        contacts = table.iloc[:0]
    for source in (contacts, table):
        if not np.array_equal(source["grain"].to_numpy(), labels):
            continue
        for column in COLUMNS:
            if column.name in source:
                found[column.name] = source[column.name].to_numpy(dtype=float)
    return found


def _contact_area(run, number):
    """Area of each grain's contacts as it is now [m²]; at the start where only that is stored."""
    contacts, grains = run.contacts(number), run.grains(number)["grain"]
    area = contacts["area_deformed" if "area_deformed" in contacts else "area"]
    found = sum(area.groupby(contacts[k]).sum().reindex(grains, fill_value=0.0)
                for k in ("grain_a", "grain_b"))  # fmt: skip
    return found.to_numpy()


def pack_contacts(packer, run, numbers, labels, without):
    """Pack the active contacts, and a colour for each grain; arguments as for the columns.

    The packer gets ``contact.NAME.STAGE``: ``a``, ``b`` (indices of grains; walls follow them),
    ``ends`` of the line [m], ``force`` [N], its ``ratio`` to the mean, ``mobilised`` friction
    and ``kind``, the sum of 1 (at least the mean force), 2 (sliding), 4 (in a force chain).
    """
    last, n = None, labels.size
    for stage, number in enumerate(numbers):
        table = _contacts_of(run, number, without)
        if table is None:
            continue
        table = table[table["wall"].isin(["", *WALLS])]  # tools are not drawn
        last = table
        a = np.searchsorted(labels, table["grain_a"])
        wall = table["wall"].map({name: n + k for k, name in enumerate(WALLS)})
        b = np.where(table["grain_b"] == 0, wall, np.searchsorted(labels, table["grain_b"]))
        start = run.grains(number)[["center_x", "center_y", "center_z"]].to_numpy()[a]
        end = start - table[["branch_x", "branch_y", "branch_z"]].to_numpy()
        kind = table["strong"] + 2 * table["sliding"] + 4 * (table["chain"] >= 0)
        for name, values, width in (
            ("a", a, "u4"),
            ("b", b, "u4"),
            ("ends", np.concatenate([start, end], axis=1), "f4"),
            ("force", table["normal_force"], "f4"),
            ("ratio", table["ratio"], "f4"),
            ("mobilised", table["mobilised"], "f4"),
            ("kind", kind, "u1"),
        ):
            packer.add(f"contact.{name}.{stage}", values, width)
    packer.add("colour", grain_colours(labels, last), "u1")


def _contacts_of(run, number, without):
    """Active contacts of a state; without friction and chains where these cannot be known."""
    try:
        return run.active_contacts(number)
    except InputError as first:
        try:
            table = run.contacts(number)
        except InputError as error:
            without("contacts", error)
            return None
        without("what tells sliding contacts and chains", first)
        table = table[table["num_points"] > 0].reset_index(drop=True)
        force = table["normal_force"]
        mean = force[table["grain_b"] != 0].mean()
        table["ratio"] = force / mean if mean > 0 else np.nan
        table["strong"] = table["ratio"] >= 1
        table["mobilised"], table["sliding"], table["chain"] = np.nan, False, -1
        return table


def grain_colours(labels, contacts):
    """Colours of the grains, so that two that touch differ where the palette suffices.

    Those with most neighbours choose first, the colour that fewest of their neighbours have.

    Args:
        labels: Of the grains, shape (num_grains,).
        contacts: Table of contacts, or None.

    Returns:
        Places in :data:`PALETTE`, shape (num_grains,).
    """
    if contacts is None:
        return np.arange(labels.size) % len(PALETTE)
    inner = contacts[contacts["grain_b"] != 0]
    a, b = (np.searchsorted(labels, inner[name]) for name in ("grain_a", "grain_b"))
    around = [[] for _ in labels]
    for i, j in zip(a, b, strict=True):
        around[i].append(j)
        around[j].append(i)
    colour = np.full(labels.size, -1)
    for i in np.argsort([-len(others) for others in around], kind="stable"):
        near = np.array([colour[j] for j in around[i] if colour[j] >= 0], dtype=int)
        uses = np.bincount(near, minlength=len(PALETTE))
        # Turned by the grain's number, so that all colours are used.
        colour[i] = (np.argmin(np.roll(uses, -i)) + i) % len(PALETTE)
    return colour
