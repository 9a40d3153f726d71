"""Labels and tables of contacts as SPAM has them, https://spam-project.dev.

SPAM keeps labels as a TIFF stack without a voxel size; lengths are in voxels, positions in
the order (z, y, x). ``spam.label.labelledContacts`` finds contacts in them: voxels of one label
with a corner neighbour of another one. Contacts are numbered from 1 as they are met, and come as

- ``contactingLabels``: the two labels of each contact, the smaller first, shape (num_contacts, 2);
- ``contactTable``: a row for each label from 0 to the largest, with pairs (label on the other
  side, number of the contact), zeros behind them;
- ``Z``: the number of contacts of each label.

The tables written here are the same to the number, but for grains with more contacts than
SPAM's ``maximumCoordinationNumber``, of which SPAM leaves out some.
"""

import csv
import itertools
from pathlib import Path

import numpy as np
import tifffile

from ..errors import InputError
from ..machine.files import new_folder

LABELS, CONTACTS, TABLE = "labels.tif", "contacts.tsv", "contactTable.txt"
COLUMNS = ("Contact", "Label1", "Label2", "Zpos", "Ypos", "Xpos", "Voxels")


def find_contacts(labels):
    """Contacts of labels by SPAM's rule.

    Args:
        labels: Shape (z, y, x). As in SPAM, voxels on the border of the image look for no
            neighbours.

    Returns:
        contactingLabels, shape (num_contacts, 2); mean position (z, y, x) of the voxels of each
        contact [voxels], shape (num_contacts, 3); and how many these are, shape (num_contacts,).
    """
    labels = np.asarray(labels)
    if min(labels.shape) < 3:
        return np.empty((0, 2), np.int64), np.empty((0, 3)), np.empty(0, np.int64)
    middle = labels[1:-1, 1:-1, 1:-1]
    own, other, met = [], [], []
    for k, step in enumerate(itertools.product((-1, 1), repeat=3)):
        part = tuple(slice(1 + d, n - 1 + d) for d, n in zip(step, labels.shape, strict=True))
        beyond = labels[part]
        at = np.flatnonzero((middle > 0) & (beyond > 0) & (middle != beyond))
        own.append(middle.ravel()[at])
        other.append(beyond.ravel()[at])
        met.append(8 * at + k)
    own, other, met = (np.concatenate(part).astype(np.int64) for part in (own, other, met))
    order = np.argsort(met)
    own, other, voxel = own[order], other[order], met[order] // 8
    pairs = np.column_stack([np.minimum(own, other), np.maximum(own, other)])
    found, first, number = np.unique(pairs, axis=0, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first))
    number = rank[number.ravel()]
    # A voxel counts once for each contact that it is part of.
    seen = np.unique(np.column_stack([number, voxel]), axis=0)
    place = np.column_stack(np.unravel_index(seen[:, 1], middle.shape)) + 1.0
    voxels = np.bincount(seen[:, 0], minlength=len(found))
    sums = [np.bincount(seen[:, 0], place[:, i], len(found)) for i in range(3)]
    return found[np.argsort(first)], np.column_stack(sums) / np.maximum(voxels, 1)[:, None], voxels


def contact_table(contacting, largest):
    """SPAM's contactTable and Z from contactingLabels.

    Args:
        contacting: Labels of the contacts, shape (num_contacts, 2).
        largest: Largest label of the image.

    Returns:
        contactTable, shape (largest + 1, 2 max(Z)), and Z, shape (largest + 1,).
    """
    contacting = np.asarray(contacting, dtype=np.int64).reshape(-1, 2)
    count = np.bincount(contacting.ravel(), minlength=largest + 1)
    table = np.zeros((largest + 1, 2 * count.max(initial=0)), dtype=np.int64)
    ends = contacting.ravel()
    order = np.argsort(ends, kind="stable")
    column = np.arange(ends.size) - np.repeat(np.cumsum(count) - count, count)
    table[ends[order], 2 * column] = contacting[:, ::-1].ravel()[order]
    table[ends[order], 2 * column + 1] = order // 2 + 1
    return table, count


def export_spam(folder, labels, voxel_size, *, overwrite=False):
    """Write ``labels.tif``, ``contacts.tsv`` and ``contactTable.txt`` for SPAM.

    Args:
        folder: Folder to make.
        labels: Shape (z, y, x).
        voxel_size: Edge of a voxel [m]; SPAM's files have no place for it, the summary has.
        overwrite: Replace a folder that was written so.

    Returns:
        Summary, a dict.

    Raises:
        InputError: a folder that is in use or cannot be written.
    """
    largest = int(labels.max(initial=0))
    contacting, place, voxels = find_contacts(labels)
    table, count = contact_table(contacting, largest)
    with new_folder(folder, overwrite=overwrite, marker=CONTACTS) as made:
        kind = np.uint16 if largest < 2**16 else np.uint32
        tifffile.imwrite(made / LABELS, labels.astype(kind), photometric="minisblack")
        with (made / CONTACTS).open("w", newline="", encoding="utf-8") as file:
            rows = csv.writer(file, delimiter="\t")
            rows.writerow(COLUMNS)
            for k, (pair, at, n) in enumerate(zip(contacting, place, voxels, strict=True), 1):
                rows.writerow([k, *pair, *(f"{c:.6g}" for c in at), n])
        np.savetxt(made / TABLE, table, fmt="%d")
    present = np.unique(labels[labels > 0])
    return {
        "folder": str(Path(folder)),
        "num_grains": len(present),
        "num_contacts": len(contacting),
        "mean_coordination": float(count[present].mean()) if len(present) else 0.0,
        "largest_coordination": int(count.max(initial=0)),
        "voxel_size": float(voxel_size),
    }


def read_contacts(path):
    """Contacts of a table that SPAM or :func:`export_spam` wrote.

    Args:
        path: ``contacts.tsv`` as written here; or contactingLabels or contactTable as
            ``numpy.save`` (.npy) or ``numpy.savetxt`` write them.

    Returns:
        Labels of the contacts in their order, the smaller first, shape (num_contacts, 2).

    Raises:
        InputError: no such file, or none of these tables.
    """
    path = Path(path)
    wanted = "expected contacts.tsv, or contactingLabels or contactTable of SPAM"
    try:
        if path.suffix.lower() == ".npy":
            table = np.load(path, allow_pickle=False)
        else:
            with path.open(encoding="utf-8") as file:
                head = file.readline().split()
            if tuple(head) == COLUMNS:
                table = np.loadtxt(path, skiprows=1, usecols=(1, 2), ndmin=2)
            else:
                table = np.loadtxt(path, ndmin=2)
    except (OSError, ValueError, UnicodeDecodeError) as error:
        text = " ".join(str(error).split())
        raise InputError(f"contacts {path} cannot be read: {text}, {wanted}") from error
    table = np.asarray(table, dtype=float)
    whole = table.ndim == 2 and np.isfinite(table).all() and (table == np.floor(table)).all()
    if not whole or (table.size and (table.min() < 0 or table.shape[1] % 2)):
        raise InputError(f"contacts {path} hold an array of shape {table.shape}, {wanted}")
    table = table.astype(np.int64)
    # A row of contactTable begins with the label on the other side and the number of the contact.
    if table.shape[1] != 2 or (table.size and not table[0].any()):
        table = _from_table(table, path, wanted)
    if table.size and (table.min() < 1 or (table[:, 0] == table[:, 1]).any()):
        raise InputError(f"contacts {path} name a label 0 or a grain that touches itself, {wanted}")
    return np.sort(table.reshape(-1, 2), axis=1)


def _from_table(table, path, wanted):
    """contactingLabels of a contactTable."""
    row, column = np.nonzero(table[:, 1::2])
    number, other = table[row, 2 * column + 1], table[row, 2 * column]
    pairs = np.sort(np.column_stack([row, other]), axis=1)
    _, first, count = np.unique(number, return_index=True, return_counts=True)
    same = np.unique(np.column_stack([number, pairs]), axis=0)
    if (count != 2).any() or len(same) != len(first):
        raise InputError(f"contacts {path} do not name each contact from both sides, {wanted}")
    return pairs[first]
