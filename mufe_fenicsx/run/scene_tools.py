"""Tools of a scene: bodies and paths from their files, what identifies these, and their size."""

import numpy as np
from mpi4py import MPI

from ..bulk.tools import Tool, ToolPath
from ..contact.walls import rotation_of
from ..errors import InputError
from ..loading.measured import TIME, read_measured
from ..machine.ranks import on_first_rank
from ..output.checkpoint import file_checksum
from ..scene.tools import FREEDOMS

#: Size of a tool over that of the sample, one way or the other, and distance between both over it:
#: what is beyond is a wrong unit, which is off by a thousand.
FAR = 100.0


def make_tools(comm, scene):
    """The tools of a scene, made by rank 0 alone. Collective.

    Args:
        comm: MPI communicator.
        scene: :class:`~mufe_fenicsx.scene.Scene`.

    Returns:
        List of :class:`~mufe_fenicsx.bulk.tools.Tool`.

    Raises:
        InputError: A file cannot be read, or its surface bounds no body; on all ranks.
    """
    return comm.bcast(on_first_rank(comm, lambda: read_tools(scene)))


def read_tools(scene):
    """As :func:`make_tools`. Local."""
    return [_named(table, lambda table=table: _tool(table)) for table in scene.tools]


def _named(table, read):
    """What ``read()`` gives; an error says which tool it is of."""
    try:
        return read()
    except InputError as error:
        raise InputError(f"tool {table.name}: {error}") from error


def _tool(table):
    from ..geometry.bodies.tool_body import read_tool  # what others need not wait for

    points, cells = read_tool(table.surface, table.unit, table.thickness)
    points = points @ rotation_of(np.array(table.turned)).T + np.array(table.position)
    return Tool(
        table.name, points, cells, friction=table.friction,
        friction_kinetic=table.friction_kinetic, velocity=table.velocity,
        angular_velocity=table.angular_velocity, point=table.point,
        path=None if table.path is None else read_path(table.path), free=table.freedoms,
        force=table.force, torque=table.torque, density=table.density,
    )  # fmt: skip


def read_path(path):
    """The motion of a tool from a CSV file: time, x, y, z and rx, ry, rz; see `read_measured`.

    Columns that are absent are zero.

    Raises:
        InputError: It cannot be read, has no such columns, or is no path.
    """
    units = dict(zip(FREEDOMS, ("m",) * 3 + ("rad",) * 3, strict=True))
    measured = read_measured(path, {TIME: "s", **units})
    rest = np.zeros(measured.time.size)
    place = np.column_stack([measured.columns.get(name, rest) for name in FREEDOMS])
    try:
        return ToolPath(measured.time, place)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def checksums_of_files(comm, scene):
    """{file of a tool: checksum}, of surfaces and paths. Collective.

    Raises:
        InputError: One cannot be read; on all ranks.
    """

    def read():
        if scene.tools:
            from ..geometry.tets.foreign import check_size  # what others need not wait for
        for table in scene.tools:
            _named(table, lambda table=table: check_size(table.surface))
        return {
            f"{what} of tool {table.name}": _named(table, lambda path=path: file_checksum(path))
            for table in scene.tools
            for what, path in (("surface", table.surface), ("path", table.path))
            if path is not None
        }

    return comm.bcast(on_first_rank(comm, read))


def check_sizes(mesh, tools):
    """See that tools are of the size of the sample, and near it. Collective.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        tools: All :class:`~mufe_fenicsx.bulk.tools.Tool`.

    Raises:
        InputError: One is not; on all ranks.
    """
    if not tools:
        return
    points, low, high = mesh.x[mesh.sample_nodes], np.empty(3), np.empty(3)
    mesh.comm.Allreduce(points.min(axis=0, initial=np.inf), low, op=MPI.MIN)
    mesh.comm.Allreduce(points.max(axis=0, initial=-np.inf), high, op=MPI.MAX)
    size = (high - low).max()
    for tool in tools:
        first, last = tool.points.min(axis=0), tool.points.max(axis=0)
        own, away = (last - first).max(), np.maximum(first - high, low - last).max()
        if not size / FAR < own < size * FAR:
            raise InputError(
                f"tool {tool.name} is {own:.3g} m across, the grains {size:.3g} m, expected "
                f"between {size / FAR:.3g} and {size * FAR:.3g} m: its unit tells the length of "
                "one unit of its file"
            )
        if away > size * FAR:
            raise InputError(
                f"tool {tool.name} is {away:.3g} m away from the grains, expected at most "
                f"{size * FAR:.3g} m: its position is that of the origin of its file"
            )
