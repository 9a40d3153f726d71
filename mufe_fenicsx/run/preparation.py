"""What a test of a scene begins with: read, found and checked once, with nothing written yet."""

from dataclasses import dataclass

from ..container import Bounds
from ..machine.ranks import on_first_rank
from ..mesh import GrainMesh
from ..output.checkpoint import find_checkpoint
from ..output.run_folder import check_inside, check_run_folder
from ..scene import scene_to_toml
from .from_scene import find_bounds, load_mesh, make_walls, separate_surfaces, sleeve_of
from .restart import mesh_of, partition_of
from .resume_check import check_origin, check_results, grains_checksum, reading
from .run_place import say
from .scene_tools import check_sizes, checksums_of_files, make_tools


@dataclass(frozen=True)
class Prepared:
    """Grains, walls and tools of a test at its start."""

    mesh: GrainMesh
    bounds: Bounds  #: where the walls stand
    walls: list  #: of :class:`~mufe_fenicsx.contact.walls.Wall`
    tools: list  #: all :class:`~mufe_fenicsx.bulk.tools.Tool`, those of the mesh

    @classmethod
    def of(cls, scene, mesh, tools=()):
        """That of a scene and a mesh. Collective.

        Raises:
            InputError: As of :func:`~.from_scene.find_bounds`.
        """
        bounds = find_bounds(scene, mesh)
        return cls(mesh, bounds, make_walls(scene, bounds, mesh.labels_of_sleeves), tools)


def find_start(scene, grains_folder, folder, lock, options):
    """What a test goes on from, and what it has to be a test of. Collective.

    Args:
        scene: :class:`~mufe_fenicsx.scene.Scene`.
        grains_folder: Folder that `mufe mesh` wrote.
        folder: Run folder.
        lock: :class:`~mufe_fenicsx.output.run_lock.RunLock` of it.
        options: :class:`~.run_options.RunOptions`.

    Returns:
        :class:`~.output.checkpoint.Checkpoint`, None for a new test; and
        {what: text or checksum} of scene, grains and tools.

    Raises:
        InputError: The folder or the checkpoint cannot be used; on all ranks.
    """
    comm, quiet = lock.comm, options.quiet
    identity = {
        "scene": scene_to_toml(scene),
        "grains": grains_checksum(comm, grains_folder),
        "tools": checksums_of_files(comm, scene),
    }
    if not options.resume:
        lock.look()
        check_run_folder(comm, folder, options.overwrite)
        return None, identity
    say(comm, lock.take(), quiet)
    on_first_rank(comm, lambda: check_inside(folder))
    checkpoint = find_checkpoint(comm, folder)
    check_origin(comm, checkpoint, identity, folder, quiet)
    check_results(comm, checkpoint, folder, options.accept_loss, quiet)
    return checkpoint, identity


def prepare(scene, grains_folder, comm, checkpoint):
    """:class:`Prepared`, and how surfaces that overlapped were moved or None. Collective.

    Args:
        scene: :class:`~mufe_fenicsx.scene.Scene`.
        grains_folder: Folder that `mufe mesh` wrote.
        comm: MPI communicator.
        checkpoint: That of :func:`find_start`: surfaces are as they were then.

    Raises:
        InputError: Grains, tools and scene do not fit; on all ranks.
    """
    with reading(checkpoint):
        partition = checkpoint and partition_of(checkpoint, comm)
    tools, around = make_tools(comm, scene), sleeve_of(scene)
    with reading((partition is not None and checkpoint) or None):
        mesh = load_mesh(comm, grains_folder, partition, tools, around)
    check_sizes(mesh, tools)
    sample = mesh.labels[: mesh.num_sample_grains]
    scene.materials_of(sample, sample)
    separation = None
    if checkpoint is None:
        separation = separate_surfaces(mesh, scene.sample)
    else:
        with reading(checkpoint):
            mesh = mesh_of(checkpoint, mesh)
    return Prepared.of(scene, mesh, tools), separation and separation.as_dict()
