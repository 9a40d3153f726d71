"""What the processes that draw a report load before they are asked to.

A figure loads some of these when it is drawn, which each process would do for itself.
"""

import matplotlib.backends.backend_pdf  # noqa: F401
import pyvista.plotting  # noqa: F401

import mufe_fenicsx.report.parts  # noqa: F401
