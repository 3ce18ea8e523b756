"""Which pictures a report shows, where it can't show all."""


def chosen_conditions(conditions: int, levels: int, most: int) -> set[int]:
    """Choose conditions, of which `levels` in a row are one group: whole groups, so that the sliders work within them.

    Groups lie evenly over all of them, the first among them; where not even one fits, its levels lie evenly, with
    the darkest and the brightest.

    Parameters
    ----------
    conditions, levels : int
    most : int
        1 or more.
    """
    if most >= conditions:
        return set(range(conditions))
    groups = conditions // levels
    fitting = most // levels
    if fitting:
        return {place * groups // fitting * levels + level for place in range(fitting) for level in range(levels)}
    return {round(place * (levels - 1) / max(most - 1, 1)) for place in range(most)}
