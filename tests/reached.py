"""A plugin of pytest: which files of tests pass through lines, `python -m pytest -p tests.reached`.

REACHED_LINES names a JSON file with {path: [line, ...]}, REACHED_TO a folder: each process writes
[[path, line, file of tests], ...] there. Lines that are passed where a module is loaded have no
file of tests, nor have compiled loops.
"""

import json
import os
import sys
from pathlib import Path

LINE, DISABLE = sys.monitoring.events.LINE, sys.monitoring.DISABLE
TOOL = sys.monitoring.COVERAGE_ID

_targets = json.loads(Path(os.environ["REACHED_LINES"]).read_text(encoding="utf-8"))
_targets = {path: set(lines) for path, lines in _targets.items()}
_test = None
_found = set()


def _on_line(code, line):
    if line not in _targets.get(code.co_filename, ()):
        return DISABLE
    if _test is not None:
        _found.add((code.co_filename, line, _test))
    return None


sys.monitoring.use_tool_id(TOOL, "reached")
sys.monitoring.register_callback(TOOL, LINE, _on_line)
sys.monitoring.set_events(TOOL, LINE)


def pytest_runtest_logstart(nodeid, location):
    """What is passed from here on is by this test."""
    global _test
    _test = nodeid.partition("::")[0]


def pytest_sessionfinish():
    """Write what was found."""
    path = Path(os.environ["REACHED_TO"]) / f"{os.getpid()}.json"
    path.write_text(json.dumps(sorted(_found)), encoding="utf-8")
