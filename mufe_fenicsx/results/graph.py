"""The contact network of a stored state as a graph."""

from pathlib import Path

from ..errors import InputError


def contact_graph(run, number=-1):
    """Grains and walls as nodes, active contacts as edges.

    Args:
        run: :class:`~mufe_fenicsx.results.run.Run`.
        number: Of the stored state; -1 is the last.

    Returns:
        networkx.Graph. Nodes are labels of grains, with the columns of ``run.grains()``, and names
        of walls; ``kind`` is "grain" or "wall". Edges have the columns of
        ``run.active_contacts()``, in SI units; vectors are those on ``grain_a``.

    Raises:
        InputError: The state or its contacts are not stored.
    """
    import networkx  # only here: no report needs it

    graph = networkx.Graph()
    for row in run.grains(number).to_dict("records"):
        graph.add_node(int(row.pop("grain")), kind="grain", **row)
    for row in run.active_contacts(number).to_dict("records"):
        other = row["wall"] if row["grain_b"] == 0 else int(row["grain_b"])
        if other not in graph:
            graph.add_node(other, kind="wall")
        graph.add_edge(int(row["grain_a"]), other, **row)
    return graph


def write_graphml(run, path, number=-1):
    """Write that graph as GraphML, which networkx, igraph, Gephi and Cytoscape read.

    Args:
        run, number: As of :func:`contact_graph`.
        path: File to write; an earlier one is replaced.

    Raises:
        InputError: As of :func:`contact_graph`, or the file cannot be written.
    """
    import networkx

    graph = contact_graph(run, number)
    try:
        networkx.write_graphml_xml(graph, Path(path))
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror}") from error
