"""Builds small units in C for the tests: FMI 2.0 and 3.0 from one list of variables."""

import math
import subprocess
import zipfile
from dataclasses import dataclass, field
from pathlib import Path
from xml.sax.saxutils import quoteattr

import fmpy

HERE = Path(__file__).parent / "units"
HEADERS = Path(fmpy.__file__).parent / "c-code"
MEMBER = {"real": "r", "whole": "i", "truth": "b", "text": "s", "size": "n"}
FIRST = {"real": 0, "whole": 1000, "truth": 2000, "text": 3000, "size": 4000}
TYPES2 = {"real": "Real", "whole": "Integer", "truth": "Boolean", "text": "String"}
TYPES3 = {"real": "Float64", "whole": "Int32", "truth": "Boolean", "text": "String",
          "size": "UInt64"}  # fmt: skip

#: Units of measurement with their base units.
UNITS = {
    "N": 'kg="1" m="1" s="-2"', "kN": 'kg="1" m="1" s="-2" factor="1000"', "m": 'm="1"',
    "mm": 'm="1" factor="0.001"', "m/s": 'm="1" s="-1"', "K": 'K="1"',
    "degC": 'K="1" offset="273.15"', "Pa": 'kg="1" m="-1" s="-2"', "m3/s": 'm="3" s="-1"',
    "kg": 'kg="1"', "N/m": 'kg="1" s="-2"', "s": 's="1"', "N.s/m": 'kg="1" s="-1"',
}  # fmt: skip


@dataclass
class Var:
    """A variable of a unit; ``start`` None: an output that the unit computes.

    ``by`` (FMI 3.0): names of the structural parameters, of kind ``size`` and listed before, that
    give an array its sizes; ``size`` is then how many values there is room for.
    """

    name: str
    causality: str = "output"
    kind: str = "real"
    start: object = None
    unit: str | None = None
    size: int | None = None
    needs: tuple[str, ...] | None = ()
    variability: str | None = None
    by: tuple[str, ...] = ()
    limits: tuple[int, int] | None = None


@dataclass
class Model:
    """Variables and the C code of a unit; code reaches values as ``V(name)``."""

    name: str
    variables: list[Var]
    answer: str = ""
    advance: str = "return 0;"
    begin: str = ""
    options: dict = field(default_factory=dict)
    extra: str = ""


def header(model: Model, version: int) -> str:
    """The file model.h of a unit."""
    counts = dict.fromkeys(MEMBER, 0)
    lines, offsets, sizes, starts = [], [], [], []
    for v in model.variables:
        at, size = counts[v.kind], v.size or 1
        counts[v.kind] += size
        name = v.name.replace(".", "_")
        lines.append(f"#define {name} (v->{MEMBER[v.kind]}{f'+{at}' if v.size else f'[{at}]'})")
        if v.kind == "real":
            offsets.append(at)
            sizes.append(size)
        for k in range(size if v.start is not None else 0):
            if v.kind == "text":
                starts.append(f'strcpy(v->s[{at}], "{v.start}");')
            else:
                starts.append(f"v->{MEMBER[v.kind]}[{at + k}] = {float(v.start):.17g};")
    sizes_text = f"""#define REALS {counts["real"]}
#define WHOLES {counts["whole"]}
#define TRUTHS {counts["truth"]}
#define TEXTS {counts["text"]}
#define NUMBERS {counts["size"]}"""
    reals = [v for v in model.variables if v.kind == "real"]
    cases = " ".join(
        f"case {k}: return {' * '.join(one.replace('.', '_') for one in v.by)};"
        for k, v in enumerate(reals)
        if v.by
    )
    listed = (", ".join(map(str, numbers or [0])) for numbers in (offsets, sizes))
    one, other = listed
    return sizes_text, "\n".join(
        [
            f'#define TOKEN "{model.name}"',
            f"static const int OFFSET[] = {{{one}}}, SIZE[] = {{{other}}};",
            *lines,
            model.extra,
            f"static int size_of(const Values *v, int k) {{ switch (k) {{ {cases} }} "
            "return SIZE[k]; }",
            f"static void begin(Values *v) {{ {' '.join(starts)} {model.begin} }}",
            f"static void answer(Values *v) {{ {model.answer} }}",
            f"static int advance(Unit *u, Values *v, double t, double h) {{ {model.advance} }}",
            *(f"#undef {v.name.replace('.', '_')}" for v in model.variables),
        ]
    )


def reference(counts: dict, v: Var, version: int, number: int) -> int:
    if version == 3 and v.kind == "real":
        return number
    return counts[v.kind] + (FIRST[v.kind] if version == 3 else 0)


def description(model: Model, version: int) -> str:
    """The model description."""
    counts = dict.fromkeys(MEMBER, 0)
    rows, references, indices, reals = [], {}, {}, 0
    for v in model.variables:
        default = {"parameter": "fixed"}.get(v.causality, "continuous")
        variability = v.variability or ("discrete" if v.kind != "real" else default)
        if v.causality in ("parameter", "structuralParameter"):
            variability = v.variability or "fixed"
        unit = f" unit={quoteattr(v.unit)}" if v.unit else ""
        exact = v.causality in ("parameter", "input", "structuralParameter")
        start = v.start if exact else None
        if v.kind == "truth" and start is not None:
            start = str(bool(start)).lower()
        for k in range(v.size or 1 if version == 2 else 1):
            vr = reference(counts, v, version, reals)
            name = f"{v.name}[{k + 1}]" if v.size and version == 2 else v.name
            about = f'name="{name}" valueReference="{vr}" causality="{v.causality}"'
            about += f' variability="{variability}"'
            indices.setdefault(v.name, []).append(len(rows) + 1)
            references[v.name] = vr
            if version == 2:
                value = "" if start is None else f" start={quoteattr(str(start))}"
                kind = TYPES2[v.kind]
                rows.append(f"<ScalarVariable {about}><{kind}{unit}{value}/></ScalarVariable>")
                counts[v.kind] += 1
            else:
                kind, inner = TYPES3[v.kind], ""
                sized = {one.name: one for one in model.variables if one.name in v.by}
                size = math.prod(sized[name].start for name in v.by)
                if v.by:
                    inner = "".join(
                        f'<Dimension valueReference="{references[name]}"/>' for name in v.by
                    )
                    start = " ".join([str(start)] * size) if start is not None else None
                elif v.size:
                    inner = f'<Dimension start="{v.size}"/>'
                    start = " ".join([str(start)] * v.size) if start is not None else None
                value = "" if start is None else f" start={quoteattr(str(start))}"
                if v.limits is not None:
                    value += f' min="{v.limits[0]}" max="{v.limits[1]}"'
                if v.kind == "text" and start is not None:
                    value, inner = "", f"<Start value={quoteattr(str(start))}/>"
                rows.append(f"<{kind} {about}{unit}{value}>{inner}</{kind}>")
                reals += v.kind == "real"
                counts[v.kind] += 1 if v.kind != "real" else 0
    if version == 3:
        rows.append(
            '<Float64 name="time" valueReference="9999" causality="independent" '
            'variability="continuous"/>'
        )
    units = "".join(
        f'<Unit name="{name}"><BaseUnit {UNITS[name]}/></Unit>'
        for name in sorted({v.unit for v in model.variables if v.unit})
    )
    units = f"<UnitDefinitions>{units}</UnitDefinitions>" if units else ""
    options = {
        "canHandleVariableCommunicationStepSize": "true",
        "canGetAndSetFMUstate" if version == 2 else "canGetAndSetFMUState": "true",
        "canSerializeFMUstate" if version == 2 else "canSerializeFMUState": "true",
        **model.options,
    }
    able = " ".join(f'{key}="{value}"' for key, value in options.items())
    outputs = [v for v in model.variables if v.causality == "output"]
    structure = []
    for tag in ("Outputs", "InitialUnknowns") if version == 2 else ("Output", "InitialUnknown"):
        unknowns = []
        for v in outputs:
            if v.needs is None:
                depends = ""
            else:
                all_of = indices if version == 2 else {k: [r] for k, r in references.items()}
                numbers = [str(n) for name in v.needs for n in all_of[name]]
                depends = f' dependencies="{" ".join(numbers)}"'
            for k in range(len(indices[v.name])):
                if version == 2:
                    unknowns.append(f'<Unknown index="{indices[v.name][k]}"{depends}/>')
                else:
                    unknowns.append(f'<{tag} valueReference="{references[v.name]}"{depends}/>')
        text = "".join(unknowns)
        structure.append(f"<{tag}>{text}</{tag}>" if version == 2 and text else text)
    token = "guid" if version == 2 else "instantiationToken"
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription fmiVersion="{version}.0" '
        f'modelName="{model.name}" {token}="{model.name}">'
        f'<CoSimulation modelIdentifier="{model.name}" {able}/>{units}'
        f"<ModelVariables>{''.join(rows)}</ModelVariables>"
        f"<ModelStructure>{''.join(structure)}</ModelStructure></fmiModelDescription>"
    )


def build(model: Model, version: int, folder: Path) -> Path:
    """Compile a unit and pack it; returns the archive."""
    work = folder / f"{model.name}_{version}"
    work.mkdir(parents=True, exist_ok=True)
    counts, code = header(model, version)
    (work / "model.h").write_text(code)
    defines = [line.replace("#define ", "-D").replace(" ", "=") for line in counts.splitlines()]
    library = work / f"{model.name}.so"
    sources = [str(HERE / "unit.c"), *([str(HERE / "more.c")] if version == 3 else [])]
    subprocess.run(
        ["gcc", "-O1", "-shared", "-fPIC", "-w", f"-DFMI={version}", *defines, f"-I{HEADERS}",
         f"-I{work}", *sources, "-lm", "-o", str(library)],
        check=True,
    )  # fmt: skip
    place = "linux64" if version == 2 else "x86_64-linux"
    archive = folder / f"{model.name}_{version}.fmu"
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as packed:
        packed.writestr("modelDescription.xml", description(model, version))
        packed.write(library, f"binaries/{place}/{model.name}.so")
    return archive
