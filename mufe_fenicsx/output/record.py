"""What a run has written, with checksums: a run that goes on sees what is gone or was changed.

Checkpoints hold the record of all files of results that were written before them, and of each row
of the history.
"""

import zlib
from pathlib import Path

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.machine.files import regular
from mufe_fenicsx.output.checkpoint import file_checksum

HISTORY = "history.csv"


class ResultRecord:
    """Sizes and checksums of files of results. Local, to be used on the rank that writes them.

    Args:
        folder: The run folder.
        kept: What :attr:`kept` was, where a run goes on.
    """

    def __init__(self, folder, kept=None):
        self.folder, self._files = Path(folder), dict(kept or {})

    @property
    def kept(self):
        """Name in the run folder -> [size, checksum, strain, mesh or None]; fit for JSON."""
        return dict(self._files)

    def add(self, names, strain, mesh=None):
        """Note files that were written.

        Args:
            names: In the run folder, with "/".
            strain: At which they were.
            mesh: Name of the mesh that they need, or None.

        Raises:
            InputError: One cannot be read.
        """
        for name in names:
            path = self.folder / name
            checksum = file_checksum(path)
            self._files[name] = [path.stat().st_size, checksum, float(strain), mesh]


def row_checksum(line):
    """Checksum of a row of a history, bytes without the line's end."""
    return zlib.crc32(line)


def lost_results(folder, kept):
    """What is no longer as a checkpoint counts it.

    Args:
        folder: The run folder.
        kept: The checkpoint's part of the recorder.

    Returns:
        Lines, and the least strain from which on something is gone; and what a recorder goes on
        from without it, as ``kept``.
    """
    folder, record = Path(folder), kept.get("record") or {}
    lines, strains, gone = [], [], set()
    for name, (size, checksum, strain, mesh) in record.items():
        what = _damage(folder / name, size, checksum)
        if what is None and mesh in gone:
            what = f"needs {mesh}"
        if what is not None:
            gone.add(name)
            strains.append(strain)
            lines.append(f"{name} {what}")
    left = dict(kept)
    if gone:
        states = kept["fields"]["states"]
        bad = {Path(name).stem[-4:] for name in gone if not Path(name).stem.startswith("mesh")}
        left["record"] = {n: row for n, row in record.items() if Path(n).stem[-4:] not in bad}
        for name in gone:
            left["record"].pop(name, None)
        left["fields"] = kept["fields"] | {
            "states": [s for s in states if Path(s["name"]).stem not in bad],
            "mesh_is_gone": f"fields/{kept['fields']['mesh']}" in gone,
        }
        for of in ("contacts", "tools"):
            left[of] = [s for s in kept.get(of, ()) if Path(s["name"]).stem not in bad]
    if kept.get("history_rows") is not None:
        what, strain, left["history"], left["history_rows"] = _history(folder / HISTORY, kept)
        if what is not None:
            lines.append(what)
            strains.append(strain)
    return lines, min(strains, default=0.0), left


def _damage(path, size, checksum):
    try:
        if not path.is_file():
            return "is missing"
        if path.stat().st_size != size or file_checksum(path) != checksum:
            return "has changed"
    except (OSError, InputError):
        return "cannot be read"
    return None


def _history(path, kept):
    """What is wrong with the history or None, from which strain on, its bytes and rows."""
    wanted, size = kept["history_rows"], kept["history"]
    try:
        with regular(path).open("rb") as file:
            data = file.read(size)
    except OSError:
        return f"{HISTORY} is missing", 0.0, None, None
    lines = data.split(b"\n")[:-1]  # what follows the last line end is torn
    found = [row_checksum(line) for line in lines]
    if len(data) == size and found == wanted:
        return None, 0.0, size, wanted
    first = next((k for k, pair in enumerate(zip(found, wanted, strict=False))
                  if pair[0] != pair[1]), min(len(found), len(wanted)))  # fmt: skip
    if first == 0:
        return f"{HISTORY} has lost its first row", 0.0, None, None
    what = "has lost rows" if first == len(found) else "has changed"
    strain = _strain_of(lines, first - 1)
    whole = sum(len(line) + 1 for line in lines)
    return f"{HISTORY} {what} from row {first} on", strain, whole, found


def _strain_of(lines, row):
    """Strain of a row, 0 where it says none."""
    try:
        at = lines[0].split(b",").index(b"strain")
        return float(lines[row].split(b",")[at])
    except (ValueError, IndexError):
        return 0.0
