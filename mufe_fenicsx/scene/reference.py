"""[[reference]] of a scene: measured curves, which reports draw beside those of the run."""

from dataclasses import dataclass, field
from pathlib import Path

from ..units import REQUIRED, Key, check_keys, setting


@dataclass(frozen=True)
class Column:
    """An entry of `columns`: where a quantity stands in the file. A text alone is ``header``."""

    header: str = setting(REQUIRED, "", "name of the column in the file, without [unit]")
    unit: str = setting("", "", 'such as "MPa"; left out: that in brackets behind the name')

    def __post_init__(self):
        check_keys(self)


@dataclass(frozen=True)
class Reference:
    """[[reference]]: measured curves, which reports draw beside those of the run.

    They change nothing of the test.
    """

    file: Path = setting(REQUIRED, "", "CSV file whose first line names columns with their units")
    name: str = setting("", "", "in legends and tables; left out: that of the file")
    columns: dict[str, Column] = field(
        default_factory=dict,
        metadata={"key": Key({}, "", "column of the file by quantity; left out: as it names them")},
    )

    def __post_init__(self):
        check_keys(self)

    @property
    def label(self) -> str:
        """What legends and tables call it."""
        return self.name or self.file.stem
