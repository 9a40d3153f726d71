"""Friction by pair of materials: what the entries of [contact.pairs] name."""

from ..errors import InputError, nearest_name, shortened

#: Name of the material of grains that are in no group: that of its table.
REST = "material"
#: Name of that of a membrane.
MEMBRANE = "membrane"


def names_of(entry, materials):
    """The two materials that an entry NAME-NAME names; names may have hyphens themselves.

    Args:
        entry: The key of the table.
        materials: Names that there are, beside that of [material].

    Raises:
        InputError: There are no such materials, or several such pairs.
    """
    known = dict.fromkeys([REST, *materials])
    parts = entry.split("-")
    found = [
        (first, second)
        for k in range(1, len(parts))
        if {first := "-".join(parts[:k]), second := "-".join(parts[k:])} <= known.keys()
    ]
    if len(found) == 1:
        return found[0]
    where = f"contact.pairs.{shortened(entry)}"
    if found:
        raise InputError(
            f"{where} is {' or '.join(' and '.join(pair) for pair in found)}, expected names of "
            "materials that leave no doubt"
        )
    raise InputError(
        f"{where} names no pair of materials, expected NAME-NAME, each {nearest_name('', known)}"
    )


def by_materials(entries, materials):
    """What the table holds, by sorted pairs of names: {(name, name): entry}.

    Args:
        entries: The table: {"NAME-NAME": entry}.
        materials: As of :func:`names_of`.

    Raises:
        InputError: As of :func:`names_of`; a pair is there twice; a group has the name of the rest.
    """
    if entries and REST in materials:
        raise InputError(
            f"materials.{REST} is given, expected another name beside [contact.pairs]: there it "
            f"is that of [{REST}]"
        )
    found, entry_of = {}, {}
    for entry, value in entries.items():
        pair = tuple(sorted(names_of(entry, materials)))
        if pair in found:
            raise InputError(
                f"contact.pairs.{shortened(entry)} is given, expected one entry for a pair: "
                f"{shortened(entry_of[pair])} is there too"
            )
        found[pair], entry_of[pair] = value, entry
    return found
