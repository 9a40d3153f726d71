"""What the numbers of printed summaries are called, and their units; JSON has the keys."""

#: Endings of keys that state a unit.
ENDINGS = {"_m": "m", "_s": "s", "_deg": "°", "_bytes": "bytes", "_voxels": "voxels"}

_OF_MESHES = {
    "retried": ("grains meshed with other settings than the first", ""),
    "element_size": ("element size h", "m"),
    "volume_ratio": ("volume of all meshes, over that given", ""),
    "smallest_volume_ratio": ("the same of a grain, smallest", ""),
    "min_altitude_over_h": ("altitude of tetrahedra over h, smallest", ""),
    "mean_min_altitude_over_h": ("the same, mean of the grains' smallest", ""),
    "min_dihedral_deg": ("angle between faces of a tetrahedron, smallest", "°"),
    "share_below_quarter_h": ("tetrahedra with an altitude below h/4, part of all", ""),
    "time_step_without_worst": ("time step without the flattest 0.1 % of tetrahedra, over now", ""),
} | {
    key.format(unit): (text, "h" if unit == "sizes" else unit)
    for unit in ("voxels", "sizes")
    for key, text in {
        "distance_median_{}": "distance from the surfaces given, half of the nodes within",
        "distance_95_{}": "the same, 95 % of the nodes within",
        "largest_distance_95_{}": "the same, of the worst grain",
    }.items()
}

_OF_LABELS = {
    "threshold": ("threshold", "grey levels"),
    "void_grey": ("level of voids", "grey levels"),
    "solid_grey": ("level of grains", "grey levels"),
    "filled_pore_voxels": ("pores filled inside grains", "voxels"),
    "opened_contacts": ("contacts opened: dark between the grains", ""),
    "dropped_fragments": ("fragments left out as too small", ""),
    "dropped_voxels": ("the same, in all", "voxels"),
    "merge_depth": ("depth up to which basins merge", ""),
    "cylinder_x_m": ("axis of the cylinder, x", "m"),
    "cylinder_y_m": ("the same, y", "m"),
    "cylinder_radius_m": ("radius of the cylinder", "m"),
    "rim": ("grains at its rim", ""),
    "rim_grains_left_out": (
        "grains left out beyond the cylinder, or as too little of them is within",
        "",
    ),
    "round_faces_share": ("cut faces, part of the side of the cylinder", ""),
    "median_diameter": ("diameter of the sphere of equal volume, median", "m"),
    "small_grains": ("grains much smaller than the rest", ""),
    "large_grains": ("grains much larger than the rest", ""),
    "concave_grains": ("concave grains, perhaps several in one", ""),
    "wide_necks": ("wide necks, perhaps one grain cut in two", ""),
    "num_true": ("true grains", ""),
    "num_found": ("grains found", ""),
    "num_matched": ("grains found one-to-one", ""),
    "matched_share": ("the same, part of the true ones", ""),
    "false_grains": ("grains found that are none", ""),
    "split": ("true grains cut into several", ""),
    "merged": ("true grains in one with others", ""),
    "num_true_contacts": ("true contacts", ""),
    "num_found_contacts": ("contacts found", ""),
    "contact_precision": ("contacts found that are true, part of those found", ""),
    "contact_recall": ("true contacts found, part of the true ones", ""),
    "mean_diameter_error": ("error of the diameter, mean, relative", ""),
    "largest_diameter_error": ("the same, largest", ""),
    "diameter_error_95": ("the same, 95 % of the grains within", ""),
    "solid_fraction_error": ("error of the solid fraction", ""),
    "wrong_voxels": ("voxels of another grain, part of those solid in both", ""),
    "mean_whole_diameter": ("mean diameter of whole grains", "m"),
    "packed_d50": ("d50 of the packed grains", "m"),
    "packed_uniformity": ("uniformity of the packed grains", ""),
    "porosity_of_labels": ("porosity of truth_labels.tif", ""),
    "coordination_number_of_labels": ("coordination number in truth_labels.tif", ""),
    "num_label_contacts": ("contacts in truth_labels.tif", ""),
}

_OF_RUNS = {
    "area": ("cross-section of the sample", "m²"),
    "first_height": ("height at the start", "m"),
    "reference_height": ("height at strain 0", "m"),
    "mass": ("mass of the grains", "kg"),
    "added_mass": ("mass added to them by scaling", "kg"),
    "diameters": ("height at strain 0 in median diameters of grains", ""),
    "porosity": ("porosity of the container", ""),
    "void_ratio_error": ("the same, standard error", ""),
    "stress": ("vertical stress at the end", "Pa"),
    "setup_s": ("time to set up", "s"),
    "wall_s": ("time in all", "s"),
    "time": ("simulated time", "s"),
    "time_step": ("time step", "s"),
    "element_time_step": ("least time step of single elements, a bound from below", "s"),
    "peak_memory_bytes": ("memory at its peak", "bytes"),
    "edges_per_diameter": ("edges a diameter of grains", ""),
    "elements_per_radius": ("elements per contact radius, half of the force has fewer", ""),
    "cracks": ("cracks", ""),
    "all_hold_from": ("strain from which all checks of the report hold", ""),
}

_OF_PACKINGS = {
    "void_ratio": ("void ratio of the container", ""),
    "solid_fraction": ("solid fraction of the container", ""),
    "void_ratio_inside": ("void ratio away from walls", ""),
    "bearing_coordination_number": ("contacts of a grain that bears, walls among them", ""),
    "rattlers": ("grains that bear nothing, part of all", ""),
    "mean_overlap": ("overlap of pairs, mean", "D"),
    "largest_overlap": ("overlap, largest", "D"),
    "unbalanced": ("unbalanced forces over those of contacts", ""),
    "friction_at_start": ("friction at the start", ""),
    "friction_at_end": ("friction at the end", ""),
    "mean_diameter": ("mean diameter D", "m"),
    "container_x": ("container along x", "m"),
    "container_y": ("container along y", "m"),
    "container_z": ("container along z", "m"),
    "size_taken": ("size of the container taken", ""),
}

_OF_SCANS = {
    "shortening": ("shortening of the grains along z, scan", ""),
    "run_shortening": ("the same, run", ""),
    "num_rotations": ("grains whose rotation the scan tells", ""),
    "num_on_labels": ("grains of the run that lie on labels", ""),
    "num_tracked": ("grains compared", ""),
    "num_lost_in_scan": ("grains of the first scan that are lost", ""),
    "mean_displacement": ("displacement in the scan, mean", "m"),
    "mean_displacement_difference": ("its difference to that of the run, mean", "m"),
    "mean_difference_voxels": ("the same in voxels", ""),
    "mean_rotation_difference_deg": ("angle between rotations of scan and run, mean", "°"),
    "mean_dice": ("overlap of grains with their labels (Dice), mean", ""),
    "contacts_gained": ("contacts gained in the scan", ""),
    "run_contacts_gained": ("contacts gained in the run", ""),
    "contacts_lost": ("contacts lost in the scan", ""),
    "run_contacts_lost": ("contacts lost in the run", ""),
}

#: Key -> words and unit, where the key does not say them.
WORDS = {
    "voxel_size": ("voxel size", "m"),
    "image_voxel_size_from": ("voxel size stated by", ""),
    "grains": ("folder of grains", ""),
    "d50": ("d50", "m"),
    "seconds": ("time", "s"),
    "packing_seconds": ("time of packing", "s"),
    **_OF_MESHES,
    **_OF_LABELS,
    **_OF_RUNS,
    **_OF_PACKINGS,
    **_OF_SCANS,
}


def breakage_line(result):
    """What run.json says of grains that break in one line, or None where they cannot."""
    found = result.get("breakage")
    if found is None:
        return None
    split, chipped = (round(found[name] * result["num_grains"]) for name in ("split", "chipped"))
    opened, failed = (f"{1e6 * found[name]:.3g} mm²" for name in ("opened_area", "failed_area"))
    return (
        f"{found['num_opened']} facets opened ({opened}, of which {failed} failed), "
        f"{found['num_fragments']} fragments, {split} grains split, {chipped} chipped, "
        f"fracture work {1e6 * found['fracture_work']:.4g} µJ"
    )


def described(key):
    """Words and unit of a key of a summary.

    Args:
        key: As in JSON.

    Returns:
        (words, unit); the unit is "" where there is none.
    """
    if key in WORDS:
        return WORDS[key]
    unit = next((unit for ending, unit in ENDINGS.items() if key.endswith(ending)), "")
    words = key.removeprefix("num_")
    for ending, own in ENDINGS.items():
        words = words.removesuffix(ending) if own == unit else words
    return words.replace("_", " "), unit


def printed(result):
    """Of what a run returns the part that the terminal shows: without numbers that are not known.

    A sample too narrow for a void ratio away from walls has 0 for it.
    """
    left_out = {"profile"}
    if not result.get("void_ratio_inside"):
        left_out |= {"void_ratio_inside", "void_ratio_error"}
    return {name: value for name, value in result.items() if name not in left_out}
