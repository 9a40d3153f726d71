"""What contact costs: the search against the number of facets, and its share of a step."""

import math
import statistics
import time
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from ...contact.contact import Contact
from ...contact.settings import ContactGrains, ContactSettings
from ...contact.walls import Walls
from ...run.profile import Profile
from .launch import case_of, row

#: Surfaces of so many grains of 1280 facets each.
GRAINS = (8, 27, 64, 216, 512, 800)
#: Largest exponent of the number of facets in the time of a search; 1 is linear.
TARGET_EXPONENT = 1.1


@dataclass
class Shells:
    """Surfaces without an inside, with what contact asks of a GrainMesh."""

    comm: object
    x: np.ndarray
    facets: np.ndarray
    grain_of_node: np.ndarray
    grain_of_facet: np.ndarray
    grains: np.ndarray
    labels: np.ndarray

    @property
    def num_grains(self):
        """Grains on this rank."""
        return self.grains.size


def search(parameters):
    """Time of a search and of a step of contact against the number of facets, on one rank.

    Balls in a cubic packing, each touching six others, are turned at random. The number of nodes
    in contact grows with that of facets.

    Parameters: ``grains``, the largest number of grains; ``repeats``; ``points``, where contact
    acts, one of contact.surface.points.KINDS.
    """
    largest = int(parameters.get("grains", GRAINS[-1]))
    repeats = int(parameters.get("repeats", 3))
    points = str(parameters.get("points", "facets"))
    sizes = [n for n in GRAINS if n < largest] + [largest]
    results, facets, times = {}, [], []
    for num_grains in sizes:
        one = _measure(num_grains, repeats, points)
        facets.append(one["num_facets"])
        times.append(one["search_s"])
        name = f"{one['num_facets']}_facets"
        results[f"search_s_{name}"] = {"computed": one["search_s"]}
        results[f"search_us_per_facet_{name}"] = {
            "computed": 1e6 * one["search_s"] / one["num_facets"]
        }
        results[f"step_us_per_facet_{name}"] = {"computed": 1e6 * one["step_s"] / one["num_facets"]}
        results[f"contacts_{name}"] = {"computed": one["num_contacts"]}
    exponent = np.polyfit(np.log(facets), np.log(times), 1)[0] if len(sizes) > 1 else math.nan
    passed = exponent <= TARGET_EXPONENT
    results["exponent_of_search"] = row(float(exponent), TARGET_EXPONENT, passed)
    return case_of("search", {"grains": largest, "repeats": repeats, "points": points}, results)


def _measure(num_grains, repeats, points):
    """Median times of a search and of a step [s], on one rank."""
    shells, centre = packed_shells(num_grains)
    one = np.ones(num_grains)
    local = shells.x - centre
    grains, settings = ContactGrains(1e9 * one, one), ContactSettings(0.3, points=points)
    contact = Contact(shells, shells.x, Walls([]), grains, settings)
    force = np.zeros_like(shells.x)

    def grow(size):
        x = centre + size * local
        start = time.perf_counter()
        contact.begin_step(x)
        contact.add_forces(force, x)
        return time.perf_counter() - start

    # Contact begins from outside: the balls swell until they touch.
    for size in np.linspace(1.0, 1.006, 7):
        grow(size)
    searches = []
    for _ in range(repeats):
        start = time.perf_counter()
        contact.search(centre + 1.006 * local)
        searches.append(time.perf_counter() - start)
    grow(1.006)
    steps = [grow(1.006 + 1e-6 * k) for k in range(5 * repeats)]
    return {
        "num_facets": len(shells.facets),
        "search_s": statistics.median(searches),
        "step_s": statistics.median(steps),
        "num_contacts": contact.energy()[1],
    }


def packed_shells(num_grains):
    """Balls of radius 1 and 1280 facets, 2.005 apart, and the centre at each node."""
    import pyvista

    ball = pyvista.Icosphere(radius=1.0, nsub=3)
    points, facets = np.asarray(ball.points, float), ball.regular_faces
    # Facets enclose the volume of the ball, as where the compliance was measured.
    points *= np.cbrt(4 / 3 * np.pi / ball.volume)
    side = math.ceil(round(num_grains ** (1 / 3), 9))
    grid = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1)
    centres = 2.005 * grid.reshape(-1, 3)[:num_grains]
    rng = np.random.default_rng(3)
    turns = np.linalg.qr(rng.normal(size=(num_grains, 3, 3)))[0]
    turns *= np.sign(np.linalg.det(turns))[:, None, None]
    x = (np.einsum("gij,nj->gni", turns, points) + centres[:, None]).reshape(-1, 3)
    number = np.arange(num_grains)
    shells = Shells(
        comm=MPI.COMM_SELF,
        x=x,
        facets=(facets[None] + len(points) * number[:, None, None]).reshape(-1, 3),
        grain_of_node=np.repeat(number, len(points)),
        grain_of_facet=np.repeat(number, len(facets)),
        grains=number,
        labels=number + 1,
    )
    return shells, np.repeat(centres, len(points), axis=0)


def share_of_contact(simulation, num_steps):
    """How steps divide between tets and contact, and how rare searches are. Collective.

    Returns:
        dict: ``contact_over_tets``, sums over the ranks; and ``steps_per_search``.
    """
    profile = Profile(simulation)
    for _ in range(num_steps):
        simulation.step()
    found = profile.summary()
    seconds = [rank["seconds"] for rank in found["ranks"]]
    contact = ("contact search", "contact forces", "walls", "communication")
    return {
        "contact_over_tets": sum(s[part] for s in seconds for part in contact)
        / sum(s["tets"] for s in seconds),
        "steps_per_search": num_steps / max(found["searches"], 1),
    }
