"""What accuracy costs: the studies whose tables and charts stand in the manual.

    python examples/accuracy/charts.py [--out DIR] [--page F.md] [--pictures DIR] [--only NAME ...]
        [--workers N] [--coarser F]

Each study is `lcmchain study accuracy SOURCE ...`, with the options that `STUDIES` holds; one that
was stopped goes on. `--page` writes their tables into a page of Markdown, each in place of the
section of its title, and their charts into the folder of `--pictures`; sections of other titles
stay. `--coarser 3` makes all edges longer by that factor, for a look in a minute.
"""

from __future__ import annotations

import argparse
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path

from lcmchain.study import AccuracyStudy, Workers, read_source, study_accuracy
from lcmchain.study.accuracy_files import write_accuracy

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from with_time import entries_with_time

EXAMPLES = Path(__file__).resolve().parent.parent


@dataclass(frozen=True)
class Chart:
    """A study: scene or coupon, edge length of its base [mm] and of its finest mesh over that.

    overrides : of the scene; text : what the manual says of it.
    """

    source: str
    edge: float
    finest: float = 0.6
    overrides: tuple[str, ...] = ()
    text: str = ""

    def command(self) -> str:
        """Return the command that makes the same study."""
        name = self.source
        if name.endswith(".toml"):
            name = f"examples/{name}"
        entries = " ".join(f'--set "{entry}"' for entry in self.entries(1.0))
        return f"lcmchain study accuracy {name} --finest {self.finest:g} {entries}"

    def entries(self, coarser: float) -> tuple[str, ...]:
        """Return the overrides, with edges longer by a factor."""
        return (f"blank.edge_length={coarser * self.edge:g} mm", *self.overrides)


STUDIES = {
    "hemisphere_holder": Chart(
        "hemisphere_holder/scene.toml", 5.0, overrides=entries_with_time("hemisphere_holder"),
    ),
    "hemisphere_free": Chart(
        "hemisphere_free/scene.toml", 6.0, overrides=entries_with_time("hemisphere_free"),
        text="Without a holder the blank is free to wrinkle: what finer meshes add is folds.",
    ),
    "closed_mould": Chart(
        "wet_compression/scene.toml", 5.0,
        overrides=("title=Closed mould: dome pressed to 0.85 mm", "infiltration=none",
                   "permeability=none"),
        text="The matched tools of `examples/wet_compression` without its resin: they close to "
        "0.85 mm, so that the punch force is that of compaction.",
    ),
    "bias_extension": Chart(
        "bias-extension", 5.0,
        text="The strip of 320 mm x 160 mm of [Coupon tests](coupons.md), pulled by 60 mm; the "
        "clamps' force stands in place of a punch's.",
    ),
}  # fmt: skip


def main() -> None:
    """Make the studies, and write them into the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("results/accuracy"))
    parser.add_argument("--page", type=Path, help="Markdown page to write the tables into")
    parser.add_argument("--pictures", type=Path, help="folder of its pictures")
    parser.add_argument("--only", nargs="+", choices=STUDIES, default=list(STUDIES))
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--coarser", type=float, default=1.0)
    arguments = parser.parse_args()
    for name in arguments.only:
        folder = arguments.out / name
        study = made(STUDIES[name], folder, arguments.workers, arguments.coarser)
        print(f"{name}: {study.sentence()}", flush=True)
        if arguments.page is not None:
            picture = f"accuracy-{name.replace('_', '-')}.png"
            pictures = arguments.pictures or arguments.page.parent / "pictures"
            pictures.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(folder / "accuracy.png", pictures / picture)
            table = (folder / "accuracy.md").read_text(encoding="utf-8")
            write_section(arguments.page, section(STUDIES[name], table, picture))


def made(chart: Chart, folder: Path, workers: int, coarser: float) -> AccuracyStudy:
    """Make a study and its files."""
    source = chart.source
    if source.endswith(".toml"):
        source = str(EXAMPLES / source)
    text = read_source(source, chart.entries(coarser))
    folder.mkdir(parents=True, exist_ok=True)
    study = study_accuracy(text, folder, finest=chart.finest, workers=Workers(workers, 1))
    write_accuracy(folder, study)
    return study


def section(chart: Chart, table: str, picture: str) -> str:
    """Return the section of a study: what it is, its chart and its tables."""
    heading, _, rest = table.partition("\n")
    about = [chart.text] if chart.text else []
    parts = [heading, *about, f"```console\n{chart.command()}\n```",
             f"![Error against time](pictures/{picture})", rest.strip()]  # fmt: skip
    return "\n\n".join(parts) + "\n"


def write_section(page: Path, text: str) -> None:
    """Write a section into a page, in place of the one with the same heading, else at its end."""
    heading = text.partition("\n")[0]
    old = page.read_text(encoding="utf-8") if page.exists() else "# Accuracy table\n"
    parts = old.split("\n## ")
    sections = [parts[0].rstrip() + "\n", *(f"## {part.rstrip()}\n" for part in parts[1:])]
    places = [k for k, part in enumerate(sections) if part.partition("\n")[0] == heading]
    if places:
        sections[places[0]] = text
    else:
        sections.append(text)
    page.write_text("\n".join(sections), encoding="utf-8")


if __name__ == "__main__":
    main()
