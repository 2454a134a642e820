"""What each picture of a run shows, by file name."""

from __future__ import annotations

from lcmchain.report.shown import BETWEEN_SHOWN, SHOWN, STACK_SHOWN

#: Picture of the start, which a check leaves in the folder of the results.
START_PICTURE = "initial.png"

#: Captions in the order in which pictures are shown.
CAPTIONS: dict[str, str] = {
    **{
        f"{shown.name}.png": f"{shown.title} on the formed shape: oblique, and from above with the "
        "initial outline and the places of the largest and the smallest value"
        for shown in SHOWN
    },
    **{
        f"{shown.name}.png": f"{shown.title}: all plies that lie over each other, told on the "
        "uppermost ply seen"
        for shown in STACK_SHOWN
    },
    **{
        f"plies_{shown.name}.png": f"{shown.title} of every ply, formed and from above, with its "
        "initial outline; the colours are the same for all plies"
        for shown in SHOWN
    },
    **{
        f"plies_{shown.name}.png": f"{shown.title}, on the upper face of each ply that another one "
        "lies on, from above; white where none does or ever did"
        for shown in BETWEEN_SHOWN
    },
    "courses.png": "Courses of the ply on the formed shape, and from above the gaps along their "
    "joints; overlaps are negative",
    "plies_fibre_directions.png": "Fibre lines of all families of every ply, formed and from above",
    "exploded.png": "Formed plies lifted off each other, with their shear angle and fibre lines",
    "fibre_directions.png": "Fibre lines of all families on the formed shape; they followed a "
    "fibre before forming",
    "tools.png": "Formed shape between the tools in their final position, which are transparent",
    "sections.png": "Sections through sheet and tools: to scale, and unrolled with the thickness "
    "stretched, so that gaps and penetrations show",
    "force.png": "Forces on the tools over the travel of the punch, and over time with the travels",
    "force_over_travel.png": "Force on every tool over its own travel: mean over the intervals of "
    "the histories, and the band up to the largest force of a single step",
    "energy.png": "Energy balance, and kinetic energy and balance error as ratios",
}

#: Captions of the pictures of an infiltration, by what their names end in.
OF_FILLINGS = {
    "_filling_medium_time": "Infiltration: lines of equal fill time in the flow medium on the part",
    "_filling_time": "Infiltration: lines of equal fill time, with gates, vents and dry spots",
    "_filling_pressure": "Infiltration: pressure of the resin shortly before the part is full",
    "_filling_curves": "Infiltration: pressure and flow rate of the gates, volumes of resin",
}

#: What begins the names of the pictures of stages.
PREFIX = "stage_"
#: The pictures of every stage, by what their names end in.
CAPTIONS_OF_STAGE = {
    "tools": "the sheet between the tools that are at work, at the end of the stage",
    "sections": "sections through sheet and tools at the end of the stage",
    "shear_angle": "shear angle at the end of the stage",
}


def caption_of(file_name: str) -> str:
    """Return the caption of a picture, of any other file its name in words."""
    stem = file_name.rpartition("/")[2].rpartition(".")[0]
    if stem.startswith("animation"):
        return "Forming from the start to the end; colours and view are the same in all frames"
    if stem.startswith(PREFIX):
        for ending, caption in CAPTIONS_OF_STAGE.items():
            if stem.endswith(f"_{ending}"):
                number, _, name = (
                    stem.removeprefix(PREFIX).removesuffix(f"_{ending}").partition("_")
                )
                return f"Stage {number}, {name}: {caption}"
    for ending, caption in OF_FILLINGS.items():
        if stem.endswith(ending):
            return f"{caption} ({stem.removesuffix(ending)})"
    return CAPTIONS.get(f"{stem}.png", stem.replace("_", " ").replace("-", " "))
