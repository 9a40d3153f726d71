"""Units and signs of what runs store and tables have, by name: of fields and of columns.

A column is known by its whole name, else by the longest beginning that is known, before a "_":
``force_x`` and ``force_z_max`` by ``force``. Where one name means two things, a table says which.
"""

import h5py
import numpy as np

#: Unit -> names; "-": none.
UNITS = {
    "m": "height diameter inner_diameter length depth edge edge_distance contact_radius center "
    "centroid branch displacement translation misfit contact_gap contact_slip radius d10 d50",
    "m^2": "area contact_area opened_area failed_area",
    "m^3": "volume cell_volume overlap",
    "m^5": "inertia",
    "m/s": "speed velocity",
    "kg": "mass",
    "s": "time dt age since_time",
    "N": "force normal_force shear shear_force friction unbalanced mean_force",
    "N m": "torque",
    "Pa": "stress tensile_stress target modulus von_mises pressure pore_pressure "
    "contact_pressure contact_shear yield_stress shear_xz shear_tz strength least median largest",
    "J": "kinetic elastic plastic contact switching damping parting work residual energy "
    "friction_work",
    "rad": "rotation angle turn twist neighbours excess",
    "-": "step strain gamma state since rank probe num N_cA coordination added_mass wall normal "
    "grain grain_a grain_b body tool strong sliding chain ratio mobilised strong_force force_share "
    "anisotropy fabric grains_in_chains elements_per_radius elements_across plastic_strain "
    "volume_expansion shear_strain yielded_volume_fraction unstressed under_contact inside "
    "fragment crack broken_grains broken split chipped hardin einav "
    "age_strain since_strain difference closure void_ratio porosity log10_stress K0",
}
_UNIT_OF = {name: unit for unit, names in UNITS.items() for name in names.split()}
#: Sign -> names of stresses, strains and normal forces.
SIGNS = {
    "compression positive": "pressure pore_pressure contact_pressure normal_force target "
    " stress strain since_strain age_strain "
    "force_x_min force_x_max force_y_min force_y_max force_z_min force_z_max force_side "
    "force_inner",
    "tension positive": "tensile_stress",
    "expansion positive": "volume_expansion",
    "open positive": "contact_gap",
    "": "strain_deviator",
}
_SIGN_OF = {name: sign for sign, names in SIGNS.items() for name in names.split()}
#: How ParaView names the components of arrays with so many.
COMPONENTS = {3: "X Y Z", 6: "XX YY ZZ XY YZ XZ"}
#: Columns of contacts, whose vectors act on the first grain.
OF_CONTACTS = {
    **dict.fromkeys(("force", "shear", "friction"), ("N", "on grain_a")),
    "torque": ("N m", "on grain_a"),
    "normal": ("-", "from grain_b to grain_a"),
    "branch": ("m", "from grain_b to grain_a"),
    "normal_force": ("N", "compression positive"),
    "friction_work": ("J", ""),
}
#: Where a name means something else: method of `Run`, or fields -> name -> (unit, sign).
ELSEWHERE = {
    "fields": {"stress": ("Pa", "tension positive")},
    "history": {"friction": ("J", ""), "overlap": ("-", "")},
    "stresses": {
        **dict.fromkeys(("contact", "wall"), ("Pa", "compression positive")),
        **dict.fromkeys(("kinetic", "unbalanced"), ("-", "")),
    },
    "wall_friction": {"normal": ("N", "compression positive"), "shear": ("N", "on the wall")},
    "contacts": OF_CONTACTS,
    "active_contacts": OF_CONTACTS,
    "grains": {"force": ("N", "on the grain")},
}


def unit_and_sign(name, where):
    """Unit and sign of a column or field, "" where there is none; where: as of `ELSEWHERE`."""
    own = _longest(name, ELSEWHERE.get(where, {}))
    return own or (_longest(name, _UNIT_OF), _longest(name, _SIGN_OF))


def _longest(name, known):
    while name and name not in known:
        name = name.rpartition("_")[0]
    return known.get(name, "")


def describe_fields(group, names):
    """Let the fields of a VTKHDF group say what they are.

    Each dataset gets the attributes ``units``, ``sign`` and ``components``. The format has no place
    for them, so that ``FieldData/about`` has a line for each field too, which ParaView shows.

    Args:
        group: The group, h5py.
        names: Of the datasets, as "CellData/stress".
    """
    lines = []
    for path in names:
        field, name = group[path], path.rpartition("/")[2]
        about, line = about_field(name, field.shape[1] if field.ndim > 1 else 1)
        field.attrs.update(about)
        lines += [line] * bool(about)
    # ASCII: VTK's reader fails on other strings.
    group["FieldData/about"] = np.array(lines, h5py.string_dtype("ascii"))


def about_field(name, num_components, where="fields"):
    """Units, sign and components of a field, those that it has, as a dictionary and as a line."""
    unit, sign = unit_and_sign(name, where)
    about = {"units": unit, "sign": sign, "components": COMPONENTS.get(num_components)}
    about = {key: text for key, text in about.items() if text and unit}
    return about, ", ".join([f"{name} [{unit}]", *list(about.values())[1:]])
