"""What makes a comparison of a run with scans doubtful, in sentences."""

#: Part by which diameters of run and labels may differ: twice what a mesh may have too little or
#: too much of a grain's volume, and what labels are off by where they were segmented anew.
LARGEST_DIFFERENCE = 0.03
#: Part of the grains that may be lost without a word, and of a strain that walls may be off by.
SMALL = 0.1
#: Motion that all grains share beyond that of the run which is told [voxels].
LARGE_SHIFT = 2.0
#: Distance of labels of the first scan from grains of the run, in the mean, which is told [voxels]:
#: where the same image was segmented anew it is below a half.
LARGE_OFFSET = 1.0


def about_grains(begin, run, first, size):
    """What the labels of the first scan lack, and whether their voxels are as large as meshed."""
    told = []
    lacking = begin.num_grains - len(begin.grains)
    if lacking:
        told.append(
            f"{lacking} of {begin.num_grains} grains of {run.path} lie on no label of "
            f"{first} and are left out"
        )
    if abs(begin.diameter_ratio - 1) > LARGEST_DIFFERENCE:
        told.append(
            f"grains of {first} are {begin.diameter_ratio:.3g} times as wide as those of "
            f"{run.path} (median), expected 1: with voxels of {size / begin.diameter_ratio:.3g} m "
            f"instead of {size:.3g} m they would be as wide"
        )
    return told


def about_offset(begin, numbers, run, first, size):
    """Whether labels of the first scan, of voxels as meshed, lie beside the grains of the run."""
    offset = [numbers[f"label_offset_{a}"] / size for a in "xyz"]
    if abs(begin.diameter_ratio - 1) > LARGEST_DIFFERENCE or max(map(abs, offset)) <= LARGE_OFFSET:
        return []
    off = ", ".join(f"{o:.1f}" for o in offset)
    return [
        f"labels of {first} lie {off} voxels (x, y, z) beside the grains of {run.path}, in the "
        "mean, expected 0: give them cropped as those that were meshed"
    ]


def about_lost(track, name):
    """Whether more than a tenth of the grains of the first scan are lost in a later one."""
    num, lost = len(track.label), int((~track.found).sum())
    if lost <= SMALL * num:
        return []
    return [
        f"{lost} of {num} grains of the first scan are not found in {name}: is it mirrored, does "
        "it show another part, or another sample?"
    ]


def about_shift(numbers, name, size):
    """Whether all grains of a scan have moved together, beyond the run: by over two voxels."""
    shift = [numbers[f"common_shift_{a}"] / size for a in "xyz"]
    if max(abs(s) for s in shift) <= LARGE_SHIFT:
        return []
    text = ", ".join(f"{s:.1f}" for s in shift)
    return [
        f"grains of {name} have moved by {text} voxels (x, y, z) more than those of the run, in "
        "the mean: where the sample was mounted anew, --align takes that out, also of motion.csv"
    ]


def about_seating(begin, found, height):
    """Whether the run seated a first scan of grains as meshed: by over half a voxel."""
    seating = found[0].numbers.get("run_shortening_seated", 0.0)
    if begin.seated or seating <= 0.5 / height:
        return []
    return [
        "the first scan shows the grains as meshed, and seating makes those of the run shorter "
        f"by {seating:.3g} along z: stages of stages.toml begin before it, so put them before the "
        "stage that seats, or give labels of the seated sample as first scan"
    ]


def about_ways(walls, cut):
    """By what walls of motion.csv go, see :mod:`mufe_fenicsx.results.sample_ends`: a sentence.

    Args:
        walls: Names of all.
        cut: Names of those at which the scan goes on through the sand.
    """
    ways = {
        "with surfaces of grains that touch them": [w for w in walls if w not in cut],
        "with centres of all grains, as cuts through the sand": [w for w in walls if w in cut],
    }
    told = [f"{', '.join(names)} {way}" for way, names in ways.items() if names]
    return "Walls of motion.csv go: " + "; ".join(told)


def about_walls(places, found, names, size):
    """Whether flat walls come nearer by another strain than centres of grains do.

    Of each axis the scan counts where both differ most. Half a voxel a wall is no difference.

    Args:
        places: Of :func:`~mufe_fenicsx.results.sample_ends.places_by_scans`.
        found: List of :class:`~mufe_fenicsx.results.scans.Beside`, one a later scan.
        names: Of the later scans.
        size: Of voxels [m].

    Returns:
        A list of one sentence, or of none.
    """
    axes = []
    for a in "xyz":
        if not {f"{a}_min", f"{a}_max"} <= set(places[0]):
            continue
        length = [at[f"{a}_max"] - at[f"{a}_min"] for at in places]
        walls = [1 - now / length[0] for now in length[1:]]
        grains = [beside.numbers[f"sample_strain_{a}"] for beside in found]
        apart = [abs(w - g) for w, g in zip(walls, grains, strict=True)]
        k = apart.index(max(apart))
        if apart[k] > max(SMALL * max(abs(walls[k]), abs(grains[k])), size / length[0]):
            axes.append(f"{walls[k]:.3g} and {grains[k]:.3g} along {a} at {names[k]}")
    if not axes:
        return []
    return [
        "strains by walls of motion.csv and by centres of grains differ: "
        + ", ".join(axes)
        + "; by chance where samples are few grains high, else because these are no platens, or "
        "the run is pressed otherwise: delete columns of walls that stand still, and give motions "
        "that were measured otherwise for those that move, if they are known"
    ]


def beyond(numbers, name, height):
    """Whether a scan is pressed less or more than the run ever is: by over half a voxel."""
    wanted, least, most = (
        numbers.get(key) for key in ("shortening", "run_shortening_least", "run_shortening_most")
    )
    if least is None or least - 0.5 / height <= wanted <= most + 0.5 / height:
        return []
    what = "less than the run at its start" if wanted < least else "more than the run at its end"
    return [
        f"{name} is pressed {what}: its grains are {_by(wanted)} along z than in the first scan, "
        f"those of the run {_by(least)} to {_by(most)}; it stands beside the nearest state"
    ]


def _by(strain):
    """A shortening in words; below 1e-6 it is rounding."""
    strain = round(strain, 6)
    return f"{'longer' if strain < 0 else 'shorter'} by {abs(strain):.3g}"
